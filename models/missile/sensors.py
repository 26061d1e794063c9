"""Sensors of the missile: from its true motion, in MuJoCo's joint coordinates, to readings of the thesis' state."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mathnavi.interfaces.bounds import NonNegative, configuration
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import Coordinates


@configuration(prefix="full_state sensor: ")
class StateNoise:
    """Standard deviations of a full-state reading, independent on each axis and from reading to reading."""

    position: NonNegative = 0.0  # [m]
    velocity: NonNegative = 0.0  # [m/s] on the axes of the body frame
    angle: NonNegative = 0.0  # [rad]
    rate: NonNegative = 0.0  # [rad/s]

    def deviations(self, coordinates: Coordinates) -> Array:
        """Standard deviations (nx,) of the components of the state, in their units."""
        by_unit = {"m": self.position, "m/s": self.velocity, "rad": self.angle, "rad/s": self.rate}
        return np.array([by_unit[unit] for unit in coordinates.units])


@dataclass(frozen=True)
class MissileStateSensor:
    """Sensor of the thesis' state (nx,) with Gaussian noise."""

    coordinates: Coordinates
    noise: StateNoise = field(default_factory=StateNoise)
    rate: float | None = None  # [Hz]; None: every control step
    name: str = "full_state"

    @property
    def size(self) -> int:
        """Number nx of states."""
        return self.coordinates.state_size

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the thesis' state (nx,) of ``motion``; ``rng`` draws the noise."""
        x = self.coordinates.from_joints(motion.x)
        deviations = self.noise.deviations(self.coordinates)
        if not deviations.any():
            return x
        noise: Array = deviations * rng.standard_normal(len(x))
        return x + noise
