"""Distribution of a field that is drawn again for every trial of a sweep.

The generator is seeded by the trial's seed and the field's name, so that it does not depend on what else is varied.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Uniform:
    """Interval from which a field is drawn, both ends included."""

    name: str  # of the field
    low: Any
    high: Any

    def draw(self, seed: int) -> Any:
        rng = np.random.default_rng([seed, zlib.crc32(self.name.encode())])
        if isinstance(self.low, int):
            return int(rng.integers(self.low, self.high, endpoint=True))
        return float(rng.uniform(self.low, self.high))
