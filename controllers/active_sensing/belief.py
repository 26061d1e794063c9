"""The planner's belief of the pose: estimates with their covariance, widened where they contradict one another.

A pose that is right stays right when it is integrated with the inputs. Estimates that are still converging, or that
jump, disagree with one another, and so show that they err, and by about how much. An earlier estimate's own uncertainty
is no disagreement.

**Motion** of a unicycle along a plan: arcs of constant input, and rest before and after them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians, wrapped


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


_DEVIATIONS = 3.0  # standard deviations by which an estimate may err
_LEAST, _MOST = 1e-12, 1e6  # variances [m^2, rad^2]: no error is known exactly, and none is unbounded


@dataclass(frozen=True)
class Belief:
    """A pose x = (x_1, x_2, phi) [m, m, rad] and its uncertainty."""

    pose: Array  # (3,)
    covariance: Array  # (3, 3) of the error of the pose, positive definite
    is_found: bool = True  # False while the estimator has no estimate, or has lost its sensors
    alternatives: Array = field(default_factory=lambda: np.empty((0, 3)))  # (m, 3) poses that may be the true one too

    @property
    def position_deviation(self) -> float:
        """Standard deviation of the position [m], in the direction in which it is the largest."""
        return math.sqrt(float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))

    @property
    def heading_deviation(self) -> float:
        """Standard deviation of the heading [rad]."""
        return math.sqrt(float(self.covariance[2, 2]))

    def predicted(self, plan: Plan, begin: float, end: float) -> Belief:
        """The belief at ``end`` [s], if this is the one at ``begin`` and the robot has the inputs of a plan.

        P' = F P F' with F = d x(end) / d x(begin); no reading narrows it.
        """
        pose, covariance = self.pose, self.covariance
        for u, duration in pieces(plan, begin, end):
            F, _ = integrate_jacobians(pose, u[0], u[1], duration)
            pose, covariance = integrate(pose, u[0], u[1], duration), F @ covariance @ F.T
        others = [integrate_plan(other, plan, begin, end) for other in self.alternatives]
        return Belief(pose, covariance, self.is_found, np.array(others).reshape(-1, 3))


class BeliefFromEstimates:
    """Estimates with their own covariance, widened by their disagreement with those of the ``span`` [s] before.

    An estimate without a usable covariance has the standard deviation ``deviation`` [m, rad] in every direction, and
    every difference from an earlier one counts as disagreement.
    """

    def __init__(self, deviation: float, span: float) -> None:
        self._deviation, self._disagreement = deviation, Disagreement(span)

    def update(self, request: PlanRequest) -> Belief:
        """Return the belief at the time of a request; ValueError for an estimate that is not a pose."""
        estimate = request.estimate
        pose, P = checked_pose(estimate), estimate.covariance
        is_usable = P is not None and P.shape == (3, 3) and bool(np.isfinite(P).all())
        P = _definite(P) if P is not None and is_usable else self._deviation**2 * np.eye(3)
        belief = Belief(pose, P, estimate.status.usable or _is_only(estimate), _alternatives(estimate))
        if not np.isfinite(pose).all():
            return belief
        own = np.array([belief.position_deviation, belief.heading_deviation]) if is_usable else np.zeros(2)
        distance, angle = self._disagreement.update(request.t, pose, own, request.current)
        return dataclasses.replace(belief, covariance=P + np.diag([distance**2, distance**2, angle**2]))


class Disagreement:
    """Largest difference of the newest estimate from those of the last ``span`` [s], integrated with the inputs."""

    def __init__(self, span: float) -> None:
        self._span = span
        self._earlier: list[_Earlier] = []
        self._t = 0.0
        self._plan: Plan | None = None  # flown since t

    def update(self, t: float, pose: Array, deviation: Array, plan: Plan | None) -> tuple[float, float]:
        """Largest distance [m] and angle [rad] of a pose (3,) at t [s] from the earlier ones.

        ``deviation`` (2,) [m, rad] is the pose's own; ``plan`` is flown from t on. Estimates before the first plan are
        forgotten.
        """
        if self._plan is None:
            self._earlier = []
        else:
            recent = (earlier for earlier in self._earlier if earlier.t >= t - self._span)
            self._earlier = [
                dataclasses.replace(earlier, pose=integrate_plan(earlier.pose, self._plan, self._t, t))
                for earlier in recent
            ]
        largest = np.zeros(2)
        for earlier in self._earlier:
            x, y, phi = pose - earlier.pose
            error = np.array([np.hypot(x, y), abs(wrapped(phi))])
            largest = np.maximum(largest, np.where(error > earlier.allowed, error, 0.0))
        self._earlier.append(_Earlier(t, pose, _DEVIATIONS * deviation))
        self._t, self._plan = t, plan
        return float(largest[0]), float(largest[1])


@dataclass(frozen=True)
class _Earlier:
    """An estimate, integrated to the present."""

    t: float  # [s] when it was made
    pose: Array  # (3,) now
    allowed: Array  # (2,) [m, rad] by which it may err


def checked_pose(estimate: Estimate) -> Array:
    """The estimate's pose (3,); ValueError for any other shape, which compiled code would read beyond."""
    if estimate.x.shape != (3,):
        raise ArgumentError(f"the estimate's state has shape {estimate.x.shape}; allowed: (3,)")
    return np.asarray(estimate.x, np.float64)


def _hypotheses(estimate: Estimate) -> Array:
    """Poses (m, 3) of an estimator's hypotheses; empty if it lists none, and once it is lost."""
    hypotheses = estimate.extra.get("hypotheses")
    if estimate.covariance is None or estimate.status is Status.LOST:
        return np.empty((0, 3))
    if hypotheses is None or hypotheses.ndim != 2 or hypotheses.shape[1] != 3:
        return np.empty((0, 3))
    return np.asarray(hypotheses, np.float64)


def _is_only(estimate: Estimate) -> bool:
    """True if an estimator lists its hypotheses, and the estimate is the one that is left, certified or not."""
    hypotheses = _hypotheses(estimate)
    return bool(np.isfinite(hypotheses).all(axis=1).sum() == 1)


def _alternatives(estimate: Estimate) -> Array:
    """Poses (m, 3) of an estimator's hypotheses other than its estimate."""
    hypotheses = _hypotheses(estimate)
    others = np.isfinite(hypotheses).all(axis=1) & (hypotheses != estimate.x).any(axis=1)
    poses: Array = hypotheses[others]
    return poses


def _definite(P: Array) -> Array:
    """The nearest symmetric matrix to P (3, 3), finite, whose eigenvalues are within the allowed variances."""
    values, vectors = np.linalg.eigh(0.5 * (P + P.T))
    covariance = (vectors * np.clip(values, _LEAST, _MOST)) @ vectors.T
    nearest: Array = 0.5 * (covariance + covariance.T)
    return nearest
