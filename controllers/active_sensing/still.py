"""The mode ``still``: u = 0, under which two sensors or fewer cannot tell the pose."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Still:
    """No motion at all."""

    cycle: float = 1.0  # [s]

    def input_at(self, t: float) -> tuple[float, float]:
        return 0.0, 0.0
