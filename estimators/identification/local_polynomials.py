"""Values and derivatives of sampled signals without lag: polynomials that are fitted about each sample.

About the stamp t_k a polynomial of degree d is fitted by least squares to the samples within t_k +- T, with the weights
1 - ((t - t_k) / T)^2. Its value, slope and second derivative at t_k are those of the signal; for evenly spaced stamps
this is the filter of Savitzky and Golay with weights, of zero phase. Stamps may be uneven and samples may be missing.
Signals that are filtered with the same T and d have lost the same, so that an equation between them still holds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array

_MORE = 3  # samples in a window beyond the coefficients
_LEAST_WEIGHT = 1e-3
_EVEN = 1e-9  # [s] up to which two windows have the same stamps


class Smoothed(NamedTuple):
    """Signals (n, m) and their derivatives at n stamps; NaN where the samples about a stamp are too few."""

    value: Array
    slope: Array
    curvature: Array
    known: NDArray[np.bool_]  # (n,)


def smooth(t: Array, y: Array, half_window: float, degree: int) -> Smoothed:
    """Fit polynomials to the signals y (n, m) at the stamps t (n,) [s], which increase.

    ``half_window`` is T [s]. A stamp is known if its window lies within the log and has three samples more than the
    polynomial has coefficients, on both sides of the stamp.
    """
    n, T = len(t), half_window
    out = np.full((3, *y.shape), np.nan)
    known = np.zeros(n, dtype=bool)
    first = np.searchsorted(t, t - T - _EVEN)
    last = np.searchsorted(t, t + T + _EVEN)
    weights: dict[bytes, Array] = {}
    for k in range(n):
        window = t[first[k] : last[k]] - t[k]
        if t[k] - t[0] < T - _EVEN or t[-1] - t[k] < T - _EVEN or len(window) < degree + 1 + _MORE:
            continue
        if window[0] > -0.5 * T or window[-1] < 0.5 * T:
            continue
        key = np.rint(window / _EVEN).astype(np.int64).tobytes()
        if key not in weights:
            s = window / T
            w = np.sqrt(np.maximum(1.0 - s * s, _LEAST_WEIGHT))
            powers = np.vander(s, degree + 1, increasing=True)
            weights[key] = (np.linalg.pinv(powers * w[:, np.newaxis]) * w)[:3]
        out[:, k] = weights[key] @ y[first[k] : last[k]]
        known[k] = np.isfinite(out[0, k]).all()
    return Smoothed(out[0], out[1] / T, 2.0 * out[2] / T**2, known)
