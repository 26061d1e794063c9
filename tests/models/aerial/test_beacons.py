"""Slant ranges of a flight: their derivative, what returns, and what a bad declaration is told."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacons import FailingBeacons, FlightBeacons, least_information, slant_ranges
from mathnavi.models.terrain.height_field import HeightField

PLACES = ((0.0, 0.0, 50.0), (2000.0, 100.0, 400.0), (300.0, 2000.0, 150.0), (1800.0, 1900.0, 0.0))
PLAIN = HeightField(np.zeros((3, 3)), 1000.0)
RIDGE = HeightField(np.array([[0.0, 500.0, 0.0]] * 3), 1000.0)  # along the middle, from south to north


class At:
    """A motion at a place."""

    def __init__(self, *place: float) -> None:
        self.x, self.acceleration = np.array([*place, 0.0, 0.0, 0.0]), np.zeros(3)

    def sensed(self, name: str) -> Array:
        raise AssertionError(name)


def test_the_derivative_of_a_range_is_that_of_finite_differences() -> None:
    rng, places, d = np.random.default_rng(0), np.array(PLACES), 1e-3
    for p in rng.uniform(0.0, 2000.0, (20, 3)):
        _, H = slant_ranges(places, p)
        each = [(slant_ranges(places, p + d * e)[0] - slant_ranges(places, p - d * e)[0]) / (2 * d) for e in np.eye(3)]
        np.testing.assert_allclose(H, np.transpose(each), atol=1e-7)


def test_readings_are_off_by_the_declared_noise_and_lost_as_declared() -> None:
    rng, place = np.random.default_rng(1), (700.0, 800.0, 300.0)
    sensor = FlightBeacons(PLACES, noise=2.0, dropout=0.2).sensor(PLAIN)
    readings = np.array([sensor.read(At(*place), rng) for _ in range(4000)])
    errors = readings - slant_ranges(np.array(PLACES), np.array(place))[0]
    assert np.nanstd(errors) == pytest.approx(2.0, rel=0.05)
    assert abs(np.nanmean(errors)) < 0.1
    assert np.isnan(readings).mean() == pytest.approx(0.2, abs=0.02)


def test_there_is_no_return_beyond_the_greatest_range_nor_through_a_ridge_where_sight_is_needed() -> None:
    rng, west = np.random.default_rng(2), At(100.0, 1000.0, 100.0)
    far = FlightBeacons(PLACES, maximum=1500.0).sensor(RIDGE).read(west, rng)
    assert np.isfinite(far).tolist() == [True, False, True, False]
    hidden = FlightBeacons(PLACES, line_of_sight=True).sensor(RIDGE).read(west, rng)
    assert np.isfinite(hidden).tolist() == [True, False, True, False]
    assert np.isfinite(FlightBeacons(PLACES).sensor(RIDGE).read(west, rng)).all()


def test_beacons_in_a_plane_say_nothing_across_it_and_those_out_of_reach_nothing_at_all() -> None:
    flat = FlightBeacons(tuple((x, y, 100.0) for x, y, _ in PLACES))
    points = np.array([[700.0, 700.0, 100.0], [700.0, 700.0, 900.0]])
    within, above = least_information(flat, PLAIN, points)
    assert within == pytest.approx(0.0, abs=1e-9)
    assert above > 0.1
    assert least_information(FlightBeacons(PLACES, maximum=10.0), PLAIN, points).tolist() == [0.0, 0.0]


def test_a_failing_beacon_is_stuck_or_off_from_its_time_on_and_the_others_are_as_they_are() -> None:
    beacons = FlightBeacons(PLACES, noise=1.0)
    plain, stuck, off = (beacons.sensor(PLAIN) for _ in range(3))
    sensors = plain, FailingBeacons(stuck, (1,), 0.5, None), FailingBeacons(off, (1,), 0.5, 5.0)
    rngs = [np.random.default_rng(3) for _ in sensors]
    rows = np.array(
        [[s.read(At(10.0 * k, 0.0, 200.0), r) for s, r in zip(sensors, rngs, strict=True)] for k in range(10)]
    )
    np.testing.assert_array_equal(rows[:5, 0], rows[:5, 1])
    assert (rows[5:, 1, 1] == rows[4, 0, 1]).all()
    np.testing.assert_allclose(rows[5:, 2, 1] - rows[5:, 0, 1], 5.0)
    others = [0, 2, 3]
    np.testing.assert_array_equal(rows[:, 0][:, others], rows[:, 1][:, others])


@pytest.mark.parametrize(
    ("fields", "error", "words"),
    [
        ({"places": ()}, FieldError, "one beacon or more"),
        ({"places": ((0.0, 0.0, 1.0),) * 2}, MissionError, "one place twice"),
        ({"places": ((0.0, 0.0, math.nan),)}, FieldError, "finite"),
        ({"noise": -1.0}, FieldError, "noise = -1.0"),
        ({"maximum": 0.0}, FieldError, "maximum = 0.0"),
        ({"rate": 0.0}, FieldError, "rate = 0.0"),
    ],
)
def test_beacons_that_cannot_be_are_refused(fields: dict[str, object], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        FlightBeacons(**{"places": PLACES, **fields})  # type: ignore[arg-type]
