"""Control systems of the thesis' definitions (2.1):

Sigma:   x' = F(x, u),   y = h(x, u),   x in R^n, u in R^p, y in R^m.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.runge_kutta import Flow
from mathnavi.models.textbook.observer_form import ObserverForm

Map = Callable[[casadi.SX, casadi.SX], casadi.SX]


@dataclass(frozen=True, eq=False)
class System:
    """A system Sigma, with its default run. A name states its unit, for instance "x_1 [m]"."""

    name: str
    title: str  # where it stands
    states: tuple[str, ...]  # (n,)
    inputs: tuple[str, ...]  # (p,)
    outputs: tuple[str, ...]  # (m,)
    f: Map  # F, (x (n,), u (p,)) -> x' (n,)
    h: Map  # (x (n,), u (p,)) -> y (m,)
    start: tuple[float, ...]  # (n,) x(0)
    start_error: tuple[float, ...]  # (n,) error of an observer's start
    constant: tuple[float, ...] = ()  # (p,) u = constant + amplitude sin t
    amplitude: tuple[float, ...] = ()  # (p,)
    angles: tuple[int, ...] = ()  # components of x that are angles [rad], modulo a turn
    output_max: float = np.inf  # a sensor does not see beyond
    form: ObserverForm | None = None  # coordinates in which the dynamics are linear up to output injection

    @cached_property
    def flow(self) -> Flow:
        """Flow of the system: integrates x with u held."""
        return Flow(self.f, len(self.states), len(self.inputs))

    def reach(self, x: Array, u: Array, dt: float) -> tuple[Array, float]:
        """Integrate x (n,) over dt [s] with u (p,) held.

        Returns the state (n,) and dt, or a shorter time [s] if the solution escapes before.
        """
        return self.flow.reach(x, u, dt)

    def rate(self, x: Array, u: Array) -> Array:
        """Rate x' (n,) at x (n,) under u (p,)."""
        return np.array(self._numbers(x, u)[0]).ravel()

    def output(self, x: Array, u: Array) -> Array:
        """Output y (m,) at x (n,) under u (p,)."""
        return np.array(self._numbers(x, u)[1]).ravel()

    @cached_property
    def _numbers(self) -> casadi.Function:
        x, u = casadi.SX.sym("x", len(self.states)), casadi.SX.sym("u", len(self.inputs))
        return casadi.Function("system", [x, u], [self.f(x, u), self.h(x, u)])

    def difference(self, a: Array, b: Array) -> Array:
        """Difference a - b (..., n) of states a, b (..., n), angles wrapped."""
        difference = np.array(a - b, dtype=np.float64)
        for k in self.angles:
            difference[..., k] = wrapped(difference[..., k])
        return difference
