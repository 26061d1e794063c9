"""Proof from the elastic multipliers that a problem with affine constraints has no feasible point.

Let ν be multipliers of the conditions at the end, m_k those of bounds and path constraints of the states at times t_k
and π(t) densities of those of the path constraints that depend on a control, each of the sign of its limit. With every
feasible x and u,

    φ = ν'(s(x(T)) - limit) + Σ_k m_k (c(x(t_k)) - limit) + ∫ π'(d(x, u, t) - limit) dt  <=  0.

Where these and the dynamics x' = A x + B u + c are affine, and T is known, the adjoint

    λ(T) = s_x'ν,      -λ' = A'λ + d_x'π,      λ(t_k-) = λ(t_k+) + c_x'm_k

takes the states out of φ: what remains is λ(0)'x(0), whose least value under the conditions at the start is a linear
programme, and ∫ (B'λ + d_u'π)'u, whose least value the bounds of u give pointwise. A sum above zero is a proof
(Farkas), for all controls and not only those of a transcription: the multipliers may come from anywhere. Equations of
states that do not come into φ need not be affine.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.optimize import linprog

from mathnavi.controllers.ocp.call import check
from mathnavi.controllers.ocp.feasibility.intervals import enclosed, point
from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.interfaces.signals import Array, Integers

_SMALL = 1e-6  # multipliers below this share of the largest are left out
_ROUNDING = 1e-9  # share of the largest slope that a control or a state without limits may have
_STEPS, _MOST_STEPS = 2, 1000  # of the integration between two points
_NO_POINT = 2  # status of a linear programme that is infeasible
_PIECES, _VARIATION = 400, 0.05  # parts of [0, T], and what affine rows may vary within one, over their largest value
_SHARE = 0.01  # of the elastic violation that φ exceeds
_QUADRATURE = 1e-4  # share of the parts of φ that their integration may be wrong by


def affinely_infeasible(elastic: Solution, violation: float) -> bool:
    """True if the multipliers of an elastic solution prove that its problem has no feasible point.

    Args:
        elastic: solution of the elastic programme, with its multipliers.
        violation: weighted sum of the violations there, > 0.
    """
    problem = elastic.problem
    if not problem.nx:
        return False
    if _least_start(problem, _shape(problem), np.zeros(problem.nx), elastic.parameters) == np.inf:
        return True
    if problem.free_duration:
        return False
    chosen = _chosen(elastic)
    if chosen is None:
        return False
    with np.errstate(all="ignore"):
        value, size = _least(problem, elastic, chosen)
    return bool(value > max(_SHARE * violation, _QUADRATURE * size))


class _Shape(NamedTuple):
    """Structure of a problem: where functions are affine in states and controls, and on which states they depend."""

    dynamics: tuple[bool, ...]  # nx
    path: tuple[bool, ...]  # nd
    initial: tuple[bool, ...]  # ni
    final: tuple[bool, ...]  # ns
    mixed: tuple[bool, ...]  # nd, True if it depends on a control
    jacobians: ca.Function  # (x, u, t, p) -> f, f_x, f_u, d, d_x, d_u
    column: ca.Function  # the same values below each other
    timed: tuple[bool, ...]  # nx + nd, True for rows of f and d that depend on t
    ends: ca.Function  # (x, T, p) -> s, s_x
    starts: ca.Function  # (x, p) -> i, i_x


@lru_cache(maxsize=16)
def _shape(problem: ProblemFunctions) -> _Shape:
    x, u, t, p = problem.dynamics.sx_in()
    both = ca.vertcat(x, u)
    f, d = problem.dynamics(x, u, t, p), problem.path(x, u, t, p)
    final, initial = problem.final(x, t, p), problem.initial(x, p)

    def affine(rows: ca.SX, variables: ca.SX) -> tuple[bool, ...]:
        return tuple(not bent for bent in ca.which_depends(rows, variables, 2, True)) if rows.numel() else ()

    along = [ca.densify(each) for g in (f, d) for each in (g, ca.jacobian(g, x), ca.jacobian(g, u))]
    return _Shape(
        affine(f, both),
        affine(d, both),
        affine(initial, x),
        affine(final, x),
        tuple(ca.which_depends(d, u, 1, True)) if d.numel() and u.numel() else (False,) * d.numel(),
        ca.Function("along", [x, u, t, p], along),
        ca.Function("column", [x, u, t, p], [ca.vertcat(*(ca.vec(each) for each in along))]),
        tuple(ca.which_depends(ca.vertcat(f, d), t, 1, True)),
        ca.Function("ends", [x, t, p], [ca.densify(final), ca.densify(ca.jacobian(final, x))]),
        ca.Function("starts", [x, p], [ca.densify(initial), ca.densify(ca.jacobian(initial, x))]),
    )


class _Chosen(NamedTuple):
    """Multipliers that come into φ, with the limits that they belong to; 0 for the others."""

    final: Array  # (ns,) ν
    final_limits: Array  # (ns,)
    times: Array  # (K,) [s] t_k, increasing
    shares: Array  # (K,) [s] time that each stands for
    states: Array  # (K, nx) m of the bounds of the states
    state_limits: Array  # (K, nx)
    path: Array  # (K, nd) m of path constraints, of those with a control their densities π
    path_limits: Array  # (K, nd)


def _chosen(elastic: Solution) -> _Chosen | None:
    """The multipliers of an elastic solution, if what they belong to and lead to is affine."""
    problem, shape, many = elastic.problem, _shape(elastic.problem), elastic.multipliers
    shares = elastic.point_shares.ravel()
    own = shares > 0.0
    mass = shares[:, None]
    final = many.final.values
    states = many.states.values.reshape(len(shares), -1) * mass
    path = many.path.values.reshape(len(shares), -1) * mass
    most = max((np.abs(each).max(initial=0.0) for each in (final, states, path)), default=0.0)
    parts = []
    for values, limits in ((final, problem.final_bounds), (states, problem.state_bounds), (path, problem.path_bounds)):
        limit = np.where(values > 0.0, limits.upper, limits.lower)
        used = (np.abs(values) > _SMALL * most) & np.isfinite(limit)
        parts += [np.where(used, values, 0.0), np.where(used, limit, 0.0)]
    used_path, used_final = (parts[4] != 0.0).any(axis=0), parts[0] != 0.0
    if any(use and not is_affine for use, is_affine in zip(used_path, shape.path, strict=True)):
        return None
    if any(use and not is_affine for use, is_affine in zip(used_final, shape.final, strict=True)):
        return None
    involved = _involved(problem, used_final, used_path, (parts[2] != 0.0).any(axis=0))
    if not all(shape.dynamics[i] for i in involved) or not _resolved(elastic, [*involved], np.flatnonzero(used_path)):
        return None
    mixed = np.array(shape.mixed, bool)
    parts[4] = np.where(mixed, parts[4] / np.where(own, shares, 1.0)[:, None], parts[4])
    order = np.argsort(elastic.point_times.ravel()[own], kind="stable")
    along = [each[own][order] for each in parts[2:]]
    return _Chosen(parts[0], parts[1], elastic.point_times.ravel()[own][order], shares[own][order], *along)


def _involved(problem: ProblemFunctions, final: Array, path: Array, states: Array) -> set[int]:
    """Indices of all states that λ comes to."""
    involved = set(np.flatnonzero(states).tolist())
    for used, pattern in ((final, problem.final), (path, problem.path)):
        rows, columns = pattern.jac_sparsity(0, 0).get_triplet()
        involved |= {column for row, column in zip(rows, columns, strict=True) if used[row]}
    rows, columns = problem.dynamics.jac_sparsity(0, 0).get_triplet()
    while True:
        following = involved | {column for row, column in zip(rows, columns, strict=True) if row in involved}
        if following == involved:
            return involved
        involved = following


def _resolved(elastic: Solution, states: list[int], path: Integers) -> bool:
    """True if what rows of f and d vary with time shows in the steps of an integration: no pulse is passed over."""
    problem, shape = elastic.problem, _shape(elastic.problem)
    nx, nu, nd = problem.nx, problem.nu, len(problem.path_names)
    rows = [i for i in (*states, *(nx + path)) if shape.timed[i]]
    if not rows:
        return True
    edges = np.linspace(0.0, elastic.duration, _PIECES + 1)[None, :]
    fixed = (problem.guess_states[0], problem.guess_controls[0])
    boxes = [point(each, _PIECES) for each in fixed]
    boxes += [Interval(edges[:, :-1], edges[:, 1:]), point(elastic.parameters, _PIECES)]
    lower, upper = enclosed(shape.column, boxes)
    of_f, of_d = np.arange(nx), nx + np.arange(nd)
    owner = np.concatenate([np.tile(of_f, 1 + nx + nu), np.tile(of_d, 1 + nx + nu)])  # row of each value, by columns
    own = np.isin(owner, rows)
    largest = np.maximum(np.abs(lower), np.abs(upper))[own].max(axis=1)
    return bool((np.isfinite(largest)[:, None] & ((upper - lower)[own] <= _VARIATION * largest[:, None])).all())


def _least(problem: ProblemFunctions, elastic: Solution, chosen: _Chosen) -> tuple[float, float]:
    """Least value of φ over all x(0) and u within their limits, and the sum of the sizes of its parts."""
    shape, T, p = _shape(problem), elastic.duration, elastic.parameters
    x_0, u_0 = problem.guess_states[0], problem.guess_controls[0]
    s, s_x = (np.array(each.full()) for each in shape.ends(x_0, T, p))
    lam = s_x.T @ chosen.final
    phi = float(chosen.final @ (s[:, 0] - s_x @ x_0 - chosen.final_limits))
    size, mixed, along = abs(phi), np.array(shape.mixed, bool), _Affine(shape, x_0, u_0, p, problem.control_scale)
    cells = np.concatenate([[0.0], np.cumsum(chosen.shares)])  # a density holds where its point stands for the time
    cells *= T / cells[-1]
    stops = np.unique(np.clip(np.concatenate([cells, chosen.times]), 0.0, T))[::-1]
    for now, until in zip(stops, np.append(stops[1:], 0.0), strict=True):
        for k in np.flatnonzero(chosen.times == now):
            added, slope = along.at(now, np.where(mixed, 0.0, chosen.path[k]), chosen.path_limits[k])
            added -= float(chosen.states[k] @ chosen.state_limits[k])
            lam, phi, size = lam + slope + chosen.states[k], phi + added, size + abs(added)
        if until < now:
            after = int(np.searchsorted(cells, 0.5 * (now + until), side="right"))
            cell = min(after, len(chosen.times)) - 1
            pi = np.where(mixed, chosen.path[cell], 0.0)
            lam, gained, turned = along.back(lam, now, until, pi, chosen.path_limits[cell], problem.control_bounds)
            phi, size = phi + gained, size + turned
    if not np.isfinite(lam).all():
        return -np.inf, np.inf
    start = _least_start(problem, shape, lam, p)
    return (phi + start, size + abs(start)) if np.isfinite(phi + start) else (-np.inf, np.inf)


class _Affine:
    """x' = A x + B u + c and d = D_x x + D_u u + d_0 as functions of time."""

    def __init__(self, shape: _Shape, x_0: Array, u_0: Array, p: Array, scale: Array) -> None:
        self._jacobians, self._x, self._u, self._p, self._scale = shape.jacobians, x_0, u_0, p, scale

    def _values(self, t: float) -> tuple[Array, ...]:
        """A, B, c, D_x, D_u, d_0 at a time [s]; 0 where a row is not finite, for it is not among those that count."""
        found = [np.array(each.full()) for each in self._jacobians(self._x, self._u, t, self._p)]
        f, A, B, d, D_x, D_u = (np.where(np.isfinite(each), each, 0.0) for each in found)
        c, d_0 = f[:, 0] - A @ self._x - B @ self._u, d[:, 0] - D_x @ self._x - D_u @ self._u
        return A, B, c, D_x, D_u, d_0

    def at(self, t: float, m: Array, limits: Array) -> tuple[float, Array]:
        """Parts of φ and of λ (nx,) that path constraints of the states with multipliers m (nd,) add at a time."""
        _, _, _, D_x, _, d_0 = self._values(t)
        return float(m @ (d_0 - limits)), D_x.T @ m

    def back(
        self, lam: Array, t_1: float, t_0: float, pi: Array, limits: Array, bounds: Interval
    ) -> tuple[Array, float, float]:
        """λ (nx,) from t_1 back to t_0 [s], what φ gains, and the size of it, by Runge-Kutta's method."""
        A = self._values(t_1)[0]
        steps = _STEPS + 4.0 * float(np.abs(A).sum(axis=1).max(initial=0.0)) * (t_1 - t_0)
        if not steps <= _MOST_STEPS:
            return np.full_like(lam, np.nan), np.nan, np.nan
        steps = int(np.ceil(steps))
        h, gained, size = (t_1 - t_0) / steps, 0.0, 0.0

        def slopes(at: tuple[Array, ...], y: Array) -> tuple[Array, float, float]:
            A, B, c, D_x, D_u, d_0 = at
            constant = float(y @ c + pi @ (d_0 - limits))
            least = _least_product(B.T @ y + D_u.T @ pi, bounds, self._scale)
            return A.T @ y + D_x.T @ pi, constant + least, abs(constant) + abs(least)

        at_end = self._values(t_1)
        for k in range(steps):
            check()
            t = t_1 - k * h
            middle, at_start = self._values(t - 0.5 * h), self._values(t - h)
            first = slopes(at_end, lam)
            second = slopes(middle, lam + 0.5 * h * first[0])
            third = slopes(middle, lam + 0.5 * h * second[0])
            fourth = slopes(at_start, lam + h * third[0])
            lam = lam + h / 6.0 * (first[0] + 2.0 * second[0] + 2.0 * third[0] + fourth[0])
            gained += h / 6.0 * (first[1] + 2.0 * second[1] + 2.0 * third[1] + fourth[1])
            size += h * first[2]
            at_end = at_start
        return lam, gained, size


def _least_product(slope: Array, bounds: Interval, scale: Array) -> float:
    """min slope'v over v within bounds; a slope that is 0 but for rounding has none."""
    slope = _without_rounding(slope, scale)
    products = np.where(slope > 0.0, slope * bounds.lower, slope * bounds.upper)
    return float(np.where(slope == 0.0, 0.0, products).sum())


def _without_rounding(slope: Array, scale: Array) -> Array:
    """Slopes, 0 where they are small for variables of these scales."""
    sizes = np.abs(slope) * scale
    return np.where(sizes <= _ROUNDING * sizes.max(initial=0.0), 0.0, slope)


def _least_start(problem: ProblemFunctions, shape: _Shape, lam: Array, p: Array) -> float:
    """min λ'x(0) under the affine conditions at the start and the bounds of the states.

    -inf where nothing bounds it, and inf where no x(0) meets all of them.
    """
    x_0 = problem.guess_states[0]
    i, i_x = (np.array(each.full()) for each in shape.starts(x_0, p))
    own: Integers = np.flatnonzero(np.array(shape.initial, bool) & np.isfinite(i_x).all(axis=1) & np.isfinite(i[:, 0]))
    offsets = i[own, 0] - i_x[own] @ x_0
    lower, upper = (side[own] - offsets for side in problem.initial_bounds)
    scale = problem.state_scale
    lam = _without_rounding(lam, scale)
    rows = i_x[own] * scale
    equal = lower == upper
    unequal = [(sign * rows[~equal], sign * side[~equal]) for sign, side in ((1.0, upper), (-1.0, lower))]
    A_ub, b_ub = (np.concatenate([each[k] for each in unequal]) for k in (0, 1))
    finite = np.isfinite(b_ub)
    found = linprog(
        lam * scale, A_ub=A_ub[finite], b_ub=b_ub[finite], A_eq=rows[equal], b_eq=lower[equal],
        bounds=np.column_stack([side / scale for side in problem.state_bounds]), method="highs",
    )  # fmt: skip
    return float(found.fun) if found.status == 0 else np.inf if found.status == _NO_POINT else -np.inf
