"""The last readings of a robot: ranges, and the inputs that led from each to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mathnavi.interfaces.signals import Array


class Way(NamedTuple):
    """Readings of n calls in a row, for compiled code too."""

    ranges: Array  # (n, l) [m], NaN where lost
    inputs: Array  # (n, 2) [m/s, rad/s] over the periods that end with the calls
    times: Array  # (n,) [s] of the calls


class LastReadings:
    """The readings of the last calls of an estimator, NaN before the first."""

    def __init__(self, count: int, rays: int) -> None:
        self._kept = Way(np.full((count, rays), np.nan), np.zeros((count, 2)), np.full(count, np.nan))
        self.calls = 0
        """number of calls until now"""

    def remember(self, t: float, rho: Array, u: Array) -> None:
        """Remember the ranges rho (l,) [m] of t [s], NaN where lost, and the input u (2,) since the call before."""
        for values, newest in zip(self._kept, (rho, u, np.array(t)), strict=True):
            values[:-1] = values[1:]
            values[-1] = newest
        self.calls += 1

    def last(self, calls: int) -> Way:
        """Views of the readings of the last ``calls``, fewer if fewer are kept."""
        ranges, inputs, times = self._kept
        return Way(ranges[-calls:], inputs[-calls:], times[-calls:])
