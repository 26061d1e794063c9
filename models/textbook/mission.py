"""Mission of an observer of a textbook system: the system, the noise of its readings, the assumed start.

**The sensor of a textbook system**: its output y = h(x, u), with noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.system import System


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


TICK = 1e-3
"""tick [s] of a textbook plant; periods are whole multiples, and solutions do not depend on the tick"""


@dataclass(frozen=True)
class TextbookMission:
    """Mission: find the state of a system from its outputs. It holds no truth of a run.

    Raises MissionError for a start or deviations of another size.
    """

    system: System
    start: tuple[float, ...]  # (n,) x^(0)
    deviation: tuple[float, ...]  # (n,) standard deviations of it
    noise: float = 0.0  # standard deviation of each output's reading
    period: float = 0.01  # [s] of readings, estimates and commands

    def __post_init__(self) -> None:
        n = len(self.system.states)
        for name in ("start", "deviation"):
            given = getattr(self, name)
            if len(given) != n or not all(map(math.isfinite, given)):
                raise MissionError(
                    f"{name} = {given!r}; allowed: {n} finite numbers, of {', '.join(self.system.states)}"
                )

    @property
    def input_size(self) -> int:
        """Number p of inputs."""
        return len(self.system.inputs)

    @property
    def start_state(self) -> Array:
        """Assumed start x^(0) (n,)."""
        return np.array(self.start)

    @property
    def sensor(self) -> OutputSensor:
        """Sensor of the output y."""
        return OutputSensor(len(self.system.outputs), 1.0 / self.period, self.noise, self.system.output_max)
