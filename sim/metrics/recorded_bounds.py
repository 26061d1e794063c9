"""The posterior Cramér-Rao bound along a recorded run: what the bounds of all scenarios share.

The noise is what the mission declares, without the floors and the reserves that estimators add. A reading counts at the
sample by which it has come. Where readings may be outliers, of the fraction epsilon, their information is 1 - epsilon
times that of good ones, which is at least what a mixture has, so that the bound stays one.

Without process noise the recursion is the Cramér-Rao bound of the start as a parameter, which falls as long as there
are readings; where the start is exact besides, it is zero and says nothing. A bound needs a likelihood that is smooth:
there is none for readings that are exact, or that are rounded more than they are noisy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.stagewise.model import Piece, StagewiseModel, advanced
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound


def estimates_at(recording: Recording, name: str, size: int) -> Array:
    """The newest estimate (n, size) at each sample; NaN before the first, and for estimates of another size."""
    estimates = recording.agents[name].estimates
    x = np.full((len(recording.t), size), np.nan)
    if estimates and np.shape(estimates[0].x) == (size,):  # all of them have one shape
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
    """Deviations (n, d) along the true states x (n, nx) of a model; NaN while the bound does not exist.

    ``inputs`` (n - 1) lead from each sample to the next, ``weighted`` (n) are W (m, d) of each sample's readings, of
    the Fisher information W' W. ``kept`` are the components of an error that are not known exactly, all if not given.
    A Jacobian stands for ``held`` transitions.
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
    """The bound of the deviations (n, d), judged by some components; none where no sample has one."""
    if np.isnan(deviation).all():
        return PosteriorBound.none("the readings never determine the whole state", len(deviation))
    return PosteriorBound(deviation, judged, quantity)
