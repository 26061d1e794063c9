"""A beacon at an unknown place is taken in wherever its first reading can be of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.beacons.kernels import BEARING, DIFFERENCE, RANGE, expected
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.estimators.beacons.taking_in import LEAST, first_places

QUALITY = mn.BeaconQuality(0.05)
STATE = np.array([1.0, -2.0, 0.7, 0.01, -0.02, 0.03, 4.0, 5.0, 0.0, 0.0])
READINGS = [(RANGE, 2, 6.0), (BEARING, 2, -1.2), (DIFFERENCE, 2, -3.0), (DIFFERENCE, 1, 2.5)]


def model(kind: int, i: int) -> tuple[BeaconModel, int]:
    """A model of four beacons of which two are unknown, one of them placed, and the one that is to be found."""
    found = 0 if kind == DIFFERENCE and i == 1 else 2
    places = [(9.0, 1.0), (7.0, 7.0), (-5.0, 2.0), (-3.0, -8.0)]
    given = tuple(place if k not in ({0, 1} if found == 0 else {0, 2}) else None for k, place in enumerate(places))
    mission = mn.BeaconMission(
        given, ranges=QUALITY, bearings=QUALITY, range_differences=QUALITY, start=mn.KnownStart((0.0, 0.0, 0.0))
    )
    made = BeaconModel(mission)
    made.placed[:] = True
    made.placed[found] = False
    return made, found


@pytest.mark.parametrize(("kind", "i", "y"), READINGS)
def test_each_place_explains_the_reading_and_its_derivative_is_that_of_differences(kind: int, i: int, y: float) -> None:
    made, found = model(kind, i)
    assert made.finds(kind, i) == found
    k, other = int(made.columns[found]), STATE.copy()
    other[6:8], other[8:] = (STATE[6:8], STATE[8:]) if k == 8 else (STATE[8:], STATE[6:8])
    first = first_places(other[None], kind, i, y, made)
    assert first.places.shape == (first.count, 2)
    for place in first.places:
        at = other.copy()
        at[k : k + 2] = place
        assert expected(at, kind, i, made.places, made.columns)[0] == pytest.approx(y)
    for j, e in enumerate(1e-6 * np.eye(len(other))):
        ahead, behind = (first_places((other + sign * e)[None], kind, i, y, made).places for sign in (1.0, -1.0))
        assert first.G[:, :, j] == pytest.approx((ahead - behind) / 2e-6, abs=1e-5)


@pytest.mark.parametrize(("kind", "i", "y"), READINGS)
def test_wherever_a_beacon_is_on_the_circle_or_the_ray_a_gaussian_is_about_it(kind: int, i: int, y: float) -> None:
    made, _ = model(kind, i)
    first = first_places(STATE[None], kind, i, y, made)
    spread = first.noise + first.spread
    offsets = first.places - STATE[:2]
    if kind == BEARING:
        direction = STATE[2] + y
        lengths = np.geomspace(LEAST, 1.0, 200) * made.mission.longest
        points = STATE[:2] + lengths[:, None] * (math.cos(direction), math.sin(direction))
    else:
        angles = np.linspace(0.0, 2.0 * np.pi, 200)
        points = STATE[:2] + np.hypot(*offsets[0]) * np.column_stack([np.cos(angles), np.sin(angles)])
    off = points[:, None] - first.places
    squares = np.einsum("pki,pki->pk", off, np.linalg.solve(spread, off[..., None])[..., 0])
    assert squares.min(axis=1).max() < 4.0
    density = (np.exp(-0.5 * squares) / np.sqrt(np.linalg.det(spread))).sum(axis=1)
    if kind == BEARING:
        density *= lengths**2  # across a ray and along it: even by the logarithm of the distance
    inner = density[20:-20]
    assert inner.max() < 1.5 * inner.min()
