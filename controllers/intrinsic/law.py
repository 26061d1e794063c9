"""Intrinsic tracking on a configuration manifold: an estimate (x, v) after a reference (x_r, v_r), in no coordinates.

    D_t v = PT_{x_r -> x} D_t v_r + k_p e + k_d (PT_{x_r -> x} v_r - v) - R(e, v_r) v_r,    e = log_x x_r,

under which e'' + k_d e' + k_p e = 0 to first order: without its last term, in which v_r is transported to x,
neighbouring geodesics would part by the Jacobi equation, e'' + R(e, v_r) v_r = 0, where the curvature is negative. The
input u is that for which the system's force is this, as near to it as the inputs' ranges allow: force is affine in u,
and of systems with an input for each dimension invertible. The input of a servo is found from its control law,
``ActuatedSystem``; of all that come as near, the one nearest to the default is taken, its constant part.

**Planner and tracker** of a reference motion: plans hold its states, the tracker keeps the estimate on them.
"""

from __future__ import annotations

import time
from typing import Protocol

import numpy as np

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import ArgumentError, PluginError
from mathnavi.interfaces.signals import OPTIMISED, Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.manifold.manifold import CutLocusError, Manifold
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import ActuatedSystem, LagrangianSystem
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
    """Tracker by the law above on a plan's states, one per period."""

    def __init__(self, gains: TrackingGains, mission: LagrangianMission) -> None:
        self.period = mission.period
        self._gains, self._system = gains, mission.system
        self._inverse = InverseForce(mission.system)
        self._default = np.array(mission.system.constant, dtype=np.float64)

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """Input u (nu,) at t [s]: the constant part of the system's default while the estimator has no estimate.

        Raises ArgumentError for an estimate of another shape than the plan's states.
        """
        if estimate.x.shape != plan.x.shape[1:]:
            raise ArgumentError(f"the estimate's state has shape {estimate.x.shape}; allowed: {plan.x.shape[1:]}")
        if estimate.status is Status.INITIALISING:
            return self._default
        arc = min(max(int(np.searchsorted(plan.t, t + TIME_TOLERANCE, side="right")) - 1, 0), len(plan.u) - 1)
        wanted = wanted_force(self._system, self._gains, estimate.x, plan.x[arc], plan.u[arc])
        n = self._system.manifold.size
        return self._inverse(estimate.x[:n], estimate.x[n:], wanted)


_SINGULAR = 1e-9  # of the largest singular value of the inputs' effect
_ASIDE = 1e-6  # by which a reference is moved that no shortest way leads to
_PROBE = 1e-3  # of each input, that its effect is seen by: within the ranges that actuators may have


@configuration
class TrackingGains:
    """Gains of the position and of the velocity."""

    k_p: Positive  # [1/s^2]
    k_d: Positive  # [1/s]


class InverseForce:
    """Inverse of a system's force, by its inputs; ValueError where they do not move every direction."""

    def __init__(self, system: LagrangianSystem) -> None:
        manifold, inputs = system.manifold, system.inputs
        n = manifold.dimension
        self._system, self._none, self._probes = system, np.zeros(len(inputs)), _PROBE * np.eye(len(inputs))
        self._default = np.array(system.constant, dtype=np.float64)
        actuated = system if isinstance(system, ActuatedSystem) else None
        self._affine = None if actuated is None else actuated.affine_inputs()
        coupled = 0 if actuated is None else actuated.coupled
        origin, rest = manifold.origin, np.zeros(manifold.vector_size)
        effect = self._effect(origin, rest)[1] if self._affine is None else self._affine(origin, rest).effect
        values = np.linalg.svd(effect, compute_uv=False)
        moved = int((values > _SINGULAR * values[0]).sum()) if inputs else 0
        if moved < n - coupled or (self._affine is None and len(inputs) != n):
            raise PluginError(
                f"{manifold.name}: {len(inputs)} inputs that move {moved} of its {n} dimensions; allowed for tracking: "
                "one for each"
            )

    def __call__(self, x: Array, v: Array, wanted: Array) -> Array:
        """u (nu,) with force(x, v, u) = ``wanted``, a tangent vector at x, as nearly as the ranges allow."""
        if self._affine is not None:
            law = self._affine(x, v)
            missing = self._system.manifold.components(x, wanted) - law.without - law.effect @ self._default
            u = self._default + np.linalg.lstsq(law.effect, missing, rcond=_SINGULAR)[0]
            return np.asarray(np.clip(u, law.least, law.most), dtype=np.float64)
        without, effect = self._effect(x, v)
        u = np.linalg.solve(effect, self._system.manifold.components(x, wanted) - without)
        return np.asarray(u, dtype=np.float64)

    def _effect(self, x: Array, v: Array) -> tuple[Array, Array]:
        """The components of the force without an input, and what a unit of each input adds (n, nu)."""
        system, components = self._system, self._system.manifold.components
        without = components(x, system.force(x, v, self._none))
        columns = [(components(x, system.force(x, v, probe)) - without) / _PROBE for probe in self._probes]
        return without, np.stack(columns, axis=1) if columns else np.empty((len(without), 0))


def wanted_force(
    system: LagrangianSystem, gains: TrackingGains, state: Array, reference: Array, feedforward: Array
) -> Array:
    """Acceleration D_t v (n,) at an estimate (x, v) after a reference (x_r, v_r) that an input keeps on its way.

    ``feedforward`` (nu,) is that input. Half a turn away from the reference, where two ways back are equally short,
    one of them is taken.
    """
    manifold = system.manifold
    n = manifold.size
    x, v = state[:n], state[n:]
    x_r, v_r = _reachable(manifold, x, reference[:n], reference[n:])
    error = manifold.log(x, x_r)
    a = manifold.transport(x_r, x, system.force(x_r, v_r, feedforward))
    v_there = manifold.transport(x_r, x, v_r)
    # manifold.curvature is R(v, e) v = -R(e, v) v.
    wanted: Array = a + gains.k_p * error + gains.k_d * (v_there - v) + manifold.curvature(x, v_there, error)
    return wanted


def _reachable(manifold: Manifold, x: Array, x_r: Array, v_r: Array) -> tuple[Array, Array]:
    """Reference (x_r, v_r), or one next to it if no unique shortest geodesic leads from x (size,) to it.

    Raises CutLocusError if none leads to the neighbour either.
    """
    try:
        manifold.log(x, x_r)
    except CutLocusError:
        for axis in np.eye(manifold.dimension):
            beside = manifold.exp(x_r, manifold.vector(x_r, _ASIDE * axis))
            try:
                manifold.log(x, beside)
            except CutLocusError:
                continue
            return beside, manifold.transport(x_r, beside, v_r)
        raise
    return x_r, v_r
