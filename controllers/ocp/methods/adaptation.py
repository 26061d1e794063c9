"""Methods of Paper B that adapt a grid, a call each: one solve, moved nodes, nodes inside the programme, added nodes.

``solve`` is the plain method: one grid, one solve, one replay.

``redistribute`` (r-refinement) solves, moves the same number of nodes to where the monitor function is large, and
solves again. The distribution is not part of the programme, so each solve is as easy as the first, and the second
starts from the first.

``distribute`` has the nodes inside the programme, (B.1) augmented to the problem: the method of Paper B. The programme
with free nodes has many minima, and from a cold start rounding would decide between them. So an equidistribution is
found on two levels first: nodes outside, states inside. The uniform solution's nodes are moved half of the way to where
they would equidistribute the monitor's measure, the problem is solved on them, and so on until they rest. From there
the programme starts near its solution, with a small barrier; and with a large one only where the J that it finds is
not below the J that it starts from. Other distributions start from the uniform solution.

``refine`` (h-refinement) adds nodes where the local error is, until it is small everywhere. The local error η_i of an
interval (see ``residual``) falls with the (k + 1)-th power of the interval's width where the rates are interpolated at
k points (after Betts, Practical Methods for Optimal Control, 4.7). Each pass hands out new nodes one by one to the
interval with the largest predicted error, at most as many as there are intervals, because the prediction is no better
than that.

The replay gate accepts an adaptive solution only if it replays as well as the uniform one, or within tolerance. Nodes
that the optimiser may move are moved where the transcription's error hides; J then looks better than it is. The gate
compares what both do in the true dynamics (see ``mathnavi.controllers.ocp.replay``), figure by figure: one that is
large on both grids, as a path violation where a constraint begins to hold, does not hide another.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.distribution import Equidistributed, NodeDistribution
from mathnavi.controllers.ocp.grid import Grid, check_nodes, equidistributed, from_widths, on_breaks, split, uniform
from mathnavi.controllers.ocp.monitors import CURVATURE, Monitor, interval_measures
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions, check_problem
from mathnavi.controllers.ocp.replay import GIVEN_NODES, replayed
from mathnavi.controllers.ocp.residual import local_errors
from mathnavi.controllers.ocp.solution import ReplayResult, Solution, SolverOutcome, Timing
from mathnavi.controllers.ocp.solver import DEFAULT, FIXED, Options, check_instants, transcription
from mathnavi.controllers.ocp.transcriptions.low_order import HermiteSimpson
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

HERMITE_SIMPSON = HermiteSimpson()


def solve(
    problem: ProblemFunctions,
    nodes: int | Grid,
    *,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
    tolerance: float = GIVEN_NODES,
    replay: bool = True,
) -> Solution:
    """Solve a problem on one grid and replay the solution.

    Args:
        problem: the problem as compiled functions.
        nodes: number N of uniform nodes, or a grid.
        scheme: transcription of an interval.
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        options: solver and its own tolerance.
        tolerance: largest miss, path violation and cost error of the replay of a solution that is called OPTIMAL.
        replay: False for a solution that is not replayed, and at best CONVERGED.

    Returns:
        The solution with its replay; failure is in its status, CONVERGED where N nodes are too few for the tolerance.

    Raises:
        ProblemError: for fewer than two nodes, and parameters or a guess that do not fit the problem.
    """
    check_problem(problem)
    grid = nodes if isinstance(nodes, Grid) else on_breaks(uniform(nodes), problem.breaks)
    made = transcription(problem, scheme, len(grid), FIXED, options)
    found = made.solve(guess, grid, parameters)
    return replayed(found, tolerance) if replay else found


WORSE = 3.0
"""factor over the uniform solution's figure beyond which one is worse: a third fewer nodes cost that at order four"""


def gated(adaptive: Solution, uniform: Solution, method: str, tolerance: float) -> Solution:
    """Compare replays: the adaptive solution under its method's name, or the uniform one with the status REFUSED.

    A figure of the adaptive solution's replay is refused if it is larger than the tolerance and than ``WORSE`` times
    the uniform one's. The message says which. Both carry a replay where they are solutions at all. The time of the
    adaptive one is the time of the answer. Where the uniform solve failed there is nothing to compare with: the
    adaptive solution's message says so.
    """
    timing = adaptive.timing
    if not uniform.solved or uniform.replay is None:
        if not adaptive.solved:
            return dataclasses.replace(uniform, method=method, timing=timing)
        message = f"{adaptive.message}; not gated, for the uniform solve failed: {uniform.status.value}"
        return dataclasses.replace(adaptive, message=message, method=method, timing=timing)
    if not adaptive.solved or adaptive.replay is None:
        reason = f"{method}: {adaptive.status.value} ({adaptive.message})"
    elif worse := worse_figures(adaptive.replay, uniform.replay, tolerance):
        reason = f"{method}: replays with a {'; a '.join(worse)}"
    else:
        return dataclasses.replace(adaptive, method=method, timing=timing)
    return dataclasses.replace(uniform, status=SolverOutcome.REFUSED, message=reason, method=method, timing=timing)


def worse_figures(adaptive: ReplayResult, uniform: ReplayResult, tolerance: float) -> list[str]:
    """The figures by which an adaptive solution replays worse, with both values."""
    found = []
    for (name, own), other in zip(adaptive.figures.items(), uniform.figures.values(), strict=True):
        if not own <= max(tolerance, WORSE * other):
            found.append(f"{name} of {own:.3g}, uniform with {other:.3g}")
    return found


def redistribute(
    problem: ProblemFunctions,
    nodes: int,
    monitor: Monitor = CURVATURE,
    *,
    rounds: int = 1,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
    tolerance: float = GIVEN_NODES,
) -> Solution:
    """Solve on uniform nodes, then ``rounds`` times on the grid that equidistributes a monitor function; gated.

    Args:
        problem: the problem as compiled functions.
        nodes: N, the same in every round.
        monitor: w, whose ``density`` is equidistributed; it needs no measure.
        rounds: number of redistributions, at least one.
        scheme, guess, parameters, options: as of ``solve``.
        tolerance: as of ``solve``; the gate lets replays within it pass, however good the uniform solution's are.

    Returns:
        The solution with its replay, or the uniform one with the status REFUSED where that replays better.

    Raises:
        ProblemError: for fewer than two nodes or no round, and a monitor function that is not positive.
    """
    check_problem(problem)
    if rounds < 1:
        raise ProblemError(f"rounds = {rounds!r}; allowed: a whole number >= 1")
    budget, start = Budget(options), on_breaks(uniform(nodes), problem.breaks)
    made = transcription(problem, scheme, len(start), FIXED, options)
    first = replayed(made.solve(guess, start, parameters), tolerance)
    if not (first.solved or first.status is SolverOutcome.LIMIT):
        return first
    current = first  # even one that did not converge shows where the next grid has to be dense
    for _ in range(rounds):
        if budget.spent:
            break
        made = transcription(problem, scheme, len(start), FIXED, budget.left(options))
        following = made.solve(current, redistributed(current, len(start), monitor), parameters)
        spent = dataclasses.replace(following.timing, build_ms=0.0)  # it is the same programme
        current = dataclasses.replace(following, timing=spent + current.timing)
        if not (current.solved or current.status is SolverOutcome.LIMIT):
            break
    return gated(replayed(current, tolerance), first, f"redistribution, {monitor.name}", tolerance)


def redistributed(solution: Solution, nodes: int, monitor: Monitor) -> Grid:
    """The grid of ``nodes`` nodes between which the integral of a solution's monitor function is the same.

    Nodes at break times are put there afterwards.
    """
    found = equidistributed(nodes, lambda tau: monitor.density(solution, tau, monitor.epsilon), solution.grid.nodes)
    return on_breaks(found, solution.problem.breaks)


EQUIDISTRIBUTED = Equidistributed()
_MOST_MOVES = 40
_AT_REST = 1e-5  # of T: largest move of a node


def distribute(
    problem: ProblemFunctions,
    nodes: int,
    distribution: NodeDistribution = EQUIDISTRIBUTED,
    *,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
    tolerance: float = GIVEN_NODES,
) -> Solution:
    """Solve a problem whose nodes are unknowns of the programme, (B.1), from its uniform solution; gated.

    Args:
        problem: the problem as compiled functions.
        nodes: N.
        distribution: functional I and constraints m of the nodes.
        scheme, guess, parameters, options: as of ``solve``.
        tolerance: as of ``solve``; the gate lets replays within it pass, however good the uniform solution's are.

    Returns:
        The solution with its replay, or the uniform one with the status REFUSED where that replays better.

    Raises:
        ProblemError: for fewer than two nodes, or a distribution whose nodes are not unknowns.
    """
    budget = Budget(options)
    if not distribution.moving:
        raise ProblemError(f"distribution = {distribution!r} fixes the nodes; allowed: one that moves them")
    check_problem(problem)
    check_instants(problem, distribution, options)
    first = solve(
        problem, nodes, scheme=scheme, guess=guess, parameters=parameters, options=options, tolerance=tolerance
    )
    if not first.solved:
        return first
    if isinstance(distribution, Equidistributed):
        second = _equidistributed(first, distribution, budget, options)
    else:
        monitor = getattr(distribution, "monitor", None)
        grid = redistributed(first, nodes, monitor) if isinstance(monitor, Monitor) else first.grid
        made = transcription(problem, scheme, nodes, distribution, budget.left(options))
        second = made.solve(first, grid, parameters)
        second = dataclasses.replace(second, timing=second.timing + first.timing)
    return gated(replayed(second, tolerance), first, f"in the programme: {described(distribution)}", tolerance)


def _equidistributed(first: Solution, distribution: Equidistributed, budget: Budget, options: Options) -> Solution:
    """Solution with equidistributed nodes inside the programme, from a uniform one, on two levels; not replayed."""
    problem, scheme, nodes, parameters = first.problem, first.scheme, first.nodes, first.parameters
    rest, timing = first, first.timing
    for _ in range(_MOST_MOVES):
        if budget.spent:
            break
        moved = _moved(rest, distribution)
        found = transcription(problem, scheme, nodes, FIXED, budget.left(options)).solve(rest, moved, parameters)
        timing += dataclasses.replace(found.timing, build_ms=0.0)
        if not found.solved:
            break
        change, rest = float(np.abs(moved.nodes - rest.grid.nodes).max()), found
        if change <= _AT_REST:
            break
    found = rest
    for warm in (True, options.warm):
        chosen = dataclasses.replace(budget.left(options), warm=warm)
        found = transcription(problem, scheme, nodes, distribution, chosen).solve(rest, rest.grid, parameters)
        timing += found.timing
        if found.solved and found.cost <= rest.cost:
            break
    return dataclasses.replace(found, timing=timing)


def _moved(solution: Solution, distribution: Equidistributed) -> Grid:
    """The grid half of the way to where the nodes of a solution would equidistribute the monitor's measure."""
    known, shares = solution.grid, interval_measures(distribution.monitor, solution, distribution.epsilon)
    mass = np.concatenate([[0.0], np.cumsum(shares)])
    nodes = np.interp(np.linspace(0.0, mass[-1], len(known)), mass, known.nodes)
    return from_widths(0.5 * (np.diff(nodes) + known.widths))


def described(distribution: NodeDistribution) -> str:
    """Name of a distribution's class, with that of its monitor function if it has one."""
    monitor = getattr(distribution, "monitor", None)
    return type(distribution).__name__ + (f", {monitor.name}" if isinstance(monitor, Monitor) else "")


REFINED = 1e-6
"""tolerance of a refinement, of local errors and of the replay"""


def refine(
    problem: ProblemFunctions,
    nodes: int = 6,
    *,
    most_nodes: int = 60,
    tolerance: float = REFINED,
    scheme: Scheme = HERMITE_SIMPSON,
    guess: Solution | None = None,
    parameters: Array | None = None,
    options: Options = DEFAULT,
) -> Solution:
    """Solve a problem, adding nodes until the local error is small; gated against as many uniform nodes.

    Args:
        problem: the problem as compiled functions.
        nodes: number of uniform nodes to start with.
        most_nodes: limit of the number of nodes.
        tolerance: allowed local error η of an interval, over the states' scales, and allowed error of the replay.
        scheme: transcription of an interval.
        guess: a solution to start from, on any grid; None for the problem's own guess.
        parameters: (np,) values of the problem's parameters; None for the nominal ones.
        options: solver and tolerance.

    Returns:
        The solution with its replay; its message says whether the tolerance was reached. The uniform solution with the
        status REFUSED where that replays better.

    Raises:
        ProblemError: for a scheme whose state has no polynomial, limits that contradict each other and a tolerance that
            is not positive.
    """
    check_problem(problem)
    if len(scheme.points) < 2:
        raise ProblemError(f"scheme = {scheme.name} cannot be refined; allowed: a collocation scheme")
    check_nodes(nodes)
    if not nodes <= check_nodes(most_nodes, "most_nodes"):
        raise ProblemError(f"most_nodes = {most_nodes!r}; allowed: at least nodes = {nodes}")
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise ProblemError(f"tolerance = {tolerance!r}; allowed: a finite value > 0")
    budget = Budget(options)
    grid, current, timing, errors = on_breaks(uniform(nodes), problem.breaks), guess, Timing(), np.array([math.inf])
    while True:
        made = transcription(problem, scheme, len(grid), FIXED, budget.left(options))
        current = made.solve(current, grid, parameters)
        timing += current.timing
        if not current.solved:
            return dataclasses.replace(current, method="refinement", timing=timing)
        errors = local_errors(current)
        if errors.max() <= tolerance or current.nodes >= most_nodes or budget.spent:
            break
        grid = split(grid, _parts(errors, tolerance, len(scheme.points) + 1, most_nodes - len(grid)))
    reached = "at most" if errors.max() <= tolerance else "still"
    refined = replayed(dataclasses.replace(current, method="refinement", timing=timing), tolerance)
    message = f"local error {reached} {errors.max():.2g} on {current.nodes} nodes; {refined.message}"
    refined = dataclasses.replace(refined, message=message)
    if refined.ok or budget.spent:
        return refined
    even = solve(
        problem, refined.nodes, scheme=scheme, guess=refined, parameters=parameters, options=budget.left(options),
        tolerance=tolerance,
    )  # fmt: skip
    spent = even.timing.build_ms + even.timing.solve_ms + even.timing.replay_ms
    refined = dataclasses.replace(refined, timing=refined.timing + Timing(gate_ms=spent))
    return gated(refined, even, "refinement", tolerance) if even.solved else refined


def _parts(errors: Array, tolerance: float, power: int, spare: int) -> list[int]:
    """Number of parts to divide each interval into, with at most ``spare`` new nodes."""
    parts = np.ones(len(errors))
    for _ in range(min(spare, len(errors))):
        predicted = errors / parts**power
        worst = int(np.argmax(predicted))
        if predicted[worst] <= 0.5 * tolerance:
            break
        parts[worst] += 1
    return [int(k) for k in parts]
