"""Control systems of the thesis' definitions (2.1):

Sigma:   x' = F(x, u),   y = h(x, u),   x in R^n, u in R^p, y in R^m.

Coordinates in which a system is linear up to output injection (thesis 2.4; Krener, Isidori, Respondek):

    x~ = T_1(x),   y~ = T_2(y):     x~' = A x~ - g(y, u),   y~ = C x~,   (A, C) observable.

The thesis counts the known inputs among the outputs, so that g may depend on u. With a gain L the same coordinates
serve an observer of Kazantzis and Kravaris, who require x~' = A x~ - g(y, u) with a Hurwitz A only:

    x~' = (A - L C) x~ - (g(y, u) - L T_2(y)).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.buffered_function import NumericFunction
from mathnavi.models.runge_kutta import Flow


@dataclass(frozen=True, eq=False)
class ObserverForm:
    """T_1, its inverse, T_2, A, C and g of one system with a single output."""

    T_1: Callable[[casadi.SX], casadi.SX]  # (n,) -> (n,)
    T_1_inverse: Callable[[casadi.SX], casadi.SX]  # (n,) -> (n,)
    T_2: Callable[[casadi.SX], casadi.SX]  # (1,) -> (1,)
    A: Array  # (n, n)
    C: Array  # (1, n)
    g: Callable[[casadi.SX, casadi.SX], casadi.SX]  # (y (1,), u (p,)) -> (n,)

    def gain(self, poles: Sequence[float]) -> Array:
        """Gain L (n, 1) with which A - L C has these eigenvalues [1/s], by Ackermann's formula.

        Raises FieldError for poles that are not n different numbers < 0.
        """
        n = len(self.A)
        check_poles(poles, n)
        observability = np.vstack([self.C @ np.linalg.matrix_power(self.A, k) for k in range(n)])
        characteristic: Array = sum(
            c * np.linalg.matrix_power(self.A, n - k) for k, c in enumerate(np.poly(np.array(poles)))
        )
        gain: Array = characteristic @ np.linalg.solve(observability, np.eye(n)[:, -1:])
        return gain


def check_poles(poles: Sequence[float], n: int) -> None:
    """Raise FieldError unless the poles are n different real numbers < 0."""
    apart = len(set(poles)) == len(poles) == n
    if not (apart and all(np.isfinite(pole) and pole < 0.0 for pole in poles)):
        raise FieldError(f"poles = {tuple(poles)!r}; allowed: {n} different finite numbers < 0")


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
        return self._numbers(x, u)[0].ravel()

    def output(self, x: Array, u: Array) -> Array:
        """Output y (m,) at x (n,) under u (p,)."""
        return self._numbers(x, u)[1].ravel()

    @cached_property
    def _numbers(self) -> NumericFunction:
        x, u = casadi.SX.sym("x", len(self.states)), casadi.SX.sym("u", len(self.inputs))
        return NumericFunction(casadi.Function("system", [x, u], [self.f(x, u), self.h(x, u)]))

    def difference(self, a: Array, b: Array) -> Array:
        """Difference a - b (..., n) of states a, b (..., n), angles wrapped."""
        difference = np.array(a - b, dtype=np.float64)
        for k in self.angles:
            difference[..., k] = wrapped(difference[..., k])
        return difference
