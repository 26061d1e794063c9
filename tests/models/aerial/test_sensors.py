"""Sensors of the aerial vehicle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.mission import AccelerationSensor, FullStateSensor, PositionSensor

SENSORS: list[Sensor] = [FullStateSensor(3.0), PositionSensor(5.0), AccelerationSensor(0.5)]


@dataclass(frozen=True)
class Truth:
    x: Array
    acceleration: Array


@pytest.fixture
def truth() -> Truth:
    return Truth(np.array([1e4, 2e4, 3e3, 100.0, -50.0, 5.0]), np.array([1.0, -2.0, 3.0]))


def exact(sensor: Sensor, truth: Truth) -> Array:
    return {"full_state": truth.x, "position": truth.x[:3], "acceleration": truth.acceleration}[sensor.name]


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.name)
def test_readings_are_unbiased_and_as_noisy_as_declared(sensor: Sensor, truth: Truth) -> None:
    rng = np.random.default_rng(0)
    errors = np.array([sensor.read(truth, rng) for _ in range(20_000)]) - exact(sensor, truth)
    assert errors.shape == (20_000, sensor.size)
    declared = {"full_state": [3.0] * 3 + [0.0] * 3, "position": [5.0] * 3, "acceleration": [0.5] * 3}[sensor.name]
    np.testing.assert_allclose(errors.std(axis=0), declared, rtol=0.03, atol=1e-12)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.15)


def test_full_state_noise_is_uniform_in_a_cube(truth: Truth) -> None:
    rng = np.random.default_rng(0)
    sensor = FullStateSensor(position_noise=2.0)
    errors = np.array([sensor.read(truth, rng)[:3] - truth.x[:3] for _ in range(5000)])
    half_width = np.sqrt(3.0) * 2.0
    assert 0.99 * half_width < np.abs(errors).max() <= half_width + 1e-9


@pytest.mark.parametrize("sensor", [FullStateSensor(), PositionSensor(), AccelerationSensor()], ids=lambda s: s.name)
def test_without_noise_a_reading_is_the_truth_and_a_copy_of_it(sensor: Sensor, truth: Truth) -> None:
    reading = sensor.read(truth, np.random.default_rng(0))
    assert reading is not None
    np.testing.assert_array_equal(reading, exact(sensor, truth))
    assert not np.shares_memory(reading, truth.acceleration)


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: sensor.name)
def test_the_same_generator_gives_the_same_readings(sensor: Sensor, truth: Truth) -> None:
    first, second = (
        [sensor.read(truth, rng) for _ in range(5)] for rng in (np.random.default_rng(7), np.random.default_rng(7))
    )
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("noise", [-1.0, np.nan, np.inf])
@pytest.mark.parametrize("kind", [FullStateSensor, PositionSensor, AccelerationSensor])
def test_an_impossible_noise_is_refused(kind: type, noise: float) -> None:
    with pytest.raises(ValueError, match="noise"):
        kind(noise)
