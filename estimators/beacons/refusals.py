"""Count of refused readings: are there more than are declared as outliers, of all together or of one beacon?"""

from __future__ import annotations

import math

_COUNTED = (4, 8, 16, 32, 64, 128)  # last readings
_RECENT, _REFUSED = 24, 18  # last readings, and how many of them are refused of a pose that is wrong
_CHANCE = 1e-5  # with which more of these are outliers


class Refusals:
    """Whether each of the last readings was refused, of n beacons: bits of whole numbers, the last reading's first."""

    def __init__(self, beacons: int, share: float) -> None:
        """``share`` of the readings are outliers."""
        self._of = [0] * (beacons + 1)  # of each, and in the end of all of them
        self._noted = [0] * (beacons + 1)  # numbers of readings
        self._most = [((1 << n) - 1, most_of(n, share)) for n in _COUNTED]

    def note(self, beacon: int, refused: bool) -> None:
        """Count a reading."""
        for i in (beacon, -1):
            self._of[i] = (self._of[i] << 1 | refused) & self._most[-1][0]
            self._noted[i] += 1

    def clear(self, beacon: int | None = None) -> None:
        """Forget all, or those of a beacon."""
        for i in range(len(self._of)) if beacon is None else (beacon,):
            self._of[i] = self._noted[i] = 0

    def are_most(self, beacon: int = -1) -> bool:
        """True if most of the last readings were refused, of a beacon or of all."""
        lately = self._of[beacon] & ((1 << _RECENT) - 1)
        return self._noted[beacon] >= _RECENT and lately.bit_count() >= _REFUSED

    @property
    def as_declared(self) -> bool:
        """True while no more readings are refused than are declared as outliers."""
        return all((each & last).bit_count() <= most for each in self._of if each for last, most in self._most)


def most_of(n: int, share: float) -> int:
    """Number of n things, each of which is with a probability ``share``, that is exceeded with one of at most 1e-5."""
    beyond, most = 1.0, -1
    while beyond > _CHANCE and most < n:
        most += 1
        beyond -= math.comb(n, most) * share**most * (1.0 - share) ** (n - most)
    return most
