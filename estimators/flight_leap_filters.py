"""Filters of a flight whose readings may have leapt (``flight_leaps``).

The state is (p, v, g, tau, d), with the model of ``flight_model`` for position, velocity and gust. A reading of the
numbers h is

    y = h(p - tau v + tau^2 (u + g) / 2 + d) + noise,   tau' = w_tau,   d' = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.flight_model import AxisModel
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.tolerances import TIME_TOLERANCE

_I3 = np.eye(3)
_LATEST, _WANDERS = 1.0, 0.01  # [s] deviation of tau at a leap; [s/sqrt(s)] of its random walk
_MOVED = 300.0  # [m] deviation of d at a leap
IN_A_ROW = 4
"""readings in a row that cannot be, by which a model is wrong"""
_CHANCE, _FAR = 1e-4, 1e-9  # of all readings since a leap; of one
_SURE = 3.0  # deviations of tau that make it one
_INTERVALS = 64  # that are kept
_TAU, _D, _SIZE = 9, slice(10, 13), 13  # in the state
_EYE = np.eye(_SIZE)
_HERE = np.eye(_SIZE)  # (p, v, g, tau, d) of readings at p + d
_HERE[:3, _D], _HERE[_D, _D] = _I3, 0.0


class Rows(Protocol):
    """Readings of a flight: ``BeaconRows``, or ``FixRows``."""

    def linear(self, p: Array, rows: Iterable[int]) -> tuple[Array, Array]:
        """Numbers of some rows from p (3,), and their derivatives."""

    def innovations(self, y: Array, h: Array, rows: Integers) -> Array:
        """Numbers y of some rows minus expected ones."""

    def covariance(self, rows: Integers) -> Array:
        """Covariance of the noise of some rows."""


@dataclass(frozen=True)
class FixRows:
    """The three numbers of a position fix."""

    variance: float  # [m^2]

    def linear(self, p: Array, rows: Iterable[int]) -> tuple[Array, Array]:
        chosen = list(rows)
        return p[chosen], _I3[chosen]

    def innovations(self, y: Array, h: Array, rows: Integers) -> Array:
        return y - h

    def covariance(self, rows: Integers) -> Array:
        return self.variance * np.eye(len(rows))


@dataclass
class Step:
    """Time from one reading to the next, or to one at which a state is kept."""

    start: float  # [s]
    t: float  # [s]
    held: list[tuple[float, Array]]  # inputs (3,) [m/s^2], each with the time until which it was held
    y: Array | None  # (m,), NaN for numbers that did not come
    moved: Array | None = None  # (9,) what the inputs add to (p, v, g), once a filter has asked for it


@dataclass
class LeapFilter:
    """A filter of (p, v, g, tau, d), and how well its readings fit since its leap."""

    t: float
    x: Array  # (13,)
    P: Array  # (13, 13)
    fit: float = 0.0  # sum of normalised squares
    numbers: int = 0
    readings: int = 0
    far: int = 0  # readings in a row that cannot be
    louder: float = 1.0  # variance of the gusts over the declared one
    cost: float = 0.0  # sum of all normalised squares since it was begun, those that cannot be as if they just could
    counted: int = 0  # numbers of it
    wider: float = 0.0  # sum of ln det S

    def begun(self) -> LeapFilter:
        """This filter without readings yet, at the place where they are: p + d."""
        x, P = _HERE @ self.x, _HERE @ self.P @ _HERE.T
        return LeapFilter(self.t, x, P)

    def leap(self, *, moved: bool) -> LeapFilter:
        """This filter, which has begun without d, with a d or a tau that is anything."""
        P = self.P.copy()
        if moved:
            P[_D, _D] = _MOVED**2 * _I3
        else:
            P[_TAU, :] = P[:, _TAU] = 0.0
            P[_TAU, _TAU] = _LATEST**2
        return LeapFilter(self.t, self.x, P, cost=self.cost, counted=self.counted)

    @property
    def tau(self) -> float:
        """tau [s], or 0 where it is within its deviations."""
        tau, deviation = float(self.x[_TAU]), math.sqrt(max(float(self.P[_TAU, _TAU]), 0.0))
        return tau if abs(tau) > _SURE * deviation else 0.0

    @property
    def fits(self) -> bool:
        """False once its readings cannot be those of this model."""
        possible = not self.numbers or self.fit < float(chdtri(self.numbers, _CHANCE))
        return possible and self.far < IN_A_ROW and math.isfinite(self.fit)

    @staticmethod
    def at(t: float, moments: tuple[Array, Array]) -> LeapFilter:
        """A filter at t [s] without a leap, by the state (p, v, g) (9,) and its covariance (9, 9)."""
        x, P = np.zeros(_SIZE), np.zeros((_SIZE, _SIZE))
        x[:9], P[:9, :9] = moments
        return LeapFilter(t, x, P)

    @property
    def d(self) -> tuple[Array, Array]:
        """d (3,) [m] and its covariance (3, 3)."""
        return self.x[_D], self.P[_D, _D]


class LeapReading(NamedTuple):
    """A reading of m numbers as a filter has used it."""

    nu: Array  # (m,)
    S: Array  # (m, m)
    H: Array  # (m, 13)
    gain: Array  # (13, m), 0 where it was not used


class LeapSizes:
    """The leaps d that make the innovations of a filter without one the likeliest, for k moments of the leap.

    A leap d moves the innovation of every reading since then by m d, m = H_d - H r, and the state by r d: r = 0 at the
    leap, r <- r + K m at a reading, r <- F r in between. The sum of normalised squares is less by b' A^-1 b with
    d = A^-1 b, A = sum m' S^-1 m and b = sum m' S^-1 nu (the generalised likelihood ratio after Willsky and Jones).
    """

    def __init__(self) -> None:
        self._r = np.zeros((0, _SIZE, 3))  # (k, 13, 3)
        self._A, self._b = np.zeros((0, 3, 3)), np.zeros((0, 3))

    def begin(self) -> None:
        """The next reading may be the first after the leap."""
        self._r = np.concatenate([self._r, np.zeros((1, _SIZE, 3))])
        self._A, self._b = np.concatenate([self._A, _I3[None] / _MOVED**2]), np.concatenate([self._b, np.zeros((1, 3))])

    def predict(self, F: Array) -> None:
        """Follow the filter, which has predicted by F (13, 13)."""
        self._r = F @ self._r

    def read(self, read: LeapReading) -> None:
        """Follow the filter, which has read."""
        m = read.H[:, _D] - read.H @ self._r
        weighted = np.linalg.solve(read.S, m)
        self._A += np.swapaxes(m, 1, 2) @ weighted
        self._b += read.nu @ weighted
        self._r = self._r + read.gain @ m

    @property
    def likeliest(self) -> int:
        """The moment of the leap that explains the readings best."""
        d = np.linalg.solve(self._A, self._b[:, :, None])[:, :, 0]
        return int(np.argmax((self._b * d).sum(axis=1)))


class LeapModel:
    """Model of the filters: how they are predicted, and conditioned on what is read."""

    def __init__(self, model: AxisModel, rows: Rows) -> None:
        self._model, self._rows = model, rows
        self._discrete: dict[float, tuple[Array, Array, Array]] = {}

    def advance(self, state: LeapFilter, step: Step) -> None:
        """Predict until the end of a step, and condition on its numbers."""
        self.predict(state, step)
        self.condition(state, step)

    def predict(self, state: LeapFilter, step: Step) -> Array:
        """Predict until the end of a step; returns F (13, 13)."""
        h = step.t - state.t
        if h <= TIME_TOLERANCE:
            return _EYE
        F, _, Q = self._over(h)
        state.x = F @ state.x
        state.x[:9] += self._moved_by(step)  # x is new: no other filter shares it
        state.P = F @ state.P @ F.T + state.louder * Q
        state.t = step.t
        return F

    def _over(self, h: float) -> tuple[Array, Array, Array]:
        """F (13, 13), B (9, 3) and Q (13, 13) over h [s]."""
        key = round(h, 10)
        if key not in self._discrete:
            if len(self._discrete) >= _INTERVALS:  # stamps jitter
                self._discrete.clear()
            F, B, Q = self._model.discretised(h)
            over, noise = np.eye(_SIZE), np.zeros((_SIZE, _SIZE))
            over[:9, :9], noise[:9, :9], noise[_TAU, _TAU] = np.kron(F, _I3), np.kron(Q, _I3), _WANDERS**2 * h
            self._discrete[key] = over, np.asarray(np.kron(B, _I3), np.float64), noise
        return self._discrete[key]

    def _moved_by(self, step: Step) -> Array:
        """Change of (p, v, g) (9,) by the inputs of a step."""
        if step.moved is None:
            since, moved = step.start, np.zeros(9)
            for t, command in step.held:
                if t - since > TIME_TOLERANCE:
                    F, B, _ = self._over(t - since)
                    since, moved = t, F[:9, :9] @ moved + B @ command
            step.moved = moved
        return step.moved

    def condition(self, state: LeapFilter, step: Step) -> LeapReading | None:
        """Condition on the numbers of a step, if it has any."""
        if step.y is None or not len(rows := np.flatnonzero(np.isfinite(step.y))):
            return None
        x, P = state.x, state.P
        tau, a = float(x[_TAU]), step.held[-1][1] + x[6:9]
        h, D = self._rows.linear(x[:3] + x[_D] - tau * x[3:6] + 0.5 * tau * tau * a, rows.tolist())
        H = np.hstack([D, -tau * D, 0.5 * tau * tau * D, (D @ (tau * a - x[3:6]))[:, None], D])
        nu, PH = self._rows.innovations(step.y[rows], h, rows), P @ H.T
        S = H @ PH + self._rows.covariance(rows)
        gain: Array = np.asarray(np.linalg.solve(S, PH.T).T, np.float64)
        square = float(nu @ np.linalg.solve(S, nu))
        most = float(chdtri(len(rows), _FAR))
        state.wider += float(np.linalg.slogdet(S)[1])
        state.cost, state.counted = state.cost + min(square, most), state.counted + len(rows)
        if square > most:
            state.far += 1
            return LeapReading(nu, S, H, np.zeros(gain.shape))
        state.far = 0
        state.fit, state.numbers, state.readings = state.fit + square, state.numbers + len(rows), state.readings + 1
        state.x = x + gain @ nu
        state.P = P - gain @ PH.T
        state.P = 0.5 * (state.P + state.P.T)
        return LeapReading(nu, S, H, gain)
