"""Automatic scales: typical magnitudes of variables, from their guesses, ends and bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable

from mathnavi.interfaces.signals import Array


def automatic_scale(guess: Array, ends: Iterable[float], lower: float, upper: float) -> float:
    """Scale of a variable without a stated one.

    The largest magnitude among its guess (k,), its values at the start and the end, and, where both its bounds are
    finite and nothing else differs from zero, its bounds; 1 where that is not known.
    """
    stated = max([*(abs(float(value)) for value in guess), *(abs(end) for end in ends)], default=0.0)
    if stated > 0.0:
        return stated
    bounded = max((abs(bound) for bound in (lower, upper) if math.isfinite(bound)), default=0.0)
    return bounded or 1.0
