"""Projection onto the bounds, and the backtracking line search along it, compiled."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.flight.kernels.problem_data import (
    ACCELERATION,
    MANOEUVRE,
    SPEED,
    ProblemData,
    QuadraticProgramme,
    cost_of,
    end_violation,
)
from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array

_SUFFICIENT, _SHORTEST = 1e-4, 1e-3  # of the line search: share of the promised decrease, length of a step


@inner_njit(nogil=True)
def project(unknowns: Array, data: ProblemData, out: Array) -> None:
    """Fill ``out`` (3n + 1,) with unknowns near the given ones that keep all bounds of speed, acceleration, manoeuvre.

    Velocities are pulled into the ball |v_i| <= v_max, then approached with |a_i| <= a_max, node by node; a node within
    the ball is reached from within the ball, so both bounds hold. w = 0 is always within reach of the manoeuvre.
    """
    start, lengths, packed = data.start, data.lengths, data.packed
    n = (unknowns.shape[0] - 1) // 3
    v_max, a_max = packed[SPEED], packed[ACCELERATION]
    desired, v, a = np.empty(3), np.empty(3), np.empty(3)
    for axis in range(3):
        desired[axis] = v[axis] = start[3 + axis]
    for i in range(n):
        h = lengths[i]
        for axis in range(3):
            desired[axis] += h * unknowns[3 * i + axis]
        length = math.sqrt(desired[0] * desired[0] + desired[1] * desired[1] + desired[2] * desired[2])
        pull = v_max / length if length > v_max else 1.0
        for axis in range(3):
            a[axis] = (pull * desired[axis] - v[axis]) / h
        length = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        pull = a_max / length if length > a_max else 1.0
        for axis in range(3):
            out[3 * i + axis] = pull * a[axis]
            v[axis] += h * pull * a[axis]
    across = v[0] * v[0] + v[1] * v[1]
    rise = math.sqrt(max(0.0, (packed[MANOEUVRE] * a_max) ** 2 - across))
    out[3 * n] = min(max(unknowns[3 * n], v[2] - rise, 0.0), v[2] + rise, v_max)


@inner_njit(nogil=True)
def _model_decrease(step: Array, programme: QuadraticProgramme, soft: int) -> float:
    """Decrease of the quadratic programme's objective from d = 0 to ``step``; its first ``soft`` rows are soft."""
    hessian, gradient, rows, upper, lower = programme
    size = step.shape[0]
    decrease = 0.0
    for j in range(size):
        product = 0.0
        for k in range(size):
            product += hessian[j, k] * step[k]
        decrease -= step[j] * (gradient[j] + 0.5 * product)
    for r in range(soft):
        along = 0.0
        for k in range(size):
            along += rows[r, k] * step[k]
        below, above = lower[size + r], -upper[size + r]
        decrease += 0.5 * (max(below, 0.0) ** 2 - max(below - along, 0.0) ** 2)
        decrease += 0.5 * (max(above, 0.0) ** 2 - max(above + along, 0.0) ** 2)
    return decrease


@njit(cache=True, nogil=True)
def begin(guess: Array, known: tuple[Array, ...], terminal_position: Array, out: Array) -> tuple[float, float]:
    """Fill ``out`` (3n + 1,) with the projected guess (3n + 1,); returns its cost and its violation [m]."""
    data = ProblemData(*known)
    project(guess, data, out)
    return cost_of(out, data), end_violation(out, data, terminal_position)


@njit(cache=True, nogil=True)
def search(
    unknowns: Array,
    cost: float,
    violation: float,
    step: Array,
    penalty: float,
    soft: int,
    quadratic: tuple[Array, ...],
    known: tuple[Array, ...],
    terminal_position: Array,
    out: Array,
) -> tuple[float, float, float, bool]:
    """Backtrack from the full step along the projected line until merit = cost + penalty * violation falls enough.

    ``cost`` and ``violation`` [m] are those of the unknowns; the first ``soft`` rows of the programme are soft. Fills
    ``out``; returns the decrease that the quadratic model promises of the full step, the cost and violation of ``out``,
    and True if the merit fell.
    """
    data, programme = ProblemData(*known), QuadraticProgramme(*quadratic)
    decrease = penalty * violation + _model_decrease(step, programme, soft)
    merit = cost + penalty * violation
    length, trial = 1.0, np.empty(step.shape[0])
    while True:
        for k in range(step.shape[0]):
            trial[k] = unknowns[k] + length * step[k]
        project(trial, data, out)
        cost = cost_of(out, data)
        violation = end_violation(out, data, terminal_position)
        if cost + penalty * violation <= merit - _SUFFICIENT * length * max(decrease, 0.0):
            return decrease, cost, violation, True
        length *= 0.5
        if length < _SHORTEST:
            return decrease, cost, violation, False
