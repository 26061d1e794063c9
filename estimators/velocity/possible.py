"""Whether an estimate of (x, v) of a Lagrangian system can be true at all; one that cannot is LOST.

Its components are finite; no joint, and no body that moves freely, is faster than twice the ``speed_max`` of the
mission; its covariance is finite and positive semidefinite, but for rounding.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mathnavi.estimators.timeout_monitor import worst
from mathnavi.estimators.velocity.readings import TOO_FAST
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.models.manifold.manifold import greatest_rate
from mathnavi.models.manifold.mission import LagrangianMission

_ROUNDING = 1e-9  # of an eigenvalue, of the greatest one with the variances scaled to 1


def possible_or_lost(mission: object, estimate: Estimate) -> Estimate:
    """Return an estimate unchanged if it can be true; else LOST, and its message says what it cannot be.

    One that is INITIALISING claims nothing, and stays. Estimates of other missions than a ``LagrangianMission`` are
    returned unchanged.
    """
    if not isinstance(mission, LagrangianMission) or estimate.status is Status.INITIALISING:
        return estimate
    wrong = impossible(mission, estimate.x, estimate.covariance)
    return replace(estimate, status=worst(estimate.status, Status.LOST), message=wrong) if wrong else estimate


def impossible(mission: LagrangianMission, state: Array, covariance: Array | None) -> str:
    """Return what an estimate (size + vector_size,) with its covariance, if it has one, cannot be; "" if it can be."""
    manifold = mission.system.manifold
    x, v = state[: manifold.size], state[manifold.size :]
    if not np.isfinite(state).all():
        return "is not finite"
    rate = greatest_rate(manifold, manifold.components(x, v))
    if not rate <= TOO_FAST * mission.speed_max:
        return f"moves at {rate:.3g} rad/s or m/s, with speed_max = {mission.speed_max:g}"
    if covariance is not None and not is_covariance(covariance):
        return "has a covariance that is not finite and positive semidefinite"
    return ""


def is_covariance(P: Array) -> bool:
    """True for P (n, n) that is finite and, but for rounding, positive semidefinite, whatever the units."""
    variances = np.diag(P)
    if not np.isfinite(P).all() or (variances < 0.0).any():
        return False
    scale = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    scaled = P / np.outer(scale, scale)
    try:  # a factor exists nearly always, and takes a tenth of the time of the eigenvalues
        np.linalg.cholesky(scaled + _ROUNDING * len(P) * np.eye(len(P)))
    except np.linalg.LinAlgError:
        return bool(np.linalg.eigvalsh(scaled)[0] >= -_ROUNDING * len(P))
    return True
