"""Count of refused readings: are there more than are declared as outliers, of all together or of one beacon?"""

from __future__ import annotations

import math
from collections import deque

_COUNTED = (4, 8, 16, 32, 64, 128)  # last readings
_CHANCE = 1e-5  # with which more of these are outliers


class Refusals:
    """Whether each of the last readings was refused, of n beacons."""

    def __init__(self, beacons: int, share: float) -> None:
        """``share`` of the readings are outliers."""
        self.all: deque[bool] = deque(maxlen=_COUNTED[-1])
        self._of = tuple(deque[bool](maxlen=_COUNTED[-1]) for _ in range(beacons))
        self._most = [(n, most_of(n, share)) for n in _COUNTED]

    def note(self, beacon: int, refused: bool) -> None:
        """Count a reading."""
        self.all.append(refused)
        self._of[beacon].append(refused)

    def clear(self) -> None:
        """Forget all."""
        for each in (self.all, *self._of):
            each.clear()

    @property
    def as_declared(self) -> bool:
        """True while no more readings are refused than are declared as outliers."""
        return all(sum(list(each)[-n:]) <= most for each in (self.all, *self._of) for n, most in self._most)


def most_of(n: int, share: float) -> int:
    """Number of n things, each of which is with a probability ``share``, that is exceeded with one of at most 1e-5."""
    beyond, most = 1.0, -1
    while beyond > _CHANCE and most < n:
        most += 1
        beyond -= math.comb(n, most) * share**most * (1.0 - share) ** (n - most)
    return most
