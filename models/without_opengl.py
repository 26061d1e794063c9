"""Imports of MuJoCo and dm_control that load no OpenGL: both read MUJOCO_GL once, when they are first imported."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager


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
