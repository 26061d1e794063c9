"""The Kalman filter of a flight by ranges: consistent, and OK only where ranges tell the place."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.beacons.flight import Side
from mathnavi.estimators.beacons.flight_geometry import image_separation, located, mirrored, plane_of
from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.interfaces.reading_counts import Unused, unused_in
from mathnavi.interfaces.signals import Measurement, Status
from mathnavi.models.aerial.beacons import RANGES, FlightBeacons, slant_ranges
from tests.estimators.beacons.flights import FLAT, FOUR, SIX, flight, mission_of


def test_the_mean_and_the_spread_of_a_range_are_those_of_samples_near_a_beacon() -> None:
    rng, place = np.random.default_rng(0), np.array([40.0, -20.0, 10.0])
    P = np.zeros((9, 9))
    P[:3, :3] = np.diag([3.0, 2.0, 4.0]) ** 2
    side = Side(np.zeros(9), P)
    expected, u, R = side.expected(place, 0.25)
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
            found = located(array, y, 0.01)
            assert found is not None
            d = found[0] - p
            assert float(d @ np.linalg.solve(found[1], d)) < 25.0
        flat = np.array(FLAT)
        assert located(flat, slant_ranges(flat, p)[0], 0.01) is None
        plane = plane_of(flat)
        assert plane is not None
        np.testing.assert_allclose(slant_ranges(flat, mirrored(p, *plane))[0], slant_ranges(flat, p)[0])
        assert image_separation(flat, p, 0.01) < 1e-6
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
