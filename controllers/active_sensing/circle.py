"""The mode ``circle``: speed and turn rate stay as they are."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mathnavi.models.unicycle.patterns import circle


@dataclass(frozen=True)
class Circle:
    """A circle to the left, of radius speed x cycle / (2 pi)."""

    speed: float  # [m/s]
    cycle: float  # [s] once around

    def input_at(self, t: float) -> tuple[float, float]:
        return circle(t, self.speed, 2.0 * math.pi / self.cycle)
