"""A problem of ``mathnavi.controllers.ocp`` as others state it: fixed ends, other end conditions, limits, guess.

MAPTOR and dymos have a place of its own for the value of a state at the start and at the end; what is no such value is
an event or a boundary constraint. ``CONTROL_LIMITS`` are limits that a user of theirs would add.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.interfaces.signals import Array

Limits = tuple[float | None, float | None]

CONTROL_LIMITS: dict[str, Interval] = {"Zermelo": Interval(np.array([0.0]), np.array([2.0 * math.pi]))}
"""by the problem's name; a heading without limits winds between two collocation points"""


@dataclass(frozen=True)
class End:
    """Conditions on one end of the flight."""

    fixed: dict[int, float]  # value over the scale of each state that has one
    others: tuple[int, ...]  # rows of the conditions that are none


def ends(problem: ProblemFunctions) -> tuple[End, End]:
    """Conditions at the start and at the end."""
    x, T, p = ca.SX.sym("x", problem.nx), ca.SX.sym("T"), ca.DM(problem.nominal)
    return (
        _end(problem, problem.initial(x, p), x, problem.initial_bounds),
        _end(problem, problem.final(x, T, p), x, problem.final_bounds),
    )


def _end(problem: ProblemFunctions, conditions: ca.SX, x: ca.SX, bounds: Interval) -> End:
    slope = ca.jacobian(conditions, x)
    offset = ca.substitute(conditions, x, ca.DM.zeros(problem.nx))
    fixed: dict[int, float] = {}
    others = []
    for k, (lower, upper) in enumerate(zip(*bounds, strict=True)):
        named = slope[k, :].sparsity().get_col() if slope.shape[0] else []
        simple = lower == upper and len(named) == 1 and slope[k, :].nz[0].is_constant() and offset[k].is_constant()
        if simple and named[0] not in fixed:
            i = int(named[0])
            fixed[i] = float((lower - float(offset[k])) / float(slope[k, i]) / problem.state_scale[i])
        else:
            others.append(k)
    return End(fixed, tuple(others))


def limits(bounds: Interval, scale: Array) -> list[Limits]:
    """Limits over the scales, None where there is none."""
    lower, upper = (side / scale for side in bounds)
    return [(finite(low), finite(high)) for low, high in zip(lower, upper, strict=True)]


def control_limits(problem: ProblemFunctions) -> list[Limits]:
    """Limits of the controls over their scales."""
    return limits(CONTROL_LIMITS.get(problem.name, problem.control_bounds), problem.control_scale)


def finite(value: float) -> float | None:
    """A limit; None for an infinite one."""
    return float(value) if math.isfinite(value) else None


def guess(problem: ProblemFunctions, fractions: Array) -> tuple[Array, Array]:
    """Guessed states (nx, n) and controls (nu, n) over their scales at fractions (n,) of T."""

    def at(values: Array, scale: Array) -> Array:
        return np.array([np.interp(fractions, problem.guess_times, column) for column in values.T]) / scale[:, None]

    return at(problem.guess_states, problem.state_scale), at(problem.guess_controls, problem.control_scale)
