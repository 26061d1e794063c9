"""Scenarios as environments. Where Gymnasium is installed, importing this makes them known to it.

Gymnasium looks for no plug-ins of its own accord: what is imported registers what it has.
"""

import os
from importlib.util import find_spec

from mathnavi.renders.opengl import choose_backend

if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
    choose_backend()  # for pictures, before mujoco is imported and has chosen

if find_spec("gymnasium") is not None:
    from mathnavi.sim.environments.registration import register

    register()
