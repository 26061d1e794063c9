"""The Kalman filter of a flight by ranges: consistent, and OK only where ranges tell the place."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.beacons.flight_geometry import image_separation, located, mirrored, plane_of
from mathnavi.estimators.beacons.flight_side import Side
from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.interfaces.reading_counts import Unused, unused_in
from mathnavi.interfaces.signals import Measurement, Status
from mathnavi.models.aerial.beacon_readings import BeaconRows
from mathnavi.models.aerial.beacons import FlightBeacons, slant_ranges
from mathnavi.models.beacon_names import RANGES, BeaconKind
from tests.estimators.beacons.flights import FLAT, FOUR, SIX, View, flight, mission_of


def test_the_mean_and_the_spread_of_a_range_are_those_of_samples_near_a_beacon() -> None:
    rng, place = np.random.default_rng(0), np.array([40.0, -20.0, 10.0])
    P = np.zeros((9, 9))
    P[:3, :3] = np.diag([3.0, 2.0, 4.0]) ** 2
    side, rows = Side(np.zeros(9), P), BeaconRows(FlightBeacons((tuple(place.tolist()),), noise=0.5))
    expected, u, R = side.expected(rows, 0)
    samples = rng.multivariate_normal(np.zeros(3), P[:3, :3], 200_000)
    ranges = np.linalg.norm(samples - place, axis=1) + 0.5 * rng.standard_normal(len(samples))
    assert expected == pytest.approx(ranges.mean(), abs=0.02)
    assert expected - float(np.linalg.norm(place)) > 0.1, "a straight line would have it shorter"
    assert float(u @ P[:3, :3] @ u) + R == pytest.approx(ranges.var(), rel=0.02)


@pytest.mark.parametrize("places", [FOUR, SIX, FLAT])
def test_it_is_consistent_and_never_sure_and_wrong(places: tuple[tuple[float, float, float], ...]) -> None:
    runs = [flight(places, seed, 30.0) for seed in range(3)]
    nees, ratio = (np.concatenate([getattr(run, name) for run in runs]) for name in ("nees", "ratio"))
    assert 1.8 < nees.mean() < 4.2, "three degrees of freedom; errors last, so that few of them are independent"
    assert np.nanvar(ratio) == pytest.approx(1.0, abs=0.08)
    assert np.mean([run.sure_and_wrong for run in runs]) <= 0.005
    assert np.mean([run.ok.mean() for run in runs]) > 0.98


BEARINGS: tuple[BeaconKind, ...] = ("bearings",)
DIFFERENCES: tuple[BeaconKind, ...] = ("range-differences",)
EVERYTHING: tuple[BeaconKind, ...] = ("ranges", "bearings", "range-differences")


@pytest.mark.parametrize(
    ("places", "read"),
    [
        (FOUR[:2], BEARINGS),
        (FLAT, BEARINGS),
        (SIX, DIFFERENCES),
        (FOUR, EVERYTHING),
        (FOUR[:1], ("ranges", "bearings")),
    ],
)
def test_it_is_consistent_by_bearings_and_differences(
    places: tuple[tuple[float, float, float], ...], read: tuple[BeaconKind, ...]
) -> None:
    runs = [flight(places, seed, 20.0, read=read, swing=0.0, sinks=10.0) for seed in range(2)]
    assert 1.0 < np.concatenate([run.nees for run in runs]).mean() < 5.0
    assert np.nanvar(np.concatenate([run.ratio for run in runs])) == pytest.approx(1.0, abs=0.1)
    assert np.mean([run.ok.mean() for run in runs]) > 0.98
    assert np.mean([run.sure_and_wrong for run in runs]) <= 0.02


def test_the_differences_of_an_instant_say_what_ranges_do_whose_error_is_one_unknown() -> None:
    rng, rows = np.random.default_rng(3), BeaconRows(FlightBeacons(SIX, read=DIFFERENCES))
    ranging, p = BeaconRows(FlightBeacons(SIX)), np.array([2000.0, 3500.0, 400.0])
    ranges = slant_ranges(np.array(SIX), p)[0] + rng.standard_normal(6)
    one, all_of_them = Side(np.array([*p, *np.zeros(6)]), 25.0 * np.eye(9)), np.arange(6)
    W = ranging.whitened(ranging.linear(p, all_of_them.tolist())[1], all_of_them)
    augmented = np.zeros((4, 4))
    augmented[:3, :3], augmented[:3, 3], augmented[3, :3], augmented[3, 3] = W.T @ W, W.sum(axis=0), W.sum(axis=0), 6.0
    information = augmented[:3, :3] - np.outer(augmented[:3, 3], augmented[3, :3]) / 6.0
    one.share(rows.common)
    for k in range(1, 6):
        expected, H, R = one.expected(rows, k)
        PH, S = one.spread(H, R, shared=True)
        one.condition(PH, ranges[k] - ranges[0] - expected, S)
    one.share(None)
    np.testing.assert_allclose(one.P[:3, :3], np.linalg.inv(information + np.eye(3) / 25.0), atol=0.01)
    np.testing.assert_allclose(rows.information(p, all_of_them[1:]), information, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("places", "read", "failing"),
    [
        (FOUR, BEARINGS, (2, 5.0)),
        (SIX, DIFFERENCES, (2, None)),
        (SIX, DIFFERENCES, (0, 8.0)),
        (SIX, DIFFERENCES, (0, None)),
    ],
)
def test_a_beacon_at_fault_is_named_by_bearings_and_by_differences_their_reference_too(
    places: tuple[tuple[float, float, float], ...], read: tuple[BeaconKind, ...], failing: tuple[int, float | None]
) -> None:
    run = flight(places, 1, 25.0, read=read, failing=failing)
    assert (run.left_out[-60:, failing[0]] == 1.0).all()
    assert f"beacon {failing[0]}" in run.messages[-1]
    assert run.sure_and_wrong == 0.0
    assert np.linalg.norm(run.error[-60:], axis=1).max() < 15.0


@pytest.mark.parametrize("read", [BEARINGS, DIFFERENCES])
def test_a_place_is_told_by_the_bearings_or_the_differences_of_an_instant(read: tuple[BeaconKind, ...]) -> None:
    rng, beacons = np.random.default_rng(6), FlightBeacons(SIX, noise=0.1, read=read, bearing_noise=1e-3)
    rows, (sensor,) = BeaconRows(beacons), beacons.sensors(mission_of(beacons, (0.0, 0.0, 0.0)).terrain)
    for p in rng.uniform(500.0, 5500.0, (10, 3)) * [1.0, 1.0, 0.3]:
        y = sensor.read(View(p), rng)
        y[1] += 0.5 if read == BEARINGS else 300.0
        found = located(rows, y, np.flatnonzero(np.isfinite(y)))
        assert found is not None
        d = found[0] - p
        assert float(d @ np.linalg.solve(found[1], d)) < 25.0


@pytest.mark.parametrize("count", [1, 2])
def test_with_too_few_beacons_it_is_ok_from_a_known_start_and_no_longer_than_its_covariance_allows(count: int) -> None:
    run = flight(FOUR[:count], 1)
    assert run.ok[:60].all()
    assert not run.ok[-300:].any()
    assert run.sure_and_wrong == 0.0
    assert any("one sigma" in message for message in run.messages)
    assert "a line of beacons, or a single one" in run.messages[-1]


@pytest.mark.parametrize("seed", range(2))
def test_past_the_plane_of_its_beacons_it_is_ok_only_on_the_right_side(seed: int) -> None:
    run = flight(FLAT, seed, swing=0.0, sinks=15.0)
    assert run.sure_and_wrong == 0.0
    assert not run.ok.all()
    assert any("side of the plane" in message for message in run.messages)


@pytest.mark.parametrize("offset", [None, 5.0])
def test_a_beacon_at_fault_is_named_and_left_out(offset: float | None) -> None:
    run = flight(SIX, 2, failing=(2, offset))
    late = run.t > 25.0
    assert (run.left_out[late, 2] == 1.0).all()
    assert run.left_out[:, [0, 1, 3, 4, 5]].sum() == 0.0
    assert "beacon 2" in run.messages[-1]
    assert run.sure_and_wrong == 0.0
    assert np.linalg.norm(run.error[late], axis=1).max() < 6.0


def test_three_ranges_tell_by_their_leap_that_a_beacon_is_off() -> None:
    run = flight(FOUR[:3], 103, 25.0, failing=(1, 5.0))
    assert run.ok[run.t < 14.9].all()
    assert run.sure_and_wrong == 0.0
    assert not run.ok[-200:].any()


def test_fixes_beside_ranges_are_used() -> None:
    both, alone = flight(FOUR[:1], 1, config=KalmanConfig(fixes=True)), flight(FOUR[:1], 1)
    assert both.ok.all()
    assert np.linalg.norm(both.error[-300:], axis=1).max() < 8.0 < np.linalg.norm(alone.error[-1])


def test_after_a_long_gap_it_finds_its_place_by_the_ranges_alone() -> None:
    run = flight(FOUR, 0, 90.0, gap=(5.0, 75.0))
    assert not run.ok[(run.t > 10.0) & (run.t < 75.0)].any()
    assert run.ok[-30:].all()
    assert run.sure_and_wrong == 0.0


def test_a_place_is_told_by_four_ranges_unless_a_mirror_image_fits_as_well() -> None:
    rng = np.random.default_rng(5)
    for p in rng.uniform(500.0, 5500.0, (20, 3)) * [1.0, 1.0, 0.3]:
        for places, one_wrong in ((FOUR, False), (SIX, False), (SIX, True)):
            array = np.array(places)
            y = slant_ranges(array, p)[0] + 0.1 * rng.standard_normal(len(array))
            y[1] += 300.0 * one_wrong
            rows = BeaconRows(FlightBeacons(places, noise=0.1))
            found = located(rows, y, np.arange(len(y)))
            assert found is not None
            d = found[0] - p
            assert float(d @ np.linalg.solve(found[1], d)) < 25.0
        flat = np.array(FLAT)
        rows, four = BeaconRows(FlightBeacons(FLAT, noise=0.1)), np.arange(4)
        assert located(rows, slant_ranges(flat, p)[0], four) is None
        plane = plane_of(flat)
        assert plane is not None
        np.testing.assert_allclose(slant_ranges(flat, mirrored(p, *plane))[0], slant_ranges(flat, p)[0])
        assert image_separation(rows, four, p) < 1e-6
    assert plane_of(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [3.0, 3.0, 3.0]])) is None


def test_readings_that_cannot_be_are_counted_and_not_used() -> None:
    estimator = Kalman.build(KalmanConfig(), mission_of(FlightBeacons(FOUR), (3000.0, 3000.0, 400.0)))
    values = [np.full(3, 1.0), np.array([np.inf, 1.0, np.nan, -4.0])]
    readings = [Measurement(RANGES, 0.0, value) for value in values]
    estimate = estimator.update(0.0, [*readings, Measurement("position", 0.0, np.zeros(3))], np.zeros(3))
    counts = unused_in(estimate.extra) or {}
    assert counts[Unused.MALFORMED.value] == 1
    assert counts[Unused.NOT_FINITE.value] == 1
    assert counts[Unused.OUT_OF_RANGE.value] == 1
    assert counts[Unused.OUTLIER.value] == 1
    assert counts[Unused.UNKNOWN_SENSOR.value] == 1
    assert estimate.status is Status.INITIALISING
