"""Weierstrass' condition for controls without limits: a minimum of H = L + λ'f in u exists only if H is bounded below.

Where H falls without limit in a control, needle variations lower J by as much as one likes, however small J's second
variation makes any smooth change: v' = u^3 has strict minima for small variations, and its infimum is not attained.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.layout import mixed_constraints
from mathnavi.controllers.ocp.pontryagin_terms import symbols_of
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.scheme import gauss_legendre
from mathnavi.interfaces.signals import Array

_POINTS = 10  # of an interval
_FAR = (1e2, 1e4, 1e6)  # times a control's size
_FALLS = 1e3  # least ratio of the last fall to |H|, and to the fall before: faster than |u|^1.5, which no line is


def control_without_minimum(solution: Solution) -> str:
    """Name of a control in which H falls without limit at some time of a solution; empty where none does.

    A control is judged on the sides where nothing limits it, and only where no path constraint depends on a control. A
    Hamiltonian that is at most quadratic in u needs no such test: its H_uu is part of the second variation.
    """
    problem = solution.problem
    if mixed_constraints(problem) or not _bends(problem):
        return ""
    abscissae, _ = gauss_legendre(_POINTS)
    t = (solution.t[:-1, None] + 0.5 * (abscissae + 1.0) * np.diff(solution.t)[:, None]).ravel()
    x, u, costate = solution.state(t), solution.control(t), solution.costate(t)
    H = _hamiltonian(problem).map(len(t))
    p = np.tile(solution.parameters[:, None], (1, len(t)))

    def along(controls: Array) -> Array:
        values: Array = H(x.T, controls.T, t[None, :], p, costate.T).full()[0]
        return values

    here = along(u)
    sizes = np.abs(u).max(axis=0, initial=0.0) + problem.control_scale
    for j, name in enumerate(problem.controls):
        for sign, limit in zip((-1.0, 1.0), problem.control_bounds, strict=True):
            if np.isfinite(limit[j]):
                continue
            falls = []
            for far in _FAR:
                moved = u.copy()
                moved[:, j] = sign * far * sizes[j]
                falls.append(along(moved) - here)
            _, before, last = falls
            if ((before < 0.0) & (last < _FALLS * before) & (last < -_FALLS * np.abs(here))).any():
                return name
    return ""


@lru_cache(maxsize=64)
def _bends(problem: ProblemFunctions) -> bool:
    """True if H_uu depends on u."""
    s = symbols_of(problem)
    return bool(ca.depends_on(ca.hessian(s.hamiltonian, s.u)[0], s.u)) if problem.nu else False


@lru_cache(maxsize=64)
def _hamiltonian(problem: ProblemFunctions) -> ca.Function:
    """(x, u, t, p, λ) -> H."""
    s = symbols_of(problem)
    return ca.Function("H", s.arguments, [ca.densify(s.hamiltonian)])
