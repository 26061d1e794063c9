"""The choice of OpenGL for this process, before anything imports mujoco."""

from __future__ import annotations

import os
from importlib import import_module

from mathnavi.renders import opengl
from mathnavi.sim.commands.errors import BadInputError

BACKENDS = ("osmesa", "egl", "glfw")


def choose() -> None:
    """Keep the backend that MUJOCO_GL names, else choose one; without any, rendering is switched off.

    BadInputError if MUJOCO_GL names none that is known.
    """
    backend = opengl.choose_backend()
    if backend is None:
        os.environ["MUJOCO_GL"] = opengl.SWITCHED_OFF[0]
    elif backend not in BACKENDS:
        raise BadInputError(f"MUJOCO_GL = {backend}; allowed: {', '.join((*BACKENDS, *opengl.SWITCHED_OFF))}")


def import_physics() -> None:
    """Import MuJoCo without the OpenGL that was chosen: who flies draws nothing, and pictures are drawn by processes of
    their own.
    """
    chosen = os.environ["MUJOCO_GL"]
    os.environ["MUJOCO_GL"] = opengl.SWITCHED_OFF[0]
    try:
        import_module("dm_control.mujoco")  # looks at MUJOCO_GL as mujoco does, both of them once
    finally:
        os.environ["MUJOCO_GL"] = chosen
