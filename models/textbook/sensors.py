"""The sensor of a textbook system: its output y = h(x, u), with noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array


@dataclass(frozen=True)
class OutputSensor:
    """Sensor of "output" (m,); components that are out of sight are NaN."""

    size: int  # m
    rate: float | None  # [Hz]
    noise: float = 0.0  # standard deviation of each component
    largest: float = np.inf  # magnitude that is in sight
    name: ClassVar[str] = "output"

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the output y (m,) of ``motion``; ``rng`` draws the noise."""
        y = motion.sensed(self.name)
        seen = np.abs(y) <= self.largest  # not where it is NaN
        read: Array = np.where(seen, y + self.noise * rng.standard_normal(self.size), np.nan)
        return read
