"""A flight that finds places of beacons: consistent, never sure and wrong, and silent about what it cannot know."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.special import chdtri

from mathnavi.estimators.beacons.flight_place_fit import PlaceReadings, place_fits
from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.aerial.beacon_readings import AZIMUTH, ELEVATION, RANGE
from mathnavi.models.aerial.beacons import FlightBeacons, bearings
from mathnavi.models.beacon_names import BeaconKind
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from tests.estimators.beacons.flights import THREE_SIGMA, Flown, flight, mission_of

WITH_FIXES = KalmanConfig(fixes=True)
PLACES = ((2000.0, 2000.0, 50.0), (4000.0, 2200.0, 900.0), (2100.0, 4000.0, 300.0), (3900.0, 3900.0, 10.0))
RANGES: tuple[BeaconKind, ...] = ("ranges",)
BEARINGS: tuple[BeaconKind, ...] = ("bearings",)
DIFFERENCES: tuple[BeaconKind, ...] = ("range-differences",)
Asked = tuple[int, tuple[int, ...], tuple[BeaconKind, ...], float]
FLIGHTS: tuple[Asked, ...] = (
    (0, (1, 2), RANGES, 45.0),
    (3, (3,), RANGES, 45.0),
    (1, (1, 2), BEARINGS, 20.0),
    (2, (0, 1, 2, 3), BEARINGS, 20.0),
    (1, (1, 2), DIFFERENCES, 45.0),
    (3, (1, 3), (*RANGES, *BEARINGS, *DIFFERENCES), 20.0),
)
"""seed, beacons at unknown places, what is read of all, and duration [s]"""


@cache
def flown(seed: int, unknown: tuple[int, ...], read: tuple[BeaconKind, ...], duration: float) -> Flown:
    return flight(PLACES, seed, duration, config=WITH_FIXES, unknown=unknown, read=read, swing=300.0)


def errors_of_place(run: Flown, i: int) -> tuple[Array, Array]:
    """Errors (n, 3) and covariances (n, 3, 3) of a beacon's place; NaN where it is not known."""
    return (
        np.array([each.extra["beacon_places"][i] for each in run.estimates]) - np.array(PLACES[i]),
        np.array([each.extra["beacon_places_covariance"][i] for each in run.estimates]),
    )


@pytest.mark.parametrize("asked", FLIGHTS)
def test_places_are_found_and_never_sure_and_wrong(asked: Asked) -> None:
    run, unknown = flown(*asked), asked[1]
    assert run.sure_and_wrong == 0.0
    assert run.ok.all()
    for i in unknown:
        error, P = errors_of_place(run, i)
        found = np.isfinite(error).all(axis=1)
        assert not sure_and_wrong(run.t, found, error, P, (slice(0, 3),)).any()
        if found[-1]:
            assert error[-1] @ np.linalg.solve(P[-1], error[-1]) < THREE_SIGMA
        else:
            assert f"beacon {i}: " in run.messages[-1]


def test_most_places_are_found_and_their_covariances_are_consistent() -> None:
    squares, asked = [], 0
    for each in FLIGHTS:
        for i in each[1]:
            error, P = errors_of_place(flown(*each), i)
            asked += 1
            if np.isfinite(error[-1]).all():
                squares.append(float(error[-1] @ np.linalg.solve(P[-1], error[-1])))
    assert len(squares) >= asked - 1
    assert chdtri(3 * len(squares), 0.999) < sum(squares) < chdtri(3 * len(squares), 0.001)


def test_a_mirror_image_that_the_errors_of_the_way_suit_better_is_not_taken_for_the_place() -> None:
    run = flight(PLACES, 6, 30.0, config=WITH_FIXES, unknown=(1, 2, 3), read=DIFFERENCES, swing=300.0)
    for i in (1, 2, 3):
        error, P = errors_of_place(run, i)
        found = np.isfinite(error).all(axis=1)
        squares = [e @ np.linalg.solve(each, e) for e, each in zip(error[found], P[found], strict=True)]
        assert max(squares, default=0.0) < 25.0


def test_a_straight_flight_does_not_tell_a_place_from_those_around_its_line_and_says_so() -> None:
    for read in (RANGES, DIFFERENCES):
        run = flight(PLACES, 1, 15.0, config=WITH_FIXES, unknown=(3,), read=read, straight=True)
        assert all(np.isnan(each.extra["beacon_places"][3]).all() for each in run.estimates)
        assert run.messages[-1].startswith("beacon 3: ")
        assert run.ok.all(), "it is carried by its fixes"
        assert run.sure_and_wrong == 0.0


def test_bearings_from_a_straight_flight_tell_a_place_once_it_is_known_to_a_sixth_of_its_distance() -> None:
    run = flight(
        PLACES, 2, 20.0, config=WITH_FIXES, unknown=(3,), read=BEARINGS, bearing_noise=0.05, straight=True
    )  # fmt: skip
    error, P = errors_of_place(run, 3)
    found = np.isfinite(error).all(axis=1)
    first = int(np.argmax(found))
    assert run.t[first] > 6.0, "later than it is searched first"
    assert found[first:].all()
    way = np.array([each.x[:3] for each in run.estimates[: first + 1]])
    rho = np.linalg.norm(way - (error[first] + PLACES[3]), axis=1).min()
    assert 0.03 * rho < np.sqrt(np.linalg.eigvalsh(P[first])[-1]) < rho / 6.0
    squares = [e @ np.linalg.solve(each, e) for e, each in zip(error[first:], P[first:], strict=True)]
    assert max(squares) < THREE_SIGMA
    assert run.sure_and_wrong == 0.0


@pytest.mark.parametrize(("read", "fails_at"), [(RANGES, 24.0), (BEARINGS, 12.0)])
def test_a_place_that_its_readings_contradict_is_dropped(read: tuple[BeaconKind, ...], fails_at: float) -> None:
    run = flight(
        PLACES, 5, fails_at + 4.0, config=WITH_FIXES, unknown=(3,), read=read, swing=300.0, failing=(3, 30.0),
        fails_at=fails_at,
    )  # fmt: skip
    error, _ = errors_of_place(run, 3)
    found = np.isfinite(error).all(axis=1)
    assert found[(run.t > fails_at - 4.0) & (run.t < fails_at)].all()
    assert not found[run.t > fails_at + 1.0].any()
    assert run.left_out[run.t > fails_at + 1.0, 3].all()
    assert run.sure_and_wrong == 0.0


@pytest.mark.parametrize(
    ("unknown", "heard", "read"),
    [
        ((1, 2), True, RANGES),
        ((0, 1, 2, 3), True, RANGES),
        ((2, 3), False, RANGES),
        ((0, 1, 2, 3), True, BEARINGS),
    ],
)
def test_without_fixes_it_flies_by_the_places_that_it_found_and_is_not_ok(
    unknown: tuple[int, ...], heard: bool, read: tuple[BeaconKind, ...]
) -> None:
    gap = (0.0, 0.0) if heard else (44.0, 50.0)
    run = flight(PLACES, 2, 50.0, config=WITH_FIXES, unknown=unknown, read=read, swing=300.0, fixes_end=40.0, gap=gap)
    after = run.t > 46.0
    said = {each.status for each in run.estimates if each.t > 46.0}
    if not heard:
        assert said == {Status.LOST}
    else:
        assert said == ({Status.DEGRADED} if len(unknown) == 4 else {Status.OK, Status.DEGRADED})
        assert run.nees[after].max() < THREE_SIGMA
        assert np.linalg.norm(run.error[after], axis=1).max() < 10.0
        assert "at places that it has found" in run.messages[-1]


def test_a_known_beacon_that_is_stuck_is_not_used_for_places() -> None:
    run = flight(PLACES, 5, 55.0, config=WITH_FIXES, unknown=(3,), swing=300.0, failing=(0, None), fails_at=24.0)
    error, P = errors_of_place(run, 3)
    found = np.isfinite(error).all(axis=1)
    out = run.left_out[:, 0] > 0.0
    assert found[(run.t > 20.0) & (run.t < 24.0)].all()
    assert out.any()
    assert not found[np.flatnonzero(out)[0] :][:150].any()
    assert found[-1]
    assert run.left_out[-1, 0] == 1.0
    assert error[-1] @ np.linalg.solve(P[-1], error[-1]) < THREE_SIGMA
    assert run.sure_and_wrong == 0.0


def test_differences_to_a_beacon_at_fault_are_not_used_for_places() -> None:
    run = flight(
        PLACES, 1, 26.0, config=WITH_FIXES, unknown=(2, 3), read=(*RANGES, *BEARINGS, *DIFFERENCES), swing=300.0,
        failing=(0, 10.0), fails_at=15.0,
    )  # fmt: skip
    out = run.left_out[:, 0] > 0.0
    assert run.sure_and_wrong == 0.0
    for i in (2, 3):
        error, P = errors_of_place(run, i)
        found = np.isfinite(error).all(axis=1)
        assert found[(run.t > 10.0) & (run.t < 15.0)].all()
        assert not found[np.flatnonzero(out)[0] :][:150].any()
        assert found[-1]
        assert out[-1]
        assert error[-1] @ np.linalg.solve(P[-1], error[-1]) < THREE_SIGMA


def test_ranges_from_a_way_in_a_plane_fit_two_places_and_bearings_one() -> None:
    angle = np.linspace(0.0, 5.0, 200)
    p = np.column_stack([300.0 * np.cos(angle), 200.0 * np.sin(angle), np.zeros(200)])
    place = np.array([800.0, -300.0, 400.0])
    y = np.linalg.norm(p - place, axis=1) + np.random.default_rng(0).standard_normal(200)
    nothing = np.zeros((200, 3, 3))
    ranged = PlaceReadings(np.full(200, RANGE), y, np.ones(200), p, nothing, np.zeros((200, 3)))
    fits = place_fits(ranged, outliers=False)
    assert len(fits) == 2
    assert fits[0].cost == pytest.approx(fits[1].cost, abs=1e-3)
    np.testing.assert_allclose(fits[0].place * [1.0, 1.0, -1.0], fits[1].place, atol=0.1)
    assert min(float((e := fit.place - place) @ fit.information @ e) for fit in fits) < THREE_SIGMA
    seen = np.array([bearings(place[None], each) for each in p])[:, :, 0].T.ravel()
    seen += 0.002 * np.random.default_rng(1).standard_normal(400)
    kinds, twice = np.repeat([AZIMUTH, ELEVATION], 200), np.tile(p, (2, 1))
    rays = PlaceReadings(kinds, seen, np.full(400, 4e-6), twice, np.tile(nothing, (2, 1, 1)), np.zeros((400, 3)))
    (fit,) = place_fits(rays, outliers=False)
    assert float((e := fit.place - place) @ fit.information @ e) < THREE_SIGMA


@pytest.mark.parametrize(
    ("unknown", "read", "fewest"),
    [
        ((2, 3), RANGES, 3),
        ((0, 1, 2, 3), RANGES, 3),
        ((0, 2, 3), BEARINGS, 2),
        ((3,), DIFFERENCES, 4),
        ((1, 2, 3), DIFFERENCES, 4),
    ],
)
def test_a_flight_that_nothing_carries_is_refused(
    unknown: tuple[int, ...], read: tuple[BeaconKind, ...], fewest: int
) -> None:
    places = tuple(None if i in unknown else place for i, place in enumerate(PLACES))
    mission = mission_of(FlightBeacons(places, read=read), (3000.0, 3000.0, 400.0))
    for refused in (Kalman.build, Kalman.quality):
        with pytest.raises(MissionError, match=rf"without fixes.*allowed: estimator.fixes, or {fewest} beacons"):
            refused(KalmanConfig(), mission)
    assert Kalman.build(WITH_FIXES, mission).update(0.0, (), np.zeros(3)).extra["beacon_places"].shape == (4, 3)
