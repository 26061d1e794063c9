"""Committed trajectories: the first part of a nominal one, and a way to rest behind it.

A vehicle flies a committed trajectory until another one is committed to, so it must be safe for ever: it has to pass
the certificate of the mission, with its own end as the target.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mathnavi.controllers.flight.certificate import Certificate, Refusal
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.plan_status import FlightPhase

_NEGLIGIBLE = 1e-9  # [m/s]


def refusal(certificate: Certificate, trajectory: Plan) -> Refusal | None:
    """The first reason why a trajectory may not be committed to; None if it is safe for ever."""
    return dataclasses.replace(certificate, target=trajectory.x[-1, :3]).check(trajectory)


def optimised_arcs(plan: Plan) -> int:
    """Number of arcs at the beginning of a plan that were optimised."""
    others = np.flatnonzero(plan.phase != FlightPhase.OPTIMISED)
    return int(others[0]) if len(others) else len(plan.u)


def first_part(plan: Plan, arcs: int, duration: float) -> ArcList:
    """The first ``duration`` [s] of the first arcs of a plan."""
    begun = ArcList.begin(plan.t_start, plan.x[0])
    for u, length in zip(plan.u[:arcs], np.diff(plan.t[: arcs + 1]), strict=True):
        begun.add(u, min(float(length), duration - (begun.t[-1] - plan.t_start)), FlightPhase.OPTIMISED)
    return begun


def stop_and_climb(arcs: ArcList, acceleration: float, climb: float) -> None:
    """Append one acceleration of the norm ``acceleration`` [m/s^2] into a climb [m/s], and another into rest."""
    velocity = arcs.x[-1][3:]
    speed = float(np.linalg.norm(velocity))
    rise = min(climb, speed)
    change = np.array([0.0, 0.0, rise]) - velocity
    duration = float(np.linalg.norm(change)) / acceleration
    if duration > _NEGLIGIBLE:
        arcs.add(change / duration, duration, FlightPhase.MANOEUVRE)
        arcs.x[-1] = np.array([*arcs.x[-1][:3], 0.0, 0.0, rise])
    arcs.add(np.array([0.0, 0.0, -acceleration]), rise / acceleration, FlightPhase.MANOEUVRE)
    arcs.rest()


def hovering(arcs: ArcList, duration: float, solve_ms: float = math.nan) -> Plan:
    """Plan of arcs that end at rest, with a hover of ``duration`` [s] behind them that then never ends."""
    arcs.add(np.zeros(3), duration, FlightPhase.HOVER)
    return arcs.plan(math.nan, solve_ms)


def least_effort(start: Array, end: Array, arcs: int, duration: float) -> Array:
    """Accelerations (arcs, 3) [m/s^2], held equally long, of the least sum of squares from state to state (6,)."""
    h = duration / arcs
    weights = np.vstack([h * (duration - h * (np.arange(arcs) + 0.5)), np.full(arcs, h)])  # of position and velocity
    wanted = np.vstack([end[:3] - start[:3] - duration * start[3:], end[3:] - start[3:]])
    solution: Array = weights.T @ np.linalg.solve(weights @ weights.T, wanted)
    return solution
