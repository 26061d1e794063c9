"""A transcribed problem and the solver behind it: IPOPT, or FATROP with its structure and compiled stages.

A transcription is built once for a problem, a scheme, a distribution of nodes and N, and solved for any guess, grid and
parameters. Every outcome of the solver, exceptions included, becomes a status.
"""

from __future__ import annotations

import dataclasses
import time
from functools import cached_property, lru_cache
from typing import TypeAlias

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.arcs import Arcs, placed, starts
from mathnavi.controllers.ocp.backend import NumericalSolver, SolverAnswer
from mathnavi.controllers.ocp.backend import Options as Options
from mathnavi.controllers.ocp.call import CURRENT, check, kept
from mathnavi.controllers.ocp.clocks import clocks_of, own_arcs
from mathnavi.controllers.ocp.diagnosis import not_finite, unbounded
from mathnavi.controllers.ocp.distribution import Fixed, NodeDistribution, constants_guess
from mathnavi.controllers.ocp.dual_solution import Answer, multipliers_of
from mathnavi.controllers.ocp.feasibility.certificate import affinely_infeasible
from mathnavi.controllers.ocp.feasibility.elastic import contradiction
from mathnavi.controllers.ocp.feasibility.proof import proved
from mathnavi.controllers.ocp.grid import Grid, check_nodes, from_widths, on_breaks, uniform
from mathnavi.controllers.ocp.layout import (
    bounded_controls,
    bounded_states,
    control_variations,
    fractions_between,
    mixed_constraints,
)
from mathnavi.controllers.ocp.multipliers import NamedValues
from mathnavi.controllers.ocp.nlp import SHORTEST_ARC, at_rows, programme
from mathnavi.controllers.ocp.problem_functions import GuessedTrajectory, ProblemFunctions, check_problem
from mathnavi.controllers.ocp.solution import Solution, SolvedProgramme, SolverOutcome, Timing, along
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.controllers.ocp.transcriptions.variable_radau import interval_points
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

FIXED = Fixed()
DEFAULT = Options()
_BEFORE_THE_END = 1.0 - 1e-10
_AT_NODE = 1e-9  # of T, from a node that is at a given time
_MAY_BE_INFEASIBLE = (SolverOutcome.NO_FEASIBLE_POINT, SolverOutcome.LIMIT, SolverOutcome.FAILED)
_FEASIBLE = 1e-4  # scaled violation up to which a last iterate may show that J has no least value
_MAY_BE_UNBOUNDED = (SolverOutcome.CONVERGED, SolverOutcome.UNBOUNDED, SolverOutcome.LIMIT, SolverOutcome.FAILED)


_Bounds: TypeAlias = tuple[Array, Array, Array, Array]  # of the scaled unknowns (n,) and the rows (m,)


class Transcription:
    """A programme with its solver, solved for any guess, grid and parameters; ``build_ms`` [ms] is its build time."""

    def __init__(
        self,
        problem: ProblemFunctions,
        scheme: Scheme,
        distribution: NodeDistribution,
        nodes: int,
        options: Options,
        arcs: int = 1,
        instant_nodes: tuple[int, ...] | None = None,
    ) -> None:
        """Build programme and solver for N = ``nodes`` nodes in ``arcs`` arcs; of phases with clocks, one or several.

        ``instant_nodes`` are the indices of the nodes at given times, None for those of uniform nodes; for a grid with
        other ones ``solve`` builds another transcription, and keeps it.

        Raises ProblemError for FATROP with a scheme that is not explicit, for too few nodes for the distribution, and
        for several arcs of nodes that are unknowns.
        """
        check()
        began = time.perf_counter()
        if options.backend.startswith("fatrop") and not scheme.explicit:
            raise ProblemError(
                f"backend = {options.backend!r} cannot solve {scheme.name}: x_(i+1) is not given explicitly; "
                "allowed: forward Euler, multiple shooting, or backend = 'ipopt'"
            )
        check_instants(problem, distribution, options)
        self.problem, self.scheme, self.distribution, self.nodes = problem, scheme, distribution, nodes
        if instant_nodes is None:
            instant_nodes = nodes_of_instants(problem, on_breaks(uniform(check_nodes(nodes)), problem.breaks))
        self._options, self._siblings = options, dict[tuple[int, ...], Transcription]()
        self.instant_nodes = instant_nodes
        self.programme = programme(problem, scheme, distribution, check_nodes(nodes), arcs, instant_nodes)
        self.layout = self.programme.layout
        self._clocks, self._arcs = clocks_of(problem), arcs
        nlp = self.programme
        self._functional = None if nlp.functional is None else ca.Function("I", [nlp.x, nlp.p], [nlp.functional])
        self.solver = NumericalSolver(self.programme, options)
        self.build_ms = 1e3 * (time.perf_counter() - began)

    def solve(
        self,
        guess: Solution | GuessedTrajectory | None = None,
        grid: Grid | None = None,
        parameters: Array | None = None,
        arcs: Arcs | None = None,
        *,
        explained: bool = True,
        plain_rows: bool = False,
    ) -> Solution:
        """Solve from a guess; failure is in the solution's status. There is no replay yet.

        Args:
            guess: another solution, on any grid and by any scheme, or a trajectory; None for the problem's own guess.
            grid: N nodes or, where the nodes are unknowns, their guess; None for the guess's, or uniform ones.
            parameters: (np,) values of the problem's parameters; None for the nominal ones.
            arcs: arcs of the grid, with unknown lengths and separate bounds of the controls, as many as the
                transcription has. None for a transcription of one arc.
            explained: True if a programme that found no feasible point is examined: which constraints cannot hold
                together, of one without arcs, and whether it is proved that the problem has none.
            plain_rows: True for rows as stated, without their own scales.

        Raises:
            ProblemError: for a grid of another number of nodes, parameters of another shape, arcs that do not fit, and
                a guess with other numbers of states or controls.
        """
        p = self.problem.nominal if parameters is None else parameters
        own = guess.grid if isinstance(guess, Solution) else on_breaks(uniform(self.nodes), self.problem.breaks)
        where = grid or own
        if len(where) != self.nodes:
            raise ProblemError(f"grid: {len(where)} nodes; allowed: the {self.nodes} of this transcription")
        if not isinstance(p, np.ndarray) or p.shape != self.problem.nominal.shape:
            shape = f": shape {p.shape}" if isinstance(p, np.ndarray) else f" = {p!r:.80}"
            raise ProblemError(f"parameters{shape}; allowed: {self.problem.nominal.shape}, one for each parameter")
        if guess is not None and not isinstance(guess, Solution | GuessedTrajectory):
            raise ProblemError(f"guess = {guess!r:.80}; allowed: a Solution, or None for the problem's own guess")
        if isinstance(guess, Solution) and (guess.problem.nx, guess.problem.nu) != (self.problem.nx, self.problem.nu):
            raise ProblemError(
                f"guess: a solution of {guess.problem.name} with {guess.problem.nx} states and {guess.problem.nu} "
                f"controls; allowed: {self.problem.nx} and {self.problem.nu}"
            )
        if (1 if arcs is None else len(arcs)) != self._arcs:
            raise ProblemError(f"arcs: {arcs}; allowed: the {self._arcs} of this transcription")
        if (instant_nodes := nodes_of_instants(self.problem, where)) != self.instant_nodes:
            same = self._sibling(instant_nodes)
            return same.solve(guess, where, p, arcs, explained=explained, plain_rows=plain_rows)
        shares = None
        smoothing = np.zeros((self.nodes - 1, self.layout.smoothed))
        if arcs is not None and arcs.smoothing is not None:
            smoothing = arcs.smoothing[arcs.of_interval]
        if self.layout.moving:
            known = p
        elif arcs is None or self.layout.arcs == 1:
            known = np.concatenate([p, where.widths * (self.nodes - 1)])
        else:
            arcs.check(where)
            shares = arcs.shares(where)
            known = np.concatenate([p, starts(shares).ravel(), shares.ravel()])
        known = np.concatenate([known, smoothing.ravel()])
        x_0 = self._unknowns(guess, where, p, arcs)
        programme = self.programme
        bounds = programme.x_lower, programme.x_upper, programme.lower, programme.upper
        if arcs is not None:
            bounds = self._bounds(arcs)
        if self._clocks and arcs is not None and self._arcs > 1:
            arcs.check(where)
            self._tie(bounds, arcs, where, x_0)
        elif self._clocks and isinstance(guess, Solution) and not self.scheme.shared:
            bounds = self._as_guessed(bounds, guess, where, x_0)
        if (call := CURRENT.get()) is not None:
            call.mesh(self.scheme.name, self.nodes)
        feasible_guess = isinstance(guess, Solution) and guess.solves(self.problem, p)
        near = guess.cost if isinstance(guess, Solution) and feasible_guess else None
        answer = self.solver.solve(x_0, known, bounds=bounds, plain_rows=plain_rows, cost=near)
        if answer.status is SolverOutcome.NOT_FINITE:
            answer = self._explained(answer, x_0, where, p)
        cost = answer.cost if self._functional is None else answer.cost - float(self._functional(answer.x, known))
        found = self._read(answer, where, p, known, shares, cost)

        def read(unknowns: Array) -> Solution:
            return self._read(dataclasses.replace(answer, x=unknowns), where, p, known, shares, cost)

        solved = SolvedProgramme(programme, answer.x, known, bounds, answer.multipliers, found.grid, read)
        found = dataclasses.replace(found, solved_programme=solved)
        if found.status is SolverOutcome.INTERRUPTED:
            return kept(found)
        if answer.status is SolverOutcome.NO_FEASIBLE_POINT and arcs is None and explained:
            found = self._examined(found, answer, known)
        if found.status in _MAY_BE_INFEASIBLE and explained and not feasible_guess:
            found = proved(found, named=found.message != answer.message)
        if smoothing.any():  # it is no part of J
            u = found.u / self.problem.control_scale
            added = float((control_variations(self.scheme, u) * smoothing).sum())
            found = dataclasses.replace(found, cost=found.cost - added)
        feasible = answer.violation <= _FEASIBLE or answer.status is SolverOutcome.UNBOUNDED
        if answer.status in _MAY_BE_UNBOUNDED and found.status is answer.status and feasible:
            u, diverged = np.concatenate(list(found.u)), answer.status is SolverOutcome.UNBOUNDED
            if why := unbounded(self.problem, found.x, u, found.duration, diverged=diverged):
                found = dataclasses.replace(found, status=SolverOutcome.UNBOUNDED, message=why)
        return kept(found)

    def _sibling(self, instant_nodes: tuple[int, ...]) -> Transcription:
        """The transcription that is this one with given times at other nodes."""
        if instant_nodes not in self._siblings:
            self._siblings[instant_nodes] = Transcription(
                self.problem,
                self.scheme,
                self.distribution,
                self.nodes,
                self._options,
                self._arcs,
                instant_nodes,
            )
        return self._siblings[instant_nodes]

    def _examined(self, found: Solution, answer: SolverAnswer, known: Array) -> Solution:
        """A solution without a feasible point with the constraints that cannot hold, INFEASIBLE if that is proved."""
        conflict = contradiction(self.programme, answer.x, known)
        if conflict is None:
            return found
        own = dataclasses.replace(answer, x=conflict.x, multipliers=conflict.multipliers)
        elastic = self._read(own, found.grid, found.parameters, known, None, answer.cost)
        proved = affinely_infeasible(elastic, conflict.violation)
        status = SolverOutcome.INFEASIBLE if proved else SolverOutcome.NO_FEASIBLE_POINT
        return dataclasses.replace(found, status=status, message=conflict.words)

    def _explained(self, answer: SolverAnswer, x_0: Array, grid: Grid, p: Array) -> SolverAnswer:
        """Add to the answer of a solve that met NaN or infinity what was not finite at the guess or last iterate."""
        nx, durations = self.problem.nx, self.layout.durations
        found = ""
        for name, unknowns in (("guess", x_0), ("last iterate", answer.x)):
            z, w, last = self.layout.split(unknowns)
            duration = float(z[0, nx : nx + durations].sum()) if durations else self.problem.guess_duration
            u = np.vstack([w[:, : self.problem.nu], last if self.scheme.shared else w[-1:, : self.problem.nu]])
            found = found or not_finite(self.problem, z[:, :nx], u, grid.nodes * duration, p, name)
        return dataclasses.replace(answer, message=found or answer.message)

    def _bounds(self, arcs: Arcs) -> _Bounds:
        """Bounds on the scaled unknowns and the rows, those of controls and path constraints by their arcs."""
        layout, problem, programme = self.layout, self.problem, self.programme
        points, nd = self.layout.own_points, len(self.problem.path_bounds.lower)
        unknowns, rows = (
            (programme.x_lower.copy(), programme.x_upper.copy()),
            (
                programme.lower.copy(),
                programme.upper.copy(),
            ),
        )
        controls = layout.stage_columns[:, layout.state_size :][:, : points * problem.nu]
        rates = [clock.rate for clock in self._clocks]  # their limits are no part of the problem
        stated = (controls >= 0) & ~np.isin(np.arange(points * problem.nu) % max(1, problem.nu), rates)
        for limits, own in zip(unknowns, arcs.control_bounds, strict=True):
            held = np.tile((own / problem.control_scale)[arcs.of_interval], (1, points))
            limits[controls[stated]] = held[stated]
        bounded = bounded_states(problem)
        states = [layout.state_columns[1:, bounded]]  # at the end of each interval; its start is of the one before
        inner = layout.stage_columns[:, layout.state_size + points * problem.nu :]
        states += [inner[:, m * problem.nx + np.array(bounded, int)] for m in range(self.scheme.interior)]
        for limits, own in zip(unknowns, arcs.state_bounds, strict=True):
            held = (own / problem.state_scale[bounded])[arcs.of_interval]
            for columns in states:
                limits[columns[columns >= 0]] = held[columns >= 0]
        limited = bounded_controls(problem)
        of_controls = arcs.control_bounds
        fixed = (of_controls.lower == of_controls.upper) | ~np.isfinite(of_controls.upper - of_controls.lower)
        fixed = fixed[:, limited][arcs.of_interval]
        path = (arcs.path_bounds.lower == arcs.path_bounds.upper)[:, mixed_constraints(problem)][arcs.of_interval]
        many = len(fractions_between(self.scheme))  # what is held needs no bounds in between
        fixed = np.hstack([np.tile(fixed, (1, many)), path[:, : path.shape[1] * min(1, many)]])
        between = programme.held_rows[:, programme.held_rows.shape[1] - fixed.shape[1] :]
        between, along = between[fixed & (between >= 0)], programme.held_rows[:, : points * nd]
        for limits, own, free in zip(rows, arcs.path_bounds, (-np.inf, np.inf), strict=True):
            limits[along[along >= 0]] = np.tile(own[arcs.of_interval], (1, points))[along >= 0]
            limits[between] = free
        return *unknowns, *rows

    def _tie(self, bounds: _Bounds, arcs: Arcs, grid: Grid, x_0: Array) -> None:
        """Set bounds of clocks whose rates are unknown constants on each phase's own arcs, and the guess of these."""
        programme, of_interval = self.programme, arcs.of_interval
        lower, upper, row_lower, row_upper = bounds
        held = np.hstack([np.dstack(each) for each in (arcs.control_bounds, arcs.path_bounds, arcs.state_bounds)])
        for rows, columns, clock in zip(programme.tied_rows, programme.tied_columns, self._clocks, strict=True):
            own = own_arcs(clock, held)[of_interval]
            extents = np.bincount(own, grid.widths)
            # A clock reads at the start of each own arc what the guess says; its rate is the mean to the next one.
            times = x_0[self.layout.state_columns[:, clock.state]]
            edges = np.append(np.flatnonzero(np.diff(own, prepend=-1)), len(own))
            rates = np.maximum(np.diff(times[edges]), SHORTEST_ARC) / extents
            at = own[programme.tied_intervals]
            lower[columns], upper[columns], x_0[columns] = SHORTEST_ARC / extents[at], np.inf, rates[at]
            apart = rows[np.diff(at) > 0]
            row_lower[apart], row_upper[apart] = -np.inf, np.inf
            end = self.layout.state_columns[-1, clock.state]
            lower[end], upper[end], x_0[end] = 1.0, 1.0, 1.0

    def _as_guessed(self, bounds: _Bounds, guess: Solution, grid: Grid, x_0: Array) -> _Bounds:
        """The bounds with clocks that run as in the guess: each phase has its nodes where the guess has them."""
        layout = self.layout
        lower, upper, row_lower, row_upper = bounds[0].copy(), bounds[1].copy(), *bounds[2:]
        for clock in self._clocks:
            times = guess.state(grid.nodes * guess.duration)[:, clock.state]
            rates = np.diff(times) / grid.widths / (times[-1] - times[0])
            columns = layout.stage_columns[:, layout.state_size :][:, clock.rate : layout.own_points * self.problem.nu]
            columns = columns[:, :: self.problem.nu]
            there = columns >= 0
            for side in (lower, upper, x_0):
                side[columns[there]] = np.tile(rates[:, None], (1, columns.shape[1]))[there]
        return lower, upper, row_lower, row_upper

    def _read(
        self, answer: SolverAnswer, grid: Grid, p: Array, known: Array, shares: Array | None, cost: float
    ) -> Solution:
        """The solution in an answer, and its J."""
        layout, problem, scheme = self.layout, self.problem, self.scheme
        nx, nu, count = problem.nx, problem.nu, self.nodes - 1
        z, w, last = layout.split(answer.x)
        x = z[:, :nx]
        lengths = z[0, nx : nx + layout.durations]
        duration = float(lengths.sum()) if layout.durations else problem.guess_duration
        if layout.moving and (w[:, -1] > 0.0).all():
            grid = from_widths(w[:, -1])
        if shares is not None and (lengths > 0.0).all():
            grid = placed(shares, lengths)
        u = w[:, : layout.own_points * nu].reshape(count, layout.own_points, nu)
        if scheme.shared:
            u = np.concatenate([u, np.vstack([u[1:, 0], last])[:, None, :]], axis=1)
        hidden = w[:, layout.own_points * nu :][:, : scheme.interior * nx].reshape(count, scheme.interior, nx)
        inner = _inner_states(problem, scheme, grid, duration, x, hidden, u, p)
        rows = self.programme.gap_start[:, None] + np.arange(nx)
        # The gap is written z_(i+1) - flow = 0 over the scale: its multiplier is -λ times the scale. Where a scheme has
        # inner equations, flow - X = 0, x_i enters each of them, and λ is their sum.
        lam = answer.multipliers[1]
        parts = at_rows(lam, self.programme.inner_rows).reshape(count, scheme.interior, nx).sum(axis=1)
        costates = (parts - lam[rows]) / problem.state_scale
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

    def _unknowns(self, guess: Solution | GuessedTrajectory | None, grid: Grid, p: Array, arcs: Arcs | None) -> Array:
        """Vector of unknowns of a guess on a grid."""
        problem, layout, scheme = self.problem, self.layout, self.scheme
        every = interval_points(scheme)
        points = every[:, : layout.own_points]
        # A point at the end of an interval is read just before it: the control may jump there.
        at_points = (grid.nodes[:-1, None] + np.minimum(points, _BEFORE_THE_END) * grid.widths[:, None]).ravel()
        # Points that an interval lacks may have any guess.
        inside = every[:, [j for j, c in enumerate(scheme.points) if 0.0 < c < 1.0][: scheme.interior]]
        at_inner = (grid.nodes[:-1, None] + inside * grid.widths[:, None]).ravel()
        if isinstance(guess, Solution):
            T = guess.duration
            x, u, hidden = guess.state(grid.nodes * T), guess.control(at_points * T), guess.state(at_inner * T)
            last = guess.control(T)
        else:
            own = problem.guess if guess is None else guess
            T = own.duration
            x, hidden = own.states_at(grid.nodes), own.states_at(at_inner)
            u, last = own.controls_at(at_points), own.controls[-1]
        n, D = self.nodes, grid.widths * (self.nodes - 1)
        z = [x]
        if layout.durations:
            lengths = T * (arcs.lengths(grid) if arcs is not None else np.ones(1))
            z.append(np.tile(lengths, (n, 1)))
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


def check_instants(problem: ProblemFunctions, distribution: NodeDistribution, options: Options) -> None:
    """Raise ProblemError for what is stated at given times where nodes are unknowns, and for FATROP."""
    if problem.instants is not None and (distribution.moving or options.backend.startswith("fatrop")):
        why = "nodes that are unknowns" if distribution.moving else f"backend = {options.backend!r}"
        raise ProblemError(f"{problem.name}: at() with {why}; allowed: nodes that are given, and backend = 'ipopt'")


def nodes_of_instants(problem: ProblemFunctions, grid: Grid) -> tuple[int, ...]:
    """Indices of the nodes at which a problem states a cost or constraints; ProblemError where none exists."""
    if problem.instants is None:
        return ()
    nearest = np.abs(grid.nodes[:, None] - problem.instants.fractions).argmin(axis=0)
    off = np.abs(grid.nodes[nearest] - problem.instants.fractions) > _AT_NODE
    if off.any():
        times = problem.instants.fractions[off] * problem.guess_duration
        raise ProblemError(
            f"grid: no node at {', '.join(f'{t:g}' for t in times)} s, where {problem.name} states a cost or a "
            "constraint; allowed: a grid with a node there"
        )
    return tuple(nearest.tolist())


@lru_cache(maxsize=64)
def transcription(
    problem: ProblemFunctions,
    scheme: Scheme,
    nodes: int,
    distribution: NodeDistribution = FIXED,
    options: Options = DEFAULT,
    arcs: int = 1,
    instant_nodes: tuple[int, ...] | None = None,
) -> Transcription:
    """Return the transcription for these arguments, built once and kept.

    Args:
        problem: the problem as compiled functions.
        scheme: equations of an interval.
        nodes: N >= 2.
        distribution: places of the nodes; ``Fixed`` for those of a given grid.
        options: solver and tolerance.
        arcs: number A of arcs whose lengths are unknowns.
        instant_nodes: indices of the nodes at given times; None for those of uniform nodes.

    Raises:
        ProblemError: for a problem that is not a ``ProblemFunctions``, such as an ``OptimalControlProblem``, and as
            ``Transcription`` does.
    """
    check_problem(problem)
    return Transcription(problem, scheme, distribution, nodes, options, arcs, instant_nodes)


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
    points = scheme.points
    ends = [x[:-1, None, :]] if points[0] == 0.0 else [], [x[1:, None, :]] if points[-1] == 1.0 else []
    states = np.concatenate([*ends[0], hidden, *ends[1]], axis=1)
    if states.shape[1] == len(points):
        return states
    # Hermite-Simpson's midpoint
    t, d = grid.nodes * duration, np.diff(grid.nodes)[:, None] * duration
    f_0, f_1 = along(problem, x[:-1], u[:, 0], t[:-1], p), along(problem, x[1:], u[:, -1], t[1:], p)
    with np.errstate(invalid="ignore"):  # of a solve that failed
        middle = 0.5 * (x[:-1] + x[1:]) + d * (f_0 - f_1) / 8.0
    return np.stack([x[:-1], middle, x[1:]], axis=1)
