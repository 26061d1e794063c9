"""Slant ranges of a flight: their derivative, what returns, and what a bad declaration is told."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacon_readings import BeaconRows
from mathnavi.models.aerial.beacons import FailingBeacons, FlightBeacons, folded, least_information, slant_ranges
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


ALL = FlightBeacons(PLACES, read=("ranges", "bearings", "range-differences"), bearing_noise=0.01)


def test_first_and_second_derivatives_of_all_readings_are_those_of_finite_differences() -> None:
    rng, rows, d = np.random.default_rng(0), BeaconRows(ALL), 1e-2
    for p in rng.uniform(0.0, 2000.0, (5, 3)):
        for k in range(rows.size):
            (_, g, D), scale = rows.at(k, p), float(np.abs(rows.linear(p, [k])[1]).max()) or 1.0
            ends = [[rows.at(k, p + sign * d * e) for sign in (1.0, -1.0)] for e in np.eye(3)]
            slopes = [rows.innovation(k, up[0], down[0]) / (2 * d) for up, down in ends]
            np.testing.assert_allclose(g, slopes, atol=1e-6 * scale)
            np.testing.assert_allclose(D, [(up[1] - down[1]) / (2 * d) for up, down in ends], atol=1e-6 * scale)


def test_the_noise_of_readings_is_as_declared_and_differences_share_that_of_an_arrival() -> None:
    rng, place, rows = np.random.default_rng(1), np.array([700.0, 800.0, 300.0]), BeaconRows(ALL)
    y = np.array([np.concatenate([s.read(At(*place), rng) for s in ALL.sensors(PLAIN)]) for _ in range(6000)])
    read = np.flatnonzero(np.isfinite(y).all(axis=0))
    assert len(read) == rows.size - 1, "all but the difference of beacon 0 to itself"
    exact, _ = rows.linear(place, read.tolist())
    white = rows.whitened(np.array([rows.innovations(each[read], exact, read) for each in y]).T, read)
    np.testing.assert_allclose(np.cov(white), np.eye(len(read)), atol=0.06)
    assert np.abs(white.mean(axis=1)).max() < 0.06


def test_an_azimuth_is_read_within_half_a_turn_and_an_elevation_past_the_zenith_is_one_before_it() -> None:
    west, below = FlightBeacons(((-1000.0, 0.0, 0.0),), read=("bearings",)), FlightBeacons(((0.0, 0.0, 0.0),))
    (sensor,), rng = west.sensors(PLAIN), np.random.default_rng(2)
    readings = np.array([sensor.read(At(0.0, 0.0, 0.0), rng) for _ in range(200)])
    assert (np.abs(readings[:, 0]) > 3.0).all()
    assert 0.2 < (readings[:, 0] > 0.0).mean() < 0.8
    rows = BeaconRows(west)
    assert np.abs([rows.innovation(0, each, -math.pi) for each in readings[:, 0]]).max() < 0.1
    azimuth, elevation = folded(np.array([0.5]), np.array([-0.5 * math.pi - 0.1]))
    assert (azimuth, elevation) == pytest.approx((0.5 - math.pi, 0.1 - 0.5 * math.pi))
    assert np.isfinite(BeaconRows(below).at(0, np.zeros(3))[1]).all(), "at a beacon"


def test_readings_are_off_by_the_declared_noise_and_lost_as_declared() -> None:
    rng, place = np.random.default_rng(1), (700.0, 800.0, 300.0)
    sensor = FlightBeacons(PLACES, noise=2.0, dropout=0.2).sensors(PLAIN)[0]
    readings = np.array([sensor.read(At(*place), rng) for _ in range(4000)])
    errors = readings - slant_ranges(np.array(PLACES), np.array(place))[0]
    assert np.nanstd(errors) == pytest.approx(2.0, rel=0.05)
    assert abs(np.nanmean(errors)) < 0.1
    assert np.isnan(readings).mean() == pytest.approx(0.2, abs=0.02)


def test_there_is_no_return_beyond_the_greatest_range_nor_through_a_ridge_where_sight_is_needed() -> None:
    rng, west = np.random.default_rng(2), At(100.0, 1000.0, 100.0)
    far = FlightBeacons(PLACES, maximum=1500.0).sensors(RIDGE)[0].read(west, rng)
    assert np.isfinite(far).tolist() == [True, False, True, False]
    hidden = FlightBeacons(PLACES, line_of_sight=True).sensors(RIDGE)[0].read(west, rng)
    assert np.isfinite(hidden).tolist() == [True, False, True, False]
    assert np.isfinite(FlightBeacons(PLACES).sensors(RIDGE)[0].read(west, rng)).all()


def test_beacons_in_a_plane_say_nothing_across_it_and_those_out_of_reach_nothing_at_all() -> None:
    flat = FlightBeacons(tuple((x, y, 100.0) for x, y, _ in PLACES))
    points = np.array([[700.0, 700.0, 100.0], [700.0, 700.0, 900.0]])
    within, above = least_information(flat, PLAIN, points)
    assert within == pytest.approx(0.0, abs=1e-9)
    assert above > 0.1
    assert least_information(FlightBeacons(PLACES, maximum=10.0), PLAIN, points).tolist() == [0.0, 0.0]


def test_a_failing_beacon_is_stuck_or_off_from_its_time_on_and_the_others_are_as_they_are() -> None:
    beacons = FlightBeacons(PLACES, noise=1.0)
    plain, stuck, off = (beacons.sensors(PLAIN)[0] for _ in range(3))
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


@pytest.mark.parametrize("offset", [None, 5.0])
def test_all_differences_to_a_failing_reference_are_off_by_the_same(offset: float | None) -> None:
    (sensor,), rngs = ALL.sensors(PLAIN)[2:], [np.random.default_rng(4) for _ in range(2)]
    failing = FailingBeacons(sensor, (0,), 0.0 if offset else 0.5, offset)
    off = [
        failing.read(At(10.0 * k, 0.0, 200.0), rngs[0]) - sensor.read(At(10.0 * k, 0.0, 200.0), rngs[1])
        for k in range(9)
    ]
    np.testing.assert_allclose(np.ptp(np.array(off)[:, 1:], axis=1), 0.0, atol=1e-9)
    assert off[-1][1] == pytest.approx(-5.0 if offset else math.hypot(80.0, 150.0) - math.hypot(40.0, 150.0))


@pytest.mark.parametrize(
    ("fields", "error", "words"),
    [
        ({"places": ()}, FieldError, "one beacon or more"),
        ({"places": ((0.0, 0.0, 1.0),) * 2}, MissionError, "one place twice"),
        ({"places": ((0.0, 0.0, math.nan),)}, FieldError, "finite"),
        ({"noise": -1.0}, FieldError, "noise = -1.0"),
        ({"maximum": 0.0}, FieldError, "maximum = 0.0"),
        ({"rate": 0.0}, FieldError, "rate = 0.0"),
        ({"read": ()}, MissionError, "read is empty"),
        ({"read": ("range-differences",), "places": PLACES[:1]}, MissionError, "differences to one beacon"),
        ({"bearing_noise": -1.0}, FieldError, "bearing_noise = -1.0"),
        (
            {"read": ("ranges", "range-differences"), "places": (None, *PLACES)},
            MissionError,
            "the place of beacon 0 is not known, .*; allowed: a place of beacon 0 that is known",
        ),
    ],
)
def test_beacons_that_cannot_be_are_refused(fields: dict[str, object], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        FlightBeacons(**{"places": PLACES, **fields})  # type: ignore[arg-type]
