"""Sensors of the unicycle: exact without noise, as wrong as the mission declares with it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.mission import RangeSensor, RangingMission, WheelOdometry
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality
from tests.unicycle import STANDARD, Imagined

SENSORS = (-0.5 * math.pi, -0.25 * math.pi, 0.3)
MISSION = RangingMission(STANDARD, SENSORS)
POSE = np.array([1.0, -0.4, 0.7])
RHO = STANDARD.ranges(POSE, np.array(SENSORS))[0]


def ranges(quality: RangeQuality, count: int = 1, seed: int = 0) -> Array:
    """(count, l) readings at one pose."""
    sensor, _ = dataclasses.replace(MISSION, ranging=quality).sensors_carried()
    rng = np.random.default_rng(seed)
    return np.array([sensor.read(Imagined(MISSION, POSE), rng) for _ in range(count)])


def odometry(quality: OdometryQuality, seed: int = 0, count: int = 2, u: tuple[float, float] = (0.5, -1.0)) -> Array:
    """(count - 1, 2) readings while an input is held."""
    _, sensor = dataclasses.replace(MISSION, odometry=quality).sensors_carried()
    rng, motion, held = np.random.default_rng(seed), Imagined(MISSION, POSE), np.array(u)
    assert sensor.read(motion, rng) is None
    readings = []
    for _ in range(count - 1):
        motion = motion.moved(held, MISSION.period)
        readings.append(sensor.read(motion, rng))
    return np.array(readings)


def test_a_mission_has_the_two_sensors_of_its_name_and_size() -> None:
    sensors = MISSION.sensors_carried()
    assert [(sensor.name, sensor.size, sensor.rate) for sensor in sensors] == [
        ("ranges", 3, pytest.approx(100.0)),
        ("odometry", 2, pytest.approx(100.0)),
    ]


def test_without_noise_ranges_are_exact() -> None:
    np.testing.assert_array_equal(ranges(RangeQuality())[0], RHO)


def test_noise_has_the_deviation_that_is_declared() -> None:
    errors = ranges(RangeQuality(0.05, 0.1), 4000) - RHO
    np.testing.assert_allclose(errors.std(axis=0), np.hypot(0.05 * RHO, 0.1), rtol=0.05)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.02)
    assert np.abs(np.corrcoef(errors.T) - np.eye(3)).max() < 0.06


def test_rays_are_lost_one_by_one() -> None:
    lost = np.isnan(ranges(RangeQuality(0.05, dropout=0.3), 2000))
    np.testing.assert_allclose(lost.mean(axis=0), 0.3, atol=0.04)
    assert np.mean(lost.any(axis=1) & ~lost.all(axis=1)) > 0.5


def test_outliers_are_any_value_up_to_the_longest_in_sight() -> None:
    readings = ranges(RangeQuality(outliers=0.25), 4000)
    wrong = readings != RHO
    np.testing.assert_allclose(wrong.mean(axis=0), 0.25, atol=0.03)
    values = readings[wrong]
    assert values.min() >= 0.0
    assert values.max() <= 2.0 * 3.763
    np.testing.assert_allclose(np.quantile(values, [0.25, 0.5, 0.75]) / (2.0 * 3.763), [0.25, 0.5, 0.75], atol=0.03)


def test_errors_do_not_change_what_else_is_drawn() -> None:
    small, large = (ranges(RangeQuality(size), 20) / RHO - 1.0 for size in (0.01, 0.1))
    np.testing.assert_allclose(10.0 * small, large, atol=1e-12)
    whole, holed = (ranges(RangeQuality(0.05, dropout=loss), 20) for loss in (0.0, 0.3))
    np.testing.assert_array_equal(holed[~np.isnan(holed)], whole[~np.isnan(holed)])


@dataclasses.dataclass(frozen=True)
class Nowhere:
    """A motion whose rangefinders meet nothing."""

    x: Array
    acceleration: Array

    def sensed(self, name: str) -> Array:
        return np.array([-1.0])


def test_a_ray_that_meets_nothing_is_lost() -> None:
    motion: StateView = Nowhere(np.zeros(3), np.zeros(3))
    reading = RangeSensor(2, RangeQuality(), 7.0, 100.0).read(motion, np.random.default_rng(0))
    np.testing.assert_array_equal(reading, np.nan)


def test_without_noise_odometry_is_the_mean_input() -> None:
    np.testing.assert_allclose(odometry(OdometryQuality(), count=50), [[0.5, -1.0]] * 49, rtol=0.0, atol=1e-11)


def test_odometry_errs_by_noise_and_by_a_bias_of_random_sign() -> None:
    biases = [odometry(OdometryQuality(bias=0.02), seed)[0] / [0.5, -1.0] - 1.0 for seed in range(40)]
    np.testing.assert_allclose(np.abs(biases), 0.02, atol=1e-9)
    assert 8 < np.count_nonzero(np.array(biases)[:, 0] > 0.0) < 32
    noisy = odometry(OdometryQuality((0.05, 0.2)), count=3000)
    np.testing.assert_allclose(noisy.std(axis=0), [0.05, 0.2], rtol=0.06)
    np.testing.assert_allclose(noisy.mean(axis=0), [0.5, -1.0], atol=0.02)


def test_the_bias_is_the_same_over_a_run() -> None:
    readings = odometry(OdometryQuality(bias=0.1), count=30)
    np.testing.assert_allclose(readings, readings[:1].repeat(29, axis=0), atol=1e-9)


def test_an_odometer_remembers_its_own_run_only() -> None:
    first, second = WheelOdometry(OdometryQuality(), 100.0), WheelOdometry(OdometryQuality(), 100.0)
    rng, motion = np.random.default_rng(0), Imagined(MISSION, POSE)
    first.read(motion, rng)
    assert second.read(motion, rng) is None
