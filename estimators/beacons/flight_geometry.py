"""Places that ranges to points in space tell: the plane of the points, the mirror image in it, and trilateration.

Beacons b_i (m, 3) in one plane read the same from a place and from its mirror image in that plane, and beacons that are
nearly in one plane nearly the same. With the noise of variance R the image p' of a place p is told from it by

    D = sum (|p' - b_i| - |p - b_i|)^2 / R,

chi-squared with a large value where one reading of each beacon tells them apart.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacons import slant_ranges

_FEWEST = 4  # ranges that tell a place
EXCLUDED = 40.0  # D of a mirror image that is excluded
_FLAT = 1e-9  # of the largest singular value: points in a plane
_CHANCE = 1e-6  # that the residuals of good ranges are larger
_STEPS, _SETTLED = 20, 1e-6  # of Gauss-Newton, and the last one [m]


def plane_of(places: Array) -> tuple[Array, Array] | None:
    """Centre (3,) and unit normal (3,) of the plane that fits points (m, 3) best; None for points on a line."""
    if len(places) < 3:
        return None
    centre = places.mean(axis=0)
    _, values, axes = np.linalg.svd(places - centre)
    return None if values[1] <= _FLAT * values[0] else (centre, axes[2])


def mirrored(p: Array, centre: Array, normal: Array) -> Array:
    """Mirror image (3,) of p (3,) in a plane."""
    image: Array = p - 2.0 * float(normal @ (p - centre)) * normal
    return image


def image_separation(places: Array, p: Array, variance: float) -> float:
    """D between p (3,) and its mirror image, of one range to each of ``places`` (m, 3), of a ``variance`` [m^2]; 0 for
    places on a line.
    """
    plane = plane_of(places)
    if plane is None:
        return 0.0
    here, _ = slant_ranges(places, p)
    there, _ = slant_ranges(places, mirrored(p, *plane))
    return float(np.square(there - here).sum()) / variance


def located(places: Array, ranges: Array, variance: float) -> tuple[Array, Array] | None:
    """Place (3,) [m] and its covariance (3, 3) [m^2] from ranges (m,) to ``places`` (m, 3), of a ``variance`` [m^2].

    None for fewer than four, for a place whose mirror image is as good, and for ranges that contradict each other. Of
    five or more one may be wrong, if all others agree and no other four would.
    """
    m = len(ranges)
    if m < _FEWEST:
        return None
    found = _located(places, ranges, variance)
    if found is not None or m == _FEWEST:
        return found
    others = [_located(np.delete(places, i, axis=0), np.delete(ranges, i), variance) for i in range(m)]
    agreeing = [each for each in others if each is not None]
    return agreeing[0] if len(agreeing) == 1 else None


def _located(places: Array, ranges: Array, variance: float) -> tuple[Array, Array] | None:
    """Least squares from the linear solution: |p - b_i|^2 - |p - c|^2 is linear in p, c the mean of the places."""
    centre = places.mean(axis=0)
    B = places - centre
    squares = np.square(ranges)
    p = (
        centre
        + np.linalg.lstsq(
            2.0 * B, np.square(B).sum(axis=1) - np.square(B).sum(axis=1).mean() - squares + squares.mean(), rcond=None
        )[0]
    )
    for _ in range(_STEPS):
        h, H = slant_ranges(places, p)
        step = np.linalg.lstsq(H, ranges - h, rcond=None)[0]
        p = p + step
        if float(step @ step) < _SETTLED**2:
            break
    else:
        return None
    h, H = slant_ranges(places, p)
    if float(np.square(ranges - h).sum()) > chdtri(max(len(ranges) - 3, 1), _CHANCE) * variance:
        return None
    information = H.T @ H / variance
    if np.linalg.cond(information) > 1.0 / _FLAT or image_separation(places, p, variance) < EXCLUDED:
        return None
    covariance: Array = np.asarray(np.linalg.inv(information), np.float64)
    return p, 0.5 * (covariance + covariance.T)
