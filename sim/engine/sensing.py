"""Sensors that a vehicle carries, with the data that a plant needs to read each when it is due."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Sensor
from mathnavi.sim.engine.loop import whole_ticks


@dataclass(frozen=True)
class Mounted:
    """Sensor mounted on a vehicle."""

    sensor: Sensor
    every: int  # ticks from one reading to the next; 0: at every control step
    rng: np.random.Generator  # of its own

    def due(self, tick: int, at_control_step: bool) -> bool:
        """Return True if it is read at a tick, which may be that of a control step."""
        return tick % self.every == 0 if self.every else at_control_step


def mounted(vehicle: str, sensors: Sequence[Sensor], dt: float, rng: np.random.Generator) -> list[Mounted]:
    """Mount the sensors of a vehicle in a plant with ticks of dt [s], each with its own stream, spawned from ``rng``.

    Raises ArgumentError if two have one name, or the period of one is not a whole number of ticks.
    """
    if len({sensor.name for sensor in sensors}) != len(sensors):
        raise ArgumentError(f"vehicle {vehicle!r} carries two sensors of one name: {[s.name for s in sensors]}")
    generators = rng.spawn(len(sensors))
    return [
        Mounted(sensor, every(sensor, dt), generator) for sensor, generator in zip(sensors, generators, strict=True)
    ]


def every(sensor: Sensor, dt: float) -> int:
    """Return the ticks of dt [s] from one reading to the next, 0 for a sensor without a rate; ValueError for a
    fraction.
    """
    if sensor.rate is None:
        return 0
    if not (math.isfinite(sensor.rate) and sensor.rate > 0.0):
        raise ArgumentError(f"sensor {sensor.name!r}: rate = {sensor.rate!r} Hz; allowed: a finite rate > 0")
    return whole_ticks(1.0 / sensor.rate, dt, f"the period of sensor {sensor.name!r} at {sensor.rate!r} Hz")
