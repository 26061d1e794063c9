"""The OpenGL that draws without a screen: that of MUJOCO_GL, else OSMesa, else EGL.

MuJoCo reads MUJOCO_GL once, when it is first imported, and PyOpenGL reads a variable of its own. A process that has
flown a mission has imported both long ago; so pictures are drawn by child processes started in ``environment()``.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os

HOW_TO_INSTALL = (
    "found no OpenGL that draws without a screen: install OSMesa (Debian, Ubuntu: apt-get install libosmesa6) "
    "or EGL (apt-get install libegl1), or set MUJOCO_GL"
)
# For each backend, in order of preference, the libraries it needs: soname, then the name find_library knows it by.
LIBRARIES = {"osmesa": ("libOSMesa.so.8", "OSMesa"), "egl": ("libEGL.so.1", "EGL")}
SWITCHED_OFF = ("disable", "disabled", "off", "false", "0")  # values by which MUJOCO_GL forbids rendering


class NoOpenGLError(RuntimeError):
    """There is nothing to draw with; the message says how to install it."""


def available() -> str | None:
    """The backend that will draw, "osmesa", "egl" or MUJOCO_GL's; None where there is none (``HOW_TO_INSTALL``)."""
    chosen = os.environ.get("MUJOCO_GL", "").strip().lower()
    if chosen:
        return None if chosen in SWITCHED_OFF else chosen
    return next((backend for backend, names in LIBRARIES.items() if _loads(*names)), None)


def environment() -> dict[str, str]:
    """This process' environment with the backend chosen in it, for a child process that has imported nothing yet."""
    backend = available()
    if backend is None:
        raise NoOpenGLError(HOW_TO_INSTALL)
    inherited = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
    return inherited | {"MUJOCO_GL": backend}


def choose_backend() -> str | None:
    """Set MUJOCO_GL in this process if the user did not, and return the backend; call it before mujoco is imported."""
    backend = available()
    if backend is not None:
        os.environ["MUJOCO_GL"] = backend
    return backend


def _loads(soname: str, name: str) -> bool:
    for candidate in (soname, ctypes.util.find_library(name)):
        if candidate is not None:
            try:
                ctypes.CDLL(candidate)
            except OSError:
                continue
            return True
    return False
