"""Malformed measurements are not taken for readings, and are counted with the reason."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.ranging.reader import RangeReader
from mathnavi.interfaces.reading_counts import unused_in
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality
from tests.estimators.ranging.walls import FIELD

MISSION, COMMAND = RangingMission(FIELD, (-1.0, 1.0), speed_max=1.0, turn_rate_max=2.0), np.array([0.3, -0.2])
LONGEST = MISSION.sensors_carried()[0].longest


def ranges(*values: float) -> Measurement:
    return Measurement("ranges", 0.0, np.array(values))


def odometry(*values: float) -> Measurement:
    return Measurement("odometry", 0.0, np.array(values))


def read(*measurements: Measurement) -> tuple[Array, Array, dict[str, int] | None]:
    reader = RangeReader(MISSION, 0.5)
    rho, u = reader.read(0.0, measurements, COMMAND)
    return rho, u, unused_in(reader.counts.extra)


@pytest.mark.parametrize(
    ("value", "usable", "counted"),
    [
        (1e-9, True, {}),
        (1.2 * LONGEST, True, {}),
        (1.3 * LONGEST, False, {"out of range": 1}),
        (0.0, False, {"out of range": 1}),
        (-1.0, False, {"out of range": 1}),
        pytest.param(math.nan, False, {}, marks=pytest.mark.honoured("sensor log", "range that was lost (NaN)")),
        pytest.param(
            math.inf, False, {"not finite": 1}, marks=pytest.mark.refused("sensor log", "range without an echo (inf)")
        ),
    ],
)
def test_a_range_may_be_as_long_as_noise_makes_the_longest(value: float, usable: bool, counted: dict[str, int]) -> None:
    rho, _, unused = read(ranges(value, 1.0))
    assert (bool(np.isfinite(rho[0])), rho[1], unused) == (usable, 1.0, counted)


def test_what_reads_as_no_echo_is_none_by_the_declared_maximum_and_the_noise() -> None:
    for ranging, longest in (
        (RangeQuality(absolute=0.2 * LONGEST), 2.6 * LONGEST),
        (RangeQuality(maximum=0.5 * LONGEST), 0.5 * LONGEST),
        (RangeQuality(maximum=9.0 * LONGEST), 1.25 * LONGEST),
    ):
        reader = RangeReader(RangingMission(FIELD, (-1.0, 1.0), ranging), 0.5)
        rho, _ = reader.read(0.0, (ranges(0.999 * longest, longest),), COMMAND)
        assert np.isfinite(rho).tolist() == [True, False]
        assert unused_in(reader.counts.extra) == {"out of range": 1}


def test_without_a_reading_every_ray_is_lost_and_the_input_is_the_command() -> None:
    for measurements in ((), (odometry(0.1, 0.2),)):
        rho, u, unused = read(*measurements)
        np.testing.assert_array_equal(rho, [np.nan, np.nan])
        np.testing.assert_array_equal(u, [0.1, 0.2] if measurements else COMMAND)
        assert unused == {}


def test_readings_are_distinguished_by_their_name_and_of_several_the_newest_ranges_are_used() -> None:
    stranger = Measurement("sonar", 0.0, np.array([3.0, 4.0]))
    rho, u, unused = read(odometry(0.1, 0.2), stranger, ranges(3.0, math.nan), ranges(1.0, 2.0))
    np.testing.assert_array_equal((rho, u), [[1.0, 2.0], [0.1, 0.2]])
    assert unused == {"late": 1, "unknown sensor": 1}


def test_a_reading_is_not_changed() -> None:
    reading = ranges(1.0, -1.0)
    read(reading)
    np.testing.assert_array_equal(reading.value, [1.0, -1.0])


@pytest.mark.parametrize("values", [(1.0,), (1.0, 2.0, 3.0)])
def test_a_reading_of_another_length_is_refused(values: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"ranges has shape .*; allowed: \(2,\)"):
        read(ranges(*values))


@pytest.mark.parametrize(
    ("u", "counted"),
    [
        ((-1.2, 2.4), {}),
        ((5.0, 0.0), {}),
        pytest.param(
            (-100.0, 0.0),
            {"out of range": 1},
            marks=pytest.mark.refused("sensor log", "odometry far beyond the declared maximum"),
        ),
        ((0.0, 100.0), {"out of range": 1}),
        ((math.nan, 0.0), {"not finite": 1}),
        ((0.0, -math.inf), {"not finite": 1}),
    ],
)
def test_what_is_a_little_too_fast_is_believed(u: tuple[float, float], counted: dict[str, int]) -> None:
    _, used, unused = read(odometry(*u))
    np.testing.assert_array_equal(used, COMMAND if counted else u)
    assert unused == counted


def test_without_odometry_for_longer_than_declared_the_estimate_is_degraded_and_without_ranges_lost() -> None:
    reader = RangeReader(MISSION, 0.5)

    def status(t: float, *measurements: Measurement) -> Status:
        reader.read(t, measurements, COMMAND)
        reader.note(t)
        return reader.status(t)

    assert status(0.0) is Status.INITIALISING
    assert status(0.1, ranges(1.0, 1.0)) is Status.OK, "a robot may have no odometry"
    assert status(0.2, ranges(1.0, 1.0), odometry(0.0, 0.0)) is Status.OK
    assert status(0.6, ranges(1.0, 1.0)) is Status.OK
    assert status(0.8, ranges(1.0, 1.0)) is Status.DEGRADED
    assert status(0.9, ranges(1.0, 1.0), odometry(0.0, 0.0)) is Status.DEGRADED, "it has to converge again"
    assert status(1.4, ranges(1.0, 1.0), odometry(0.0, 0.0)) is Status.OK
    assert status(2.0, odometry(0.0, 0.0)) is Status.LOST
