"""Chains of slides, hinges and balls for the tests of mechanisms."""

from __future__ import annotations

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.geometry import MechanismManifold


def chain(joints: str, extra: str = "", option: str = "") -> mujoco.MjModel:
    """One body for each letter: s, h, b or, the first one, f; ``option`` and what else is in the file as MJCF."""
    kinds = {"s": 'type="slide" axis="1 .2 0"', "h": 'axis="{} {} .3"', "b": 'type="ball"'}
    text, end = "", ""
    for k, kind in enumerate(joints):
        axis = kinds.get(kind, "").format(k % 2, 1 - k % 2)
        joint = f'<joint name="joint_{k}" {axis} armature=".01"/>' if kind != "f" else '<freejoint name="joint_0"/>'
        text += f'<body pos=".05 0 .3">{joint}'
        text += '<geom type="capsule" fromto="0 .03 0 .1 0 .3" size=".05" contype="0" conaffinity="0"/>'
        end += "</body>"
    body = f"<mujoco><option {option}/><worldbody>{text}{end}</worldbody>{extra}</mujoco>"
    return mujoco.MjModel.from_xml_string(body)


def somewhere(manifold: MechanismManifold, model: mujoco.MjModel, rng: np.random.Generator) -> Array:
    """A point within a radian or so of qpos0."""
    return manifold.point(model.qpos0.copy(), rng.uniform(-1.5, 1.5, model.nv))
