"""A field that is drawn afresh for every trial of a sweep.

The generator is one of the trial's seed and the field's name, so that what else is varied changes nothing in it.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Uniform:
    """Interval that a field is drawn from, both ends included."""

    name: str  # of the field
    low: Any
    high: Any

    def draw(self, seed: int) -> Any:
        rng = np.random.default_rng([seed, zlib.crc32(self.name.encode())])
        if isinstance(self.low, int):
            return int(rng.integers(self.low, self.high, endpoint=True))
        return float(rng.uniform(self.low, self.high))
