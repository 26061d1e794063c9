"""The mode ``figure-eight``: the heading swings, so that every range rises and falls."""

from __future__ import annotations

from dataclasses import dataclass

from mathnavi.models.unicycle.patterns import figure_eight


@dataclass(frozen=True)
class FigureEight:
    """A figure of eight, 0.375 speed x cycle long and 0.139 wide."""

    speed: float  # [m/s]
    cycle: float  # [s] once through

    def input_at(self, t: float) -> tuple[float, float]:
        return figure_eight(t, self.speed, self.cycle)
