"""Scales of the cost and of the rows of a problem, by which a solver divides them.

What counts is the largest change by an unknown v that moves by its own scale s,

    cost     γ = max T (|L_v| s + |L_vv| s²/2), |Psi_v| s + |Psi_vv| s²/2, T |L + Psi_T|     along a guess, and the
                 same of the costs at given times, Psi_k;
    row d    max |nearer limit|, |d_v| s                                                      along the problem's guess.

The scale is its power of ten, and 1 for what is of ordinary size: J from 1e-3 to 1e3, a row from 1e-2 to 1e2. A large
J is divided by a hundredth of that: a J with slopes of 100 beside constraints with slopes of 1 takes fewer solves. The
second derivatives are there because a guess is often 0, where a square is flat. A row is divided by a small
number only where its second derivatives are small as well: a slope may be small by chance.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.scaling import Scale
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.interfaces.signals import Array

_ORDINARY_COST = (1e-3, 1e3)
_ORDINARY_ROW = (1e-2, 1e2)
_ROUNDING = 1e-9  # of J: changes below are those of a J that nothing changes, which has its own size
_LARGE = 1e2  # change that is left of a large J
_FAR, _NOTHING = 1e3, 1e-12  # of the scale of J: J over it that asks for another scale
_GUESSED = 1e-9  # of the scale, above which the guess of a control says how large it is


def cost_scale(problem: ProblemFunctions, times: Array, x: Array, u: Array, duration: float, p: Array) -> float:
    """Scale of J along a trajectory.

    Args:
        problem: the problem as compiled functions.
        times: (k,) [s], from 0 to T.
        x: (k, nx) states.
        u: (k, nu) controls.
        duration: T [s].
        p: (np,) parameters.
    """
    scales, n = np.concatenate([problem.state_scale, problem.control_scale]), problem.nx + problem.nu
    running, terminal = _cost_slopes(problem, len(times))
    known = np.tile(p[:, None], (1, len(times)))
    along = np.array(running(x.T, u.T, times[None, :], known).full())
    at_end = np.array(terminal(x[-1], duration, p).full())
    changes = [
        duration * _change(along[1 : 1 + n], along[1 + n :], scales[:, None]),
        _change(at_end[1 : 1 + problem.nx], at_end[1 + problem.nx : -1], problem.state_scale[:, None]),
    ]
    if problem.free_duration:
        changes.append(duration * np.abs(along[:1] + at_end[0]))
    if (found := problem.instants) is not None:
        X, size = _at_instants(problem, times / duration, x)
        slopes = np.array(_row_slopes(found.cost, (arguments := found.cost.sx_in()), arguments[0])(X, p).full())[0]
        slopes, curvatures = np.split(slopes, 2)
        changes.append(_change(slopes, curvatures, size))
    largest, own = _largest(changes), _largest([duration * np.abs(along[:1]), np.abs(at_end[-1:])])
    scale = _power_of_ten(own if largest < _ROUNDING * own else largest, _ORDINARY_COST)
    return scale / _LARGE if scale > 1.0 else scale


def corrected(scale: float, cost: float) -> float:
    """A scale of J once J is known: that of J where the scale, other than 1, was far too large for it."""
    if scale != 1.0 and _NOTHING * scale < abs(cost) < scale / _FAR:
        return _power_of_ten(abs(cost), _ORDINARY_COST)
    return scale


def guess_cost_scale(problem: ProblemFunctions) -> float:
    """Scale of J along the problem's own guess."""
    times = problem.guess_times * problem.guess_duration
    return cost_scale(
        problem, times, problem.guess_states, problem.guess_controls, problem.guess_duration, problem.nominal
    )


def programme_scales(problem: ProblemFunctions) -> tuple[Scale, list[tuple[str, Scale]]]:
    """Scale of the cost along the problem's guess and those of its constraints by name, for a table."""
    at_start, at_end = end_scales(problem)
    names = (*problem.path_names, *problem.initial_names, *problem.final_names)
    values = np.concatenate([path_scale(problem), at_start, at_end]).tolist()
    limits = [problem.path_bounds, problem.initial_bounds, problem.final_bounds]
    if problem.instants is not None:
        names += problem.instants.names
        values += instant_scales(problem).tolist()
        limits.append(problem.instants.bounds)
    nearer = [_nearer_limit(*sides) for each in limits for sides in zip(*each, strict=True)]
    rows = []
    for name, value, limit in zip(names, values, nearer, strict=True):
        of_limit = value != 1.0 and value == _power_of_ten(limit, _ORDINARY_ROW)
        rows.append((name, Scale(value, "bounds") if of_limit else _derived(value)))
    return _derived(guess_cost_scale(problem)), rows


def _derived(value: float) -> Scale:
    return Scale(value, "ordinary size" if value == 1.0 else "derivative")


@lru_cache(maxsize=64)
def path_scale(problem: ProblemFunctions) -> Array:
    """Scales (nd,) of the path constraints."""
    arguments = problem.path.sx_in()
    times = problem.guess_times * problem.guess_duration
    slopes = _row_slopes(problem.path, arguments, ca.vertcat(*arguments[:2])).map(len(times))
    p = np.tile(problem.nominal[:, None], (1, len(times)))
    found = slopes(problem.guess_states.T, problem.guess_controls.T, times[None, :], p)
    sizes, scales = (
        np.concatenate([problem.state_scale, own]) for own in (_control_sizes(problem), problem.control_scale)
    )
    return _row_scales(np.array(found.full()), len(times), sizes, scales, problem.path_bounds)


def path_sizes(problem: ProblemFunctions) -> Array:
    """Sizes (nd,) that a violation of the path constraints is relative to: limits, at least the rows' scales."""
    limits = [np.where(np.isfinite(side), np.abs(side), 0.0) for side in problem.path_bounds]
    sizes: Array = np.maximum(path_scale(problem), np.maximum(*limits))
    return sizes


def with_ordinary_rows(solution: Solution) -> Solution:
    """The solution with its path constraints over their scales, for what compares them with figures of order one."""
    scale = path_scale(solution.problem)
    if (scale == 1.0).all():
        return solution
    path = solution.multipliers.path
    multipliers = dataclasses.replace(solution.multipliers, path=dataclasses.replace(path, values=path.values * scale))
    return dataclasses.replace(solution, problem=_with_ordinary_rows(solution.problem), multipliers=multipliers)


@lru_cache(maxsize=64)
def _with_ordinary_rows(problem: ProblemFunctions) -> ProblemFunctions:
    arguments, scale = problem.path.sx_in(), path_scale(problem)
    path = ca.Function("d", arguments, [problem.path(*arguments) / ca.DM(scale)])
    return dataclasses.replace(
        problem, path=path, path_bounds=Interval(*(side / scale for side in problem.path_bounds))
    )


@lru_cache(maxsize=64)
def end_scales(problem: ProblemFunctions) -> tuple[Array, Array]:
    """Scales (ni,) and (ns,) of the constraints at the start and at the end."""
    x, p = problem.initial.sx_in()
    at_start = _row_slopes(problem.initial, [x, p], x)(problem.guess_states[0], problem.nominal)
    x, T, p = problem.final.sx_in()
    moved = ca.vertcat(x, T) if problem.free_duration else x
    scales = np.append(problem.state_scale, [problem.guess_duration] * problem.free_duration)
    known = problem.guess_states[-1], problem.guess_duration, problem.nominal
    at_end = _row_slopes(problem.final, [x, T, p], moved)(*known)
    return (
        _row_scales(np.array(at_start.full()), 1, problem.state_scale, problem.state_scale, problem.initial_bounds),
        _row_scales(np.array(at_end.full()), 1, scales, scales, problem.final_bounds),
    )


@lru_cache(maxsize=64)
def instant_scales(problem: ProblemFunctions) -> Array:
    """Scales (nc,) of the constraints at given times; the problem has some."""
    found = problem.instants
    assert found is not None
    X, size = _at_instants(problem, problem.guess_times, problem.guess_states)
    slopes = _row_slopes(found.rows, (arguments := found.rows.sx_in()), arguments[0])(X, problem.nominal)
    return _row_scales(np.array(slopes.full()), 1, size, size, found.bounds)


def _at_instants(problem: ProblemFunctions, fractions: Array, x: Array) -> tuple[Array, Array]:
    """States (k nx,) of a trajectory at given times, one behind the other, and their scales."""
    assert problem.instants is not None
    at = problem.instants.fractions
    return (
        np.array([np.interp(at, fractions, column) for column in x.T]).T.ravel(),
        np.tile(problem.state_scale, len(at)),
    )


def state_row_scale(problem: ProblemFunctions) -> Array:
    """Scales (nx,) of rows that are a state itself, where a scheme has it as an expression."""
    return np.array([_power_of_ten(scale, _ORDINARY_ROW) for scale in problem.state_scale.tolist()])


@lru_cache(maxsize=64)
def _cost_slopes(problem: ProblemFunctions, count: int) -> tuple[ca.Function, ca.Function]:
    """(x, u, t, p) -> L, its gradient by x and u, second derivatives, of ``count`` points; (x, T, p) -> of Psi.

    Those of Psi are Psi_T, its gradient by x, second derivatives, and Psi itself.
    """
    along, at_end = problem.running_cost.sx_in(), problem.terminal_cost.sx_in()
    L, Psi = problem.running_cost(*along), problem.terminal_cost(*at_end)
    v = ca.vertcat(along[0], along[1])
    of_running = ca.vertcat(L, ca.gradient(L, v), _own_curvature(L, v))
    by_T, by_x = ca.gradient(Psi, at_end[1]), ca.gradient(Psi, at_end[0])
    of_terminal = ca.vertcat(by_T, by_x, _own_curvature(Psi, at_end[0]), Psi)
    return (
        ca.Function("running", along, [ca.densify(of_running)]).map(count),
        ca.Function("terminal", at_end, [ca.densify(of_terminal)]),
    )


def _own_curvature(rows: ca.SX, by: ca.SX) -> ca.SX:
    """Second derivatives (m, n) of rows (m,) by each unknown; (n,) of a single one."""
    columns = []
    for each in ca.vertsplit(by):
        columns.append(ca.jacobian(ca.jacobian(rows, each), each))
    made = ca.horzcat(ca.SX(rows.numel(), 0), *columns)
    return made.T if rows.numel() == 1 else made


def _change(slopes: Array, curvatures: Array, scales: Array) -> Array:
    """Change by an unknown that moves by its scale."""
    changed: Array = np.abs(slopes) * scales + 0.5 * np.abs(curvatures) * scales**2
    return changed


def _row_slopes(function: ca.Function, arguments: list[ca.SX], by: ca.SX) -> ca.Function:
    """(rows, 2 n): Jacobian of a function of these arguments, then its second derivatives by each unknown."""
    rows = function(*arguments)
    curvatures = ca.reshape(_own_curvature(rows, by), rows.numel(), by.numel())
    return ca.Function("slopes", arguments, [ca.densify(ca.horzcat(ca.jacobian(rows, by), curvatures))])


def _row_scales(found: Array, count: int, sizes: Array, scales: Array, limits: Interval) -> Array:
    """Scales (m,) of rows.

    Args:
        found: (m, 2 n count) ``_row_slopes`` at each of ``count`` points, side by side.
        count: number of points.
        sizes: (n,) typical moves of the unknowns.
        scales: (n,) their scales.
        limits: (m,) limits of the rows.
    """
    slopes, curvatures = np.split(found.reshape(len(limits.lower), count, 2 * len(scales)), 2, axis=2)
    made = np.ones(len(slopes))
    for k, (lower, upper) in enumerate(zip(*limits, strict=True)):
        limit = _nearer_limit(lower, upper)
        size = max(limit, _largest([np.abs(slopes[k]) * sizes]))
        if size < _ORDINARY_ROW[0]:
            size = max(limit, _largest([_change(slopes[k], curvatures[k], scales)]))
            size = min(size, _ORDINARY_ROW[0])
        made[k] = _power_of_ten(size, _ORDINARY_ROW)
    return made


def _nearer_limit(lower: float, upper: float) -> float:
    """The lesser magnitude of two limits, 0 for none: the other may stand for no limit."""
    return min((abs(side) for side in (lower, upper) if np.isfinite(side) and side), default=0.0)


def _control_sizes(problem: ProblemFunctions) -> Array:
    """Typical moves (nu,) of the controls: as large as guessed, for limits may be far from any solution."""
    guessed = np.abs(problem.guess_controls).max(axis=0, initial=0.0)
    sizes: Array = np.where(guessed > _GUESSED * problem.control_scale, guessed, problem.control_scale)
    return sizes


def _largest(changes: Sequence[Array]) -> float:
    """The largest of what is finite, 0 for nothing."""
    return max((float(each[np.isfinite(each)].max(initial=0.0)) for each in changes), default=0.0)


def _power_of_ten(size: float, ordinary: tuple[float, float]) -> float:
    """The power of ten of a size; 1 where it is ordinary, or 0."""
    if size <= 0.0 or ordinary[0] <= size <= ordinary[1]:
        return 1.0
    return float(10.0 ** np.round(np.log10(size)))
