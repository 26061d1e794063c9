"""Motion along a plan, compiled, because the loop evaluates it at every control step.

The state after the input u was held for s from x = (p, v) is (p + v s + u s^2 / 2, v + u s); see ``dynamics``.
"""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE


@njit(cache=True, nogil=True)
def arc_at(breaks: Array, t: float) -> int:
    """Index of the arc that holds from t [s] on, by the breakpoints (K + 1,) [s]: -1 before the first, K after the
    last.

    A breakpoint belongs to the later arc.
    """
    reached, first, end = t + TIME_TOLERANCE, 0, len(breaks)
    while first < end:  # np.searchsorted takes long to compile
        middle = (first + end) // 2
        if reached < breaks[middle]:
            end = middle
        else:
            first = middle + 1
    return first - 1


@njit(cache=True, nogil=True)
def state_on(breaks: Array, x: Array, u: Array, t: float) -> Array:
    """State (2 m,) at t [s] of arcs: breaks (K + 1,) [s], states x (K + 1, 2 m), inputs u (K, m); held beyond both
    ends.

    Raises ValueError for arrays that do not fit together.
    """
    m = u.shape[1]
    if len(x) != len(breaks) or len(u) != len(breaks) - 1 or x.shape[1] != 2 * m:  # compiled code would read on
        raise ValueError("the plan's arrays do not fit together")
    arc = arc_at(breaks, t)
    state: Array = x[max(arc, 0)].astype(np.float64)
    if 0 <= arc < len(u):
        s = t - breaks[arc]
        for i in range(m):
            state[i] = state[i] + s * state[m + i] + (0.5 * s * s) * u[arc, i]
            state[m + i] = state[m + i] + s * u[arc, i]
    return state


@njit(cache=True, nogil=True)
def offset_from(breaks: Array, x: Array, u: Array, t: float, state: Array) -> tuple[float, float, float]:
    """Position [m] of a state (6,) minus that of arcs at t [s], in three numbers; arguments as of ``state_on``."""
    planned = state_on(breaks, x, u, t)
    return state[0] - planned[0], state[1] - planned[1], state[2] - planned[2]
