"""Readings by a point mass at p (3,) [m] of beacons b_i (3,) [m] in the map frame, with two derivatives.

With q = b_i - p, rho = |q| and r = |(q_x, q_y)|,

    range               rho_i                     [m]
    azimuth             atan2(q_y, q_x)           [rad] counter-clockwise from the map's x axis, in [-pi, pi)
    elevation           atan2(q_z, r)             [rad] above the horizontal
    range difference    rho_i - rho_0             [m] time difference of arrival times the wave's speed

A point mass has no attitude: its bearings are in the map frame, as those of a sensor are that is levelled and knows
north. The numbers of all sensors of an instant are stacked to y (m,), in the order of the rows of ``BeaconRows``. Their
noise is independent but for that of the differences: each is the difference of two arrivals, so that all of an instant
share the noise of the arrival from beacon 0, and their covariance is noise^2 (I + 1 1').
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.beacon_names import BEARINGS, DIFFERENCES, RANGES

RANGE, AZIMUTH, ELEVATION, DIFFERENCE = range(4)
"""kinds of numbers"""
LEAST_ANGLE = 1e-4  # [rad] least noise of a bearing that an estimator assumes
NEAREST = 1e-6  # [m] from a beacon, or from the vertical through it, where a direction is anything
_TURN = 2.0 * math.pi


def reading_of(kind: int, place: Array, p: Array) -> tuple[float, Array, Array]:
    """Number h of a kind but a difference that is read of a ``place`` (3,) from p (3,), its derivative (3,) and its
    second derivative (3, 3) by p.
    """
    x, y, z = (p - place).tolist()  # -q, whose second derivatives are those by p
    rr = max(x * x + y * y, NEAREST**2)
    square = max(x * x + y * y + z * z, NEAREST**2)
    if kind == RANGE:
        rho = math.sqrt(square)
        u = np.array([x, y, z]) / rho
        return rho, u, (np.eye(3) - np.outer(u, u)) / rho
    if kind == AZIMUTH:
        xy, other = 2.0 * x * y / rr**2, (y * y - x * x) / rr**2
        D = np.array([[xy, other, 0.0], [other, -xy, 0.0], [0.0, 0.0, 0.0]])
        return math.atan2(-y, -x), np.array([-y, x, 0.0]) / rr, D
    r = math.sqrt(rr)
    along, up, across = np.array([x, y, 0.0]) / r, np.array([0.0, 0.0, 1.0]), np.array([-y, x, 0.0]) / r
    g = (z * along - r * up) / square
    bent, tilted = 2.0 * r * z / square**2, (rr - z * z) / square**2
    D = bent * (np.outer(up, up) - np.outer(along, along)) + tilted * (np.outer(along, up) + np.outer(up, along))
    return math.atan2(-z, r), g, D + z / (square * r) * np.outer(across, across)


def curvature_effects(P: Array, D: Array) -> tuple[float, float]:
    """Mean and variance that the second derivative D (3, 3) adds to a reading, for a position of covariance P (3, 3).

    tr(A) / 2 and tr(A A) / 2 with A = D P.
    """
    A = D @ P
    return 0.5 * float(A.trace()), 0.5 * max(float(np.vdot(A, A.T)), 0.0)


class DeclaredBeacons(Protocol):
    """Beacons as far as the rows need them: ``FlightBeacons``."""

    @property
    def array(self) -> Array: ...
    @property
    def noise(self) -> float: ...
    @property
    def bearing_noise(self) -> float: ...
    @property
    def sensor_names(self) -> tuple[str, ...]: ...


class BeaconRows:
    """The numbers that are read of beacons at ``places`` (n, 3) in an instant, stacked to (m,).

    The ranges (n,), the azimuths (n,), the elevations (n,), and the differences (n,), of which that to beacon 0 itself
    is never read; only those that are read.
    """

    def __init__(self, beacons: DeclaredBeacons, floor: float = 0.0, least_angle: float = 0.0) -> None:
        """``floor`` [m] and ``least_angle`` [rad] are the least standard deviations that are assumed of a number."""
        n, kinds = len(beacons.array), list[int]()
        self.places = beacons.array
        self.slices: dict[str, slice] = {}
        """rows of each sensor"""
        for name in beacons.sensor_names:
            own = {RANGES: (RANGE,), BEARINGS: (AZIMUTH, ELEVATION), DIFFERENCES: (DIFFERENCE,)}[name]
            self.slices[name] = slice(n * len(kinds), n * (len(kinds) + len(own)))
            kinds += own
        self.kinds: Integers = np.repeat(kinds, n)
        """kind (m,) of each row"""
        self.beacons: Integers = np.tile(np.arange(n), len(kinds))
        """beacon (m,) of each row"""
        self.size = len(self.kinds)
        length, angle = max(beacons.noise, floor) ** 2, max(beacons.bearing_noise, least_angle) ** 2
        self.variance: Array = np.where((self.kinds == AZIMUTH) | (self.kinds == ELEVATION), angle, length)
        """variance (m,) of each number, of a difference but for the arrival from beacon 0"""
        self.common = length
        """variance [m^2] of the arrival from beacon 0"""

    def at(self, k: int, p: Array) -> tuple[float, Array, Array]:
        """Number h of row k from p (3,), its derivative (3,) and its second derivative (3, 3)."""
        kind, place = int(self.kinds[k]), self.places[self.beacons[k]]
        if kind != DIFFERENCE:
            return reading_of(kind, place, p)
        h, g, D = reading_of(RANGE, place, p)
        reference = reading_of(RANGE, self.places[0], p)
        return h - reference[0], g - reference[1], D - reference[2]

    def innovation(self, k: int, y: float, h: float) -> float:
        """A number y of row k minus an expected one, an azimuth within half a turn."""
        nu = y - h
        return (nu + math.pi) % _TURN - math.pi if self.kinds[k] == AZIMUTH else nu

    def linear(self, p: Array, rows: Iterable[int]) -> tuple[Array, Array]:
        """Numbers of some rows from p (3,), and their derivatives."""
        found = [self.at(k, p) for k in rows]
        return np.array([each[0] for each in found]), np.array([each[1] for each in found]).reshape(-1, 3)

    def innovations(self, y: Array, h: Array, rows: Integers) -> Array:
        """Numbers y of some rows minus expected ones, azimuths within half a turn."""
        numbers = zip(rows.tolist(), y.tolist(), h.tolist(), strict=True)
        return np.array([self.innovation(k, *each) for k, *each in numbers])

    def covariance(self, rows: Integers) -> Array:
        """Covariance of the noise of some rows."""
        of_arrivals = (self.kinds[rows] == DIFFERENCE).astype(np.float64)
        R: Array = np.diag(self.variance[rows]) + self.common * np.outer(of_arrivals, of_arrivals)
        return R

    def information(self, p: Array, rows: Integers) -> Array:
        """Fisher information (3, 3) [1/m^2] about the position p (3,) of some rows."""
        W = self.whitened(self.linear(p, rows.tolist())[1], rows)
        return W.T @ W

    def whitened(self, values: Array, rows: Integers) -> Array:
        """L^-1 values, for values (k, ...) of k rows and L L' the covariance of their noise."""
        white = values / np.sqrt(self.variance[rows]).reshape(-1, *[1] * (values.ndim - 1))
        shared = np.flatnonzero(self.kinds[rows] == DIFFERENCE)
        if len(shared) > 1 or (len(shared) and self.common > 0.0):
            white[shared] = np.linalg.solve(np.linalg.cholesky(self.covariance(rows[shared])), values[shared])
        return white

    def possible(self, name: str, value: Array) -> NDArray[np.bool_]:
        """True for the numbers of a sensor that can be, or are NaN: no negative range, no elevation past the zenith."""
        if name == RANGES:
            return ~(value < 0.0)
        if name == BEARINGS:
            n = len(self.places)
            return ~(np.abs(value) > np.repeat([_TURN, 0.25 * _TURN + 1e-9], n))
        return np.ones(len(value), dtype=np.bool_)
