"""Ranges and range rates from noisy ranges: a Savitzky-Golay filter at the centre of a window.

The output flow Q needs rho_dot. From noisy ranges, which differ by 0.1 m from one to the next, no causal filter
estimates it well enough; the polynomial of order p that fits the 2 m + 1 readings around an instant best does, m
periods later. The observer therefore runs at the window's centre, and its estimate is propagated from there with the
inputs since.

The fit is to the ranges themselves, or to the innovation: their difference from the ranges expected of a robot that
moves through the window by the inputs. Within a second ranges are not a cubic of time; the innovation on the truth is
zero, so a straight line fits it, and an estimate on the truth stays on it for any window.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array

LONGEST_WINDOW = 1001
HIGHEST_ORDER = 7
_STRIDE = 5  # readings at most between two at which rays are cast
_LEAST_NODES = 4  # of them on either side


def check_window(window: int, order: int) -> None:
    """Raise FieldError unless the window is an odd number of readings, and more than the polynomial needs."""
    if not (window % 2 == 1 and 3 <= window <= LONGEST_WINDOW):
        raise FieldError(f"window = {window!r}; allowed: an odd number of readings from 3 to {LONGEST_WINDOW}")
    if not 1 <= order <= min(HIGHEST_ORDER, window - 1):
        highest = min(HIGHEST_ORDER, window - 1)
        raise FieldError(f"order = {order!r}; allowed with window = {window}: 1 to {highest}")


@lru_cache(maxsize=16)
def savitzky_golay(window: int, order: int) -> Array:
    """Weights (p + 1, 2 m + 1) from readings at tau = -1, ..., 1 to the coefficients of the polynomial that fits them
    best.
    """
    tau = np.linspace(-1.0, 1.0, window)
    weights: Array = np.ascontiguousarray(np.linalg.pinv(np.vander(tau, order + 1, increasing=True)))
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=16)
def spread(window: int) -> Array:
    """Matrix (2 m + 1, 2 k + 1) of a cubic spline: from values at 2 k + 1 readings, evenly spaced from end to end, to
    values at all readings.
    """
    m = window // 2
    stride = max(step for step in range(1, _STRIDE + 1) if step == 1 or (m % step == 0 and m >= _LEAST_NODES * step))
    at = np.arange(-m, m + 1, stride)
    weights: Array = np.ascontiguousarray(CubicSpline(at, np.eye(len(at)))(np.arange(-m, m + 1)))
    weights.flags.writeable = False
    return weights


class FitWindow:
    """Window of the last 2 m + 1 readings of ranges, and the inputs between them."""

    def __init__(self, window: int, sensors: int) -> None:
        self.ranges = np.full((window, sensors), np.nan)  # (2 m + 1, l) [m], the oldest first
        self.inputs = np.zeros((window - 1, 2))  # (2 m, 2) [m/s, rad/s]
        self.count = 0  # readings so far
        self.half = window // 2  # m

    def push(self, rho: Array, u: Array) -> None:
        """Add a reading rho (l,) [m], NaN where a ray was lost, and the input u (2,) since the one before."""
        self.ranges[:-1], self.ranges[-1] = self.ranges[1:], rho
        self.inputs[:-1], self.inputs[-1] = self.inputs[1:], u
        self.count += 1

    @property
    def has_centre(self) -> bool:
        """True if there is a reading at the centre."""
        return self.count > self.half

    @property
    def is_at_start(self) -> bool:
        """True if the reading at the centre is the first."""
        return self.count == self.half + 1

    @property
    def inputs_since(self) -> Array:
        """Inputs (n, 2) from the centre, or from the first reading while there is none at the centre, until now."""
        return self.inputs[len(self.inputs) - min(self.count - 1, self.half) :]

    @property
    def centre_input(self) -> Array:
        """Mean (2,) of the inputs before and after the centre, between which it jumps."""
        mean: Array = 0.5 * (self.inputs[self.half - 1] + self.inputs[self.half])
        return mean
