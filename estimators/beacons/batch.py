"""Batch fit of all readings since a beginning: the most probable poses, scale errors and places of unknown beacons.

A filter linearises each reading once, about what it believed at that time. With beacons at places that it finds only
later it is too sure of them: what it has taken for information stays in its covariance. The batch fit linearises all
readings about one solution, that at which they fit best, so that its covariance is that of the data. It minimises

    prior + sum of squares of the motions' noises - sum log((1 - epsilon) N(y - h; 0, sigma^2) + epsilon / L)

by Levenberg and Marquardt's steps (``batch_kernels``), first with Cauchy's density in place of that of the readings,
which draws from afar. Its newest pose, the scale errors and the places are the state of the filters of the bank, which
go on from there.

A range leaves a beacon on a circle, and ranges from a straight path leave two images of it. So a fit is believed only
if no other place of a beacon explains its readings nearly as well: around poses spread over the run, the places at the
distance that was read, or in the direction, are searched all around for minima, and the fit begins again at each that
is not the one found.

The oldest half of too many stages is replaced by the Gaussian that follows from it (marginalisation).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.beacons.batch_kernels import cost_of, moved, ray_costs, ring_costs, step, weighed
from mathnavi.estimators.beacons.kernels import BEARING, DIFFERENCE, RANGE, expected
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.estimators.beacons.taking_in import LEAST
from mathnavi.estimators.stagewise.model import Piece
from mathnavi.estimators.stagewise.verdict import improbable
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.angles import wrapped

_MOST = 2000  # stages
_STEPS, _ENOUGH = 40, 1e-3  # steps at most, and the decrease of the cost that ends them
_LEAST_DAMPING, _DAMPING, _LARGEST_DAMPING = 1e-9, 1e-3, 1e5
_BETTER = 1.0  # by which the cost of another minimum is less than one that is doubted
_COST = 2.0  # of a reading, of some that are as declared, at most
_AS_GOOD = 9.0  # by which the cost of another minimum may be greater: it is as probable as 1 to e^9
_RINGS, _AROUND = 5, 72  # poses around which other places are sought, and directions
_APART = 9.0  # squared Mahalanobis distance from which on a place is another one
_WINDOWS = (10.0, 40.0, 160.0, 640.0)  # readings over which residuals are tested
_EXACT = 1e-8  # variance of what is known exactly
_BACK = np.array([1.0, -1.0, -1.0, 1.0, 1.0])  # a piece, driven backwards


Data = tuple[Array, Integers, Array]
"""pieces (M, 5), the first (N,) after each stage, and readings (n, 4)"""
Candidates = tuple[Array, Array, Array]
"""places (K, 2), their costs (K,), and half the distances (K,) [m] between them"""


@dataclass(frozen=True, eq=False)
class BatchMinimum:
    """A minimum of the cost."""

    X: Array  # (N, 3) poses at the stages
    theta: Array  # (p,) scale errors and unknown places
    cost: float
    information: Array  # (d, d) of the newest pose and theta

    @property
    def state(self) -> Array:
        """Newest pose and constants (d,)."""
        return np.concatenate([self.X[-1], self.theta])

    @property
    def covariance(self) -> Array:
        """Covariance (d, d) of the newest pose and the constants."""
        P: Array = np.linalg.inv(self.information).astype(np.float64)
        return 0.5 * (P + P.T)


class BatchFit:
    """Readings since a beginning, and what fits them best."""

    def __init__(self, model: BeaconModel) -> None:
        self._model = model
        self._errors = np.zeros((3, 4))
        for kind, errors in model.errors.items():
            self._errors[kind] = errors
        self._nothing = model.covariance(np.full(3, math.inf))
        self.begin(model.state(np.zeros(3)), self._nothing)

    def begin(self, x: Array, P: Array) -> None:
        """Begin again with a state (d,), known to a covariance (d, d) that is infinite for what is not known."""
        known = np.flatnonzero(np.isfinite(np.diag(P)))
        information = np.zeros_like(P)
        information[np.ix_(known, known)] = np.linalg.inv(P[np.ix_(known, known)] + _EXACT * np.eye(len(known)))
        self._prior = x.copy(), information
        self._pieces: list[tuple[float, ...]] = []
        self._firsts = [0]
        self._readings: list[tuple[float, ...]] = []
        self._X: Array | None = None  # (k, 3) poses at the first k stages, as last fitted
        self._before = math.inf, 0  # cost of that fit, and number of its readings
        self._whole = True  # False once the oldest stages are summed up

    @property
    def stages(self) -> int:
        """Number of stages: the beginning, and each with readings."""
        return len(self._firsts)

    def move(self, inputs: Iterable[Piece]) -> None:
        """Note motion."""
        self._pieces.extend((h, *u.tolist()) for h, u in inputs)

    def read(self, y: Array) -> None:
        """Note a reading y (rows,) of now."""
        if len(self._pieces) > self._firsts[-1]:
            self._firsts.append(len(self._pieces))
        k = len(self._firsts) - 1
        for row in np.flatnonzero(np.isfinite(y)).tolist():
            self._readings.append((k, *self._model.entries[row], float(y[row])))

    def forget(self, i: int) -> None:
        """Forget all that was read of beacon i, at an unknown place; of beacon 0 the range differences are that too."""
        self._readings = [each for each in self._readings if each[2] != i and (i or each[1] != DIFFERENCE)]
        self._before = math.inf, 0
        x, information = self._prior
        k = int(self._model.columns[i])
        left = np.setdiff1d(np.arange(len(x)), (k, k + 1))
        own, cross = information[k : k + 2, k : k + 2], information[left, k : k + 2]
        after = np.zeros_like(information)
        after[np.ix_(left, left)] = information[np.ix_(left, left)] - cross @ np.linalg.solve(own, cross.T)
        after[k : k + 2, k : k + 2] = np.linalg.inv(self._nothing[k : k + 2, k : k + 2])
        self._prior = x, after

    def fit(self, x: Array) -> BatchMinimum | None:
        """Fit from a state x (d,) of now on; None if the steps do not converge to a minimum that has a covariance."""
        data = self._data()
        begin = self._initial(x)
        again = self._X is not None
        found = self._solved(begin, x[3:].copy(), data, (False,)) if again else None
        if found is None or self._has_leapt(found, data):
            other = self._solved(begin, x[3:].copy(), data, (True, False))
            if found is None or (other is not None and other.cost < found.cost - _BETTER):
                found = other
        if found is not None:
            self._X, self._before = found.X, (found.cost, len(data[2]))
            if self.stages > _MOST:
                self._marginalise(found, data)
        return found

    @property
    def first_pose(self) -> Array | None:
        """Pose (3,) at the beginning by the last fit; None without one, and once the oldest stages are summed up."""
        return self._X[0].copy() if self._X is not None and self._whole else None

    def _has_leapt(self, found: BatchMinimum, data: Data) -> bool:
        """True if a fit is worse by more than its readings since the one before make credible: the steps have led to a
        minimum at which the readings of a beacon are outliers.
        """
        cost, count = self._before
        return found.cost > cost + _AS_GOOD + _COST * (len(data[2]) - count)

    def outliers(self, found: BatchMinimum) -> frozenset[tuple[int, int, float]]:
        """Kind, beacon and value of each reading that is rather an outlier by a fit."""
        return frozenset((kind, i, value) for kind, i, value, r in self._residuals(found) if math.isnan(r))

    def contradicts(self, found: BatchMinimum) -> bool:
        """True if readings of a beacon, or all, differ from a fit by more than chance; outliers are no evidence."""
        residuals = self._residuals(found)
        r = np.full((len(residuals), len(self._model.places)), np.nan)
        for k, (_, i, _, own) in enumerate(residuals):
            r[k, i] = own
        return bool(improbable(np.arange(len(r), dtype=np.float64), r, _WINDOWS))

    def _residuals(self, found: BatchMinimum) -> list[tuple[int, int, float, float]]:
        """Kind, beacon, value and whitened residual of each reading by a fit, NaN for one that is rather an outlier."""
        residuals, X = [], found.X[-self.stages :]  # those that are left
        for k, kind, i, value in self._data()[2].tolist():
            state = np.concatenate([X[int(k)], found.theta])
            h, _, _, rho = expected(state, int(kind), int(i), self._model.places, self._model.columns)
            absolute, relative, epsilon, length = self._errors[int(kind)].tolist()
            nu = wrapped(value - h) if kind == BEARING else value - h
            sigma = math.hypot(absolute, relative * rho)
            far = weighed(nu, sigma, epsilon, length, False)[0] < 0.5
            residuals.append((int(kind), int(i), value, math.nan if far else nu / sigma))
        return residuals

    def alone(self, found: BatchMinimum) -> tuple[BatchMinimum, int | None]:
        """The most probable fit that a search for other places of the beacons leads to from a fit, and a beacon of
        which another place is as probable as one in e^9 or more; None if there is none.
        """
        for _ in self._model.mission.unknown:
            rival = self.rival(found)
            if rival is None:
                return found, None
            i, other = rival
            if other.cost > found.cost - _AS_GOOD:
                return found, i
            found, self._X, self._before = other, other.X, (other.cost, self._before[1])
        return found, i

    def rival(self, found: BatchMinimum) -> tuple[int, BatchMinimum] | None:
        """A beacon, and a fit with it at another place that is as probable as one in e^9 or more; None without one."""
        data, P = self._data(), found.covariance
        for i in self._model.mission.unknown:
            k = int(self._model.columns[i])
            own, b = P[k : k + 2, k : k + 2], found.theta[k - 3 : k - 1]

            def is_back(theta: Array, k: int = k, own: Array = own, b: Array = b) -> bool:
                off = theta[k - 3 : k - 1] - b
                return float(off @ np.linalg.solve(own, off)) <= _APART

            for place in self._others(found, i, own, data):
                theta = found.theta.copy()
                theta[k - 3 : k - 1] = place
                other = self._solved(found.X.copy(), theta, data, (True, False), is_back)
                if other is not None and other.cost < found.cost + _AS_GOOD:
                    return i, other
        return None

    # ---- parts of a fit

    def _data(self) -> Data:
        """Pieces (M, 5), the first (N,) after each stage, and the readings (n, 4) of beacons that are placed."""
        used = [each for each in self._readings if self._model.says(int(each[1]), int(each[2]))]
        pieces = np.array(self._pieces, np.float64).reshape(-1, 5)
        return pieces, np.array(self._firsts, np.int64), np.array(used, np.float64).reshape(-1, 4)

    def _initial(self, x: Array) -> Array:
        """Poses (N, 3) to begin with: those of the last fit and on from there, or back from x (d,) by odometry."""
        pieces, firsts, _ = self._data()
        X = np.empty((self.stages, 3))
        theta = x[3:].copy()
        if self._X is None:
            X[-1] = x[:3]
            for k in range(self.stages - 1, 0, -1):
                X[k - 1] = moved(X[k], theta, pieces[firsts[k - 1] : firsts[k]][::-1] * _BACK)[0]
            return X
        count = len(self._X)
        X[:count] = self._X
        for k in range(count, self.stages):
            X[k] = moved(X[k - 1], theta, pieces[firsts[k - 1] : firsts[k]])[0]
        return X

    def _solved(
        self,
        X: Array,
        theta: Array,
        data: Data,
        costs: tuple[bool, ...],
        ends: Callable[[Array], bool] | None = None,
    ) -> BatchMinimum | None:
        """Minimum from poses X (N, 3) and constants theta (p,) on, for the robust cost and for that of the data in
        turn; None if the steps do not converge, or come to constants that ``ends`` is true of.
        """
        pieces, firsts, readings = data
        rest = (self._prior, pieces, firsts, readings, self._model.places, self._model.columns, self._errors)
        cost = math.inf
        for robust in costs:
            damping, cost, converged = _DAMPING, cost_of(X, theta, *rest, robust), False
            for _ in range(_STEPS):
                try:
                    dX, dtheta, _ = step(X, theta, *rest, robust, damping)
                except np.linalg.LinAlgError:
                    return None
                after, constants = X + dX, theta + dtheta
                after[:, 2] = wrapped(after[:, 2])
                new = cost_of(after, constants, *rest, robust)
                if not new < cost:
                    damping *= 10.0
                    converged = damping > _LARGEST_DAMPING
                else:
                    converged = cost - new < _ENOUGH
                    X, theta, cost, damping = after, constants, new, max(0.1 * damping, _LEAST_DAMPING)
                if ends is not None and ends(theta):
                    return None
                if converged:
                    break
        if not (converged and math.isfinite(cost)):
            return None
        _, _, information = step(X, theta, *rest, False, 0.0)
        information = 0.5 * (information + information.T)
        if not np.isfinite(information).all() or np.linalg.eigvalsh(information)[0] <= 0.0:
            return None
        return BatchMinimum(X, theta, cost, information)

    def _others(self, found: BatchMinimum, i: int, own: Array, data: Data) -> list[Array]:
        """Places (2,) of beacon i other than that of a fit, known to ``own`` (2, 2), that explain its readings best of
        those nearby: its ranges, or range differences without any, or bearings without these.
        """
        k = int(self._model.columns[i])
        b, places = found.theta[k - 3 : k - 1], list[Array]()
        for points, costs, near in self._candidates(found, i, b, data[2]):
            lowest = np.flatnonzero((costs <= np.roll(costs, 1)) & (costs < np.roll(costs, -1)))
            for place, nearest in zip(points[lowest], near[lowest].tolist(), strict=True):
                difference = place - b
                apart = float(difference @ np.linalg.solve(own + nearest**2 * np.eye(2), difference)) > _APART
                if apart and all(math.dist(place, other) > 4.0 * nearest for other in places):
                    places.append(place)
        return places

    def _candidates(self, found: BatchMinimum, i: int, b: Array, readings: Array) -> Iterable[Candidates]:
        """Places of beacon i, b (2,) by a fit, about poses spread over the run, with their costs by one kind of its
        readings.
        """
        of = [readings[(readings[:, 1] == kind) & (readings[:, 2] == i)] for kind in (RANGE, DIFFERENCE, BEARING)]
        if i == 0:  # whose differences are those of the others
            of[1] = readings[readings[:, 1] == DIFFERENCE]
        for kind, read in zip((RANGE, DIFFERENCE, BEARING), of, strict=True):
            if len(read):
                X = found.X[read[:, 0].astype(int)]
                return self._on_rays(b, read, X) if kind == BEARING else self._on_circles(found, i, b, read, X)
        return ()

    def _on_rays(self, b: Array, read: Array, X: Array) -> Iterator[Candidates]:
        """Places in the directions of bearings (n, 4) that were read at poses X (n, 3)."""
        absolute, relative, *_ = self._errors[BEARING]
        offsets = b - X[:, :2]
        sigma = np.hypot(absolute, relative * np.hypot(offsets[:, 0], offsets[:, 1]))
        rho = self._model.mission.longest * np.geomspace(LEAST, 1.0, _AROUND)
        for n in _spread(np.abs(wrapped(read[:, 3] - np.arctan2(offsets[:, 1], offsets[:, 0]) + X[:, 2]))):
            direction = X[n, 2] + read[n, 3]
            ray = X[n, :2] + rho[:, None] * np.array([math.cos(direction), math.sin(direction)])
            yield ray, ray_costs(ray, X, np.ascontiguousarray(read[:, 3]), sigma), 0.5 * np.gradient(rho)

    def _on_circles(self, found: BatchMinimum, i: int, b: Array, read: Array, X: Array) -> Iterator[Candidates]:
        """Places at the distances by ranges or range differences (n, 4) that were read at poses X (n, 3)."""
        absolute, relative, *_ = self._errors[int(read[0, 1])]
        rho = self._distances(found, i, read, X)
        sigma = np.hypot(absolute, relative * (np.abs(read[:, 3]) / (1.0 + found.theta[2])))
        angles = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
        e = np.column_stack([np.cos(angles), np.sin(angles)])
        for n in _spread(np.abs(rho - np.hypot(*(b - X[:, :2]).T))):
            ring = X[n, :2] + rho[n] * e
            yield (
                ring,
                ring_costs(ring, np.ascontiguousarray(X[:, :2]), rho, sigma),
                np.full(_AROUND, math.pi * rho[n] / _AROUND),
            )

    def _distances(self, found: BatchMinimum, i: int, read: Array, X: Array) -> Array:
        """Distances (n,) [m] of beacon i from poses X (n, 3) by its ranges or range differences (n, 4)."""
        rho: Array = read[:, 3] / (1.0 + found.theta[2])
        if int(read[0, 1]) == RANGE:
            return rho
        others = read[:, 2].astype(int) if i == 0 else np.zeros(len(read), dtype=int)
        places, unknown = self._model.places.copy(), np.flatnonzero(self._model.columns >= 0)
        places[unknown] = found.theta[3:].reshape(-1, 2)
        to_others = np.hypot(*(places[others] - X[:, :2]).T)
        far: Array = np.maximum(to_others - rho if i == 0 else to_others + rho, self._errors[DIFFERENCE, 0])
        return far

    def _marginalise(self, found: BatchMinimum, data: Data) -> None:
        """Replace the oldest half of the stages by the Gaussian of the state at the first one that stays."""
        pieces, firsts, readings = data
        k = self.stages // 2
        rest = (self._model.places, self._model.columns, self._errors, False, 0.0)
        dX, dtheta, information = step(
            found.X[: k + 1], found.theta, self._prior, pieces, firsts[: k + 1], readings[readings[:, 0] < k], *rest
        )  # fmt: skip
        self._prior = np.concatenate([found.X[k] + dX[-1], found.theta + dtheta]), information
        first = self._firsts[k]
        self._pieces = self._pieces[first:]
        self._firsts = [each - first for each in self._firsts[k:]]
        self._readings = [(each[0] - k, *each[1:]) for each in self._readings if each[0] >= k]
        self._X, self._before, self._whole = found.X[k:], (math.inf, 0), False


def _spread(off: Array) -> list[int]:
    """Numbers of some readings spread over a run, none of which is farther off than half of all, by ``off`` (n,)."""
    order = np.flatnonzero(off <= np.median(off))  # no outliers
    chosen: list[int] = order[np.unique(np.linspace(0, len(order) - 1, _RINGS).round().astype(int))].tolist()
    return chosen
