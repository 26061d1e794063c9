"""Sensors of a position: an encoder at every joint, an attitude sensor, or a point of a manifold with noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval

from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import FINITE, Fraction, configuration
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold

POSITION = "position"  # the name of their readings
EncoderBits = Annotated[int, Interval(ge=0, le=32), FINITE]


@configuration
class PositionQuality:
    """Errors of a position reading, in coordinates of the manifold about the truth: of each joint, for a mechanism."""

    noise: Annotated[float, Radians(0.0, 1.0, unit="rad or m")] = 0.0  # [rad, m] standard deviation of each coordinate
    resolution: EncoderBits = 0  # bits of an encoder over a turn, or over a metre; 0: it does not round
    dropout: Fraction = 0.0  # fraction of readings that are lost
    jump: Fraction = 0.0  # fraction of readings that are off by ``jump_size`` in every coordinate
    jump_size: Annotated[float, Radians(0.0, 10.0, unit="rad or m")] = 0.0  # [rad, m]


@dataclass(frozen=True)
class ManifoldPositionSensor:
    """Sensor of "position" (size,). The random numbers drawn do not depend on the size of the errors."""

    manifold: Manifold
    quality: PositionQuality
    rate: float | None  # [Hz]
    name: ClassVar[str] = POSITION

    @property
    def size(self) -> int:
        """Components of a reading, those of a point."""
        return self.manifold.size

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the position (size,) of the plant, with noise, jumps and rounding; None where the reading is lost."""
        manifold, quality = self.manifold, self.quality
        x = motion.x[: manifold.size]
        error = quality.noise * rng.standard_normal(manifold.dimension)
        lost, jumps = rng.random(2) < (quality.dropout, quality.jump)
        if jumps:
            error = error + quality.jump_size
        y = manifold.point(x, error) if error.any() else x
        return None if lost else manifold.rounded(y, quality.resolution)


@dataclass(frozen=True)
class StateSensor:
    """Sensor of "full_state", (x, v) without error: for comparison, no encoder measures it."""

    size: int
    rate: float | None  # [Hz]
    name: ClassVar[str] = "full_state"

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the state (size,) of the plant exactly."""
        return motion.x
