"""Replay of a solution: its control applied to the true dynamics, integrated to a tight tolerance.

A transcription knows its own error only at its nodes, and an optimiser that may move the nodes hides it there. So every
solution is replayed from x(0) with what its actuators can do: the control as the scheme interpolates it, saturated to
its bounds. The miss at the end, the violation on the way and the cost error are reported separately, and so is the
excess of the scheme's control over its bounds. Where a replay is ill-posed, because the linearised flow of the open
loop grows beyond 1e4, each interval is integrated from its own node instead, and the scaled defects are added up; the
miss of the flight in one piece is reported next to them.
Intervals inside which all is smooth are integrated together, others by an integrator with step-size control.

**Picard's iteration** on Gauss points integrates a solution's saturated control on all intervals at once.

The rates of each interval are a polynomial through 12 Gauss points. From those of the solution itself,

    x(t) = x_i + ∫ f(x, sat(u), t) dt,        x_{i+1} = x_i + d Σ_g b_g f_g,

is repeated over the whole flight until nothing changes: some evaluations of all points together, where an integrator
with step-size control takes thousands one after the other. What it found is taken only if between these points, at 13
others, it follows its dynamics as an integrator would, to 1e-10 in every interval; not where a control reaches a bound
inside an interval, for one.
"""

from __future__ import annotations

import dataclasses
import math
import time
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from mathnavi.controllers.ocp.call import check, kept
from mathnavi.controllers.ocp.crossings import not_smooth
from mathnavi.controllers.ocp.defects import Defects, defects
from mathnavi.controllers.ocp.diagnosis import not_finite
from mathnavi.controllers.ocp.feasibility.enclosure import pinned
from mathnavi.controllers.ocp.instants import instant_cost, instant_excess
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.scaling_rows import cost_scale, path_sizes
from mathnavi.controllers.ocp.solution import ReplayResult, Solution, SolverOutcome
from mathnavi.controllers.ocp.transcriptions.scheme import gauss_legendre, integral_weights, weights
from mathnavi.controllers.ocp.transcriptions.variable_radau import interval_weights, own_points
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import BufferedFunction

_POINTS = 12
_SWEEPS = 40
_SETTLED = 1e-13  # change of a sweep, in scaled states
_GROWN = 1e3  # times the first change: the iteration diverges


class Flight(NamedTuple):
    """Trajectory that was flown."""

    states: Array  # (N - 1, n, nx) at fractions of each interval, over the scales
    costs: Array  # (N - 1,) running cost gathered on each interval


def flight(solution: Solution, fractions: Array, tolerance: float, *, by_intervals: bool) -> Flight | None:
    """Flight of a solution's control at fractions (n,) of each interval; None where it is not within the tolerance.

    From x(0) or, ``by_intervals``, from the node of each interval.
    """
    problem, d = solution.problem, np.diff(solution.t)
    if len(solution.scheme.points) < 2:
        return None
    c, b, onwards = _gauss(_POINTS)
    scale, nodes = problem.state_scale, solution.x / problem.state_scale
    steps = d[:, None, None]
    rates = interval_weights(solution.scheme, c) @ solution.rates / scale
    at = _Evaluated(solution, c)
    starts, change, first = nodes[:-1], np.inf, None
    with np.errstate(all="ignore"):
        x = starts[:, None, :] + steps * np.einsum("gh,nhm->ngm", onwards, rates)
        for _ in range(_SWEEPS):
            rates, costs = at(x)
            if not by_intervals:
                gained = d[:, None] * np.einsum("g,ngm->nm", b, rates)
                starts = np.vstack([nodes[:1], nodes[0] + np.cumsum(gained, axis=0)[:-1]])
            following = starts[:, None, :] + steps * np.einsum("gh,nhm->ngm", onwards, rates)
            change = float(np.abs(following - x).max())
            x = following
            first = change if first is None else first
            if change <= _SETTLED * max(1.0, float(np.abs(x).max())):
                break
            if not change <= _GROWN * max(first, _SETTLED):  # NaN too
                return None
        else:
            return None
        between, share, _ = _gauss(_POINTS + 1)
        basis, to = weights(tuple(c.tolist()), between), integral_weights(tuple(c.tolist()), between)
        there = starts[:, None, :] + steps * np.einsum("gh,nhm->ngm", to, rates)
        own, running = _Evaluated(solution, between)(there)
        residual = np.abs(np.einsum("gh,nhm->ngm", basis, rates) - own).max(axis=2)
        residual += np.abs(costs @ basis.T - running) / max(1.0, abs(solution.cost))
    if not float((d * (residual @ share)).max()) <= tolerance:
        return None
    reached = integral_weights(tuple(c.tolist()), fractions)
    states = starts[:, None, :] + steps * np.einsum("gh,nhm->ngm", reached, rates)
    return Flight(states, d * (costs @ b))


@lru_cache(maxsize=8)
def _gauss(count: int) -> tuple[Array, Array, Array]:
    """Gauss points (k,) of [0, 1], their quadrature (k,), and the weights (k, k) of the integrals up to each."""
    abscissae, share = gauss_legendre(count)
    c = 0.5 * (abscissae + 1.0)
    return c, 0.5 * share, integral_weights(tuple(c.tolist()), c)


class _Evaluated:
    """Scaled rates and running cost at fractions (k,) of every interval, under the saturated control."""

    def __init__(self, solution: Solution, c: Array) -> None:
        problem, (count, k) = solution.problem, (solution.nodes - 1, len(c))
        u = np.clip(interval_weights(solution.scheme, c) @ solution.u, *problem.control_bounds)
        t = solution.t[:-1, None] + c * np.diff(solution.t)[:, None]
        self._shape, self._scale, size = (count, k), problem.state_scale, count * k
        self._x, self._out = np.zeros((size, problem.nx)), np.zeros((size, problem.nx + 1))
        known = [np.ascontiguousarray(each, float) for each in (u.reshape(size, -1), t, solution.parameters)]
        results: list[Array | None] = [self._out]
        self._evaluate = BufferedFunction(
            _rates(problem).map("rates", "serial", size, [3], []), (self._x, *known), results
        )

    def __call__(self, x: Array) -> tuple[Array, Array]:
        self._x[:] = x.reshape(self._x.shape) * self._scale
        self._evaluate()
        values = self._out.reshape(*self._shape, -1)
        return values[..., :-1] / self._scale, values[..., -1].copy()


@lru_cache(maxsize=64)
def _rates(problem: ProblemFunctions) -> ca.Function:
    """(x, u, t, p) -> (f, L), dense."""
    arguments = problem.dynamics.sx_in()
    both = ca.vertcat(problem.dynamics(*arguments), problem.running_cost(*arguments))
    return ca.Function("rates", arguments, [ca.densify(both)])


ILL_POSED = 1e4
"""norm of the scaled transition matrix above which an open loop cannot be replayed"""
GIVEN_NODES = 1e-3
"""default tolerance of a replay on a given number of nodes: figures are read to three digits"""
DENSE = 20
"""number of points of an interval at which bounds and path constraints are evaluated"""

_TOLERANCE = 1e-10  # of the integration, relative and in scaled states
_SUBINTERVALS = 4  # of an interval, for the transition matrix
_OVERFLOW = 1e100
_FAR = 1e3  # times the largest scaled state: a flight that has left the solution for good
_TERMS = 16  # of a Taylor series at a norm of at most 1/2: below rounding


def replayed(solution: Solution, tolerance: float = GIVEN_NODES, known: Defects | None = None) -> Solution:
    """Replay a solution and judge it; a failed one is returned unchanged.

    ``known`` are the solution's defects, if they were computed before.

    OPTIMAL is a solution whose miss, path violation and cost error are each within the ``tolerance``, and which crosses
    no jump or kink of its problem inside an interval; another one is CONVERGED, and its message says why. Where the
    replay is by intervals and the flight in one piece misses by more than the tolerance, the message has both figures.

    From x(0), with x' = f(x, sat(u(t)), t; p), u(t) as the scheme interpolates it and sat() its bounds; interval by
    interval where the scaled transition matrix of the linearised flow has a norm ||Φ(T, 0)|| beyond ``ILL_POSED``.
    """
    if not solution.solved:
        return solution
    began = time.perf_counter()
    growth = _growth(solution)
    found = _replay(solution, by_intervals=not growth <= ILL_POSED)
    if known is None and len(solution.scheme.points) > 1:
        known = defects(solution)
    errors = None if known is None else np.abs(known.states).max(axis=1)
    if not math.isfinite(found.error) and (why := _not_finite(solution)):
        return dataclasses.replace(solution, status=SolverOutcome.NOT_FINITE, message=why)
    return kept(judged(solution.with_replay(found, errors, 1e3 * (time.perf_counter() - began)), tolerance))


def _not_finite(solution: Solution) -> str:
    """Function that is not finite at a node, in words: a scheme may not evaluate there, rounding may avoid a pole."""
    problem, x = solution.problem, solution.x.copy()
    x[0] = np.clip(x[0], *pinned(problem, solution.parameters, "start"))
    return not_finite(problem, x, solution.control(solution.t), solution.t, solution.parameters, "solution")


def judged(solution: Solution, tolerance: float) -> Solution:
    """Judge a solved solution with a replay: set the status and the message that follow from a tolerance.

    ProblemError for a tolerance that is not finite and positive.
    """
    check_tolerance(tolerance)
    assert solution.replay is not None
    replay, figures = solution.replay, solution.replay.figures
    excess = {name: value for name, value in figures.items() if not value <= tolerance}
    shown = ", ".join(f"{name} {value:.2g}" for name, value in (excess or figures).items())
    message = f"{'not ' if excess else ''}within {tolerance:g} when it is replayed: {shown}"
    if replay.by_intervals and not replay.one_piece <= tolerance:
        message += (
            f"; it replays by intervals, miss {replay.miss:.2g}, and not in one piece, miss {replay.one_piece:.2g}: "
            "only with feedback does its control reach its end"
        )
    crossed = not_smooth(solution, tolerance)
    if crossed:
        message += f"; not smooth inside an interval, so that J need not be the least: {', '.join(crossed)}"
    status = SolverOutcome.CONVERGED if excess or crossed else SolverOutcome.OPTIMAL
    return dataclasses.replace(solution, status=status, message=message, tolerance=tolerance, not_smooth=crossed)


def check_tolerance(tolerance: float) -> None:
    """Raise ProblemError for a tolerance that is not finite and positive."""
    if not (isinstance(tolerance, (int, float)) and math.isfinite(tolerance) and tolerance > 0.0):
        raise ProblemError(f"tolerance = {tolerance!r}; allowed: a finite value > 0")


def _replay(solution: Solution, *, by_intervals: bool) -> ReplayResult:
    problem, scale = solution.problem, solution.problem.state_scale
    starts, y, cost, defects = solution.x / scale, solution.x[0] / scale, 0.0, 0.0
    fractions = np.linspace(0.0, 1.0, DENSE + 1)
    at_once = flight(solution, fractions, _TOLERANCE, by_intervals=by_intervals)
    flown = np.empty((solution.nodes - 1, DENSE + 1, problem.nx))
    for i in range(solution.nodes - 1):
        if by_intervals:
            y = starts[i]
        path = (at_once.states[i], float(at_once.costs[i])) if at_once else _integrated(solution, i, y)
        if path is None:
            end = np.full(problem.nx, np.nan)
            control_violation = _control_violation(solution)
            return ReplayResult(math.inf, math.inf, control_violation, math.inf, math.nan, end, by_intervals)
        flown[i], gained = path
        cost += gained
        y = flown[i, -1]
        defects += float(np.abs(y - starts[i + 1]).max())
    path_violation = _path_violation(solution, flown * scale, fractions)
    if problem.instants is not None:
        there = np.vstack([starts[:1], flown[:, -1]])[solution.instant_nodes] * scale
        cost += instant_cost(problem.instants, there, solution.parameters)
        path_violation = max(path_violation, instant_excess(problem.instants, there, solution.parameters))
    miss = defects if by_intervals else float(np.abs(y - starts[-1]).max())
    end = y * scale
    cost += float(problem.terminal_cost(end, solution.duration, solution.parameters))
    error = abs(cost - solution.cost) / max(least_cost(solution), abs(solution.cost))
    cost_error = error if math.isfinite(error) else math.inf
    control_violation = _control_violation(solution)
    one_piece = _one_piece(solution) if by_intervals else math.nan
    return ReplayResult(miss, path_violation, control_violation, cost_error, cost, end, by_intervals, one_piece)


def _one_piece(solution: Solution) -> float:
    """Scaled miss at the end of a flight from x(0) alone; infinite once it is far from the solution."""
    x = solution.x / solution.problem.state_scale
    far = _FAR * max(1.0, float(np.abs(x).max()))
    at_once = flight(solution, np.ones(1), _TOLERANCE, by_intervals=False)
    if at_once is not None:
        return float(np.abs(at_once.states[-1, -1] - x[-1]).max())
    y = x[0]
    for i in range(solution.nodes - 1):
        path = _integrated(solution, i, y)
        if path is None or not np.abs(path[0][-1] - x[i + 1]).max() <= far:
            return math.inf
        y = path[0][-1]
    return float(np.abs(y - x[-1]).max())


def least_cost(solution: Solution) -> float:
    """Least |J| that a replay's cost error is relative to: 1, or the scale of J where all of it is smaller."""
    u = np.vstack([solution.u[:, 0], solution.u[-1:, -1]])
    return min(1.0, cost_scale(solution.problem, solution.t, solution.x, u, solution.duration, solution.parameters))


def _integrated(solution: Solution, i: int, y: Array) -> tuple[Array, float] | None:
    """Scaled states (DENSE + 1, nx) over interval i from y, and the running cost gathered; None if it diverges."""
    problem = solution.problem
    t_0, t_1 = solution.t[i], solution.t[i + 1]
    points = own_points(solution.scheme, i)
    rates = _Rates(problem, solution.u[i, : len(points)], points, t_0, t_1 - t_0, solution.parameters)
    with np.errstate(all="ignore"):
        found = solve_ivp(
            rates,
            (0.0, 1.0),
            np.append(y, 0.0),
            method="DOP853",
            t_eval=np.linspace(0.0, 1.0, DENSE + 1),
            rtol=_TOLERANCE,
            atol=_TOLERANCE,
        )
    if not found.success or not np.isfinite(found.y).all():
        return None
    return found.y[:-1].T, float(found.y[-1, -1])


class _Rates:
    """d/dc of (x / scale, ∫ L dt) at a fraction c of an interval, for an integrator; evaluated in place."""

    def __init__(
        self, problem: ProblemFunctions, u: Array, points: tuple[float, ...], t: float, d: float, p: Array
    ) -> None:
        function = _rates_function(problem, points)
        self._c, self._y, self._out = np.zeros(1), np.zeros(problem.nx + 1), np.zeros(problem.nx + 1)
        self._known = np.concatenate([u.ravel(), [t, d], p])
        self._evaluate = BufferedFunction(function, (self._c, self._y, self._known), [self._out])

    def __call__(self, c: float, y: Array) -> Array:
        check()
        self._c[0], self._y[:] = c, y
        self._evaluate()
        return self._out.copy()


@lru_cache(maxsize=64)
def _rates_function(problem: ProblemFunctions, points: tuple[float, ...]) -> ca.Function:
    c, y = ca.SX.sym("c"), ca.SX.sym("y", problem.nx + 1)
    k, nu = len(points), problem.nu
    known = ca.SX.sym("known", k * nu + 2 + len(problem.parameters))
    t_0, d, p = known[k * nu], known[k * nu + 1], known[k * nu + 2 :]
    u = ca.SX.zeros(nu)
    for j, own in enumerate(points):
        basis = ca.SX(1)
        for other in points[:j] + points[j + 1 :]:
            basis *= (c - other) / (own - other)
        u += basis * known[j * nu : (j + 1) * nu, :]
    u = ca.fmin(ca.fmax(u, problem.control_bounds.lower), problem.control_bounds.upper)
    x, t = y[:-1] * problem.state_scale, t_0 + c * d
    rates = d * problem.dynamics(x, u, t, p) / problem.state_scale
    return ca.Function("rates", [c, y, known], [ca.vertcat(rates, d * problem.running_cost(x, u, t, p))])


def _path_violation(solution: Solution, states: Array, fractions: Array) -> float:
    """Largest violation of state bounds and path constraints at states (N - 1, n, nx) at fractions (n,)."""
    problem = solution.problem
    worst = _excess(states, *problem.state_bounds, problem.state_scale)
    if len(problem.path_bounds.lower):
        t = (solution.t[:-1, None] + fractions * np.diff(solution.t)[:, None]).ravel()
        u = np.clip(_control(solution, fractions), *problem.control_bounds).reshape(len(t), -1)
        p = np.tile(solution.parameters[:, None], (1, len(t)))
        d = problem.path.map(len(t))(states.reshape(len(t), -1).T, u.T, t[None, :], p).full().T
        lower, upper = problem.path_bounds
        worst = max(worst, _excess(d, lower, upper, path_sizes(problem)))
    return worst


def _control_violation(solution: Solution) -> float:
    """Largest violation of its bounds by the scheme's control, over their range (one bound: over the scale)."""
    problem = solution.problem
    extent = problem.control_bounds.upper - problem.control_bounds.lower
    scale = np.where(np.isfinite(extent) & (extent > 0.0), extent, problem.control_scale)
    return _excess(_control(solution, np.linspace(0.0, 1.0, DENSE + 1)), *problem.control_bounds, scale)


def _control(solution: Solution, fractions: Array) -> Array:
    """(N - 1, n, nu) the scheme's control, not saturated, at fractions (n,) of each interval."""
    values: Array = interval_weights(solution.scheme, fractions) @ solution.u
    return values


def _excess(values: Array, lower: Array, upper: Array, scale: Array) -> float:
    over = np.maximum(np.maximum(lower - values, values - upper), 0.0) / scale
    return float(np.nan_to_num(over, nan=np.inf).max(initial=0.0))


def _growth(solution: Solution) -> float:
    """||Φ(T, 0)|| of the scaled dynamics linearised along the solution."""
    problem, scale = solution.problem, solution.problem.state_scale
    fractions = (np.arange(_SUBINTERVALS) + 0.5) / _SUBINTERVALS
    starts, d = solution.t[:-1], np.diff(solution.t)
    times = (starts[:, None] + fractions * d[:, None]).ravel()
    jacobian = _jacobian(problem).map(len(times))
    p = np.tile(solution.parameters[:, None], (1, len(times)))
    slopes = jacobian(solution.state(times).T, solution.control(times).T, times[None, :], p).full()
    slopes = slopes.reshape(problem.nx, len(times), problem.nx).transpose(1, 0, 2) * scale / scale[:, None]
    steps = np.repeat(d / _SUBINTERVALS, _SUBINTERVALS)
    transition = np.eye(problem.nx)
    for flow in _exponentials(slopes * steps[:, None, None]):
        transition = flow @ transition
        if not np.abs(transition).max() < _OVERFLOW:  # NaN too
            return math.inf
    return float(np.linalg.norm(transition, 2))


def _exponentials(matrices: Array) -> Array:
    """e^A of many small matrices (n, m, m) at once, by scaling, Taylor's series and squaring.

    A routine for large matrices starts threads for each, which takes longer than all of this.
    """
    norm = float(np.abs(matrices).sum(axis=-1).max(initial=0.0))
    if not norm < _OVERFLOW:
        return np.full_like(matrices, np.nan)
    squarings = max(0, math.ceil(math.log2(max(norm, 1.0)))) + 1
    scaled = matrices / 2.0**squarings
    term = np.broadcast_to(np.eye(matrices.shape[-1]), matrices.shape)
    total = term.copy()
    for k in range(1, _TERMS):
        term = term @ scaled / k
        total += term
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(squarings):
            total = total @ total
    return total


@lru_cache(maxsize=64)
def _jacobian(problem: ProblemFunctions) -> ca.Function:
    arguments = problem.dynamics.sx_in()
    slope = ca.jacobian(problem.dynamics(*arguments), arguments[0])
    return ca.Function("A", arguments, [ca.densify(slope)])
