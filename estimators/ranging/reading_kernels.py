"""Selection of usable ranges and odometry, compiled: a count of what is not usable costs nothing there."""

from __future__ import annotations

import math

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array


@njit(cache=True, nogil=True)
def select_ranges(value: Array, longest: float, rho: Array) -> tuple[int, int, int]:
    """Write the ranges ``value`` (l,) [m] into rho (l,), NaN for those that are not finite, not positive or as long as
    ``longest`` [m].

    Returns the numbers of usable ranges, of those that are out of range, and of those that are infinite.
    """
    usable = out_of_range = infinite = 0
    for i in range(len(value)):
        rho[i] = math.nan
        if 0.0 < value[i] < longest:
            rho[i] = value[i]
            usable += 1
        elif math.isinf(value[i]):
            infinite += 1
        elif not math.isnan(value[i]):
            out_of_range += 1
    return usable, out_of_range, infinite


@njit(cache=True, nogil=True)
def is_within(u: Array, limits: Array) -> bool:
    """True if no component of u (k,) exceeds its limit (k,) or is NaN."""
    within = True
    for i in range(len(limits)):
        within = within and abs(u[i]) <= limits[i]
    return within
