"""The mode ``straight``: forth and back on a line, never turning."""

from __future__ import annotations

from dataclasses import dataclass

from mathnavi.models.unicycle.patterns import straight


@dataclass(frozen=True)
class Straight:
    """A line, speed x cycle / 2 long."""

    speed: float  # [m/s]
    cycle: float  # [s] forth and back

    def input_at(self, t: float) -> tuple[float, float]:
        return straight(t, self.speed, self.cycle)
