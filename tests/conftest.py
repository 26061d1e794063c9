"""What every test needs before mujoco is imported: an offscreen rendering backend, and repeatable examples."""

from __future__ import annotations

import ctypes.util
import os
import sys

from hypothesis import settings

if sys.platform == "linux" and not os.environ.get("MUJOCO_GL"):
    backends = {"osmesa": "OSMesa", "egl": "EGL"}
    loadable = [backend for backend, library in backends.items() if ctypes.util.find_library(library)]
    os.environ["MUJOCO_GL"] = loadable[0] if loadable else "disable"

# No deadline: the first example of a compiled kernel pays for its compilation.
settings.register_profile("mathnavi", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("mathnavi")
