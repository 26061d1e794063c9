"""Sensors of the aerial vehicle: true motion to readings.

A sensor is a frozen description; ``read`` draws its noise from the generator it is given. It keeps no time: the plant
reads it ``rate`` times a second, or at every control step where ``rate`` is None.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.bounds import NonNegative, configuration
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array


@configuration(prefix="{name} sensor: ")
class FullStateSensor:
    """Position and velocity, (6,) [m, m/s], map frame: the position with a noise uniform in a cube, the velocity exact.

    Section A.7 of the thesis draws the position noise from U(-w, w) on each axis; w = sqrt(3) position_noise.
    """

    position_noise: NonNegative = 0.0  # [m] standard deviation on each axis
    rate: float | None = None  # [Hz]; None: every control step
    name: str = "full_state"
    size: int = 6

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the state (6,) [m, m/s] of ``motion``; ``rng`` draws the noise."""
        if self.position_noise == 0.0:
            return motion.x
        half_width = math.sqrt(3.0) * self.position_noise
        noise: Array = np.concatenate([rng.uniform(-half_width, half_width, 3), np.zeros(3)])
        return motion.x + noise


@configuration(prefix="{name} sensor: ")
class PositionSensor:
    """Position fixes, (3,) [m], with Gaussian noise."""

    noise: NonNegative = 0.0  # [m] standard deviation on each axis
    rate: float | None = 10.0  # [Hz]; None: every control step
    name: str = "position"
    size: int = 3

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the position (3,) [m] of ``motion``; ``rng`` draws the noise."""
        position = motion.x[:3]
        return position + self.noise * rng.standard_normal(3) if self.noise > 0.0 else position.copy()


@configuration(prefix="{name} sensor: ")
class AccelerationSensor:
    """Net acceleration over the last tick, gusts included, (3,) [m/s^2], with Gaussian noise."""

    noise: NonNegative = 0.0  # [m/s^2] standard deviation on each axis
    rate: float | None = None  # [Hz]; None: every control step
    name: str = "acceleration"
    size: int = 3

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the acceleration (3,) [m/s^2] of ``motion``; ``rng`` draws the noise."""
        acceleration = motion.acceleration
        return acceleration + self.noise * rng.standard_normal(3) if self.noise > 0.0 else acceleration.copy()
