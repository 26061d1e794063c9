"""Smoothness of readings: the cubic through four of them, by which the one after is foreseen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from mathnavi.interfaces.signals import Array

POINTS = 4
"""readings that determine a cubic"""
_EVEN = np.array([4.0, -6.0, 4.0, -1.0])  # weights for readings that are evenly spaced
_UNEVEN = 1e-3  # of a step of time, beyond which they are not


def cubic_weights(times: Sequence[float]) -> Array:
    """Weights (4,) by which the cubic through four readings gives the value at ``times[0]``.

    ``times`` (5,) [s] are that time and those of the readings, the newest first.
    """
    gap = times[0] - times[1]
    if all(abs(after - before - gap) <= _UNEVEN * gap for after, before in pairwise(times)):
        return _EVEN
    read = np.array(times[1:])
    others = read[:, np.newaxis] - read + np.eye(POINTS)
    ahead = (times[0] - read) * np.ones((POINTS, 1))
    np.fill_diagonal(ahead, 1.0)
    weights: Array = np.prod(ahead / others, axis=1)
    return weights
