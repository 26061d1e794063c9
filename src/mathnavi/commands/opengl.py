"""The choice of OpenGL by MUJOCO_GL, checked before anything imports mujoco."""

from __future__ import annotations

import os

from mathnavi.commands.errors import BadInputError
from mathnavi.models import opengl

BACKENDS = ("osmesa", "egl", "glfw")


def check_choice() -> None:
    """Raise BadInputError if MUJOCO_GL names an unknown backend."""
    chosen = os.environ.get("MUJOCO_GL", "").strip().lower()
    if chosen and chosen not in (*BACKENDS, *opengl.SWITCHED_OFF):
        raise BadInputError(f"MUJOCO_GL = {chosen}; allowed: {', '.join((*BACKENDS, *opengl.SWITCHED_OFF))}")


def import_physics() -> None:
    """Import MuJoCo without OpenGL: a process that simulates draws nothing, and separate processes draw pictures."""
    check_choice()
    opengl.import_mujoco()
