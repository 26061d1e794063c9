"""Errors of a solution of an optimal control problem, from any solver, measured by one common replay.

A solution is a control, a polynomial on each interval, and what its solver reports: states at the nodes and J. The
control, saturated to its bounds, is integrated from x(0) by SciPy's DOP853 to 1e-10. If the linearised flow grows
beyond ``ILL_POSED``, the open loop cannot be replayed as a whole, and each interval is integrated from its first node.

**Statement for other solvers**: a problem of ``mathnavi.controllers.ocp`` with its fixed ends, end conditions, limits
and guess. MAPTOR and dymos state a fixed value of a state at the start or the end separately; any other end condition
is an event or a boundary constraint. ``CONTROL_LIMITS`` are limits that their users would add.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import BarycentricInterpolator
from scipy.linalg import expm

from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.problems.library import KnownOptimum
from mathnavi.controllers.ocp.replay import ILL_POSED
from mathnavi.interfaces.signals import Array

Limits = tuple[float | None, float | None]

CONTROL_LIMITS: dict[str, Interval] = {"Zermelo": Interval(np.array([0.0]), np.array([2.0 * math.pi]))}
"""limits of the controls, by the problem's name; an unlimited heading would wind between two collocation points"""


@dataclass(frozen=True)
class End:
    """Conditions at one end of the trajectory."""

    fixed: dict[int, float]  # value over the scale of each state that has one
    others: tuple[int, ...]  # rows of the conditions that are none


def ends(problem: ProblemFunctions) -> tuple[End, End]:
    """Return the conditions at the start and at the end."""
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
    """Return the limits divided by the scales; None instead of an infinite limit."""
    lower, upper = (side / scale for side in bounds)
    return [(finite(low), finite(high)) for low, high in zip(lower, upper, strict=True)]


def control_limits(problem: ProblemFunctions) -> list[Limits]:
    """Return the limits of the controls, divided by their scales."""
    return limits(CONTROL_LIMITS.get(problem.name, problem.control_bounds), problem.control_scale)


def finite(value: float) -> float | None:
    """Return a limit; None if it is infinite."""
    return float(value) if math.isfinite(value) else None


def guess(problem: ProblemFunctions, fractions: Array) -> tuple[Array, Array]:
    """Return guessed states (nx, n) and controls (nu, n), divided by their scales, at fractions (n,) of T."""

    def at(values: Array, scale: Array) -> Array:
        return np.array([np.interp(fractions, problem.guess_times, column) for column in values.T]) / scale[:, None]

    return at(problem.guess_states, problem.state_scale), at(problem.guess_controls, problem.control_scale)


TOLERANCE = 1e-10  # of the integration, relative and in scaled states
DENSE = 16  # parts of an interval at which bounds are evaluated


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Solution as its solver reports it, in the problem's units."""

    problem: ProblemFunctions
    duration: float  # [s]
    nodes: Array  # (N,) fractions of T from 0 to 1
    states: Array  # (N, nx) at the nodes
    points: tuple[Array, ...]  # N - 1 times (k,): fractions of the interval at which its control is known
    controls: tuple[Array, ...]  # N - 1 times (k, nu), the values there
    cost: float  # J


@dataclass(frozen=True)
class Verdict:
    """Errors of a trajectory."""

    cost_error: float
    """the larger error of the reported and the replayed J, relative to the known optimum"""
    miss: float
    """largest distance of the replayed end from the reported one, divided by the scales"""
    violation: float
    """largest violation of state bounds and path constraints, divided by the scales"""

    @property
    def accuracy(self) -> float:
        """The largest of the three errors; infinite if the replay diverges."""
        worst = max(self.cost_error, self.miss, self.violation)
        return worst if math.isfinite(worst) else math.inf


def judge(trajectory: Trajectory, known: KnownOptimum) -> Verdict:
    """Replay a trajectory and compare it with the known optimum."""
    problem, T = trajectory.problem, trajectory.duration
    flight = _Replay(trajectory)
    whole = flight.growth() <= ILL_POSED
    state, cost, miss, violation = trajectory.states[0], 0.0, 0.0, 0.0
    for i, reported in enumerate(trajectory.states[1:]):
        path = flight.interval(i, state if whole else trajectory.states[i])
        if path is None:
            return Verdict(math.inf, math.inf, math.inf)
        x, gained = path
        cost += gained
        violation = max(violation, flight.violation(i, x))
        state = x[-1]
        distance = float(np.abs((state - reported) / problem.state_scale).max())
        miss = distance if whole else miss + distance
    cost += float(problem.terminal_cost(state, T, problem.nominal))
    return Verdict(max(known.error(cost), known.error(trajectory.cost)), miss, violation)


class _Replay:
    """Integration of the control of one trajectory."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory, problem = trajectory, trajectory.problem
        self._times = trajectory.nodes * trajectory.duration
        x, u, t, p = problem.dynamics.sx_in()
        rates = problem.dynamics(x, u, t, p)
        running = problem.running_cost(x, u, t, p)
        self._rates = ca.Function("rates", [x, u, t, p], [ca.vertcat(rates / problem.state_scale, running)])
        self._slopes = ca.Function("slopes", [x, u, t, p], [ca.densify(ca.jacobian(rates, x))])
        self._polynomials = [
            BarycentricInterpolator(points, values) if len(points) > 1 else None
            for points, values in zip(trajectory.points, trajectory.controls, strict=True)
        ]

    def control(self, i: int, fraction: Array | float) -> Array:
        """Return the saturated control (..., nu) at fractions of interval i."""
        polynomial, held = self._polynomials[i], self._trajectory.controls[i][0]
        known = np.broadcast_to(held, (*np.shape(fraction), len(held))) if polynomial is None else polynomial(fraction)
        values: Array = np.clip(known, *self._trajectory.problem.control_bounds)
        return values

    def interval(self, i: int, start: Array) -> tuple[Array, float] | None:
        """Return states (DENSE + 1, nx) from a start (nx,), and the interval's running cost; None on divergence."""
        problem, t = self._trajectory.problem, self._times[i]
        d, scale = self._times[i + 1] - t, problem.state_scale

        def rates(c: float, y: Array) -> Array:
            values = self._rates(y[:-1] * scale, self.control(i, c), t + c * d, problem.nominal)
            scaled: Array = d * np.asarray(values.full()[:, 0])
            return scaled

        grid = np.linspace(0.0, 1.0, DENSE + 1)
        y = np.append(start / scale, 0.0)
        found = solve_ivp(rates, (0.0, 1.0), y, method="DOP853", t_eval=grid, rtol=TOLERANCE, atol=TOLERANCE)
        if not found.success or not np.isfinite(found.y).all():
            return None
        states: Array = found.y[:-1].T * scale
        return states, float(found.y[-1, -1])

    def violation(self, i: int, x: Array) -> float:
        """Return the largest violation of state bounds and path constraints by states (DENSE + 1, nx) of interval i."""
        problem, times = self._trajectory.problem, np.linspace(self._times[i], self._times[i + 1], len(x))
        worst = _excess(x, *problem.state_bounds, problem.state_scale)
        lower, upper = problem.path_bounds
        if len(lower):
            u = self.control(i, np.linspace(0.0, 1.0, len(x)))
            d = problem.path.map(len(x))(x.T, u.T, times[None, :], np.tile(problem.nominal[:, None], (1, len(x))))
            sizes = [np.abs(np.where(np.isfinite(side), side, 0.0)) for side in (lower, upper)]
            worst = max(worst, _excess(d.full().T, lower, upper, np.maximum(1.0, np.maximum(*sizes))))
        return worst

    def growth(self) -> float:
        """Return the norm of the scaled transition matrix along the reported states."""
        trajectory, problem = self._trajectory, self._trajectory.problem
        scale, transition = problem.state_scale, np.eye(problem.nx)
        for i, d in enumerate(np.diff(self._times)):
            for c in (0.125, 0.375, 0.625, 0.875):
                x = (1.0 - c) * trajectory.states[i] + c * trajectory.states[i + 1]
                slopes = self._slopes(x, self.control(i, c), self._times[i] + c * d, problem.nominal).full()
                transition = expm(0.25 * d * slopes * scale / scale[:, None]) @ transition
            if not np.abs(transition).max() < 1e100:  # NaN too
                return math.inf
        return float(np.linalg.norm(transition, 2))


def _excess(values: Array, lower: Array, upper: Array, scale: Array) -> float:
    over = np.maximum(np.maximum(lower - values, values - upper), 0.0) / scale
    return float(np.nan_to_num(over, nan=np.inf).max(initial=0.0))
