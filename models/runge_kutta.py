"""Integration of an ordinary differential equation x' = f(x, u) with the input held; ``Flow`` keeps a tolerance.

Its steps of Dormand and Prince (J. Comp. Appl. Math. 6, 1980), of order 5 with an error estimate of order 4, are as
long as the tolerance allows: each is kept only if, in every component, its error is estimated at most

    tolerance (1 + max |x_i|)        before and after the step.

A solution that leaves every bound in finite time is followed until it is ``FARTHEST`` from the origin or its steps are
``SHORTEST``; the time reached is then its escape time, to about 1 / ``FARTHEST`` of a solution like that of x' = x^2.
``classical_step`` is for a step that is known to be short enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import casadi
import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import BufferedFunction

State = TypeVar("State", casadi.SX, Array)

TOLERANCE = 1e-10
FARTHEST = 1e9  # of any component
SHORTEST = 1e-14  # [s]

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 5.0  # of the length of a step
_EXACT = 1e-10  # of the tolerance: an error below counts as zero
_A = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
_ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)  # order 5 less order 4


def classical_step(rate: Callable[[State, float], State], x: State, h: Any) -> State:
    """The state one step of h [s] after x, numbers or expressions, by Runge and Kutta's classical method of order 4.

    ``rate(x, c)`` is x' at the fraction c of the step, 0, 1/2 or 1.
    """
    k_1 = rate(x, 0.0)
    k_2 = rate(halfway(x, h, k_1), 0.5)
    k_3 = rate(halfway(x, h, k_2), 0.5)
    k_4 = rate(x + h * k_3, 1.0)
    after: State = classical_sum(x, h, k_1, k_2, k_3, k_4)
    return after


def halfway(x: Any, h: Any, k: Any) -> Any:
    """The state in the middle of a step of h [s] from x at the rate k."""
    return x + 0.5 * h * k


def classical_sum(x: Any, h: Any, k_1: Any, k_2: Any, k_3: Any, k_4: Any) -> Any:
    """The state after a step of h [s] from x, of the rates of the classical method's four stages."""
    return x + h / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)


compiled_halfway = njit(nogil=True)(halfway)
compiled_sum = njit(nogil=True)(classical_sum)
"""``classical_sum`` for kernels, component by component"""


def dormand_prince(
    f: Callable[[casadi.SX, casadi.SX], casadi.SX], x: casadi.SX, u: casadi.SX, h: casadi.SX
) -> tuple[casadi.SX, casadi.SX]:
    """Take one step of h [s] from x (nx,) with u (nu,) held.

    Returns the state of order 5 (nx,) and the difference of that of order 4 from it (nx,).
    """
    k: list[casadi.SX] = []
    at = x
    for row in _A:
        at = x + h * sum(a * slope for a, slope in zip(row, k, strict=True)) if k else x
        k.append(f(at, u))
    return at, h * sum(e * slope for e, slope in zip(_ERROR, k, strict=True))


class Flow:
    """The solution of x' = f(x, u), of nx states and nu inputs that are held."""

    def __init__(
        self, f: Callable[[casadi.SX, casadi.SX], casadi.SX], nx: int, nu: int, tolerance: float = TOLERANCE
    ) -> None:
        x, u, h = casadi.SX.sym("x", nx), casadi.SX.sym("u", nu), casadi.SX.sym("h")
        after, difference = dormand_prince(f, x, u, h)
        scale = 1.0 + casadi.fmax(casadi.fabs(x), casadi.fabs(after))
        step = casadi.Function("step", [x, u, h], [after, casadi.mmax(casadi.fabs(difference) / scale) / tolerance])
        self._given = np.zeros(nx), np.zeros(nu), np.zeros(1)
        self._found = np.zeros(nx), np.zeros(1)
        self._step = BufferedFunction(step, self._given, self._found)

    def __call__(self, x: Array, u: Array, dt: float) -> Array:
        """The state (nx,) after dt [s]; the last finite one where it escapes before."""
        return self.reach(x, u, dt)[0]

    def reach(self, x: Array, u: Array, dt: float) -> tuple[Array, float]:
        """Integrate from x (nx,) over dt [s] with u (nu,) held.

        Returns the state (nx,) and the time [s] at which it was reached: ``dt``, or less if the solution escapes
        before.
        """
        at, held, length = self._given
        after, difference = self._found
        at[:], held[:], t, h = x, u, 0.0, dt
        while t < dt:
            length[0] = h = min(h, dt - t)
            self._step()
            error = float(difference[0]) if np.isfinite(after).all() else math.inf  # CasADi passes over a NaN
            if error <= 1.0:
                at[:], t = after, dt if h == dt - t else t + h
                if np.abs(at).max() > FARTHEST:
                    break
            elif h < SHORTEST:
                break
            best = _SAFETY * max(error, _EXACT) ** -0.2 if error < math.inf else _SHRINK
            h *= min(max(best, _SHRINK), _GROW)
        return at.copy(), t
