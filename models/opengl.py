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
from pathlib import Path
from typing import Any

from mathnavi.models.mujoco_requirement import usable_mujoco
from mathnavi.models.opengl_probe import SOFTWARE

EGL_PACKAGES = "Debian, Ubuntu: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0"
HOW_TO_INSTALL = f"install EGL ({EGL_PACKAGES}), or OSMesa where Mesa is older than 25.1 (libosmesa6)"
PREFERRED = ("osmesa", "egl")  # backends that draw without a screen, in order of preference
REMEDIES = {
    "osmesa": "allowed: OSMesa where Mesa is older than 25.1 (apt-get install libosmesa6), or MUJOCO_GL unset",
    "egl": f"allowed: EGL with a driver ({EGL_PACKAGES}), or MUJOCO_GL unset",
    "glfw": "allowed: a desktop, or MUJOCO_GL=egl or osmesa, which draw without one",
}  # for a backend that MUJOCO_GL names and that does not draw
SWITCHED_OFF = ("disable", "disabled", "off", "false", "0")  # values by which MUJOCO_GL forbids rendering
WINDOWED = ("glfw", "glx", "enable", "enabled", "on", "true", "1")  # values by which MuJoCo draws with GLFW
PROBE = Path(__file__).with_name("opengl_probe.py")


class NoOpenGLError(RuntimeError):
    """Error where nothing can be drawn; the message says why, and what to do."""


def available() -> str | None:
    """Return the backend that will draw, as ``backend`` does; None where that raises."""
    try:
        return backend()
    except NoOpenGLError:
        return None


def backend() -> str:
    """Return the backend that will draw: that of MUJOCO_GL, else "osmesa" or "egl".

    Another process tries whether it makes a context. Raises NoOpenGLError if none does, and where MUJOCO_GL switches
    drawing off.
    """
    chosen = os.environ.get("MUJOCO_GL", "").strip().lower()
    if chosen in SWITCHED_OFF:
        raise NoOpenGLError(f"MUJOCO_GL = {chosen} switches drawing off; allowed: MUJOCO_GL unset, to draw")
    if not chosen:
        faults = []
        for name in PREFERRED:
            fault = _fault(name)
            if not fault:
                return name
            faults.append(", ".join(fault.splitlines()))
        raise NoOpenGLError(f"found no OpenGL that draws without a screen ({'; '.join(faults)}): {HOW_TO_INSTALL}")
    if chosen not in (*PREFERRED, *WINDOWED):
        raise NoOpenGLError(f"MUJOCO_GL = {chosen}; allowed: {', '.join((*PREFERRED, *WINDOWED, *SWITCHED_OFF))}")
    name = chosen if chosen in PREFERRED else "glfw"
    reason, _, allowed = _fault(name).partition("\n")
    if reason:
        raise NoOpenGLError(f"MUJOCO_GL = {chosen}: {reason}; {allowed or REMEDIES[name]}")
    return chosen


def draws_by_software() -> bool:
    """Return True if the backend draws without a graphics card: then a process that has loaded it may fork.

    NoOpenGLError as of ``backend``.
    """
    chosen = backend()
    return chosen in PREFERRED and _tried(chosen)[1] == SOFTWARE


def environment() -> dict[str, str]:
    """Return this process' environment with the backend chosen in it, for a child process that has imported nothing
    yet; NoOpenGLError as of ``backend``.
    """
    chosen = backend()
    inherited = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
    return inherited | {"MUJOCO_GL": chosen}


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
    """Import MuJoCo without OpenGL, unless it is imported already; UnusableMujocoError if it cannot be used here.

    A ``mujoco.Renderer`` of the user still draws in this process: its context loads the library when it is made.
    """
    if "mujoco" in sys.modules:
        usable_mujoco()
        return
    with without_opengl():
        mujoco = usable_mujoco()
        contexts: Any = importlib.import_module("mujoco.rendering.classic.gl_context")
    mujoco.GLContext = contexts.GLContext = opengl_context


def opengl_context(max_width: int, max_height: int) -> Any:
    """Return MuJoCo's OpenGL context of the backend; NoOpenGLError as of ``backend``."""
    chosen = backend()
    module = importlib.import_module(f"mujoco.{chosen if chosen in PREFERRED else 'glfw'}")
    return module.GLContext(max_width, max_height)


def _fault(name: str) -> str:
    """Return why a backend does not draw here, and in a second line what is allowed if there is more to say than
    ``REMEDIES`` does; "" if it draws.
    """
    code, said = _tried(name)
    return "" if code == 0 else said or f"trying it ended with exit code {code}"


def _tried(name: str) -> tuple[int, str]:
    return _tried_with(name, tuple(sorted(os.environ.items())))  # drivers read many variables


@functools.cache
def _tried_with(name: str, variables: tuple[tuple[str, str], ...]) -> tuple[int, str]:
    """Return the exit code of a trial, and what it printed."""
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(PROBE), name, *filter(None, sys.path)],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, env=dict(variables), check=False,
    )  # fmt: skip
    return done.returncode, done.stdout.strip()
