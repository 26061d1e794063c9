"""The posterior Cramér-Rao bound: the least covariance that the error of any estimator of a state can have.

With x_{k+1} = f(x_k) + w_k, w_k of covariance Q_k, and readings y_k = h(x_k) + v_k, the information J_k about x_k obeys
(P. Tichavský, C. H. Muravchik and A. Nehorai, IEEE Trans. Signal Processing 46, 1998)

    J_{k+1} = (Q_k + F_k J_k^{-1} F_k')^{-1} + M_{k+1},        cov(e_k) >= J_k^{-1},

F_k the Jacobian of f and M_k the Fisher information of the readings at k. The recursion is the one of the paper with
the matrix inversion lemma applied, so that Q_k may be singular, and so may J_k while nothing is known of a direction.
The paper takes expectations over trajectories; along one recorded trajectory the Jacobians are those at the true
states: the bound is the covariance that an extended Kalman filter linearised at the truth would state.

The efficiency of an estimator over the samples K of a run, for its judged components m, is

    sqrt(sum_{k in K} |e_k|^2 / sum_{k in K} trace P_k),        P_k the block of J_k^{-1} of these components:

the root mean square error over the root mean square of its bound. It scatters about a number >= 1 from run to run, as e
does; squared errors and bounds of many runs are to be averaged before the root is taken.

**The posterior Cramér-Rao bound along a recorded run**: parts that the bounds of all scenarios share.

The noise is as the mission declares it, without the floors and margins that estimators add. A reading counts at the
first sample after its arrival. If a fraction epsilon of the readings are outliers, their information is 1 - epsilon
times that of good ones, which is at least that of a mixture, so that the bound remains valid.

Without process noise the recursion is the Cramér-Rao bound of the start as a parameter, which falls as long as there
are readings; if the start is exact too, it is zero and useless. A bound needs a smooth likelihood: there is none for
exact readings, or for readings whose rounding exceeds their noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.stagewise.model import Piece, StagewiseModel, advanced
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording

_REGULAR = 1e-12  # least eigenvalue of an information with a diagonal of ones that is inverted


class BoundRecursion:
    """Recursion of the bound, from an initial information J or covariance P (d, d): give exactly one of the two.

    A covariance may be singular in directions in which the start is exact, an information in unknown directions.
    """

    def __init__(self, *, information: Array | None = None, covariance: Array | None = None) -> None:
        if (information is None) == (covariance is None):
            raise ArgumentError("information and covariance; allowed: exactly one of the two")
        self._J, self._P = information, covariance

    @property
    def covariance(self) -> Array | None:
        """Copy of the bound (d, d); None while some direction is not observed."""
        return None if self._P is None else self._P.copy()

    @property
    def variance(self) -> Array | None:
        """Diagonal (d,) of the bound, read-only; None while some direction is not observed."""
        return None if self._P is None else self._P.diagonal()

    def predict(self, F: Array, Q: Array) -> None:
        """Propagate the bound over a transition with regular Jacobian F (d, d) and noise of covariance Q (d, d)."""
        if self._P is not None:
            P = F.dot(self._P).dot(F.T) + Q  # a product of small matrices takes half the time of @
            self._P = 0.5 * (P + P.T)
            return
        assert self._J is not None
        inverse = np.linalg.inv(F)
        A = inverse.T @ self._J @ inverse
        values, vectors = np.linalg.eigh(Q)
        kept = values > _REGULAR * max(float(values[-1]), 0.0)
        if values[-1] > 0.0:
            L = vectors[:, kept] * np.sqrt(values[kept])
            AL = A @ L
            A -= AL @ np.linalg.solve(np.eye(L.shape[1]) + L.T @ AL, AL.T)
        self._J = 0.5 * (A + A.T)

    def observe(self, W: Array) -> None:
        """Add readings with the Fisher information W' W, W (m, d)."""
        if self._P is not None:
            PW = self._P @ W.T
            S = np.eye(len(W)) + W @ PW
            # For a single reading S is a number, and calling LAPACK for it takes longer than all the rest.
            P = self._P - PW @ (PW.T * (1.0 / S) if len(W) == 1 else np.linalg.solve(S, PW.T))
            self._P = 0.5 * (P + P.T)
            return
        assert self._J is not None
        self._J = self._J + W.T @ W
        self._P = _inverse(self._J)


def _inverse(J: Array) -> Array | None:
    """Inverse of an information; None if it is singular, independent of units."""
    diagonal = np.diag(J)
    if not (diagonal > 0.0).all():
        return None
    scale = 1.0 / np.sqrt(diagonal)
    values, vectors = np.linalg.eigh(scale[:, np.newaxis] * J * scale)
    if values[0] <= _REGULAR:
        return None
    P: Array = scale[:, np.newaxis] * (vectors / values @ vectors.T) * scale
    return P


@dataclass(frozen=True, eq=False)
class PosteriorBound:
    """Bound on the errors of a run's estimates, or the reason why none exists."""

    deviation: Array  # (n, m) standard deviations of the components at the samples; NaN where there is no bound
    judged: tuple[int, ...] = ()  # components by which the efficiency is judged
    quantity: str = ""  # name of these components: "position"
    reason: str = ""  # reason why there is no bound at all

    @staticmethod
    def none(reason: str, samples: int) -> PosteriorBound:
        """Result without a bound, with its reason."""
        return PosteriorBound(np.full((samples, 0), np.nan), reason=reason)

    def figures(self, error: Array, window: slice, span: str) -> dict[str, float | str | None]:
        """Figures of the summary: ``efficiency`` of the ``error`` (n, len(judged)) over a window of the samples, and
        its basis in words.

        ``span`` is the window in words: "the last quarter".
        """
        if self.reason:
            return {"efficiency": None, "efficiency_basis": f"none: {self.reason}"}
        variance = np.square(self.deviation[window][:, list(self.judged)])
        value = efficiency(error[window], variance)
        if value is None:
            basis = f"none: over {span} the bound or the estimate is missing, or the bound is zero"
            return {"efficiency": None, "efficiency_basis": basis}
        basis = f"root mean square error of {self.quantity} over {span}, over the posterior Cramér-Rao bound's"
        return {"efficiency": value, "efficiency_basis": basis}


def efficiency(error: Array, variance: Array) -> float | None:
    """Efficiency sqrt(sum e^2 / sum P) of errors and bounds on their variances (n, m).

    Returns None without values, if any is missing, and if all bounds are zero to round-off.
    """
    if not error.size or not (np.isfinite(error).all() and np.isfinite(variance).all()):
        return None
    bound = float(variance.sum())
    return float(np.sqrt(np.square(error).sum() / bound)) if bound > np.finfo(float).tiny else None


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
