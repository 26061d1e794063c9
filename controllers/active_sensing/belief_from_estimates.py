"""From what an estimator says to what is believed of the pose."""

from __future__ import annotations

import dataclasses

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief, checked_pose
from mathnavi.controllers.active_sensing.disagreement import Disagreement
from mathnavi.sim.interfaces.signals import Array, PlanRequest, Status

_LEAST, _MOST = 1e-12, 1e6  # variances [m^2, rad^2]: nothing is known exactly, nor not at all


class BeliefFromEstimates:
    """An estimate, as sure as it says, but where it contradicts those of the ``span`` [s] before it.

    By as much as it does it may be off beside what it says. An estimate without a usable covariance may be off by
    ``deviation`` [m, rad] in every direction, and contradicts whatever it does not agree with.
    """

    def __init__(self, deviation: float, span: float) -> None:
        self._deviation, self._disagreement = deviation, Disagreement(span)

    def at(self, request: PlanRequest) -> Belief:
        """What is believed at the time of a request."""
        estimate = request.estimate
        pose, P = checked_pose(estimate), estimate.covariance
        says = P is not None and P.shape == (3, 3) and bool(np.isfinite(P).all())
        P = _definite(P) if P is not None and says else self._deviation**2 * np.eye(3)
        belief = Belief(pose, P, estimate.status is Status.OK)
        if not np.isfinite(pose).all():
            return belief
        own = np.array([belief.position_deviation, belief.heading_deviation]) if says else np.zeros(2)
        far, turned = self._disagreement.of(request.t, pose, own, request.current)
        return dataclasses.replace(belief, covariance=P + np.diag([far**2, far**2, turned**2]))


def _definite(P: Array) -> Array:
    """A symmetric positive definite matrix near to P (3, 3), of finite numbers."""
    values, vectors = np.linalg.eigh(0.5 * (P + P.T))
    covariance = (vectors * np.clip(values, _LEAST, _MOST)) @ vectors.T
    nearest: Array = 0.5 * (covariance + covariance.T)
    return nearest
