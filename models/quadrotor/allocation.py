"""Allocation of the force and the moments that a controller commands to the thrusts of four rotors with bounds.

The thrusts T (4,) [N] give (T, tau) = A T, A the vehicle's allocation. Where A^-1 (T, tau) leaves 0 <= T_i <= T_max,
the most important part is kept: first the moments about x and y, which point the thrust, then the thrust itself, then
the moment about z, which only turns the nose.

1. The thrusts of tau_x and tau_y alone sum to zero; if the greatest and the least of them lie further apart than T_max,
   both moments are scaled down until they do not.
2. With the commanded thrust, the greatest share of the moment about z is taken that keeps the bounds.
3. If none does, the thrust is moved to the nearest one at which tau_x and tau_y alone are within the bounds, and the
   moment about z is scaled down to the rotors' remaining range.
"""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array

_ROUNDING = 1e-9


@njit(cache=True, nogil=True)
def allocated(wrench: Array, inverse: Array, thrust_max: float) -> Array:
    """Allocate a ``wrench`` (4,) (T, tau) [N, N m] to the thrusts (4,) [N]; ``inverse`` (4, 4) is that of the
    allocation.
    """
    turning, yawing = np.empty(4), np.empty(4)
    for i in range(4):
        turning[i] = inverse[i, 1] * wrench[1] + inverse[i, 2] * wrench[2]
        yawing[i] = inverse[i, 3] * wrench[3]
    apart = turning.max() - turning.min()
    if apart > thrust_max:
        turning *= thrust_max / apart
    each = wrench[0] / 4.0
    least, share = _shares(each, turning, yawing, thrust_max)
    if least > share + _ROUNDING:
        each = min(max(each, -turning.min()), thrust_max - turning.max())
        _, share = _shares(each, turning, yawing, thrust_max)
    share = max(share, 0.0)
    thrusts: Array = np.empty(4)
    for i in range(4):
        thrusts[i] = min(max(each + turning[i] + share * yawing[i], 0.0), thrust_max)
    return thrusts


@njit(cache=True, nogil=True)
def _shares(each: float, turning: Array, yawing: Array, thrust_max: float) -> tuple[float, float]:
    """Least and greatest share in [0, 1] of ``yawing`` that keep the bounds; least > greatest if no share does."""
    least, greatest = 0.0, 1.0
    for i in range(4):
        below, above = -(each + turning[i]), thrust_max - each - turning[i]
        if yawing[i] > 0.0:
            least, greatest = max(least, below / yawing[i]), min(greatest, above / yawing[i])
        elif yawing[i] < 0.0:
            least, greatest = max(least, above / yawing[i]), min(greatest, below / yawing[i])
        elif below > 0.0 or above < 0.0:
            least, greatest = 1.0, 0.0
    return least, greatest
