"""Places that readings of points in space tell: the plane of the points, the mirror image in it, and an instant's fix.

Beacons b_i (m, 3) in one plane read the same ranges from a place and from its mirror image in that plane, and beacons
that are nearly in one plane nearly the same. With the noise of covariance R the image p' of a place p is told from it
by the readings h of an instant, with

    D = (h(p') - h(p))' R^-1 (h(p') - h(p)),

chi-squared with a large value where one reading of each beacon tells them apart, as bearings do.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.aerial.beacon_readings import AZIMUTH, DIFFERENCE, ELEVATION, RANGE, BeaconRows

_FEWEST = 4  # numbers that tell a place, one of them to spare
EXCLUDED = 40.0  # D of a mirror image that is excluded
_FLAT = 1e-9  # of the largest singular value: points in a plane
_CHANCE = 1e-6  # that the residuals of good readings are larger
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


def image_separation(rows: BeaconRows, read: Integers, p: Array) -> float:
    """D between p (3,) and its mirror image, of one reading of each of the rows ``read``; 0 for places on a line."""
    plane = plane_of(rows.places[beacons_of_rows(rows, read)])
    if plane is None:
        return 0.0
    here, there = (rows.linear(each, read.tolist())[0] for each in (p, mirrored(p, *plane)))
    white = rows.whitened(rows.innovations(there, here, read), read)
    return float(white @ white)


def beacons_of_rows(rows: BeaconRows, read: Integers) -> Integers:
    """Beacons that the rows ``read`` are of; a difference is of beacon 0 too."""
    own = rows.beacons[read]
    return np.unique(np.append(own, 0) if (rows.kinds[read] == DIFFERENCE).any() else own)


def located(rows: BeaconRows, y: Array, read: Integers) -> tuple[Array, Array] | None:
    """Place (3,) [m] and its covariance (3, 3) [m^2] from the numbers y (m,) of an instant, of the rows ``read``.

    None for fewer than four numbers, for a place whose mirror image is as good, and for readings that contradict each
    other. Those of one beacon may be wrong, if all others agree and no other choice would.
    """
    found = _located(rows, y, read)
    if found is not None or len(read) <= _FEWEST:
        return found
    each_without = (read[rows.beacons[read] != i] for i in np.unique(rows.beacons[read]))
    agreeing = [each for others in each_without if (each := _located(rows, y, others)) is not None]
    return agreeing[0] if len(agreeing) == 1 else None


def _located(rows: BeaconRows, y: Array, read: Integers) -> tuple[Array, Array] | None:
    """Least squares from a linear solution."""
    if len(read) < _FEWEST or (p := _begun(rows, y, read)) is None:
        return None
    for _ in range(_STEPS):
        h, H = rows.linear(p, read.tolist())
        nu, W = rows.whitened(rows.innovations(y[read], h, read), read), rows.whitened(H, read)
        step = np.linalg.lstsq(W, nu, rcond=None)[0]
        p = p + step
        if float(step @ step) < _SETTLED**2:
            break
    else:
        return None
    if float(nu @ nu) > chdtri(max(len(read) - 3, 1), _CHANCE):
        return None
    information = W.T @ W
    if np.linalg.cond(information) > 1.0 / _FLAT or image_separation(rows, read, p) < EXCLUDED:
        return None
    covariance: Array = np.asarray(np.linalg.inv(information), np.float64)
    return p, 0.5 * (covariance + covariance.T)


def _begun(rows: BeaconRows, y: Array, read: Integers) -> Array | None:
    """Place (3,) by the linear equations that the kinds of readings there are have; None where they have no solution.

    Of an azimuth and an elevation, with the direction e: (I - e e') (p - b_i) = 0. Of ranges, |p - b_i|^2 - |p - c|^2
    is linear in p, c the mean of the places; of differences, in p and in the range to beacon 0.
    """
    kinds, beacons = rows.kinds[read], rows.beacons[read]
    values = {
        kind: dict(zip(beacons[kinds == kind].tolist(), y[read][kinds == kind].tolist(), strict=True))
        for kind in range(4)
    }
    both = [i for i in values[AZIMUTH] if i in values[ELEVATION]]
    if len(both) > 1:
        az, el = (np.array([values[kind][i] for i in both]) for kind in (AZIMUTH, ELEVATION))
        e = np.column_stack([np.cos(az) * np.cos(el), np.sin(az) * np.cos(el), np.sin(el)])
        across = np.eye(3) - np.einsum("ij,ik->ijk", e, e)
        A, b = across.sum(axis=0), np.einsum("ijk,ik->j", across, rows.places[both])
        return None if np.linalg.cond(A) > 1.0 / _FLAT else np.linalg.solve(A, b)
    ranged = list(values[RANGE])
    if len(ranged) >= _FEWEST:
        places, squares = rows.places[ranged], np.square([values[RANGE][i] for i in ranged])
        centre = places.mean(axis=0)
        B = places - centre
        own = np.square(B).sum(axis=1)
        found: Array = np.linalg.lstsq(2.0 * B, own - own.mean() - squares + squares.mean(), rcond=None)[0]
        return np.asarray(centre + found, np.float64)
    differing = list(values[DIFFERENCE])
    if len(differing) >= _FEWEST:
        d, B = np.array([values[DIFFERENCE][i] for i in differing]), rows.places[differing] - rows.places[0]
        found = np.linalg.lstsq(
            np.column_stack([2.0 * B, 2.0 * d]), np.square(B).sum(axis=1) - np.square(d), rcond=None
        )[0]
        return np.asarray(rows.places[0] + found[:3], np.float64)
    return None
