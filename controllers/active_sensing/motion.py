"""How a unicycle moves along a plan: arcs of constant input, and rest before and after them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.input_sequence import InputSequence
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians
from mathnavi.sim.interfaces.signals import Array, Plan


def pieces(plan: Plan, begin: float, end: float) -> Iterator[tuple[Array, float]]:
    """The inputs (2,) of a plan within [begin, end] [s], and how long each is held [s]."""
    first, last = np.searchsorted(plan.t, begin, side="right") - 1, np.searchsorted(plan.t, end, side="left")
    for k in range(max(0, int(first)), min(int(last), len(plan.u))):
        held = min(end, float(plan.t[k + 1])) - max(begin, float(plan.t[k]))
        if held > 0.0:
            yield plan.u[k], held


def mean_input(plan: Plan, begin: float, end: float) -> Array:
    """(2,) of a plan over [begin, end] [s]."""
    total = np.zeros(2)
    for u, held in pieces(plan, begin, end):
        total += u * held
    return total / (end - begin)


def pose_on(plan: Plan, t: float) -> Array:
    """(3,) the pose of a plan at t [s]."""
    k = int(np.clip(np.searchsorted(plan.t, t, side="right") - 1, 0, len(plan.u)))
    if k == len(plan.u):
        return np.array(plan.x[-1], dtype=np.float64)
    u = plan.u[k]
    pose: Array = integrate(np.asarray(plan.x[k], np.float64), u[0], u[1], max(0.0, t - float(plan.t[k])))
    return pose


def predicted(belief: Belief, plan: Plan, begin: float, end: float) -> Belief:
    """What is believed at ``begin`` [s], moved on with a plan's inputs to ``end``; no reading narrows it."""
    pose, covariance = belief.pose, belief.covariance
    for u, held in pieces(plan, begin, end):
        F, _ = integrate_jacobians(pose, u[0], u[1], held)
        pose, covariance = integrate(pose, u[0], u[1], held), F @ covariance @ F.T
    return Belief(pose, covariance, belief.is_found)


def planned(drive: InputSequence, t: float, pose: Array, solve_ms: float) -> Plan:
    """The plan that drives from a pose (3,) at t [s] on, to rest."""
    times = t + np.concatenate([[0.0], np.cumsum(drive.duration)])
    x = np.empty((len(drive.u) + 1, 3))
    x[0] = pose
    for k, u in enumerate(drive.u):
        x[k + 1] = integrate(x[k], u[0], u[1], float(drive.duration[k]))
    phase = np.full(len(drive.u), int(drive.phase), np.int64)
    return Plan(times, x, drive.u, phase, cost=drive.cost, solve_ms=solve_ms)
