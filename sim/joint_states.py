"""What MuJoCo's joints contribute to a state (q, v): a slide or a hinge one number each, a ball joint 4 and 3.

q of a ball joint is a unit quaternion (w, x, y, z), v its rate [rad/s] in the frame of the body it carries.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from sim.signals import Array

SLIDE, HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
BALL = int(mujoco.mjtJoint.mjJNT_BALL)

_OFF = 1e-6  # of a quaternion's length from 1 that is rounding, a float's at the worst
_UNIT = {SLIDE: "m", HINGE: "rad"}


def state_names(model: mujoco.MjModel, joints: Sequence[int]) -> tuple[str, ...]:
    """Name and unit of each component of (q, v) of these joints; the name of the vehicle, before a "/", is left out."""
    positions, velocities = [], []
    for j in joints:
        full, kind = model.joint(j).name, int(model.jnt_type[j])
        name = full.partition("/")[2] or full or str(j)
        if kind == BALL:
            positions += [f"position_{name}_{axis} [-]" for axis in "wxyz"]
            velocities += [f"velocity_{name}_{axis} [rad/s]" for axis in "xyz"]
        else:
            positions.append(f"position_{name} [{_UNIT[kind]}]")
            velocities.append(f"velocity_{name} [{_UNIT[kind]}/s]")
    return (*positions, *velocities)


def quaternions(model: mujoco.MjModel, joints: Sequence[int]) -> tuple[slice, ...]:
    """Where the ball joints among these, which lie together in the model, have their quaternions in q."""
    first = int(model.jnt_qposadr[joints[0]])
    at = [int(model.jnt_qposadr[j]) - first for j in joints if model.jnt_type[j] == BALL]
    return tuple(slice(k, k + 4) for k in at)


def with_unit_quaternions(q: Array, where: Sequence[slice], what: str) -> Array:
    """q with its quaternions brought to length 1 from where rounding had put them; ValueError if they were not near."""
    if not where:
        return q
    q = q.copy()
    for each in where:
        length = float(np.linalg.norm(q[each]))
        if not abs(length - 1.0) <= _OFF:
            raise ValueError(f"{what} = {q.tolist()} has a quaternion of length {length:.9g}; allowed: 1")
        q[each] /= length
    return q
