"""A transcribed problem and the solver behind it: IPOPT, or FATROP with its structure and compiled stages.

A transcription is built once for a problem, a scheme, a distribution of nodes and N, and solved for any guess, grid and
parameters. Whatever happens in the solver ends as a status.
"""

from __future__ import annotations

import time
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.backend import NumericalSolver, SolverAnswer
from mathnavi.controllers.ocp.backend import Options as Options
from mathnavi.controllers.ocp.distribution import Fixed, NodeDistribution, constants_guess
from mathnavi.controllers.ocp.dual_solution import Answer, multipliers_of
from mathnavi.controllers.ocp.grid import Grid, from_widths
from mathnavi.controllers.ocp.multipliers import NamedValues
from mathnavi.controllers.ocp.nlp import programme
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution, Timing, along
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.sim.interfaces.errors import ProblemError
from mathnavi.sim.interfaces.signals import Array

FIXED = Fixed()
DEFAULT = Options()


class Transcription:
    """A programme with its solver, solved for any guess, grid and parameters; ``build_ms`` [ms] is its build time."""

    def __init__(
        self,
        problem: ProblemFunctions,
        scheme: Scheme,
        distribution: NodeDistribution,
        nodes: int,
        options: Options,
    ) -> None:
        """Build programme and solver for N = ``nodes`` nodes.

        Raises ProblemError for FATROP with a scheme that is not explicit, and for a distribution that cannot place so
        few nodes.
        """
        began = time.perf_counter()
        if options.backend.startswith("fatrop") and not scheme.explicit:
            raise ProblemError(
                f"backend = {options.backend!r} cannot solve {scheme.name}: x_(i+1) is not given explicitly; "
                "allowed: forward Euler, multiple shooting, or backend = 'ipopt'"
            )
        self.problem, self.scheme, self.distribution, self.nodes = problem, scheme, distribution, nodes
        self.programme = programme(problem, scheme, distribution, nodes)
        self.layout = self.programme.layout
        nlp = self.programme
        self._functional = None if nlp.functional is None else ca.Function("I", [nlp.x, nlp.p], [nlp.functional])
        self.solver = NumericalSolver(self.programme, options)
        self.build_ms = 1e3 * (time.perf_counter() - began)

    def solve(
        self,
        guess: Solution | None = None,
        grid: Grid | None = None,
        parameters: Array | None = None,
    ) -> Solution:
        """Solve from a guess; failure is in the solution's status. There is no replay yet.

        Args:
            guess: another solution, on any grid and by any scheme; None for the problem's own guess.
            grid: N nodes or, where the nodes are unknowns, their guess; None for the guess's, or uniform ones.
            parameters: (np,) values of the problem's parameters; None for the nominal ones.

        Raises:
            ProblemError: for a grid of another number of nodes, parameters of another shape, and a guess with other
                numbers of states or controls.
        """
        p = self.problem.nominal if parameters is None else parameters
        where = grid or (guess.grid if guess is not None else Grid(np.linspace(0.0, 1.0, self.nodes)))
        if len(where) != self.nodes:
            raise ProblemError(f"grid: {len(where)} nodes; allowed: the {self.nodes} of this transcription")
        if p.shape != self.problem.nominal.shape:
            raise ProblemError(
                f"parameters: shape {p.shape}; allowed: {self.problem.nominal.shape}, one for each parameter"
            )
        if guess is not None and (guess.problem.nx, guess.problem.nu) != (self.problem.nx, self.problem.nu):
            raise ProblemError(
                f"guess: a solution of {guess.problem.name} with {guess.problem.nx} states and {guess.problem.nu} "
                f"controls; allowed: {self.problem.nx} and {self.problem.nu}"
            )
        known = p if self.layout.moving else np.concatenate([p, where.widths * (self.nodes - 1)])
        answer = self.solver.solve(self._unknowns(guess, where, p), known)
        cost = answer.cost if self._functional is None else answer.cost - float(self._functional(answer.x, known))
        return self._read(answer, where, p, known, cost)

    def _read(self, answer: SolverAnswer, grid: Grid, p: Array, known: Array, cost: float) -> Solution:
        """The solution in an answer, and its J."""
        layout, problem, scheme = self.layout, self.problem, self.scheme
        nx, nu, count = problem.nx, problem.nu, self.nodes - 1
        z, w, last = layout.split(answer.x)
        x = z[:, :nx]
        duration = float(z[0, nx]) if layout.free_duration else problem.guess_duration
        if layout.moving and (w[:, -1] > 0.0).all():
            grid = from_widths(w[:, -1])
        u = w[:, : layout.own_points * nu].reshape(count, layout.own_points, nu)
        if scheme.shared:
            u = np.concatenate([u, np.vstack([u[1:, 0], last])[:, None, :]], axis=1)
        hidden = w[:, layout.own_points * nu :][:, : scheme.interior * nx].reshape(count, scheme.interior, nx)
        inner = _inner_states(problem, scheme, grid, duration, x, hidden, u, p)
        rows = self.programme.gap_start[:, None] + np.arange(nx)
        # The gap is written z_(i+1) - flow = 0 over the scale: its multiplier is -λ times the scale. Where a scheme has
        # inner equations, flow - X = 0, x_i enters each of them, and λ is their sum.
        lam = answer.multipliers[1]
        shares = lam[self.programme.inner_rows].reshape(count, scheme.interior, nx).sum(axis=1)
        costates = (shares - lam[rows]) / problem.state_scale
        multipliers = multipliers_of(self.programme, Answer(*answer.multipliers, grid.nodes * duration, x, inner, u, p))
        return Solution(
            problem, scheme, answer.status, answer.message, grid, duration, p, x, inner, u, costates, cost,
            answer.iterations, Timing(self.build_ms, answer.solve_ms), multipliers, self._sensitivities(answer, known),
        )  # fmt: skip

    def _sensitivities(self, answer: SolverAnswer, known: Array) -> NamedValues:
        """dJ/dp (np,): the derivative of the Lagrangian by the parameters."""
        names = self.problem.parameters
        if not names:
            return NamedValues(names, np.empty(0))
        return NamedValues(names, self._parameter_gradient(answer.x, known, answer.multipliers[1]).full()[:, 0])

    @cached_property
    def _parameter_gradient(self) -> ca.Function:
        return self.programme.assembly.parameter_gradient(len(self.problem.parameters))

    def _unknowns(self, guess: Solution | None, grid: Grid, p: Array) -> Array:
        """The vector of unknowns that a guess amounts to on a grid."""
        problem, layout, scheme = self.problem, self.layout, self.scheme
        points = np.array(scheme.points[: layout.own_points])
        at_points = (grid.nodes[:-1, None] + points * grid.widths[:, None]).ravel()
        inside = np.array(scheme.points[1 : 1 + scheme.interior])
        at_inner = (grid.nodes[:-1, None] + inside * grid.widths[:, None]).ravel()
        if guess is not None:
            T = guess.duration
            x, u, hidden = guess.state(grid.nodes * T), guess.control(at_points * T), guess.state(at_inner * T)
            last = guess.control(T)
        else:
            T = problem.guess_duration

            def interpolated(values: Array, at: Array) -> Array:
                columns = [np.interp(at, problem.guess_times, column) for column in values.T]
                return np.array(columns).T.reshape(len(at), values.shape[1])

            x, hidden = interpolated(problem.guess_states, grid.nodes), interpolated(problem.guess_states, at_inner)
            u, last = interpolated(problem.guess_controls, at_points), problem.guess_controls[-1]
        n, D = self.nodes, grid.widths * (self.nodes - 1)
        z = [x]
        if layout.free_duration:
            z.append(np.full((n, 1), T))
        if layout.constants:
            rates = along(problem, x, np.vstack([u.reshape(n - 1, -1)[:, : problem.nu], last]), grid.nodes * T, p)
            second_derivatives = np.diff(rates, axis=0) * T / grid.widths[:, None] / problem.state_scale
            chords = np.diff(x, axis=0) / problem.state_scale
            z.append(np.tile(constants_guess(self.distribution, D, T, chords, second_derivatives), (n, 1)))
        w = [u.reshape(n - 1, -1), hidden.reshape(n - 1, -1)]
        if layout.moving:
            z.append(grid.nodes[:, None])
            w.append(D[:, None])
        return layout.join(np.hstack(z), np.hstack(w), last if scheme.shared else np.empty(0))


@lru_cache(maxsize=64)
def transcription(
    problem: ProblemFunctions,
    scheme: Scheme,
    nodes: int,
    distribution: NodeDistribution = FIXED,
    options: Options = DEFAULT,
) -> Transcription:
    """The transcription for these arguments, built once and kept.

    Args:
        problem: the problem as compiled functions.
        scheme: equations of an interval.
        nodes: N >= 2.
        distribution: places of the nodes; ``Fixed`` for those of a given grid.
        options: solver and tolerance.

    Raises:
        ProblemError: for a problem that is no ``ProblemFunctions``, an ``OptimalControlProblem`` itself for one, and as
            ``Transcription`` does.
    """
    if not isinstance(problem, ProblemFunctions):
        raise ProblemError(
            f"problem = {problem!r}; allowed: ProblemFunctions, OptimalControlProblem.functions() for one"
        )
    return Transcription(problem, scheme, distribution, nodes, options)


def _inner_states(
    problem: ProblemFunctions,
    scheme: Scheme,
    grid: Grid,
    duration: float,
    x: Array,
    hidden: Array,
    u: Array,
    p: Array,
) -> Array:
    """(N - 1, k, nx) the states at the scheme's points."""
    k = len(scheme.points)
    if k == 1:
        return x[:-1, None, :]
    if scheme.interior or k == 2:
        return np.concatenate([x[:-1, None, :], hidden, x[1:, None, :]], axis=1)
    # Hermite-Simpson's midpoint
    t, d = grid.nodes * duration, np.diff(grid.nodes)[:, None] * duration
    f_0, f_1 = along(problem, x[:-1], u[:, 0], t[:-1], p), along(problem, x[1:], u[:, -1], t[1:], p)
    middle = 0.5 * (x[:-1] + x[1:]) + d * (f_0 - f_1) / 8.0
    return np.stack([x[:-1], middle, x[1:]], axis=1)
