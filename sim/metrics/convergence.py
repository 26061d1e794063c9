"""Decay rate of an estimate's error, and the part of a run over which convergence is judged."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE

LAST = 0.25
"""share of a run, at its end, over which convergence is judged"""
_EXACT = 1e-12  # an error below is round-off


def last_quarter(t: Array) -> slice:
    """The samples of the last quarter of a run sampled at t (n,) [s]."""
    return slice(int(np.searchsorted(t, (1.0 - LAST) * t[-1] - TIME_TOLERANCE)), None)


def decay_rate(t: Array, error: Array, floor: float = 1e-6) -> float:
    """Rate lambda [1/s] of the best fit c exp(-lambda t) to errors (n,) at times t (n,) [s]: slope of a line through
    ln(error).

    Errors count until they are first below ``floor`` of the largest, where noise and sampling take over. NaN for fewer
    than three, and for an error that is round-off from the beginning.
    """
    below = np.flatnonzero(error < max(floor * float(error.max(initial=0.0)), _EXACT))
    n = int(below[0]) if len(below) else len(error)
    if n < 3:
        return math.nan
    slope, _ = np.polyfit(t[:n], np.log(error[:n]), 1)
    return -float(slope)
