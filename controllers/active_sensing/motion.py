"""Motion of a unicycle along a plan: arcs of constant input, and rest before and after them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.unicycle.kernels import integrate


def pieces(plan: Plan, begin: float, end: float) -> Iterator[tuple[Array, float]]:
    """The inputs (2,) [m/s, rad/s] of a plan within [begin, end] [s], and how long each is held [s]."""
    first, last = np.searchsorted(plan.t, begin, side="right") - 1, np.searchsorted(plan.t, end, side="left")
    for k in range(max(0, int(first)), min(int(last), len(plan.u))):
        duration = min(end, float(plan.t[k + 1])) - max(begin, float(plan.t[k]))
        if duration > 0.0:
            yield plan.u[k], duration


def mean_input(plan: Plan, begin: float, end: float) -> Array:
    """Mean input (2,) [m/s, rad/s] of a plan over [begin, end] [s]."""
    total = np.zeros(2)
    for u, duration in pieces(plan, begin, end):
        total += u * duration
    return total / (end - begin)


def pose_on(plan: Plan, t: float) -> Array:
    """Pose (3,) [m, m, rad] of a plan at t [s]."""
    k = int(np.clip(np.searchsorted(plan.t, t, side="right") - 1, 0, len(plan.u)))
    if k == len(plan.u):
        return np.array(plan.x[-1], dtype=np.float64)
    u = plan.u[k]
    pose: Array = integrate(np.asarray(plan.x[k], np.float64), u[0], u[1], max(0.0, t - float(plan.t[k])))
    return pose


def integrate_plan(pose: Array, plan: Plan, begin: float, end: float) -> Array:
    """Pose (3,) at ``end`` [s] of a robot that is at ``pose`` (3,) at ``begin`` [s] and has the inputs of a plan."""
    for u, duration in pieces(plan, begin, end):
        pose = integrate(pose, u[0], u[1], duration)
    return pose
