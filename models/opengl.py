"""OpenGL that draws without a screen: that of MUJOCO_GL, else OSMesa, else EGL.

OpenGL is loaded only when something is drawn: Mesa brings an LLVM with it, and a process that loads another one
later, as PyTorch's optimisers do with Triton's, ends in a segmentation fault. MuJoCo and PyOpenGL read the choice once,
when they are first imported, and MuJoCo loads the library then; so ``import_mujoco`` imports it without OpenGL, and
pictures are drawn by child processes started in ``environment()``. dm_control reads the choice at its first import too.
"""

from __future__ import annotations

import functools
import importlib
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

HOW_TO_INSTALL = (
    "found no OpenGL that draws without a screen: install OSMesa (Debian, Ubuntu: apt-get install libosmesa6) "
    "or EGL (apt-get install libegl1 libopengl0), or set MUJOCO_GL"
)
# For each backend, in order of preference, the libraries it needs, with those that may stand for each other in a row:
# soname, then the name find_library knows it by.
LIBRARIES = {
    "osmesa": ((("libOSMesa.so.8", "OSMesa"),),),
    "egl": ((("libEGL.so.1", "EGL"),), (("libOpenGL.so.0", "OpenGL"), ("libGL.so.1", "GL"))),
}
SWITCHED_OFF = ("disable", "disabled", "off", "false", "0")  # values by which MUJOCO_GL forbids rendering

WINDOWED = ("glfw", "glx", "enable", "enabled", "on", "true", "1")  # values by which MuJoCo draws with GLFW

LOADS = """
import ctypes, ctypes.util, sys
for name in (sys.argv[1], ctypes.util.find_library(sys.argv[2])):
    try:
        sys.exit(name is None or ctypes.CDLL(name) is None)
    except OSError:
        pass
sys.exit(1)
"""


class NoOpenGLError(RuntimeError):
    """Error for missing OpenGL; the message says how to install it."""


def available() -> str | None:
    """Return the backend that will draw, "osmesa", "egl" or MUJOCO_GL's; None if there is none (``HOW_TO_INSTALL``)."""
    chosen = os.environ.get("MUJOCO_GL", "").strip().lower()
    if chosen:
        return None if chosen in SWITCHED_OFF else chosen
    return next(
        (
            backend
            for backend, needed in LIBRARIES.items()
            if all(any(_loads(*names) for names in alternatives) for alternatives in needed)
        ),
        None,
    )


def environment() -> dict[str, str]:
    """Return this process' environment with the backend chosen in it, for a child process that has imported nothing
    yet.
    """
    backend = available()
    if backend is None:
        raise NoOpenGLError(HOW_TO_INSTALL)
    inherited = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
    return inherited | {"MUJOCO_GL": backend}


@contextmanager
def without_opengl() -> Iterator[None]:
    """Set MUJOCO_GL to forbid rendering within the context, and restore it afterwards."""
    chosen = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        yield
    finally:
        if chosen is None:
            del os.environ["MUJOCO_GL"]
        else:
            os.environ["MUJOCO_GL"] = chosen


def import_mujoco() -> None:
    """Import MuJoCo without OpenGL, unless it is imported already.

    A ``mujoco.Renderer`` of the user still draws in this process: its context loads the library when it is made.
    """
    if "mujoco" in sys.modules:
        return
    with without_opengl():
        mujoco: Any = importlib.import_module("mujoco")
        contexts: Any = importlib.import_module("mujoco.rendering.classic.gl_context")
    mujoco.GLContext = contexts.GLContext = opengl_context


def opengl_context(max_width: int, max_height: int) -> Any:
    """Return MuJoCo's OpenGL context of the available backend; NoOpenGLError if there is none."""
    backend = available()
    if backend is None:
        raise NoOpenGLError(HOW_TO_INSTALL)
    if backend not in (*LIBRARIES, *WINDOWED):
        raise NoOpenGLError(f"MUJOCO_GL = {backend}; allowed: {', '.join((*LIBRARIES, *WINDOWED, *SWITCHED_OFF))}")
    module = importlib.import_module(f"mujoco.{backend if backend in LIBRARIES else 'glfw'}")
    return module.GLContext(max_width, max_height)


@functools.cache
def _loads(soname: str, name: str) -> bool:
    """True if a library can be loaded, which a child process tries."""
    command = [sys.executable, "-I", "-S", "-c", LOADS, soname, name]
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False).returncode == 0
