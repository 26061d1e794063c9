"""Malformed measurements are not taken for readings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.ranging.model import measured_input, usable_ranges
from mathnavi.interfaces.signals import Measurement

LONGEST = 7.5
LIMITS, COMMAND = np.array([1.0, 2.0]), np.array([0.3, -0.2])


def ranges(*values: float) -> Measurement:
    return Measurement("ranges", 0.0, np.array(values))


def odometry(*values: float) -> Measurement:
    return Measurement("odometry", 0.0, np.array(values))


@pytest.mark.parametrize(
    ("value", "usable"),
    [
        (1e-9, True),
        (LONGEST, True),
        (1.5 * LONGEST, True),
        (2.1 * LONGEST, False),
        (0.0, False),
        (-1.0, False),
        (math.nan, False),
        (math.inf, False),
    ],
)
def test_a_range_may_be_as_long_as_noise_makes_the_longest(value: float, usable: bool) -> None:
    assert np.isfinite(usable_ranges([ranges(value)], 1, LONGEST)[0]) == usable


def test_without_a_reading_every_ray_is_lost() -> None:
    np.testing.assert_array_equal(usable_ranges([odometry(0.1, 0.2)], 2, LONGEST), [np.nan, np.nan])
    np.testing.assert_array_equal(usable_ranges([], 2, LONGEST), [np.nan, np.nan])


def test_ranges_are_distinguished_from_odometry_by_their_name() -> None:
    np.testing.assert_array_equal(usable_ranges([odometry(3.0, 4.0), ranges(1.0, 2.0)], 2, LONGEST), [1.0, 2.0])


def test_a_reading_is_not_changed() -> None:
    reading = ranges(1.0, -1.0)
    usable_ranges([reading], 2, LONGEST)
    np.testing.assert_array_equal(reading.value, [1.0, -1.0])


@pytest.mark.parametrize("values", [(1.0,), (1.0, 2.0, 3.0)])
def test_a_reading_of_another_length_is_refused(values: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"ranges has shape .*; allowed: \(2,\)"):
        usable_ranges([ranges(*values)], 2, LONGEST)


def test_the_input_is_what_odometry_says_and_the_command_where_it_says_nothing() -> None:
    np.testing.assert_array_equal(measured_input([ranges(1.0, 2.0), odometry(0.1, 0.2)], COMMAND, LIMITS), [0.1, 0.2])
    np.testing.assert_array_equal(measured_input([ranges(0.1, 0.2)], COMMAND, LIMITS), COMMAND)
    np.testing.assert_array_equal(measured_input([], COMMAND, LIMITS), COMMAND)


@pytest.mark.parametrize(
    ("u", "possible"),
    [
        ((-1.2, 2.4), True),
        ((5.0, 0.0), True),
        ((-100.0, 0.0), False),
        ((0.0, 100.0), False),
        ((math.nan, 0.0), False),
        ((0.0, -math.inf), False),
    ],
)
def test_what_is_a_little_too_fast_is_believed(u: tuple[float, float], possible: bool) -> None:
    np.testing.assert_array_equal(measured_input([odometry(*u)], COMMAND, LIMITS), u if possible else COMMAND)
