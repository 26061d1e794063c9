"""The default solver: a condensed Gauss-Newton method, each step a dense quadratic programme solved by ``daqp``.

All that is not convex in the problem (terrain, terminal cost, approach condition) sits in its objective, as cost or
as a quadratic penalty on a slack; the hard constraints are balls and boxes. A ball is taken by its tangent plane, its
curvature by the multiplier of the step before. So a step is a descent direction of the objective plus an exact
penalty on the balls. A backtracking line search makes every iteration an improvement, but for the first ones that
violate a ball: the next step returns to it. Iterations stop when one changes the merit by less than ``tolerance`` (1
+ cost).
"""

from __future__ import annotations

import daqp
import numpy as np
from numpy.typing import NDArray

from controllers.flight import kernels
from controllers.flight.problem import Problem, Solution
from sim.signals import Array

_SOFT, _EQUALITY = 8, 5  # daqp's constraint senses
_TANGENT_ERROR = 1e-2  # [m/s, m/s^2] by which a ball's tangent planes may overshoot it on convergence
_FREE_STEPS = 6  # may leave a ball along its tangent without a line search, which would hold back good steps
_SHORTEST_STEP = 1e-3
_CLEARANCE_REACH = 200.0  # [m]
_BALL_REACH = 0.3  # of the radius
_GRAIN = 16  # rows by which programmes differ in size
_INFINITY = 1e30  # daqp's
_INFEASIBLE = "the quadratic programme has no feasible point"


class GaussNewton:
    """Solves ``Problem`` after ``Problem``.

    Between problems it keeps the solver's workspaces, one per horizon length, with the balls' last multipliers: they
    shape the first step, not the solution.
    """

    def __init__(self, tolerance: float = 1e-6, iteration_limit: int = 12) -> None:
        if not tolerance > 0.0:
            raise ValueError(f"tolerance = {tolerance!r}; allowed: > 0")
        if iteration_limit < 1:
            raise ValueError(f"iteration_limit = {iteration_limit!r}; allowed: >= 1")
        self._tolerance, self._iteration_limit = tolerance, iteration_limit
        self._workspaces: dict[tuple[int, bool], _Workspace] = {}

    def solve(self, problem: Problem, guess: Array) -> Solution | str:
        """A solution from ``guess`` (3n + 1,), or the reason why there is none."""
        key = (problem.arcs, problem.hold is not None)
        if key not in self._workspaces:
            self._workspaces[key] = _Workspace(problem)
        work, cost, s = self._workspaces[key], problem.landscape.cost, problem.stencil
        packed = problem.packed
        data = (
            problem.start,
            s.base,
            s.weights,
            s.climbs,
            problem.landscape.heights,
            cost.ground,
            cost.ratio,
            cost.scales,
            packed,
        )
        hold = np.empty(0) if problem.hold is None else problem.hold
        unknowns = guess.copy()
        value, violation = kernels.objective(unknowns, *data)
        violation += _gap(unknowns, problem)
        converged, iteration = False, 0
        while iteration < self._iteration_limit and not converged:
            iteration += 1
            kernels.linearise(
                unknowns, *data, hold, work.multipliers, work.hessian, work.gradient, work.rows, work.upper, work.lower
            )
            step = work.step()
            if step is None:
                return _INFEASIBLE
            length, merit = 1.0, value + work.penalty * violation
            while True:
                trial = unknowns + length * step
                trial_value, trial_violation = kernels.objective(trial, *data)
                trial_violation += _gap(trial, problem)
                gain = merit - trial_value - work.penalty * trial_violation
                excused = iteration <= _FREE_STEPS and trial_violation > _TANGENT_ERROR
                if gain >= 0.0 or excused or length < _SHORTEST_STEP:
                    break
                length *= 0.5
            if not excused and gain < -self._tolerance * (1.0 + abs(value)):
                break  # no descent left in this direction, and not for rounding
            unknowns, value, violation = trial, trial_value, trial_violation
            converged = abs(gain) <= self._tolerance * (1.0 + abs(value)) and violation <= _TANGENT_ERROR
        message = "" if converged else f"stopped after {iteration} iterations"
        accelerations = unknowns[:-1].reshape(-1, 3)
        return Solution(accelerations, float(unknowns[-1]), float(value), converged, iteration, message)


def _gap(unknowns: Array, problem: Problem) -> float:
    """Distance of the last node from the point it must meet [m]; 0 if there is none."""
    if problem.hold is None:
        return 0.0
    s = problem.stencil
    p = problem.start[:3] + s.base[-2] * problem.start[3:] + s.weights[-2] @ unknowns[:-1].reshape(-1, 3)
    return float(np.abs(p - problem.hold).max())


class _Workspace:
    """The quadratic programme of one horizon length, and what is remembered of it.

    Most rows are far from active: flights are mostly high, and slower than they may be. Only rows within ``reach`` of
    their bound enter the programme that is solved. A row left out wrongly shows in the objective or in the violation of
    the next iterate, which then is not accepted as converged, and enters the next programme.
    """

    def __init__(self, problem: Problem) -> None:
        n, clearance = problem.arcs, len(problem.stencil.base) - 2
        held = 3 if problem.hold is not None else 0
        self._size, count = 3 * n + 1, clearance + 1 + 2 * n + 1 + 4 + held
        self.hessian, self.gradient = np.zeros((self._size, self._size)), np.zeros(self._size)
        self.rows = np.zeros((count, self._size))
        self.upper, self.lower = np.zeros(self._size + count), np.zeros(self._size + count)
        self.multipliers = np.zeros(2 * n + 1)  # of the balls |v| <= v_max, |a| <= a_max and the manoeuvre's
        self.penalty = 1.0  # above the sum of all multipliers, so that the merit's minimum is the problem's
        self._held = held
        self._balls = slice(clearance + 1, clearance + 2 + 2 * n)
        self._sense = np.zeros(count, np.int32)
        self._sense[: clearance + 1] = _SOFT
        self._sense[count - held :] = _EQUALITY
        p = problem.parameters
        self._reach = np.concatenate(
            [
                np.full(clearance, _CLEARANCE_REACH * np.sqrt(problem.terrain_weight)),
                [np.inf],
                np.full(n, _BALL_REACH * p.speed_max),
                np.full(n, _BALL_REACH * p.acceleration_max),
                [_BALL_REACH * p.acceleration_max * p.manoeuvre_duration],
                np.full(4, p.speed_max * p.manoeuvre_duration),
                np.full(held, np.inf),
            ]
        )
        self._programmes: dict[int, _Programme] = {}

    def step(self) -> Array | None:
        """The solution of the filled quadratic programme, or None."""
        size = self._size
        near = np.flatnonzero((self.upper[size:] < self._reach) | (self.lower[size:] > -self._reach))
        capacity = _GRAIN * (1 + len(near) // _GRAIN)
        if capacity not in self._programmes:
            self._programmes[capacity] = _Programme(size, capacity)
        found = self._programmes[capacity].solve(
            self.hessian,
            self.gradient,
            self.rows[near],
            np.concatenate([self.upper[:size], self.upper[size:][near]]),
            np.concatenate([self.lower[:size], self.lower[size:][near]]),
            self._sense[near],
        )
        if found is None:
            return None
        x, row_multipliers = found
        multipliers = np.zeros(len(self._sense))
        multipliers[near] = row_multipliers
        self.multipliers[:] = np.maximum(multipliers[self._balls], 0.0)
        holding = float(np.abs(multipliers[len(multipliers) - self._held :]).sum())
        self.penalty = 1.0 + 2.0 * (float(self.multipliers.sum()) + holding)
        return x


class _Programme:
    """A dense quadratic programme of a fixed size, padded with rows that ask for nothing."""

    def __init__(self, size: int, capacity: int) -> None:
        self._rows = np.zeros((capacity, size))
        self._upper, self._lower = np.full(size + capacity, _INFINITY), np.full(size + capacity, -_INFINITY)
        self._sense = np.zeros(size + capacity, np.int32)
        self._solver: daqp.Model | None = None

    def solve(
        self, hessian: Array, gradient: Array, rows: Array, upper: Array, lower: Array, sense: NDArray[np.int32]
    ) -> tuple[Array, Array] | None:
        """The minimiser and the rows' multipliers, or None if there is no feasible point."""
        count, size = rows.shape
        used = size + count
        self._rows[:count], self._rows[count:] = rows, 0.0
        self._upper[:used], self._upper[used:] = upper, _INFINITY
        self._lower[:used], self._lower[used:] = lower, -_INFINITY
        self._sense[size:used], self._sense[used:] = sense, 0
        if self._solver is None:
            solver = daqp.Model()
            solver.settings = {"iter_limit": 1000}
            flag, _ = solver.setup(hessian, gradient, self._rows, self._upper, self._lower, self._sense.copy())
            # Rows carry the square root of their weight, so every slack costs s^2 / 2. The setting "rho_soft" would
            # apply to rows that daqp has normalised.
            solver.soft_weights(rho_l=np.ones(self._upper.size), rho_u=np.ones(self._upper.size))
            self._solver = solver if flag >= 0 else None
        else:
            flag = self._solver.update(
                H=hessian,
                f=gradient,
                A=self._rows,
                bupper=self._upper,
                blower=self._lower,
                sense=self._sense.copy(),
            )
        if flag < 0 or self._solver is None:
            return None
        x, _, exit_flag, information = self._solver.solve()
        return (np.array(x), information["lam"][size:used]) if exit_flag > 0 else None
