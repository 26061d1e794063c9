"""Places of a beacon that its first reading leaves possible: Gaussians side by side that overlap.

From a state with the pose p = (x_1, x_2), phi the place is b = p + rho e, at K directions e or at K distances rho.

    a range y              rho = y / (1 + c)                  a circle about the robot
    a range difference y   rho = rho_0 + y / (1 + c)          likewise, rho_0 the distance of beacon 0, which is placed
    likewise, of beacon 0  rho = rho_i - y / (1 + c)          rho_i the distance of beacon i, which is placed
    a bearing y            e = (cos, sin)(phi + y)            a ray; rho from a least one to the diagonal of the box

Directions are equally spaced, distances on a ray geometrically, so that all are equally likely by the logarithm of the
distance. With G the derivative of b by the state, the covariance of b is G P G' and that of y's noise, which is across
the circle or the ray; and along it that of a Gaussian that overlaps with its neighbours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.beacons.kernels import BEARING, DIFFERENCE
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.interfaces.signals import Array

AROUND = 48
"""directions about the robot"""
SPREAD = 0.6
"""standard deviation of a place, in distances between neighbouring places"""
LEAST = 1.0 / 256.0
"""least distance on a ray, in diagonals of the box"""
_ALONG = 16  # distances on a ray
_GAP = -math.log(LEAST) / (_ALONG - 1)  # between logarithms of two distances


@dataclass(frozen=True, eq=False)
class FirstPlaces:
    """Gaussians of the place of a beacon, K for each of N states, those of one state one after the other."""

    count: int
    """K"""
    places: Array  # (N K, 2) [m]
    G: Array  # (N K, 2, d) derivative of each by the state
    noise: Array  # (N K, 2, 2) [m^2] covariance of the reading's noise
    spread: Array  # (N K, 2, 2) [m^2] that along the circle or the ray


def first_places(x: Array, kind: int, i: int, y: float, model: BeaconModel) -> FirstPlaces:
    """Places by a reading y of beacon i from states x (N, d), of the beacon that it finds (``BeaconModel.finds``)."""
    return _on_ray(x, y, model) if kind == BEARING else _on_circle(x, kind, i, y, model)


def _on_circle(x: Array, kind: int, i: int, y: float, model: BeaconModel) -> FirstPlaces:
    """Places about the robot by a range or a range difference y."""
    angles = np.tile(2.0 * np.pi * np.arange(AROUND) / AROUND, len(x))
    x = np.repeat(x, AROUND, axis=0)
    e = np.column_stack([np.cos(angles), np.sin(angles)])
    scale = 1.0 + x[:, 5]
    length = np.abs(y) / scale
    absolute, relative, *_ = model.errors[kind]
    across = np.hypot(absolute, relative * length) / scale
    rho, slope = y / scale, np.zeros_like(x)  # of rho by the state
    if kind == DIFFERENCE:
        other, sign = (0, 1.0) if model.finds(kind, i) == i else (i, -1.0)
        k = int(model.columns[other])
        offset = (model.places[other] if k < 0 else x[:, k : k + 2]) - x[:, :2]
        distance = np.hypot(offset[:, 0], offset[:, 1])
        f = offset / np.maximum(distance, across)[:, None]
        slope[:, :2] = -f
        if k >= 0:
            slope[:, k : k + 2] = f
        slope[:, 5] = -sign * rho / scale
        rho = np.maximum(distance + sign * rho, across)
    else:
        slope[:, 5] = -(rho / scale)
    along = np.column_stack([-e[:, 1], e[:, 0]])
    spread = SPREAD * np.maximum(2.0 * math.pi * rho / AROUND, 1e-2)
    return _placed(AROUND, x, rho, e, e[:, :, None] * slope[:, None, :], _line(e, across), _line(along, spread))


def _on_ray(x: Array, y: float, model: BeaconModel) -> FirstPlaces:
    """Places in the direction of a bearing y."""
    distances = model.mission.longest * np.exp(_GAP * (np.arange(_ALONG) - (_ALONG - 1)))
    rho = np.tile(distances, len(x))
    x = np.repeat(x, _ALONG, axis=0)
    e = np.column_stack([np.cos(x[:, 2] + y), np.sin(x[:, 2] + y)])
    sideways = np.column_stack([-e[:, 1], e[:, 0]])
    absolute, relative, *_ = model.errors[BEARING]
    slope = np.zeros((len(x), 2, model.size))
    slope[:, :, 2] = rho[:, None] * sideways
    noise = _line(sideways, np.hypot(absolute, relative * rho) * rho)
    return _placed(_ALONG, x, rho, e, slope, noise, _line(e, SPREAD * _GAP * rho))


def _placed(count: int, x: Array, rho: Array, e: Array, slope: Array, noise: Array, spread: Array) -> FirstPlaces:
    """Places p + rho e, ``count`` for each state, of which rho e has the derivative ``slope`` (N K, 2, d)."""
    slope[:, :, :2] += np.eye(2)
    return FirstPlaces(count, x[:, :2] + rho[:, None] * e, slope, noise, spread)


def _line(e: Array, sigma: Array) -> Array:
    """Covariances (M, 2, 2) of deviations sigma (M,) [m] along unit vectors e (M, 2)."""
    return sigma[:, None, None] ** 2 * e[:, :, None] * e[:, None, :]
