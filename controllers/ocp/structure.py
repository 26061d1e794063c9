"""Structure of a solution: the arcs on which each control rests on a bound, and where constraints become (in)active.

Read from a solution that may be coarse. A control that enters linearly jumps between its bounds, or leaves them on a
singular arc; another one has a kink where it reaches a bound. Both need a node there (see ``arcs``), as do the ends of
an arc on a path constraint or on the bound of a state. Such a limit on states alone is of first order where its rate
has a linear control in it: it has its own arc, on which it holds with equality and determines the control. A
bound counts as active only where its multiplier confirms it: on a singular arc, where a coarse control rings between
its bounds, it does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.ocp.clocks import clocks_of
from mathnavi.controllers.ocp.layout import bounded_states, mixed_constraints
from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.scaling_rows import with_ordinary_rows
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.interfaces.signals import Array, Integers

_AT_BOUND = 1e-3  # distance, over the range, that counts as resting on a control's bound
_TOUCHING = 1e-5  # scaled distance to the limit of a constraint or of a state
_WEAK = 1e-3  # of its largest value: a limit with a smaller multiplier is not active
_DRAWS = 3  # of points in general position
_ARC = 3  # points at which a constraint on states alone holds, of an arc and not of a touch
_MOSTLY = 0.5  # of these points, a control is free
_SAME = 1e-3  # [of the mean interval] boundaries that are as near are one


@dataclass(frozen=True, eq=False)
class Structure:
    """Boundaries (A - 1,) between arcs, fractions of T, and the bound that holds each control on each arc.

    ``edges`` are the fractions of T at which a constraint on the states alone begins or ends to hold. They are no
    boundaries, unless it is of first order and held there: an unknown node would move to where the constraint, which
    holds at points, can be overrun.
    """

    boundaries: Array
    held: Integers  # (A, nu + nd + nb) controls, path constraints and bounded states: -1 the lower limit, 1 the upper
    edges: Array

    def __len__(self) -> int:
        return len(self.held)

    def limits(self, problem: ProblemFunctions, *, determined: bool = False) -> tuple[Interval, Interval, Interval]:
        """Limits of controls (A, nu), path constraints (A, nd) and bounded states (A, nb), equal where held.

        With ``determined``, controls have no bounds where constraints on states alone determine them, as many as there
        are controls in their rates: near a solution, further bounds keep a solver from it.
        """
        own, path, states = np.split(self.held, [problem.nu, problem.nu + len(problem.path_bounds.lower)], axis=1)
        bounded, controls = bounded_states(problem), _held_to(own, problem.control_bounds)
        if determined:
            first_order = first_order_constraints(problem)
            followed = (np.hstack([path, states]) != 0) & first_order.any(axis=1)
            entering = (followed @ first_order) & (own == 0)
            entering &= entering.sum(axis=1, keepdims=True) <= followed.sum(axis=1, keepdims=True)
            lower, upper = controls
            controls = Interval(np.where(entering, -np.inf, lower), np.where(entering, np.inf, upper))
        return (
            controls,
            _held_to(path, problem.path_bounds),
            _held_to(states, _selected(problem.state_bounds, bounded)),
        )

    def without_arcs_below(self, length: float) -> Structure:
        """The structure without arcs shorter than ``length``, a fraction of T; neighbours that are equal become one."""
        ends = np.concatenate([[0.0], self.boundaries, [1.0]])
        boundaries: list[float] = []
        held: list[Integers] = []
        for start, end, own in zip(ends[:-1], ends[1:], self.held, strict=True):
            if end - start < length or (held and np.array_equal(held[-1], own)):
                continue
            if held:
                boundaries.append(start)
            held.append(own)
        return Structure(np.array(boundaries), np.array(held), self.edges)

    def same(self, other: Structure) -> bool:
        """True if the arcs of both hold the same controls in the same order."""
        return np.array_equal(self.held, other.held)


def _held_to(held: Integers, bounds: Interval) -> Interval:
    """Limits (A, n) on each arc of what is held (A, n) at its lower limit (-1), at its upper one (1), or free (0)."""
    lower, upper = bounds
    return Interval(np.where(held > 0, upper, lower), np.where(held < 0, lower, upper))


def structure(solution: Solution) -> Structure:
    """Structure of a solution."""
    solution = with_ordinary_rows(solution)
    problem, k, nodes = solution.problem, len(solution.scheme.points), solution.grid.nodes
    tau, multipliers = (solution.point_times / solution.duration).ravel(), solution.multipliers
    linear, path = linear_controls(problem), _path_values(solution)
    mixed, of_controls = switching_constraints(problem), mixed_constraints(problem)
    pure = _active_constraints(solution, path, mixed)
    overlaid = np.any(pure, axis=0) if pure else np.zeros(len(tau), dtype=bool)
    nowhere = np.zeros(len(tau), dtype=bool)
    codes = list[tuple[Integers, Array]]()
    nothing = np.zeros(1, dtype=np.int64), np.empty(0)
    rates = {clock.rate for clock in clocks_of(problem)}
    first_order, followed = first_order_constraints(problem), _followed(solution, path)
    for j in range(problem.nu):
        if j in rates:
            codes.append(nothing)
            continue
        resting = nowhere.copy()
        for own, code in zip(first_order, followed, strict=True):
            resting |= own[j] & (code != 0)
        bounds = problem.control_bounds.lower[j], problem.control_bounds.upper[j]
        values, multiplier = solution.u[:, :, j].ravel(), multipliers.controls.values[:, :, j].ravel()
        scale = problem.control_scale[j]
        code, last = _runs_held(values, multiplier, bounds, scale, overlaid, resting, linear=bool(linear[j]), k=k)
        codes.append((code, _between(tau, last, nodes)))
    for j in range(path.shape[1]):
        bounds = problem.path_bounds.lower[j], problem.path_bounds.upper[j]
        code, last = np.zeros(1, dtype=np.int64), np.empty(0, dtype=np.int64)
        if mixed[j] and bounds[0] < bounds[1]:
            code, last = _runs_held(
                path[:, j], multipliers.path.values[:, :, j].ravel(), bounds, 1.0, overlaid, nowhere,
                linear=False, k=k,
            )  # fmt: skip
        elif j in of_controls and bounds[0] < bounds[1]:
            code, last = _held_throughout(path[:, j], multipliers.path.values[:, :, j].ravel(), bounds)
        if followed[j].any():
            _, ends, code = _runs(followed[j])
            last = ends[:-1] - 1
        codes.append((code, _between(tau, last, nodes)))
    for on_state in followed[path.shape[1] :]:
        _, ends, code = _runs(on_state)
        codes.append((code, _between(tau, ends[:-1] - 1, nodes)))
    boundaries = _apart(np.concatenate([*(switches for _, switches in codes), np.empty(0)]), solution.nodes)
    edges = [_edges(tau, active, nodes) for active in pure]
    held = _held(codes, 0.5 * (np.append(0.0, boundaries) + np.append(boundaries, 1.0)))
    return Structure(boundaries, held, np.sort(np.concatenate([*edges, np.empty(0)])))


@lru_cache(maxsize=64)
def switching_constraints(problem: ProblemFunctions) -> NDArray[np.bool_]:
    """Path constraints (nd,) on controls that all enter linearly: they hold like bounds of these controls.

    Of a control that does not, a constraint makes a kink where it begins to hold, and that moves as smoothly as it.
    """
    depends = np.array(ca.DM(problem.path.jac_sparsity(0, 1), 1.0).full(), dtype=bool)
    depends = depends.reshape(len(problem.path_bounds.lower), problem.nu)
    return np.asarray(depends.any(axis=1) & ~depends[:, ~linear_controls(problem)].any(axis=1))


@lru_cache(maxsize=64)
def first_order_constraints(problem: ProblemFunctions) -> NDArray[np.bool_]:
    """(nd + nb, nu) True where a path constraint on states alone, or a bounded state, has a rate that a control enters.

    Only controls that enter linearly.
    """
    x, u, t, p = problem.dynamics.sx_in()
    held, linear = ca.vertcat(problem.path(x, u, t, p), x[bounded_states(problem), :]), linear_controls(problem)
    rate = ca.jtimes(held, x, problem.dynamics(x, u, t, p))
    enters = np.array(ca.DM(ca.jacobian_sparsity(rate, u), 1.0).full(), dtype=bool).reshape(held.numel(), problem.nu)
    mixed = np.array(ca.DM(ca.jacobian_sparsity(held, u), 1.0).full(), dtype=bool).reshape(enters.shape)
    pure = ~mixed.any(axis=1, keepdims=True)
    return np.asarray(enters & linear & pure)


def without_structure(problem: ProblemFunctions) -> Structure:
    """Structure of a single arc, without active bounds."""
    held = np.zeros((1, problem.nu + len(problem.path_bounds.lower) + len(bounded_states(problem))), dtype=np.int64)
    return Structure(np.empty(0), held, np.empty(0))


def _apart(boundaries: Array, nodes: int) -> Array:
    """Boundaries inside ]0, 1[ in order, without those that are equal to rounding."""
    near = _SAME / (nodes - 1)
    inside = np.sort(boundaries[(boundaries > near) & (boundaries < 1.0 - near)])
    return inside[np.append(True, np.diff(inside) > near)] if len(inside) else inside


def _held(codes: list[tuple[Integers, Array]], at: Array) -> Integers:
    """Codes (n, ·) of what is held at fractions (n,) of T, from the runs of each and the boundaries between them."""
    columns = [code[np.searchsorted(switches, at)] for code, switches in codes]
    return np.array(columns, dtype=np.int64).reshape(len(codes), len(at)).T


@lru_cache(maxsize=64)
def linear_controls(problem: ProblemFunctions) -> NDArray[np.bool_]:
    """Controls (nu,) that enter dynamics and running cost linearly, and no path constraint otherwise.

    The rates of clocks do not count: they are constants of arcs.
    """
    x, u, t, p = problem.dynamics.sx_in()
    outputs = ca.vertcat(problem.dynamics(x, u, t, p), problem.running_cost(x, u, t, p), problem.path(x, u, t, p))
    slopes = ca.jacobian(outputs, u)
    own = [ca.vec(slopes[:, j]) for j in range(problem.nu)]
    linear = np.array([_is_constant(each, u[j], [x, u, t, p]) for j, each in enumerate(own)], dtype=bool)
    linear[[clock.rate for clock in clocks_of(problem)]] = False
    return linear


def _is_constant(slopes: ca.SX, control: ca.SX, known: list[ca.SX]) -> bool:
    """True if slopes (n,) do not depend on a control ().

    Where they call a function, of a table for one, CasADi keeps its derivative in the direction of what it does not
    depend on, which looks like a dependence and is zero: there it is evaluated at some points in general position.
    """
    if not ca.depends_on(slopes, control):
        return True
    curvature = ca.Function("curvature", known, [ca.jacobian(slopes, control)])
    if ca.OP_CALL not in {curvature.instruction_id(k) for k in range(curvature.n_instructions())}:
        return False
    drawn = np.random.default_rng(0)
    points = [[drawn.uniform(0.1, 2.0, symbols.numel()) for symbols in known] for _ in range(_DRAWS)]
    return all((curvature(*point).full() == 0.0).all() for point in points)


def _runs_held(
    u: Array,
    multiplier: Array,
    bounds: tuple[float, float],
    scale: float,
    overlaid: NDArray[np.bool_],
    resting: NDArray[np.bool_],
    *,
    linear: bool,
    k: int,
) -> tuple[Integers, Integers]:
    """Codes (r,) of the runs of one control or constraint, and the last points (r - 1,) of all but the last run.

    Where a constraint on the states is ``overlaid`` (points,), the multipliers of both are not unique, and say nothing.
    Where one determines the control (``resting``), that is free up to the ends of this arc.
    """
    lower, upper = bounds
    extent = upper - lower if np.isfinite(upper - lower) else scale
    code = np.where(u >= upper - _AT_BOUND * extent, 1, np.where(u <= lower + _AT_BOUND * extent, -1, 0))
    weak = _WEAK * np.abs(multiplier).max(initial=0.0)
    code[(code * multiplier < -weak) & ~overlaid] = 0  # a multiplier of the wrong sign
    code[resting] = 0
    starts, ends, values = _runs(code)
    # A run of one interval or less whose multiplier is weak, or of the wrong sign, does not rest on its bound.
    for start, end, value in zip(starts, ends, values, strict=True):
        if value and (value * multiplier[start:end]).max() <= weak and not overlaid[start:end].any():
            code[start:end] = 0
    if linear:
        _calm(code, k + 1)
    starts, ends, values = _runs(code)
    if linear:
        for n, (start, end, value) in enumerate(zip(starts, ends, values, strict=True)):
            before, after = values[n - 1] if n else 0, values[n + 1] if n + 1 < len(values) else 0
            if value == 0 and end - start <= k + 1 and (before or after):
                if before and after and before != after:  # a jump inside the run: where the area is that of the control
                    share = (u[start:end].mean() - lower) / extent
                    count = round((share if before > 0 else 1.0 - share) * (end - start))
                    code[start : start + count], code[start + count : end] = before, after
                elif np.abs(u[start:end] - (upper if (before or after) > 0 else lower)).mean() < 0.1 * extent:
                    code[start:end] = before or after
        starts, ends, values = _runs(code)
    else:
        for start, end, value in zip(starts, ends, values, strict=True):
            if value and end - start < 2:
                code[start:end] = 0
        starts, ends, values = _runs(code)
    if resting.any():
        code[resting] = 0
        for start, end, value in zip(*_runs(code), strict=True):
            among = start + np.flatnonzero(resting[start:end])
            if value == 0 and len(among):
                if start and among[0] - start <= k + 1:
                    code[start : among[0]] = code[start - 1]
                if end < len(code) and end - 1 - among[-1] <= k + 1:
                    code[among[-1] + 1 : end] = code[end]
        starts, ends, values = _runs(code)
    return values, ends[:-1] - 1


def _held_throughout(values: Array, multiplier: Array, bounds: tuple[float, float]) -> tuple[Integers, Integers]:
    """Code (1,) of a nonlinear constraint on controls: its limit if it is active at all points, otherwise 0.

    The second result, the ends of runs, is empty. As an inequality it is solved with a barrier, whose last value leaves
    the controls uncertain along the limit by its square root: a thrust of full size wavers about its direction.
    """
    lower, upper = bounds
    extent = upper - lower if np.isfinite(upper - lower) else 1.0
    for code, distance in ((1, upper - values), (-1, values - lower)):
        if (distance <= _AT_BOUND * extent).all() and (code * multiplier > 0.0).all():
            return np.array([code], dtype=np.int64), np.empty(0, dtype=np.int64)
    return np.zeros(1, dtype=np.int64), np.empty(0, dtype=np.int64)


def _touched(values: Array, multiplier: Array, limits: Interval, free: NDArray[np.bool_], weak: float) -> Integers:
    """Codes (points,) of a constraint on states alone: where it holds with a multiplier, at three points in a row.

    One point between two others may be off the limit: a coarse solution is bent there. A constraint determines a
    control only where one is ``free`` (points, ·): where each rests on its own bound, that is what is held.
    """
    lower, upper = limits
    code = np.where(upper - values <= _TOUCHING, 1, np.where(values - lower <= _TOUCHING, -1, 0)).astype(np.int64)
    bridged = (code[1:-1] == 0) & (code[:-2] == code[2:])
    code[1:-1][bridged] = code[:-2][bridged]
    for start, end, value in zip(*_runs(code), strict=True):
        determines = free[start:end].any(axis=1).mean() >= _MOSTLY
        if value and (end - start < _ARC or value * multiplier[start:end].sum() <= weak or not determines):
            code[start:end] = 0
    return code


def _calm(code: Integers, short: int) -> None:
    """Free a control where it rings: three or more runs in a row of at most ``short`` points, one at either bound."""
    starts, ends, values = _runs(code)
    brief = np.concatenate([ends - starts <= short, [False]])
    first = 0
    for n, is_brief in enumerate(brief):
        if is_brief:
            continue
        among = set(values[first:n].tolist())
        if n - first >= 3 and {-1, 1} <= among:
            code[starts[first] : ends[n - 1]] = 0
        first = n + 1


def _between(tau: Array, last: Integers, nodes: Array) -> Array:
    """Fractions of T between each ``last`` point and the next one: a node where there is one, or the middle."""
    node = nodes[np.clip(np.searchsorted(nodes, tau[last] - 1e-12), 0, len(nodes) - 1)]
    return np.where(node < tau[last + 1], node, 0.5 * (tau[last] + tau[last + 1]))


def _active_constraints(solution: Solution, path: Array, mixed: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """Activity (points,) of each bound of a state, and each constraint on states alone, that is felt somewhere.

    ``path`` (points, nd) are the values of the path constraints, ``mixed`` (nd,) marks those that hold like bounds of
    controls.
    """
    problem, duals = solution.problem, solution.multipliers
    x = solution.inner.reshape(-1, problem.nx)
    weak = _WEAK * max(abs(solution.cost), _WEAK) / solution.duration
    found = []
    pure = ~mixed
    for values, (lower, upper), scale, multipliers in (
        (x, problem.state_bounds, problem.state_scale, duals.states.values),
        (path[:, pure], _selected(problem.path_bounds, pure), np.ones(1), duals.path.values[:, :, pure]),
    ):
        felt = np.abs(multipliers.reshape(len(x), -1)) * scale > weak
        for touched in (values - lower <= _TOUCHING * scale, upper - values <= _TOUCHING * scale):
            found += [
                column
                for column, strong, fixed in zip(touched.T, felt.T, lower == upper, strict=True)
                if not fixed and (column & strong).any()
            ]
    return found


def _followed(solution: Solution, path: Array) -> list[Integers]:
    """Codes (points,) of each path constraint, then of each bounded state, where one of first order is followed."""
    problem, duals, bounded = solution.problem, solution.multipliers, bounded_states(solution.problem)
    weak = _WEAK * max(abs(solution.cost), _WEAK) / solution.duration
    scale, points = problem.state_scale[bounded], len(path)
    values = np.hstack([path, solution.inner.reshape(points, -1)[:, bounded] / scale])
    multipliers = np.hstack(
        [duals.path.values.reshape(points, -1), duals.states.values.reshape(points, -1)[:, bounded] * scale]
    )
    own = _selected(problem.state_bounds, bounded)
    sides = (np.append(side, other / scale) for side, other in zip(problem.path_bounds, own, strict=True))
    limits, first_order = Interval(*sides), first_order_constraints(problem)
    lower, upper = problem.control_bounds
    near = _AT_BOUND * np.where(np.isfinite(upper - lower), upper - lower, problem.control_scale)
    u = solution.u.reshape(points, problem.nu)
    free = (u > lower + near) & (u < upper - near)
    return [
        _touched(values[:, j], multipliers[:, j], Interval(limits.lower[j], limits.upper[j]), free[:, own], weak)
        if own.any() and limits.lower[j] < limits.upper[j]
        else np.zeros(points, dtype=np.int64)
        for j, own in enumerate(first_order)
    ]


def _selected(limits: Interval, chosen: NDArray[np.bool_] | list[int]) -> Interval:
    return Interval(limits.lower[chosen], limits.upper[chosen])


def _path_values(solution: Solution) -> Array:
    """Values (points, nd) of the path constraints at the scheme's points."""
    problem, t = solution.problem, solution.point_times.ravel()
    x, u = solution.inner.reshape(len(t), problem.nx), solution.u.reshape(len(t), problem.nu)
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    return np.array(problem.path.map(len(t))(x.T, u.T, t[None, :], p).full().T)


def _edges(tau: Array, active: NDArray[np.bool_], nodes: Array) -> Array:
    """Fractions of T at which a constraint begins or ends to hold; the one point of a touch."""
    starts, ends, values = _runs(active.astype(np.int64))
    last, touches = [], []
    for start, end, value in zip(starts, ends, values, strict=True):
        if value and end - start > 1:
            last += ([start - 1] if start else []) + ([end - 1] if end < len(tau) else [])
        elif value and 0 < start < len(tau) - 1:
            touches.append(tau[start])
    return np.concatenate([_between(tau, np.array(last, dtype=np.int64), nodes), touches])


def _runs(code: Integers) -> tuple[Integers, Integers, Integers]:
    """First index, index behind the last, and value of each run of equal values."""
    edges = np.flatnonzero(np.diff(code)) + 1
    starts = np.concatenate([[0], edges]).astype(np.int64)
    return starts, np.concatenate([edges, [len(code)]]).astype(np.int64), code[starts]
