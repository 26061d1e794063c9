"""Figures of the velocity estimate of a Lagrangian system: errors, convergence, Lyapunov functions of a run (Paper D).

With the truth (x, v) and an estimate (xi, eta), v^ = PT_{xi -> x} eta and Delta v = v - v^. Errors of position and
velocity are given in the components of the manifold at the truth: a joint's angle and rate, a body rate, and [1/s]
without a body. A run has converged if the velocity error is within its tolerance over the last quarter.

The posterior Cramér-Rao bound of a Lagrangian system, as recorded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.manifold import CutLocusError, Manifold
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import unmodelled
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.convergence import decay_rate
from mathnavi.sim.metrics.planning import planner_share
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound, bound_along, judged_bound

_HELD, _JACOBIANS = 0.01, 400  # [s] for which a Jacobian is used, and the largest number of Jacobians


def lagrangian_bound(recording: Recording, name: str, truth: LagrangianMission) -> PosteriorBound:
    """Bound of the components of (x, v) (2 n,) of a system as it truly is, judged by the velocity.

    No noise acts on the motion of these systems: it is the bound for an unknown start.
    """
    from mathnavi.estimators.stagewise.lagrangian import LagrangianModel
    from mathnavi.estimators.velocity.readings import rounding_steps

    n, readings = recording.length, recording.agents[name].readings.get("position")
    x = recording.truths[name]
    if readings is None:
        return PosteriorBound.none("the estimator does not read the position", n)
    if not np.isfinite(x).all():
        return PosteriorBound.none("the true state is not finite", n)
    if parts := unmodelled(truth.system):
        return PosteriorBound.none(f"the motion depends on {parts}", n)
    manifold, noise = truth.system.manifold, truth.reading.noise
    rounding = float(rounding_steps(truth, x[0, : manifold.size]).max())
    if not noise > 0.0:
        return PosteriorBound.none(f"positions are read {'rounded and' if rounding else ''} without noise", n)
    if noise < 0.5 * rounding:
        return PosteriorBound.none("positions are rounded to steps of more than twice their noise", n)
    model = LagrangianModel.as_declared(truth)
    commands = recording.agents[name].commands
    inputs = [((float(h), u),) for h, u in zip(np.diff(recording.t), commands, strict=False)]
    W = math.sqrt(1.0 - truth.reading.jump) * np.eye(model.rows, model.size)
    W /= model.deviation(x[0, : manifold.size])[:, np.newaxis]
    weighted = [W if np.isfinite(row).all() else W[:0] for row in readings[:n]]
    held = max(1, round(_HELD / truth.period), math.ceil(n / _JACOBIANS))
    recursion = BoundRecursion(information=np.zeros((model.size, model.size)))
    deviation = bound_along(model, x, inputs, weighted, recursion, held=held)
    return judged_bound(deviation, tuple(range(model.rows, model.size)), "the velocity")


LAST = 0.25
"""share of a run, at its end, over which convergence is judged"""
FOUND = 0.01
"""share of the initial velocity below which the error counts as gone"""

SETTLED = 0.05
"""angle to a reference below which a body has settled on it [rad]"""


@dataclass(frozen=True, eq=False)
class VelocityErrors:
    """Velocity errors of the estimates of one vehicle, at their times (m,)."""

    t: Array  # (m,) [s]
    position: Array  # (m,) theta = dist(x, xi)
    components: Array  # (m, n) of Delta v
    norm: Array  # (m,) |Delta v|_g
    lyapunov: Array  # (m, 3): |Delta v|^2 / 2, S, <s, Delta v>, the terms of V and W
    found: Array  # (m,) 1 where the estimator had an estimate, else 0

    @staticmethod
    def from_recording(recording: Recording, name: str, manifold: Manifold) -> VelocityErrors:
        """Errors of one vehicle's run, whose state is (x, v)."""
        estimates = recording.agents[name].estimates
        t = np.array([estimate.t for estimate in estimates])
        truth = recording.truths[name][np.searchsorted(recording.t, t - TIME_TOLERANCE)]
        x = np.array([estimate.x for estimate in estimates])
        found = np.array([estimate.status is not Status.INITIALISING for estimate in estimates], dtype=np.float64)
        return VelocityErrors.between(t, truth, x, found, manifold)

    @staticmethod
    def between(t: Array, truth: Array, x: Array, found: Array, manifold: Manifold) -> VelocityErrors:
        """Errors of estimates x (m, nx) at t (m,) [s], where the state was ``truth`` (m, nx)."""
        rows = [errors_of(manifold, *pair) for pair in zip(truth, x, strict=True)]
        position, components, norm, lyapunov = (np.array(values) for values in zip(*rows, strict=True))
        return VelocityErrors(t, position, components, norm, lyapunov, found)

    def V(self, B: float) -> Array:  # noqa: N802  the thesis' letters
        """Lyapunov function V (m,) = |Delta v|^2 / 2 + B S of Theorem D.2."""
        value: Array = self.lyapunov[:, 0] + B * self.lyapunov[:, 1]
        return value

    def W(self, B: float) -> Array:  # noqa: N802
        """Lyapunov function W (m,) = |Delta v|^2 / 2 + 3/2 B |s|^2 - sqrt(B) <s, Delta v> for a double pole."""
        kinetic, S, product = self.lyapunov.T
        value: Array = kinetic + 3.0 * B * S - math.sqrt(B) * product
        return value

    def after(self, t: float) -> slice:
        """Slice of the estimates from t [s] on."""
        return slice(int(np.searchsorted(self.t, t - TIME_TOLERANCE)), None)

    @property
    def last(self) -> slice:
        """Slice of the estimates over which convergence is judged."""
        return self.after((1.0 - LAST) * float(self.t[-1]))

    def found_from(self, limit: float) -> float | None:
        """Last time [s] without an estimate or with |Delta v|_g above a limit; 0 if there is no such time.

        Returns None if that is the end: the velocity was not found.
        """
        above = np.flatnonzero(~((self.norm <= limit) & (self.found > 0.0)))
        if not len(above):
            return 0.0
        return float(self.t[above[-1]]) if above[-1] < len(self.t) - 1 else None


def errors_of(manifold: Manifold, truth: Array, estimate: Array) -> tuple[float, Array, float, Array]:
    """Errors at one time: theta, components (n,) of Delta v, |Delta v|_g and (|Delta v|^2 / 2, S, <s, Delta v>).

    Infinite or NaN if no shortest geodesic joins the two.
    """
    n = manifold.size
    x, v, xi, eta = truth[:n], truth[n:], estimate[:n], estimate[n:]
    try:
        error = v - manifold.transport(xi, x, eta)
        s = -manifold.log(x, xi)
    except CutLocusError:
        nothing = np.full(manifold.dimension, np.inf)
        return manifold.injectivity_radius, nothing, math.inf, np.full(3, np.nan)
    speed, theta, both = manifold.norm(x, error), manifold.norm(x, s), manifold.norm(x, s + error)
    product = 0.5 * (both**2 - speed**2 - theta**2)
    return theta, manifold.components(x, error), speed, np.array([0.5 * speed**2, 0.5 * theta**2, product])


def rms(values: Array) -> float:
    """Root mean square of values (n,); NaN without values, as for a run that ended before the time from which errors
    count.
    """
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else math.nan


def lagrangian_summary(
    errors: VelocityErrors,
    recording: Recording,
    name: str,
    manifold: Manifold,
    settled: float,
    seed: int,
    wall_seconds: float,
) -> dict[str, Any]:
    """Flat summary of a run; ``velocity_rms`` and ``position_rms`` are those from ``settled`` [s] on."""
    truth = recording.truths[name]
    late = errors.after(settled)
    speeds = np.array([manifold.norm(row[: manifold.size], row[manifold.size :]) for row in truth])
    statuses = [estimate.status for estimate in recording.agents[name].estimates]
    step = float(np.median(np.diff(errors.t))) if len(errors.t) > 1 else 0.0
    return {
        "velocity_rms": rms(np.linalg.norm(errors.components[late], axis=1)),
        "position_rms": rms(errors.position[late]),
        "velocity_rms_last_quarter": rms(errors.norm[errors.last]),
        "velocity_error_start": float(errors.norm[0]),
        "velocity_error_end": float(errors.norm[-1]),
        "found_from_s": errors.found_from(FOUND * float(speeds[0])) if speeds[0] > 0.0 else None,
        "decay_rate_per_s": decay_rate(errors.t, errors.norm, FOUND),
        "speed_max": float(speeds.max()),
        "lost_s": statuses.count(Status.LOST) * step,
        "degraded_s": statuses.count(Status.DEGRADED) * step,
        "planner_share": planner_share(0.0, float(recording.t[-1]), recording.agents[name].plans),
        "run_time_s": float(recording.t[-1]),
        "real_time_factor": float(recording.t[-1]) / wall_seconds,
        "seed": seed,
    }


def angles_to_reference(recording: Recording, name: str, manifold: Manifold) -> Array:
    """Angles (n,) [rad] from a body to the reference at each sample; infinite before the first plan."""
    truth, n, attitudes = recording.truths[name], manifold.size, Attitude()
    reference = _reference(recording, name, truth.shape[1])
    known = [bool(np.isfinite(row).all()) for row in reference]
    return np.array(
        [
            2.0 * attitudes.distance(row[:n], wanted[:n]) if is_known else math.inf
            for row, wanted, is_known in zip(truth, reference, known, strict=True)
        ]
    )


def tracking_figures(recording: Recording, name: str, manifold: Manifold, settled: float) -> dict[str, Any]:
    """Figures of the tracking of a reference attitude.

    The root mean square of the angle to it from ``settled`` [s] on, and the last time at which the angle was more than
    ``SETTLED``.
    """
    t, angle = recording.t, angles_to_reference(recording, name, manifold)
    above = np.flatnonzero(angle > SETTLED)
    late = t >= settled - TIME_TOLERANCE
    return {
        "attitude_rms_rad": rms(angle[late]),
        "settled_at_s": float(t[above[-1]]) if len(above) and above[-1] < len(t) - 1 else None if len(above) else 0.0,
    }


def _reference(recording: Recording, name: str, size: int) -> Array:
    """Reference states (n, size) by the current plan at each sample; NaN before the first plan."""
    reference = np.full((len(recording.t), size), np.nan)
    for adopted, plan in recording.agents[name].plans:
        held = recording.t >= max(adopted, plan.t_start) - TIME_TOLERANCE
        nearest = np.clip(np.searchsorted(plan.t, recording.t[held] - 0.5 * np.diff(plan.t[:2])[0]), 0, len(plan.t) - 1)
        reference[held] = plan.x[nearest]
    return reference
