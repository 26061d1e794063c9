"""h-refinement: nodes are added where the local error is, until it is small everywhere.

The local error η_i of an interval (see ``residual``) falls with the (k + 1)-th power of the interval's width where the
rates are interpolated at k points (after Betts, Practical Methods for Optimal Control, 4.7). Each pass hands out new
nodes one by one to the interval with the largest predicted error, at most as many as there are intervals, because the
prediction is no better than that.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mathnavi.controllers.ocp.grid import check_nodes, split, uniform
from mathnavi.controllers.ocp.methods.direct import HERMITE_SIMPSON, solve
from mathnavi.controllers.ocp.methods.gate import gated
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.residual import local_errors
from mathnavi.controllers.ocp.solution import Solution, Timing
from mathnavi.controllers.ocp.solver import DEFAULT, FIXED, Options, transcription
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

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
    if len(scheme.points) < 2:
        raise ProblemError(f"scheme = {scheme.name} cannot be refined; allowed: a collocation scheme")
    check_nodes(nodes)
    if not nodes <= check_nodes(most_nodes, "most_nodes"):
        raise ProblemError(f"most_nodes = {most_nodes!r}; allowed: at least nodes = {nodes}")
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise ProblemError(f"tolerance = {tolerance!r}; allowed: a finite value > 0")
    grid, current, timing, errors = uniform(nodes), guess, Timing(), np.array([math.inf])
    while True:
        current = transcription(problem, scheme, len(grid), FIXED, options).solve(current, grid, parameters)
        timing += current.timing
        if not current.solved:
            return dataclasses.replace(current, method="refinement", timing=timing)
        errors = local_errors(current)
        if errors.max() <= tolerance or current.nodes >= most_nodes:
            break
        grid = split(grid, _parts(errors, tolerance, len(scheme.points) + 1, most_nodes - len(grid)))
    reached = "at most" if errors.max() <= tolerance else "still"
    refined = replayed(dataclasses.replace(current, method="refinement", timing=timing), tolerance)
    message = f"local error {reached} {errors.max():.2g} on {current.nodes} nodes; {refined.message}"
    refined = dataclasses.replace(refined, message=message)
    if refined.ok:
        return refined
    even = solve(
        problem, refined.nodes, scheme=scheme, guess=refined, parameters=parameters, options=options,
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
