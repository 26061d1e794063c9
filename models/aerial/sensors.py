"""Sensors of the aerial vehicle: what turns its true motion into readings.

A sensor is a frozen description; ``read`` draws its noise from the generator it is given. It keeps no time: the plant
reads it ``rate`` times a second, or whenever the loop looks where ``rate`` is None.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.sim.interfaces.bounds import NonNegative, configuration
from mathnavi.sim.interfaces.protocols import StateView
from mathnavi.sim.interfaces.signals import Array


@configuration(prefix="{name} sensor: ")
class FullStateSensor:
    """Position and velocity, (6,) [m, m/s]: the position off by a noise uniform in a cube, the velocity exact.

    Section A.7 of the thesis draws the position noise from U(-w, w) on each axis; w = sqrt(3) position_noise.
    """

    position_noise: NonNegative = 0.0  # [m] standard deviation on each axis
    rate: float | None = None  # [Hz]; None: whenever the loop looks
    name: str = "full_state"
    size: int = 6

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        if self.position_noise == 0.0:
            return motion.x
        half_width = math.sqrt(3.0) * self.position_noise
        off: Array = np.concatenate([rng.uniform(-half_width, half_width, 3), np.zeros(3)])
        return motion.x + off


@configuration(prefix="{name} sensor: ")
class PositionSensor:
    """Position fixes, (3,) [m], with Gaussian noise."""

    noise: NonNegative = 0.0  # [m] standard deviation on each axis
    rate: float | None = 10.0  # [Hz]; None: whenever the loop looks
    name: str = "position"
    size: int = 3

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        position = motion.x[:3]
        return position + self.noise * rng.standard_normal(3) if self.noise > 0.0 else position.copy()


@configuration(prefix="{name} sensor: ")
class AccelerationSensor:
    """Net acceleration over the last tick, gusts included, (3,) [m/s^2], with Gaussian noise."""

    noise: NonNegative = 0.0  # [m/s^2] standard deviation on each axis
    rate: float | None = None  # [Hz]; None: whenever the loop looks
    name: str = "acceleration"
    size: int = 3

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        acceleration = motion.acceleration
        return acceleration + self.noise * rng.standard_normal(3) if self.noise > 0.0 else acceleration.copy()
