"""A flight that finds places of beacons: consistent, never sure and wrong, and silent about what it cannot know."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from mathnavi.estimators.beacons.flight_place_fit import place_fits
from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.interfaces.errors import MissionError
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from tests.estimators.beacons.flights import FOUR, Flown, flight, mission_of

WITH_FIXES = KalmanConfig(fixes=True)
FLIGHTS = tuple((seed, (3,) if seed % 2 else (1, 2)) for seed in range(6))


@cache
def flown(seed: int, unknown: tuple[int, ...]) -> Flown:
    return flight(FOUR, seed, 30.0, config=WITH_FIXES, unknown=unknown, swing=120.0)


def errors_of_place(run: Flown, i: int, places: tuple[tuple[float, float, float], ...] = FOUR) -> tuple[np.ndarray, np.ndarray]:
    """Errors (n, 3) and covariances (n, 3, 3) of a beacon's place; NaN where it is not known."""
    return (
        np.array([each.extra["beacon_places"][i] for each in run.estimates]) - np.array(places[i]),
        np.array([each.extra["beacon_places_covariance"][i] for each in run.estimates]),
    )


@pytest.mark.parametrize(("seed", "unknown"), FLIGHTS)
def test_places_are_found_and_never_sure_and_wrong(seed: int, unknown: tuple[int, ...]) -> None:
    run = flown(seed, unknown)
    assert run.sure_and_wrong == 0.0
    for i in unknown:
        error, P = errors_of_place(run, i)
        assert error[-1] @ np.linalg.solve(P[-1], error[-1]) < 14.16, "three sigma"
        found = np.isfinite(error).all(axis=1)
        assert not sure_and_wrong(run.t, found, error, P, (slice(0, 3),)).any()
        assert np.sqrt(np.linalg.eigvalsh(P[-1])[-1]) < 30.0
