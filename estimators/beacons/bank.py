"""A bank of Kalman filters over the poses that a robot can have: a sum of Gaussians.

From an unknown start there is a filter at each place where the first reading can have been made, with each heading.
Their weights follow the likelihoods of what is read; those that explain it worst are dropped, and those that meet are
merged, until the weight is at one pose. What two beacons cannot tell apart stays two poses until the robot turns.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.beacons.kernels import BEARING, RANGE, STATES, condition, merged, predict
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.angles import wrapped

_HEADINGS = 24  # from an unknown start
_AROUND, _GRID = 48, 14  # places on a circle, or along each side of the box
_LEAST_WEIGHT = 1e-5  # of the heaviest, below which a filter is dropped
_MOST = 4000  # filters
_NEAR = 1.0  # squared Mahalanobis distance at which two are merged
_SPREAD = 0.6  # of the distance between two places: standard deviation


class BeaconBank:
    """Filters side by side, and the start of each."""

    def __init__(self, model: BeaconModel, gate: float) -> None:
        """``gate`` is the nu^2 / s at which a filter rejects a reading."""
        self._model, self._gate = model, gate
        self._errors = {kind: np.append(errors, gate) for kind, errors in model.errors.items()}
        self.x, self.P, self.weights = np.empty((0, STATES)), np.empty((0, STATES, STATES)), np.empty(0)
        self.seeds: Integers = np.empty(0, dtype=np.int64)
        self.starts: tuple[Array, Array] = self.x, self.P
        """states (N, 6) and covariances (N, 6, 6) at the start; ``seeds`` are the places of the filters in them"""

    @property
    def begun(self) -> bool:
        """False while there is no filter."""
        return len(self.weights) > 0

    def begin(self, x: Array, P: Array) -> None:
        """Begin with one filter at a state (6,) with a covariance (6, 6)."""
        self._set(x[None].copy(), P[None].copy())

    def begin_anywhere(self, y: Array) -> None:
        """Begin with filters wherever the reading y (rows,) can have been made; it is not used itself."""
        rows = np.flatnonzero(np.isfinite(y))
        entries = [(*self._model.entries[row], float(y[row])) for row in rows]
        ranges = [each for each in entries if each[0] == RANGE]
        places = self._model.places
        if ranges:
            _, i, rho = min(ranges, key=lambda each: each[2])
            angles = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
            points = places[i] + rho * np.column_stack([np.cos(angles), np.sin(angles)])
            apart = np.full(_AROUND, max(2.0 * math.pi * rho / _AROUND, 1e-2))
        else:
            low, high = self._model.mission.box
            sides = [np.linspace(a, b, _GRID) for a, b in zip(low, high, strict=True)]
            points = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
            apart = np.full(len(points), float(((high - low) / (_GRID - 1)).max()))
        headings = -math.pi + 2.0 * math.pi * np.arange(_HEADINGS) / _HEADINGS
        turned, known = 2.0 * math.pi / _HEADINGS, [each for each in entries if each[0] == BEARING]
        if known:
            _, i, bearing = known[0]
            offsets = places[i] - points
            facing = wrapped(np.arctan2(offsets[:, 1], offsets[:, 0]) - bearing)[:, None]
            distance = np.maximum(np.hypot(offsets[:, 0], offsets[:, 1]), 1e-2)
            turn = np.minimum(np.hypot(apart / distance, self._errors[BEARING][0]), 1.0)
        else:
            facing, turn = np.tile(headings, (len(points), 1)), np.full(len(points), turned)
        count = facing.shape[1]
        x = np.zeros((len(points) * count, STATES))
        x[:, :2], x[:, 2] = np.repeat(points, count, axis=0), facing.ravel()
        deviations = np.column_stack([_SPREAD * apart, _SPREAD * apart, _SPREAD * turn])
        P = np.array([self._model.covariance(each) for each in deviations])
        self._set(x, np.repeat(P, count, axis=0))

    def _set(self, x: Array, P: Array) -> None:
        self.x, self.P = x, P
        self.weights, self.seeds = np.full(len(x), 1.0 / len(x)), np.arange(len(x))
        self.starts = x.copy(), P.copy()

    def predict(self, u: Array, h: float) -> None:
        """Move all for h [s] with the odometry and the densities of its noise u (4,) held."""
        predict(self.x, self.P, u[0], u[1], h, u[2], u[3])

    def condition(self, y: Array) -> list[tuple[int, float, float, float]]:
        """Condition on a reading y (rows,); row, nu, s and beta of the heaviest filter for each entry that was read."""
        answers = []
        for row in np.flatnonzero(np.isfinite(y)).tolist():
            kind, i = self._model.entries[row]
            logs, found = np.log(np.maximum(self.weights, 1e-300)), np.empty((len(self.x), 3))
            condition(self.x, self.P, logs, float(y[row]), kind, i, self._model.places, self._errors[kind], found)
            nu, s, beta = found[int(np.argmax(logs))].tolist()
            answers.append((row, nu, s, beta))
            if len(logs) > 1:
                weights = np.exp(logs - logs.max())
                self._keep(weights / weights.sum())
        return answers

    def _keep(self, weights: Array) -> None:
        """Drop the lightest, and merge those that meet."""
        kept = np.flatnonzero(weights > _LEAST_WEIGHT * weights.max())
        if len(kept) > _MOST:
            kept = kept[np.argsort(-weights[kept], kind="stable")[:_MOST]]
        x, P, weights, seeds = self.x[kept], self.P[kept], weights[kept], self.seeds[kept]
        if len(weights) <= _MOST // 4:
            x, P, weights, places = merged(x, P, weights, _NEAR)
            seeds = seeds[places]
        self.x, self.P, self.weights, self.seeds = x, P, weights / weights.sum(), seeds

    @property
    def best(self) -> int:
        """Place of the heaviest."""
        return int(np.argmax(self.weights))

    def heaviest(self, count: int) -> tuple[Array, Array]:
        """Poses (count, 3) of the heaviest and logarithms (count,) of their weights over the largest; NaN if fewer."""
        poses, scores = np.full((count, 3), np.nan), np.full(count, np.nan)
        chosen = np.argsort(-self.weights, kind="stable")[:count]
        poses[: len(chosen)] = self.x[chosen, :3]
        if len(chosen):
            scores[: len(chosen)] = np.log(np.maximum(self.weights[chosen] / self.weights[chosen[0]], 1e-300))
        return poses, scores

    def moments(self) -> tuple[Array, Array]:
        """Mean (6,) and covariance (6, 6) of all; headings relative to that of the heaviest."""
        if len(self.weights) == 1:
            return self.x[0].copy(), 0.5 * (self.P[0] + self.P[0].T)
        middle = self.x[self.best]
        d = self.x - middle
        d[:, 2] = wrapped(d[:, 2])
        mean = self.weights @ d
        d -= mean
        P: Array = np.einsum("n,nij->ij", self.weights, self.P) + (self.weights[:, None] * d).T @ d
        x: Array = middle + mean
        x[2] = wrapped(float(x[2]))
        return x, 0.5 * (P + P.T)
