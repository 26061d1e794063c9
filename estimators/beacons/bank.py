"""A bank of Kalman filters over the poses that a robot can have: a sum of Gaussians.

From an unknown start there is a filter at each place where the first reading can have been made, with each heading.
Their weights follow the likelihoods of what is read; those that explain it worst are dropped, and those that meet are
merged, until the weight is at one pose. What two beacons cannot tell apart stays two poses until the robot turns.

A beacon at an unknown place is taken into the state with the first reading that finds it, on the circle or on the ray
on which it must be (``taking_in``), by Gaussians that overlap with their neighbours. So each filter becomes K, of which
the readings leave one, or two: by ranges the image of the beacon in a straight path is as likely until the robot turns.
The next beacon is taken in when few are left. [J. L. Blanco, J. A. Fernandez-Madrigal, J. Gonzalez, Efficient
probabilistic range-only SLAM, IROS 2008; N. M. Kwok, G. Dissanayake, An efficient multiple hypothesis filter for
bearing-only SLAM, IROS 2004]
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.beacons.kernels import BEARING, DIFFERENCE, RANGE, STATES, condition, merged, predict
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.estimators.beacons.taking_in import AROUND, SPREAD, first_places
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.angles import wrapped

_HEADINGS = 24  # from an unknown start
_GRID = 14  # places along each side of the box
_LEAST_WEIGHT = 1e-5  # of the heaviest, below which a filter is dropped
_MOST = 4000  # filters
_NEAR = 1.0  # squared Mahalanobis distance at which two are merged
_ONE = 4.0  # likewise with unknown places: up to it two Gaussians together have one maximum
_FEW = 16  # filters, up to which a beacon at an unknown place is taken in
_UNLIKELY = 1e-3  # weight up to which a filter may have a beacon elsewhere than the others


class BeaconBank:
    """Filters side by side, and the start of each."""

    def __init__(self, model: BeaconModel, gate: float) -> None:
        """``gate`` is the nu^2 / s at which a filter rejects a reading."""
        self._model, self._gate = model, gate
        self._errors = {kind: np.append(errors, gate) for kind, errors in model.errors.items()}
        d = model.size
        self._near = _ONE if model.mission.unknown else _NEAR
        deviation = {kind: float(errors[0]) for kind, errors in model.errors.items()}
        self._length = min(deviation.get(RANGE, math.inf), deviation.get(DIFFERENCE, math.inf))
        self._angle = deviation.get(BEARING, math.inf)
        self.x, self.P, self.weights = np.empty((0, d)), np.empty((0, d, d)), np.empty(0)
        self.seeds: Integers = np.empty(0, dtype=np.int64)
        self.starts: tuple[Array, Array] = self.x, self.P
        """states (N, d) and covariances (N, d, d) at the start; ``seeds`` are the places of the filters in them"""

    @property
    def begun(self) -> bool:
        """False while there is no filter."""
        return len(self.weights) > 0

    def begin(self, x: Array, P: Array) -> None:
        """Begin with one filter at a state (d,) with a covariance (d, d)."""
        self._set(x[None].copy(), P[None].copy())

    def begin_anywhere(self, y: Array) -> bool:
        """Begin with filters wherever the reading y (rows,) can have been made; it is not used itself.

        Places that were found stay, as the heaviest filter has them. False if y has no beacon that is known or found.
        """
        rows = np.flatnonzero(np.isfinite(y))
        entries = [(*self._model.entries[row], float(y[row])) for row in rows]
        entries = [each for each in entries if self._model.says(*each[:2])]
        if not entries:
            return False
        ranges = [each for each in entries if each[0] == RANGE]
        state, found, places = self._model.state(np.zeros(3)), None, self._model.places
        if self.begun:
            state, found = self.x[self.best].copy(), self.P[self.best, STATES:, STATES:]
            at = np.flatnonzero(self._model.columns >= 0)
            places = places.copy()
            places[at] = state[STATES:].reshape(-1, 2)
        if ranges:
            _, i, rho = min(ranges, key=lambda each: each[2])
            angles = 2.0 * np.pi * np.arange(AROUND) / AROUND
            points = places[i] + rho * np.column_stack([np.cos(angles), np.sin(angles)])
            apart = np.full(AROUND, max(2.0 * math.pi * rho / AROUND, 1e-2))
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
        state[3:STATES] = 0.0
        x = np.tile(state, (len(points) * count, 1))
        x[:, :2], x[:, 2] = np.repeat(points, count, axis=0), facing.ravel()
        deviations = np.column_stack([SPREAD * apart, SPREAD * apart, SPREAD * turn])
        P = np.array([self._model.covariance(each) for each in deviations])
        if found is not None:
            P[:, STATES:, STATES:] = found
        self._set(x, np.repeat(P, count, axis=0))
        return True

    def take_in(self, kind: int, i: int, y: float) -> bool:
        """Take into the state the beacon that a reading y of beacon i finds; False if it finds none, and for too many
        filters.
        """
        found = self._model.finds(kind, i)
        if found is None or len(self.weights) > _FEW:
            return False
        first, k = first_places(self.x, kind, i, y, self._model), int(self._model.columns[found])
        x, P = np.repeat(self.x, first.count, axis=0), np.repeat(self.P, first.count, axis=0)
        x[:, k : k + 2] = first.places
        P[:, k : k + 2, :] = P[:, :, k : k + 2] = 0.0
        cross = first.G @ P
        P[:, k : k + 2, :] = cross
        P[:, :, k : k + 2] = cross.transpose(0, 2, 1)
        P[:, k : k + 2, k : k + 2] = cross @ first.G.transpose(0, 2, 1) + first.noise + first.spread
        self.x, self.P = x, P
        self.weights = np.repeat(self.weights / first.count, first.count)
        self.seeds = np.repeat(self.seeds, first.count)
        self._model.placed[found] = True
        return True

    def settle(self, x: Array, P: Array) -> None:
        """Go on with one filter at a state x (d,) with a covariance P (d, d), which began where the heaviest did."""
        self.seeds = self.seeds[[self.best]]
        self.x, self.P, self.weights = x[None].copy(), P[None].copy(), np.ones(1)

    def forget(self, i: int) -> None:
        """Forget the place of beacon i, which its readings contradict."""
        k, nothing = int(self._model.columns[i]), self._model.covariance(np.zeros(3))
        self.x[:, k : k + 2] = self._model.state(np.zeros(3))[k : k + 2]
        self.P[:, k : k + 2, :] = self.P[:, :, k : k + 2] = 0.0
        self.P[:, k : k + 2, k : k + 2] = nothing[k : k + 2, k : k + 2]
        self._model.placed[i] = False

    def places_found(self, within: float, *, alone: bool = False) -> NDArray[np.bool_]:
        """Whether (n,) the place of each beacon is known, or found to a standard deviation of ``within`` [m] over all
        filters; with ``alone`` all but unlikely ones must have it within that of their mean.
        """
        found = self._model.placed.copy()
        likely = self.weights > _UNLIKELY
        x, P = self.moments() if self.begun else (np.empty(0), np.empty(0))
        for i in np.flatnonzero(found & (self._model.columns >= 0)).tolist():
            k = int(self._model.columns[i])
            found[i] = float(np.trace(P[k : k + 2, k : k + 2])) <= within**2
            if alone:
                off = self.x[likely, k : k + 2] - x[k : k + 2]
                found[i] &= bool((np.hypot(off[:, 0], off[:, 1]) <= within).all())
        return found

    def _set(self, x: Array, P: Array) -> None:
        self.x, self.P = x, P
        self.weights, self.seeds = np.full(len(x), 1.0 / len(x)), np.arange(len(x))
        self.starts = x.copy(), P.copy()

    def predict(self, u: Array, h: float) -> None:
        """Move all for h [s] with the odometry and the densities of its noise u (4,) held."""
        predict(self.x, self.P, u[0], u[1], h, u[2], u[3])

    def condition(self, y: Array) -> list[tuple[int, float, float, float]]:
        """Condition on a reading y (rows,); row, nu, s and beta of the heaviest filter for each entry that was used."""
        answers = []
        for row in np.flatnonzero(np.isfinite(y)).tolist():
            kind, i = self._model.entries[row]
            if not self._model.says(kind, i):
                self.take_in(kind, i, float(y[row]))
                continue
            logs, found = np.log(np.maximum(self.weights, 1e-300)), np.empty((len(self.x), 3))
            condition(
                self.x, self.P, logs, float(y[row]), kind, i, self._model.places, self._model.columns,
                self._errors[kind], found,
            )  # fmt: skip
            nu, s, beta = found[int(np.argmax(logs))].tolist()
            answers.append((row, nu, s, beta))
            if len(logs) > 1:
                weights = np.exp(logs - logs.max())
                self._keep(weights / weights.sum())
        return answers

    def innovation(self, row: int, y: float) -> tuple[float, float] | None:
        """nu and s of a reading by the heaviest filter, which stays as it is; None where it says nothing."""
        kind, i = self._model.entries[row]
        if not self.begun or not self._model.says(kind, i):
            return None
        found, best = np.empty((1, 3)), [self.best]
        condition(
            self.x[best], self.P[best], np.zeros(1), y, kind, i, self._model.places, self._model.columns,
            self._errors[kind], found,
        )  # fmt: skip
        return float(found[0, 0]), float(found[0, 1])

    def _keep(self, weights: Array) -> None:
        """Drop the lightest, and merge those that meet."""
        kept = np.flatnonzero(weights > _LEAST_WEIGHT * weights.max())
        if len(kept) > _MOST:
            kept = kept[np.argsort(-weights[kept], kind="stable")[:_MOST]]
        x, P, weights, seeds = self.x[kept], self.P[kept], weights[kept], self.seeds[kept]
        if len(weights) <= _MOST // 4:
            x, P, weights, places = merged(x, P, weights, self._near, self._length, self._angle)
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
        """Mean (d,) and covariance (d, d) of all; headings relative to that of the heaviest."""
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
