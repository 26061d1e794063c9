"""Other starts: whether a lower minimum than the one that was found lies elsewhere.

The problem is solved from other guesses (see ``feasibility.starts``), first that of the guessed controls,
simulated, on a coarse uniform mesh: 21 nodes with three points each. A coarse mesh has an error of J of its own, so
what counts is J of the solution that is known, solved on that mesh too. The mesh holds the solution where this solve
ends, with

    |J_c(known) - J(known)| <= 0.1 J_s;

otherwise it is another solution, or none, that would be compared. Where the caller has asked for other starts, they are
solved on the first of twice, four and eight times as many intervals that hold the known one; what no mesh holds is
compared on the last one on which it can be solved, and the result says so. Where J from another start is lower there,

    J_c < J_c(known) - 1e-3 J_s,

the problem is solved from it by the method itself, the lowest first, and what this confirms takes the place of the
known one. A minimum that no start came to may be lower still.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.call import at
from mathnavi.controllers.ocp.feasibility.starts import starts
from mathnavi.controllers.ocp.grid import on_breaks, uniform
from mathnavi.controllers.ocp.problem_functions import GuessedTrajectory
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import FIXED, Options, transcription
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA

STARTS = 3
"""number of starts, the own one and others, where the error of J is bounded"""
_SEED = 0
_NODES, _POINTS = (21, 41, 81, 161), 3  # of the meshes, the first that holds the known solution; of each interval
_ITERATIONS, _SECONDS = 100, 5.0  # of a start
_TOLERANCE = 1e-8  # of the solver there
_LOWER = 1e-3  # of J_s: difference of J on the coarse mesh that counts
_HELD = 0.1  # of J_s: largest error of the known J on a mesh that compares it
_DIVERGING = 4  # starts that are tried for one whose simulation does not diverge


@dataclass(frozen=True)
class OtherStarts:
    """Starts in addition to the one of a solution: how many, the guess that they vary, and the method itself."""

    count: int
    guess: GuessedTrajectory
    method: Callable[[Solution], Solution]  # solves the problem from a solution on another mesh, and replays it
    asked: bool = False  # True if the caller has asked for them: finer meshes are tried where the coarsest does not do


@dataclass(frozen=True)
class Minima:
    """Result: J on the coarse mesh of each minimum, the lowest first, and how many starts came to it."""

    lower: Solution | None  # a lower minimum, by the method itself
    unconfirmed: float | None  # a lower J that the method could not solve to the tolerance
    costs: tuple[float, ...]
    starts: tuple[int, ...]
    failed: int  # starts that led to none
    nodes: int = _NODES[0]  # of the mesh: the finest that was tried
    known: float = np.nan  # J on it of the solution that is known, NaN where it cannot be solved there
    held: bool = False  # True if this is the J of the solution but for the error of a coarse mesh

    def __str__(self) -> str:
        """The minima in words."""
        found = ", ".join(
            f"J about {cost:.4g} from {count}" for cost, count in zip(self.costs, self.starts, strict=True)
        )
        none = f", none from {self.failed}" if self.failed else ""
        total = sum(self.starts) + self.failed
        if not found:
            return (
                f"{total} other starts are not compared: the solution cannot be solved again on the coarse mesh of "
                f"{self.nodes} nodes that compares them"
            )
        mesh = f"a coarse mesh of {self.nodes} nodes"
        if not self.held:
            mesh += f" that does not hold the solution, for its J there is about {self.known:.4g}"
        return f"minima from {total} starts, on {mesh}: {found}{none}"


def minima(solution: Solution, others: OtherStarts, size: float, options: Options, budget: Budget) -> Minima:
    """Solve the problem of a solution from other starts.

    Args:
        solution: the minimum that is known, with its replay.
        others: the starts.
        size: J_s, in units of J.
        options: the solver's.
        budget: CPU time of the call that this belongs to.
    """
    problem, p = solution.problem, solution.parameters
    coarse = dataclasses.replace(
        options, tolerance=_TOLERANCE, backend="ipopt", warm=False, log=None,
        seconds=min(budget.left(options).seconds, _SECONDS), iterations=min(options.iterations, _ITERATIONS),
    )  # fmt: skip
    best, held = None, False
    for nodes in _NODES if others.asked else _NODES[:1]:
        grid = on_breaks(uniform(nodes), problem.breaks)
        with at("other starts", "coarse mesh"):
            made = transcription(problem, RadauIIA(_POINTS), len(grid), FIXED, coarse)
            known = made.solve(solution, grid, p, explained=False)
        if known.solved:
            best, held = (nodes, grid, made, known), abs(known.cost - solution.cost) <= _HELD * size
        if held or budget.spent:
            break
    if best is None:  # on any of these meshes: nothing to compare with
        return Minima(None, None, (), (), others.count, nodes)
    nodes, grid, made, known = best
    found, failed = [known], 0
    for start in islice(_guesses(solution, others), others.count):
        if budget.spent:
            break
        with at(f"other start {len(found) + failed}", "coarse mesh"):
            other = made.solve(start, grid, p, explained=False)
        found += [other] if other.solved else []
        failed += int(not other.solved)
    groups = _groups(found, _LOWER * size)
    # What the known one leads to on a mesh that does not hold it may be another minimum.
    bound = known.cost if held or not others.asked else solution.cost
    lower = [group[0] for group in groups if group[0].cost < bound - _LOWER * size]
    chosen, unconfirmed = None, None
    for each in lower:
        if budget.spent:
            break
        with at("a lower minimum from another start"):
            better = others.method(each)
        if better.ok and better.cost < solution.cost - solution.tolerance * size:
            chosen = better
            break
        if unconfirmed is None and better.solved and better.replay is not None:
            gain = solution.cost - max(better.cost, better.replay.cost)
            unconfirmed = better.cost if gain > 10.0 * size * better.replay.error else None
    costs, counts = tuple(group[0].cost for group in groups), tuple(len(group) for group in groups)
    unconfirmed = None if chosen is not None else unconfirmed
    return Minima(chosen, unconfirmed, costs, counts, failed, nodes, known.cost, held)


def _guesses(solution: Solution, others: OtherStarts) -> Iterator[GuessedTrajectory]:
    """Guesses of the other starts; more than their number, for the simulation of the first may diverge."""
    many, rng = others.count + _DIVERGING, np.random.default_rng(_SEED)
    for _, guess in starts(solution.problem, others.guess, solution.parameters, many, rng):
        yield guess


def _groups(found: list[Solution], apart: float) -> list[list[Solution]]:
    """Solutions of the same J, the lowest first."""
    groups: list[list[Solution]] = []
    for each in sorted(found, key=lambda solution: solution.cost):
        if groups and each.cost - groups[-1][0].cost <= apart:
            groups[-1].append(each)
        else:
            groups.append([each])
    return groups
