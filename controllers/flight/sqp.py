"""The default solver: condensed sequential quadratic programming, each step a dense programme solved by ``daqp``.

All that is not convex in the problem (terrain, terminal cost, approach condition) sits in its objective, as cost or as
a quadratic penalty on a slack; the hard constraints are balls and boxes. A step takes the balls by their tangent planes
and puts their curvature, weighted by the multipliers of the step before, into the Hessian (sequential convex quadratic
programming): tangent planes alone converge slowly where many balls are active. The end of a step is projected back
into the balls, so every iterate keeps the bounds, full steps are not refused for leaving them along a tangent, and a
backtracking line search makes every iteration an improvement. Iterations stop when the quadratic model promises a step
less than 5 ``tolerance`` (1 + cost): what is left after that step is a small part of this.
"""

from __future__ import annotations

import daqp
import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.flight.kernels.line_search import begin, search
from mathnavi.controllers.flight.kernels.linearisation import linearise
from mathnavi.controllers.flight.kernels.problem_data import QuadraticProgramme
from mathnavi.controllers.flight.problem import PlanSolution, Problem
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

_SOFT, _EQUALITY = 8, 5  # daqp's constraint senses
# What the model may still promise of a step, in units of the tolerance: after a good model little is left, but near a
# saddle, where curvature had to be left out, the promise is too small.
_PROMISE, _PROMISE_NEAR_SADDLE = 5.0, 0.01
_NEAR = 1e-3  # [m] that a solution may miss its end by
_NOWHERE = np.empty(0)
_CLEARANCE_REACH = 200.0  # [m]
_BALL_REACH = 0.3  # of the radius
_GRAIN = 16  # rows by which programmes differ in size
_INFINITY = 1e30  # daqp's
_INFEASIBLE = "the quadratic programme has no feasible point"


class CondensedSqp:
    """Solver of one ``Problem`` after another.

    Between problems it keeps the solver's workspaces, one per size of the problem, with the balls' last multipliers:
    they shape the first step, not the solution.
    """

    def __init__(self, tolerance: float = 1e-6, iteration_limit: int = 20) -> None:
        if not tolerance > 0.0:
            raise ArgumentError(f"tolerance = {tolerance!r}; allowed: > 0")
        if iteration_limit < 1:
            raise ArgumentError(f"iteration_limit = {iteration_limit!r}; allowed: >= 1")
        self._tolerance, self._iteration_limit = tolerance, iteration_limit
        self._workspaces: dict[tuple[int, int, bool], _Workspace] = {}

    def solve(self, problem: Problem, guess: Array) -> PlanSolution | str:
        """Solve from ``guess`` (3n + 1,) [m/s^2, m/s]; returns the reason if it fails."""
        data, s = tuple(problem.data), problem.matrices
        key = (*s.weights.shape, problem.terminal_position is not None)
        if key not in self._workspaces:
            self._workspaces[key] = _Workspace(problem)
        work = self._workspaces[key]
        quadratic = tuple(work.quadratic)
        terminal_position = _NOWHERE if problem.terminal_position is None else problem.terminal_position
        unknowns, trial = np.empty_like(guess), np.empty_like(guess)
        value, violation = begin(guess, data, terminal_position, unknowns)
        converged, improved, iteration = False, True, 0
        while improved and not converged and iteration < self._iteration_limit:
            iteration += 1
            is_exact = linearise(unknowns, data, terminal_position, work.multipliers, quadratic)
            step = work.step()
            if step is None:
                return _INFEASIBLE
            decrease, trial_value, trial_violation, improved = search(
                unknowns, value, violation, step, work.penalty, work.soft, quadratic, data, terminal_position, trial
            )
            promise = _PROMISE if is_exact else _PROMISE_NEAR_SADDLE
            converged = abs(decrease) <= promise * self._tolerance * (1.0 + abs(value))
            if improved:
                unknowns, trial, value, violation = trial, unknowns, trial_value, trial_violation
        if violation > _NEAR:
            return f"the last node stays {violation:.3g} m from where it must be after {iteration} iterations"
        message = "" if converged else f"stopped after {iteration} iterations"
        accelerations = unknowns[:-1].reshape(-1, 3)
        return PlanSolution(accelerations, float(unknowns[-1]), float(value), converged, iteration, message)


class _Workspace:
    """The quadratic programme of one size of problem, and its state from solve to solve.

    Most rows are far from active: flights are mostly high, and slower than they may be. Only rows within ``reach`` of
    their bound enter the programme that is solved. A soft row left out wrongly still counts in what the model promises,
    and a bound in the projection; the row then enters the next programme.
    """

    def __init__(self, problem: Problem) -> None:
        n, clearance = problem.arcs, len(problem.matrices.base) - 2
        terminal = 3 if problem.terminal_position is not None else 0
        self._size, count = 3 * n + 1, clearance + 1 + 2 * n + 1 + 4 + terminal
        self.quadratic = QuadraticProgramme(
            hessian=np.zeros((self._size, self._size)),
            gradient=np.zeros(self._size),
            rows=np.zeros((count, self._size)),
            upper=np.zeros(self._size + count),
            lower=np.zeros(self._size + count),
        )
        self.multipliers = np.zeros(2 * n + 1)  # of the balls |v| <= v_max, |a| <= a_max and the manoeuvre's
        self.penalty = 1.0  # above the sum of the multipliers of the ends, which a projected step may miss
        self.soft = clearance + 1
        self._balls = slice(self.soft, self.soft + 2 * n + 1)
        self._ends = slice(self.soft + 2 * n + 1, count)
        self._sense = np.zeros(count, np.int32)
        self._sense[: self.soft] = _SOFT
        self._sense[count - terminal :] = _EQUALITY
        p = problem.parameters
        self._reach = np.concatenate(
            [
                np.full(clearance, _CLEARANCE_REACH * np.sqrt(problem.terrain_weight)),
                [np.inf],
                np.full(n, _BALL_REACH * p.speed_max),
                np.full(n, _BALL_REACH * p.acceleration_max),
                [_BALL_REACH * p.acceleration_max * p.manoeuvre_duration],
                np.full(4, p.speed_max * p.manoeuvre_duration),
                np.full(terminal, np.inf),
            ]
        )
        self._programmes: dict[int, _DenseProgramme] = {}

    def step(self) -> Array | None:
        """The solution of the filled quadratic programme, or None."""
        size = self._size
        hessian, gradient, rows, upper, lower = self.quadratic
        near = np.flatnonzero((upper[size:] < self._reach) | (lower[size:] > -self._reach))
        capacity = _GRAIN * (1 + len(near) // _GRAIN)
        if capacity not in self._programmes:
            self._programmes[capacity] = _DenseProgramme(size, capacity)
        found = self._programmes[capacity].solve(
            hessian,
            gradient,
            rows[near],
            np.concatenate([upper[:size], upper[size:][near]]),
            np.concatenate([lower[:size], lower[size:][near]]),
            self._sense[near],
        )
        if found is None:
            return None
        x, row_multipliers = found
        multipliers = np.zeros(len(self._sense))
        multipliers[near] = row_multipliers
        self.multipliers[:] = multipliers[self._balls]
        self.penalty = 1.0 + 2.0 * float(np.abs(multipliers[self._ends]).sum())
        return x


class _DenseProgramme:
    """A dense quadratic programme of a fixed size, padded with rows that constrain nothing."""

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
            # daqp makes room for as many active rows as there are variables and, now, soft rows; later programmes of
            # this size may have more of them, and it does not check.
            roomy = self._sense.copy()
            roomy[size:] = _SOFT
            flag, _ = solver.setup(hessian, gradient, self._rows, self._upper, self._lower, roomy)
            solver.update(sense=self._sense.copy())
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
