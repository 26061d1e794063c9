"""A robot within a wall that active sensing drives, with an estimator of one's choice, without MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mathnavi.controllers.active_sensing.plugin import ActiveSensing
from mathnavi.controllers.active_sensing.policies import InputSequence
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.models.field.curve import Curve, ellipse
from mathnavi.models.unicycle.mission import DrivePhase, RangingMission

FIELD = ellipse(3.763, math.sqrt(2.0))
TWO = (math.radians(60.0), math.radians(-60.0))
START = np.array([0.3, -0.2, 0.4])

Believing = Callable[[float, Array], Estimate]
"""Map from the time [s] and the true pose (3,) to an estimate."""


def mission(curve: Curve = FIELD, angles: tuple[float, ...] = TWO, **fields: Any) -> RangingMission:
    return RangingMission(curve, angles, **fields)


def built(task: RangingMission, **fields: Any) -> tuple[Planner, Tracker]:
    """Planner and tracker of the plug-in with some fields set."""
    return ActiveSensing.build(ActiveSensing.Config(**fields), task)


def knowing(deviation: float = 1e-3) -> Believing:
    """An estimate that is the truth, and says that it may be off."""
    return lambda t, truth: Estimate(t, truth.copy(), deviation**2 * np.eye(3))


@dataclass
class Flight:
    """Log of a run; rows are one period apart."""

    truth: list[Array] = field(default_factory=list)  # (3,)
    command: list[Array] = field(default_factory=list)  # (2,)
    plans: list[Plan] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)

    @property
    def kinds(self) -> list[str]:
        """Kinds of the events."""
        return [kind for _, kind in self.events]

    def clearance(self, curve: Curve) -> float:
        """[m] the nearest that the robot came to the wall; negative if it was outside."""
        return min(curve.distance(x[:2]) if curve.contains(x) else -1.0 for x in self.truth[::5])


def fly(
    parts: tuple[Planner, Tracker],
    task: RangingMission,
    start: Array = START,
    duration: float = 10.0,
    believing: Believing | None = None,
) -> Flight:
    """The loop of ``mathnavi.sim.engine.loop`` for one ideal robot, whose estimate is the truth unless given
    otherwise."""
    planner, tracker = parts
    believing = believing or knowing()
    every = round(planner.period / task.period)
    x, flight = np.array(start, np.float64), Flight()
    current: Plan | None = None
    pending: Plan | None = None
    for k in range(round(duration / task.period)):
        t = k * task.period
        estimate = believing(t, x)
        if k % every == 0:
            current = pending or current
            plan = planner.plan(PlanRequest(t, t + planner.period if current else t, estimate, current))
            flight.events += [(t, note) for note in plan.notes]
            flight.plans.append(plan)
            pending = plan if plan.ok else None
            current = current or plan
        assert current is not None
        u = tracker.command(t, estimate, current)
        flight.truth.append(x)
        flight.command.append(u)
        x = task.flow(x, u, task.period)
    return flight


def assert_well_formed(plan: Plan, task: RangingMission) -> None:
    """Finite arcs that join, within the robot's limits."""
    assert len(plan.t) == len(plan.x) == len(plan.u) + 1 == len(plan.phase) + 1
    assert (np.diff(plan.t) > 0.0).all()
    assert np.isfinite(plan.x).all()
    assert (np.abs(plan.u) <= np.array([task.speed_max, task.turn_rate_max]) * (1.0 + 1e-9)).all()
    for k, (u, d) in enumerate(zip(plan.u, np.diff(plan.t), strict=True)):
        np.testing.assert_allclose(task.flow(plan.x[k], u, float(d)), plan.x[k + 1], rtol=0.0, atol=1e-9)


def winding_path(task: RangingMission) -> Plan:
    """A path of nine arcs that is to be kept, none of them a whole number of periods."""
    rng = np.random.default_rng(3)
    duration = rng.uniform(0.3, 0.7, 9)
    u = rng.uniform(-0.5, 0.5, (9, 2)) * np.array([task.speed_max, task.turn_rate_max])
    return InputSequence(duration, u, DrivePhase.CRUISE).plan(0.0, START, math.nan)
