"""Compiled functions, bounds, scales and guess of an optimal control problem: the input of the transcriptions.

``mathnavi.controllers.ocp.problem`` states a problem and makes these functions of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import NamedTuple

import casadi as ca

from mathnavi.sim.interfaces.errors import ProblemError
from mathnavi.sim.interfaces.signals import Array

DURATION_LIMITS = (1e-3, 1e9)
"""[s] limits of a free final time for which none are stated: for the search, no solution ends there"""


DURATION_LIMITS = (1e-3, 1e9)
"""[s] limits of a free final time for which none are stated: for the search, no solution ends there"""


class Interval(NamedTuple):
    """Lower and upper limits, arrays of one shape (n,), infinite where there is none; equal where a value is fixed."""

    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False)
class ProblemFunctions:
    """An optimal control problem as compiled functions with their limits; every function is CasADi's, over SX columns.

    ``nx`` states, ``nu`` controls, ``np`` parameters. The scales are typical magnitudes: a solver sees x / x_scale.
    """

    name: str
    states: tuple[str, ...]  # nx names
    controls: tuple[str, ...]  # nu names
    parameters: tuple[str, ...]  # np names
    dynamics: ca.Function  # f(x, u, t, p) -> (nx,)
    running_cost: ca.Function  # L(x, u, t, p) -> ()
    terminal_cost: ca.Function  # Psi(x, T, p) -> ()
    path: ca.Function  # d(x, u, t, p) -> (nd,)
    initial: ca.Function  # i(x, p) -> (ni,)
    final: ca.Function  # s(x, T, p) -> (ns,)
    state_bounds: Interval  # (nx,) each
    control_bounds: Interval  # (nu,)
    path_bounds: Interval  # (nd,)
    initial_bounds: Interval  # (ni,)
    final_bounds: Interval  # (ns,)
    path_names: tuple[str, ...]  # nd texts or names of the constraints
    initial_names: tuple[str, ...]  # ni
    final_names: tuple[str, ...]  # ns
    duration_bounds: tuple[float, float]  # [s] equal for a fixed T
    state_scale: Array  # (nx,)
    control_scale: Array  # (nu,)
    nominal: Array  # (np,) values of the parameters by default
    guess_times: Array  # (k,) in [0, 1], fractions of T
    guess_states: Array  # (k, nx)
    guess_controls: Array  # (k, nu)
    guess_duration: float  # [s]

    @property
    def nx(self) -> int:
        """Number of states."""
        return len(self.states)

    @property
    def nu(self) -> int:
        """Number of controls."""
        return len(self.controls)

    @property
    def free_duration(self) -> bool:
        """True if T is an unknown."""
        return self.duration_bounds[0] < self.duration_bounds[1]

    def values(self, **parameters: float) -> Array:
        """Values (np,) of the parameters: the nominal ones, or those given by name.

        ProblemError for an unknown name and a value that is not finite.
        """
        values = self.nominal.copy()
        for name, value in parameters.items():
            if name not in self.parameters:
                known = ", ".join(self.parameters) or "none"
                raise ProblemError(f"{self.name}: parameter {name!r} is not known; allowed: {known}")
            if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
                raise ProblemError(f"{self.name}: parameter {name} = {value!r}; allowed: a finite number")
            values[self.parameters.index(name)] = value
        return values


def check_problem(problem: object) -> None:
    """Raise ProblemError for a problem that is no ``ProblemFunctions``, an ``OptimalControlProblem`` itself for one."""
    if not isinstance(problem, ProblemFunctions):
        raise ProblemError(
            f"problem = {problem!r:.120}; allowed: ProblemFunctions, OptimalControlProblem.functions() for one"
        )
