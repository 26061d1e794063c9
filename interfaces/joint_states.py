"""Contribution of MuJoCo's joints to a state (q, v): slide and hinge one number each, a ball 4, 3, a free one 7, 6.

q of a ball joint is a unit quaternion (w, x, y, z), v its rate [rad/s] in the frame of the body it carries. A free
joint is a position [m] in the world frame before such a quaternion, and a velocity [m/s] there before such a rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import mujoco
import numpy as np

from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.signals import Array

SLIDE, HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
BALL, FREE = int(mujoco.mjtJoint.mjJNT_BALL), int(mujoco.mjtJoint.mjJNT_FREE)
SIZES = {SLIDE: (1, 1), HINGE: (1, 1), BALL: (4, 3), FREE: (7, 6)}
"""sizes of a joint's part of q and of v"""

UNIT = 1e-2  # by which the length of a quaternion may differ from 1: logs keep few decimals
QuaternionOrder = Literal["wxyz", "xyzw"]
"""order of the components of quaternions that come in: with the scalar first, as everywhere here, or last"""

_UNIT = {SLIDE: "m", HINGE: "rad"}


def state_names(model: mujoco.MjModel, joints: Sequence[int]) -> tuple[str, ...]:
    """Return name and unit of each component of (q, v) of these joints, without the vehicle's name before a "/".

    Those of the only free joint, "position_x" for one, are without the name of the joint: they are the vehicle's.
    """
    positions, velocities = [], []
    for j, name in _joint_names(model, joints).items():
        kind, of = int(model.jnt_type[j]), f"{name}_" if name else ""
        if kind == FREE:
            positions += [f"position_{of}{axis} [m]" for axis in "xyz"]
            velocities += [f"velocity_{of}{axis} [m/s]" for axis in "xyz"]
            positions += [f"attitude_{of}{axis} [-]" for axis in "wxyz"]
            velocities += [f"rate_{of}{axis} [rad/s]" for axis in "xyz"]
        elif kind == BALL:
            positions += [f"position_{of}{axis} [-]" for axis in "wxyz"]
            velocities += [f"velocity_{of}{axis} [rad/s]" for axis in "xyz"]
        else:
            positions.append(f"position_{name} [{_UNIT[kind]}]")
            velocities.append(f"velocity_{name} [{_UNIT[kind]}/s]")
    return (*positions, *velocities)


def state_groups(model: mujoco.MjModel, joints: Sequence[int]) -> dict[str, tuple[str, ...]]:
    """Return the names of the states, without units, that are one vector or quaternion, by what they are."""
    groups = {}
    for j, name in _joint_names(model, joints).items():
        kind, of = int(model.jnt_type[j]), f"{name}_" if name else ""
        if kind == FREE:
            parts = {"position": "xyz", "velocity": "xyz", "rate": "xyz", "attitude": "wxyz"}
        else:
            parts = {"velocity": "xyz", "position": "wxyz"} if kind == BALL else {}
        for part, axes in parts.items():
            groups[f"{part} {name}".replace("_", " ").strip()] = tuple(f"{part}_{of}{axis}" for axis in axes)
    return groups


def _joint_names(model: mujoco.MjModel, joints: Sequence[int]) -> dict[int, str]:
    """Return the joints with their names; "" for the only free one, unless another is called as one of its numbers."""
    names = {j: own_name(model.joint(j).name, j) for j in joints}
    free = [j for j in joints if int(model.jnt_type[j]) == FREE]
    if len(free) == 1 and not any(name in "wxyz" for name in names.values()):
        names[free[0]] = ""
    return names


def own_name(full: str, number: int) -> str:
    """Return the name of an element without that of its vehicle; its number if it has none."""
    return full.partition("/")[2] or full or str(number)


def activations(model: mujoco.MjModel, actuators: Sequence[int]) -> tuple[list[int], tuple[str, ...]]:
    """Return the places in act of the states that these actuators have, and the name and unit of each.

    The names are without the vehicle's name before a "/"; those of an actuator with several states are numbered.
    """
    places, names = [], []
    for i in actuators:
        name, count = own_name(model.actuator(i).name, i), int(model.actuator_actnum[i])
        places += [int(model.actuator_actadr[i]) + k for k in range(count)]
        names += [f"activation_{name}{f'_{k}' if count > 1 else ''} [-]" for k in range(count)]
    return places, tuple(names)


def quaternions(model: mujoco.MjModel, joints: Sequence[int]) -> tuple[slice, ...]:
    """Return the places in q of the quaternions of the ball and free joints among these adjacent joints."""
    first = int(model.jnt_qposadr[joints[0]])
    before = {BALL: 0, FREE: 3}  # numbers of the joint that come before its quaternion
    kinds = [(j, int(model.jnt_type[j])) for j in joints]
    at = [int(model.jnt_qposadr[j]) - first + before[kind] for j, kind in kinds if kind in before]
    return tuple(slice(k, k + 4) for k in at)


def with_unit_quaternions(q: Array, where: Sequence[slice], what: str) -> Array:
    """Return q (nq,) with its quaternions normalised to length 1, from which rounding had moved them.

    Raises ArgumentError if they were more than ``UNIT`` off.
    """
    if not where:
        return q
    q = q.copy()
    for each in where:
        length = float(np.linalg.norm(q[each]))
        if not abs(length - 1.0) <= UNIT:
            allowed = f"1 +- {UNIT:g}"
            raise ArgumentError(f"{what} = {q.tolist()} has a quaternion of length {length:.7g}; allowed: {allowed}")
        q[each] /= length
    return q


def scalar_first(values: Array, where: Sequence[slice], order: QuaternionOrder) -> Array:
    """Return readings (..., m) with their quaternions, which come in this order, as (w, x, y, z)."""
    if order == "wxyz" or not where:
        return values
    values = values.copy()
    for each in where:
        values[..., each] = np.roll(values[..., each], 1, axis=-1)
    return values


def check_quaternion_order(order: str) -> None:
    """Raise FieldError for an order of quaternions that is not one."""
    if order not in get_args(QuaternionOrder):
        raise FieldError(f"quaternions = {order!r}; allowed: {', '.join(map(repr, get_args(QuaternionOrder)))}")
