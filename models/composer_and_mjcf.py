"""dm_control's ``composer`` and ``mjcf``, imported in silence and without OpenGL: its renderer is not used here.

A program that uses dm_control's renderer in the same process imports dm_control before mathnavi.
"""

from __future__ import annotations

import warnings

from mathnavi.models.dm_control_requirement import require_dm_control
from mathnavi.models.mujoco_requirement import usable_mujoco
from mathnavi.models.opengl import without_opengl

require_dm_control()
usable_mujoco()  # before dm_control imports it without OpenGL: it is for ``models.opengl`` to do that
with without_opengl(), warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from dm_control import composer, mjcf

__all__ = ["composer", "mjcf"]
