"""What an optimiser hands to the planner: inputs held between breaks, flown through the declared body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit

from mathnavi.controllers.missile.aim import TerminalCondition
from mathnavi.controllers.missile.shooting import Failed
from mathnavi.models.missile import kernels
from mathnavi.models.missile.coordinates import STEP, Coordinates
from mathnavi.models.missile.dynamics import SPATIAL_STATES, Body
from mathnavi.sim.interfaces.signals import Array


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Arcs with inputs ``u`` (K, nu) held between the times ``t`` (K + 1,) [s], from 0 on, and the states ``x``
    (K + 1, nx) at them: each is where the one before leads to."""

    t: Array
    x: Array
    u: Array
    cost: float  # J

    @property
    def duration(self) -> float:
        return float(self.t[-1])


class Optimiser(Protocol):
    """Finds the flight from a state to an aim, again and again."""

    def optimise(self, t: float, start: Array, aim: TerminalCondition) -> Trajectory | Failed:
        """The flight from the state ``start`` (nx,) at t [s], or why there is none."""
        ...


def flown(start: Array, t: Array, u: Array, coordinates: Coordinates, body: Body) -> Array:
    """(K + 1, nx) states at the times t (K + 1,) [s] of a body that starts there and holds inputs u (K, nu)."""
    x = _flown(coordinates.in_space(start), np.diff(t), coordinates.input_in_space(u), body.numbers, STEP)
    return x[:, [SPATIAL_STATES.index(name) for name in coordinates.states]]


@njit(cache=True, nogil=True)
def _flown(start: Array, durations: Array, u: Array, numbers: kernels.Numbers, step: float) -> Array:
    x = np.empty((len(u) + 1, len(start)))
    x[0] = start
    for k in range(len(u)):
        x[k + 1] = kernels.flow(x[k], u[k], durations[k], numbers, step)
    return x
