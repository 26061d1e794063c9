"""The posterior Cramér-Rao bound along a recorded run: parts that the bounds of all scenarios share.

The noise is as the mission declares it, without the floors and margins that estimators add. A reading counts at the
first sample after its arrival. If a fraction epsilon of the readings are outliers, their information is 1 - epsilon
times that of good ones, which is at least that of a mixture, so that the bound remains valid.

Without process noise the recursion is the Cramér-Rao bound of the start as a parameter, which falls as long as there
are readings; if the start is exact too, it is zero and useless. A bound needs a smooth likelihood: there is none for
exact readings, or for readings whose rounding exceeds their noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.stagewise.model import Piece, StagewiseModel, advanced
from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound


def estimates_at(recording: Recording, name: str, size: int) -> Array:
    """Newest estimates (n, size) at each sample; NaN before the first, and for estimates of another size."""
    estimates = recording.agents[name].estimates
    x = np.full((len(recording.t), size), np.nan)
    if estimates and np.shape(estimates[0].x) == (size,):  # all of them have the same shape
        valid = np.array([estimate.t for estimate in estimates])
        newest = np.searchsorted(valid, recording.t + TIME_TOLERANCE, side="right") - 1
        states = np.array([estimate.x for estimate in estimates])
        x[newest >= 0] = states[newest[newest >= 0]]
    return x


def bound_along(
    model: StagewiseModel,
    x: Array,
    inputs: Sequence[Sequence[Piece]],
    weighted: Sequence[Array],
    recursion: BoundRecursion,
    *,
    kept: Sequence[int] | None = None,
    held: int = 1,
) -> Array:
    """Standard deviations (n, d) of the bound along the true states x (n, nx) of a model; NaN while it does not exist.

    ``inputs`` (n - 1) lead from each sample to the next, ``weighted`` (n) are W (m, d) of each sample's readings, with
    the Fisher information W' W. ``kept`` are the components of an error that are not known exactly; all if not given. A
    Jacobian is used for ``held`` transitions.
    """
    rows = np.arange(model.size) if kept is None else np.asarray(kept)
    block = np.ix_(rows, rows)
    deviation = np.full((len(x), model.size), np.nan)
    F = Q = np.zeros(0)
    for k, W in enumerate(weighted):
        if k:
            if (k - 1) % held == 0:
                _, F, Q = advanced(model, x[k - 1], inputs[k - 1])
            recursion.predict(F[block], Q[block])
        if len(W):
            recursion.observe(W[:, rows])
        variance = recursion.variance
        if variance is not None:
            deviation[k] = 0.0
            deviation[k, rows] = np.sqrt(np.maximum(variance, 0.0))
    return deviation


def judged_bound(deviation: Array, judged: tuple[int, ...], quantity: str) -> PosteriorBound:
    """Bound with the deviations (n, d) of its ``judged`` components; without a bound if no sample has one."""
    if np.isnan(deviation).all():
        return PosteriorBound.none("the readings never determine the whole state", len(deviation))
    return PosteriorBound(deviation, judged, quantity)
