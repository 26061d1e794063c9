"""The choice of OpenGL for this process, before anything imports mujoco."""

from __future__ import annotations

import os

from renders import opengl
from sim.commands.errors import BadInputError

BACKENDS = ("osmesa", "egl", "glfw")


def choose() -> None:
    """Keep what MUJOCO_GL says, else choose; without any, rendering is off and nothing complains of it."""
    backend = opengl.choose_backend()
    if backend is None:
        os.environ["MUJOCO_GL"] = opengl.SWITCHED_OFF[0]
    elif backend not in BACKENDS:
        raise BadInputError(f"MUJOCO_GL = {backend}; allowed: {', '.join((*BACKENDS, *opengl.SWITCHED_OFF))}")
