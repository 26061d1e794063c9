"""Monitor functions w, whose integral a grid divides equally between its nodes (thesis B.3).

Derivatives are with respect to τ = t / T and states are over their scales S, x~ = S^-1 x, so that a metre weighs no
more than it should. With raw SI units in the monitor the claims of the thesis do not hold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.grid import Mesh
from mathnavi.controllers.ocp.solution import Solution, along
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array


@dataclass(frozen=True, eq=False)
class Monitor:
    """A monitor function w > 0, in both forms: of a solution, and of an interval whose ends are unknowns.

    ``density(solution, τ, ε)`` is w (k,) at fractions τ = t / T (k,) of a solution. ``measure(mesh, ε)`` is
    (N - 1) ∫ w dτ () over one interval, written with differences of its ends, so that no derivative of an unknown is
    needed; a monitor without one serves where nodes are moved between two solves. ε > 0 keeps w positive where the
    solution is at rest.
    """

    name: str
    density: Callable[[Solution, Array, float], Array]
    measure: Callable[[Mesh, float], ca.SX] | None = None
    epsilon: float = 1.0

    def measured(self, mesh: Mesh, epsilon: float) -> ca.SX:
        """(N - 1) ∫ w dτ () over the interval of a mesh; ProblemError for a monitor that has no measure."""
        self.check_measure()
        assert self.measure is not None
        return self.measure(mesh, epsilon)

    def check_measure(self) -> None:
        """Raise ProblemError for a monitor without a measure, which cannot be part of a programme."""
        if self.measure is None:
            raise ProblemError(f"monitor = {self.name!r} has no measure; allowed: one that has, or a redistribution")


def interval_measures(monitor: Monitor, solution: Solution, epsilon: float) -> Array:
    """(N - 1) ∫ w dτ (N - 1,) of every interval of a solution, by the monitor's measure.

    ProblemError for a monitor that has none.
    """
    problem, count, widths = solution.problem, solution.nodes - 1, solution.grid.widths
    u = np.vstack([solution.u[:, 0], solution.u[-1:, -1]])
    rates = along(problem, solution.x, u, solution.t, solution.parameters)
    chords = np.diff(solution.x, axis=0) / problem.state_scale
    second = np.diff(rates, axis=0) * solution.duration / widths[:, None] / problem.state_scale
    known = (widths[None] * count, np.full((1, count), solution.duration), chords.T, second.T)
    found = _measure(monitor, epsilon, count, problem.nx).map(count)(*known)
    values: Array = np.array(found.full())[0]
    return values


@lru_cache(maxsize=64)
def _measure(monitor: Monitor, epsilon: float, count: int, nx: int) -> ca.Function:
    """(D, T, chord, second derivative) -> (N - 1) ∫ w dτ over an interval."""
    D, T, chord, second = ca.SX.sym("D"), ca.SX.sym("T"), ca.SX.sym("chord", nx), ca.SX.sym("second", nx)
    mesh = Mesh(count, ca.SX(0), D, T, chord, second)
    return ca.Function("measure", [D, T, chord, second], [ca.densify(ca.SX(monitor.measured(mesh, epsilon)))])


def _arclength_density(solution: Solution, tau: Array, epsilon: float) -> Array:
    """w = sqrt(ε + |x~'|^2)."""
    w: Array = np.sqrt(epsilon + (solution.scaled_derivative(tau, 1) ** 2).sum(axis=1))
    return w


def _arclength_measure(mesh: Mesh, epsilon: float) -> ca.SX:
    """sqrt((N - 1)^2 |Δx~|^2 + ε D^2): the chord."""
    return ca.sqrt(mesh.count**2 * ca.sumsqr(mesh.chord) + epsilon * mesh.relative_width**2)


def _curvature_density(solution: Solution, tau: Array, epsilon: float) -> Array:
    """w = (ε + |x~''|^2)^(1/4)."""
    w: Array = (epsilon + (solution.scaled_derivative(tau, 2) ** 2).sum(axis=1)) ** 0.25
    return w


def _curvature_measure(mesh: Mesh, epsilon: float) -> ca.SX:
    """D (ε + |Δx~' / Δτ|^2)^(1/4)."""
    return mesh.relative_width * (epsilon + ca.sumsqr(mesh.second_derivative)) ** 0.25


def _local_error_density(solution: Solution, tau: Array, epsilon: float) -> Array:
    """w = (ε + |x~'''|^2)^(1/6): equal shares of w are equal |x~'''| d^3, what a parabola cannot follow."""
    w: Array = (epsilon + (solution.scaled_derivative(tau, 3) ** 2).sum(axis=1)) ** (1.0 / 6.0)
    return w


ARCLENGTH = Monitor("arclength", _arclength_density, _arclength_measure, epsilon=0.01)
CURVATURE = Monitor("curvature", _curvature_density, _curvature_measure, epsilon=1.0)
LOCAL_ERROR = Monitor("local error", _local_error_density, None, epsilon=1.0)
UNIFORM = Monitor(
    "uniform", lambda solution, tau, epsilon: np.ones(len(tau)), lambda mesh, epsilon: mesh.relative_width, epsilon=1.0
)
