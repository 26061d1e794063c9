"""Planner and tracker of a reference motion: plans hold its states, the tracker keeps the estimate on them."""

from __future__ import annotations

import time
from typing import Protocol

import numpy as np

from mathnavi.controllers.intrinsic.law import InverseForce, TrackingGains, wanted_force
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import OPTIMISED, Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.tolerances import TIME_TOLERANCE

_PERIODS = 100  # of the mission, from one plan to the next


class ReferenceMotion(Protocol):
    """A motion that is to be followed."""

    def state(self, k: int) -> Array:
        """State (x_r, v_r) (size + vector_size,) at the k-th period of the mission."""
        ...

    def acceleration(self, k: int) -> Array:
        """Acceleration D_t v_r (vector_size,) at the k-th period, a tangent vector at x_r."""
        ...


class ReferencePlanner:
    """Planner of the reference's next states, independent of the estimate, with the inputs that keep it there."""

    def __init__(self, reference: ReferenceMotion, mission: LagrangianMission) -> None:
        self.period = _PERIODS * mission.period
        self._reference, self._step, self._size = reference, mission.period, mission.system.manifold.size
        self._inverse = InverseForce(mission.system)

    def plan(self, request: PlanRequest) -> Plan:
        """Plan of the next reference states, with the inputs that would keep the system on them."""
        began = time.thread_time()
        if not np.isfinite(request.estimate.x).all():
            return Plan.failure(Status.NOT_FINITE, f"the estimate is {request.estimate.x.tolist()}")
        first = round(request.t_start / self._step)
        periods = range(first, first + 2 * _PERIODS + 1)
        x = np.array([self._reference.state(k) for k in periods])
        n = self._size
        u = [
            self._inverse(row[:n], row[n:], self._reference.acceleration(k)) for k, row in zip(periods, x, strict=True)
        ]
        phase = np.full(len(u) - 1, OPTIMISED, dtype=np.int64)
        t = self._step * np.array(periods, dtype=np.float64)
        return Plan(t, x, np.array(u[:-1]), phase, solve_ms=1e3 * (time.thread_time() - began))


class IntrinsicTracker:
    """Tracker by the law of ``law`` on a plan's states, one per period."""

    def __init__(self, gains: TrackingGains, mission: LagrangianMission) -> None:
        self.period = mission.period
        self._gains, self._system = gains, mission.system
        self._inverse = InverseForce(mission.system)
        self._none = np.zeros(len(mission.system.inputs))

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """Input u (nu,) at t [s]: zero while the estimator has no estimate.

        Raises ArgumentError for an estimate of another shape than the plan's states.
        """
        if estimate.x.shape != plan.x.shape[1:]:
            raise ArgumentError(f"the estimate's state has shape {estimate.x.shape}; allowed: {plan.x.shape[1:]}")
        if estimate.status is Status.INITIALISING:
            return self._none
        arc = min(max(int(np.searchsorted(plan.t, t + TIME_TOLERANCE, side="right")) - 1, 0), len(plan.u) - 1)
        wanted = wanted_force(self._system, self._gains, estimate.x, plan.x[arc], plan.u[arc])
        n = self._system.manifold.size
        return self._inverse(estimate.x[:n], estimate.x[n:], wanted)
