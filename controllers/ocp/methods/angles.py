"""Angles among the controls: a turn by 2π changes nothing, so neighbouring points may lie turns apart by chance.

A polynomial through such points winds, and what was an optimum at the points cannot be flown. Where a problem has a
control as an angle only, its values are moved by whole turns until neighbours are less than half a turn apart.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from mathnavi.controllers.ocp.defects import running_costs
from mathnavi.controllers.ocp.solution import Solution, along
from mathnavi.interfaces.signals import Array

_EQUAL = 1e-9  # relative difference of values that are the same


def unwound(solution: Solution) -> Solution:
    """Move the angles of a solution by whole turns, so that they do not wind between neighbouring points.

    Unchanged where a control is not an angle, where its bounds do not allow the move, and where nothing winds.
    """
    problem, u = solution.problem, solution.u.copy()
    for j in range(problem.nu):
        straight = np.unwrap(solution.u[:, :, j].ravel())
        lower, upper = problem.control_bounds.lower[j], problem.control_bounds.upper[j]
        straight -= 2.0 * np.pi * np.round((np.median(straight) - np.median(solution.u[:, :, j])) / (2.0 * np.pi))
        winds = np.abs(straight - solution.u[:, :, j].ravel()).max() > 1.0
        if winds and (straight >= lower).all() and (straight <= upper).all() and _is_angle(solution, j):
            u[:, :, j] = straight.reshape(u.shape[:2])
    return solution if np.array_equal(u, solution.u) else dataclasses.replace(solution, u=u)


def _is_angle(solution: Solution, j: int) -> bool:
    """True if a turn of control j changes neither dynamics nor running cost nor path constraints at the points."""
    turned = solution.u.copy()
    turned[:, :, j] += 2.0 * np.pi
    before, after = _values(solution, solution.u), _values(solution, turned)
    return bool(np.allclose(before, after, rtol=_EQUAL, atol=_EQUAL * max(1.0, np.abs(before).max(initial=0.0))))


def _values(solution: Solution, u: Array) -> Array:
    problem, t = solution.problem, solution.point_times.ravel()
    x, u = solution.inner.reshape(len(t), -1), u.reshape(len(t), problem.nu)
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    path = np.array(problem.path.map(len(t))(x.T, u.T, t[None, :], p).full().T)
    return np.column_stack([along(problem, x, u, t, solution.parameters), running_costs(solution, x, u, t), path])
