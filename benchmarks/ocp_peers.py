"""Optimal control problems with known optima, from the statement to J within the tolerance, beside other people's.

    python benchmarks/ocp_peers.py [--repetitions 3] [--problems NAME NAME ...]

Everyone gets the same CasADi functions, bounds, scales and coarse guess. Each has a list of settings, from a coarse
mesh tolerance to a fine one; the first whose J is within the problem's tolerance of the known optimum is the one that
is timed, and a peer without one is named. Ours is held to more: the solution has to pass the replay gate, and J has to
be as near when it is replayed. What is timed is all from the stated problem to J: transcription, solves, refinement,
of ours the replays too; nothing is kept from the run before. Wall clock, since MAPTOR and dymos may use several
threads.
"""

from __future__ import annotations

import dataclasses
import gc
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from annotated_types import Ge
from rich.console import Console
from rich.table import Table

from benchmarks import ocp_dymos, ocp_maptor
from benchmarks.comparison import Comparison, alone
from benchmarks.progress import progress
from mathnavi.controllers.ocp.methods.hp import hp
from mathnavi.controllers.ocp.methods.refinement import refine
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.library import PROBLEMS, KnownOptimum
from mathnavi.controllers.ocp.solution import Outcome, Solution
from mathnavi.sim.interfaces.bounds import Within, configuration
from mathnavi.sim.interfaces.errors import FieldError
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.studies.nodes.ocp_problems import ADAPTIVE, Method

OURS = "ours"
NODES = 60  # that ours may use
MESH_TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6)
DEFAULT = (
    "brachistochrone", "Bryson-Denham", "hypersensitive, short", "double integrator, time", "Goddard", "van der Pol",
    "Rayleigh", "cart-pole",
)  # fmt: skip
SMALL = ("brachistochrone", "Bryson-Denham", "double integrator, time")  # what a dense optimiser does in seconds

Solve = Callable[[], float | None]  # J, None where there is no solution
Prepare = Callable[[ProblemFunctions], Solve]


@configuration
class Arguments:
    """Measure our optimal control methods beside MAPTOR and dymos."""

    problems: tuple[str, ...] = DEFAULT
    """names of problems"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 3
    """runs of each"""
    out: Path = Path("renders/out/ocp_peers.json")
    """where the figures go"""

    def __post_init__(self) -> None:
        if unknown := [name for name in self.problems if name not in PROBLEMS]:
            raise FieldError(f"problems = {', '.join(unknown)}; allowed: {', '.join(PROBLEMS)}")


@dataclass(frozen=True)
class Software:
    """Somebody with the settings to try, in order."""

    name: str
    settings: dict[str, Prepare]
    problems: tuple[str, ...] = tuple(PROBLEMS)  # that it is given


def softwares() -> list[Software]:
    """Ours first, then what is installed."""
    found = [Software(OURS, our_settings())]
    if find_spec("maptor"):
        found.append(Software(ocp_maptor.NAME, _by_tolerance(ocp_maptor.prepared)))
    if find_spec("dymos"):
        found.append(Software(ocp_dymos.NAME, _by_tolerance(ocp_dymos.prepared), SMALL))
    return found


def our_settings() -> dict[str, Prepare]:
    """Refinement from a coarse tolerance to a fine one, then hp refinement, then the study's other adaptive methods."""

    def refined(tolerance: float, problem: ProblemFunctions) -> Solve:
        return lambda: accepted(problem, refine(_unknown(problem), most_nodes=NODES, tolerance=tolerance))

    def with_switches(tolerance: float, problem: ProblemFunctions) -> Solve:
        return lambda: accepted(problem, hp(_unknown(problem), tolerance=tolerance))

    def otherwise(method: Method, problem: ProblemFunctions) -> Solve:
        return lambda: accepted(problem, method(_unknown(problem), NODES))

    settings: dict[str, Prepare] = {f"refinement, {t:g}": partial(refined, t) for t in MESH_TOLERANCES}
    settings |= {f"hp refinement, {t:g}": partial(with_switches, t) for t in MESH_TOLERANCES[1:]}
    others = {name: method for name, method in ADAPTIVE.items() if name != "refinement"}
    return settings | {name: partial(otherwise, method) for name, method in others.items()}


def _by_tolerance(prepared: Callable[[ProblemFunctions, float], Solve]) -> dict[str, Prepare]:
    def at(tolerance: float, problem: ProblemFunctions) -> Solve:
        return prepared(problem, tolerance)

    return {f"{tolerance:g}": partial(at, tolerance) for tolerance in MESH_TOLERANCES}


def _unknown(problem: ProblemFunctions) -> ProblemFunctions:
    """The same problem as one that no cache has seen."""
    return dataclasses.replace(problem)


def accepted(problem: ProblemFunctions, solution: Solution) -> float | None:
    """The farther from the optimum of J and the replayed J; None without a solution that the gate passed."""
    if not solution.solved or solution.status is Outcome.REFUSED:
        return None
    if solution.replay is None or not math.isfinite(solution.replay.cost):
        return None
    known = next(known for known in PROBLEMS.values() if known.problem() is problem)
    return max((solution.cost, solution.replay.cost), key=known.error)


@dataclass(frozen=True, eq=False)
class Entry:
    """One software on one problem."""

    problem: str
    software: str
    setting: str  # that is timed; empty if none came to the tolerance
    error: float  # relative, with it
    seconds: Array  # (R,) [s] wall clock


@dataclass(frozen=True, eq=False)
class PeerFindings:
    """Errors and times of every software."""

    entries: list[Entry]

    @property
    def title(self) -> str:
        return "optimal control problems, J to 1e-4"

    def comparisons(self) -> list[Comparison]:
        ours = {entry.problem: entry for entry in self.entries if entry.software == OURS and entry.setting}
        return [
            Comparison(
                entry.problem, "ms", 1e3 * ours[entry.problem].seconds, 1e3 * entry.seconds, entry.software,
                "other / ours",
            )
            for entry in self.entries
            if entry.software != OURS and entry.setting and entry.problem in ours
        ]  # fmt: skip

    def show(self, console: Console) -> None:
        shown = Table(title="first setting that comes to the tolerance")
        for heading in ("problem", "software", "setting", "error", "ms"):
            shown.add_column(heading, justify="right" if heading in ("error", "ms") else "left", no_wrap=True)
        for entry in self.entries:
            time_ms = f"{1e3 * np.median(entry.seconds):.0f}" if entry.setting else ""
            shown.add_row(entry.problem, entry.software, entry.setting or "none", f"{entry.error:.0e}", time_ms)
        console.print(shown)

    def plain(self) -> dict[str, Any]:
        return {
            "nodes": NODES,
            "entries": [
                {
                    "problem": entry.problem,
                    "software": entry.software,
                    "setting": entry.setting or None,
                    "error": entry.error,
                    "seconds": entry.seconds.tolist(),
                }
                for entry in self.entries
            ],
        }


def first_setting(software: Software, known: KnownOptimum) -> tuple[str, float]:
    """The first setting whose J is within the tolerance, with its error; none: an empty name and the least error."""
    least = np.inf
    for setting, prepare in software.settings.items():
        cost = prepare(known.problem())()
        error = np.inf if cost is None else known.error(cost)
        if error <= known.tolerance:
            return setting, error
        least = min(least, error)
    return "", least


def seconds(solve: Solve) -> float:
    """Wall-clock time [s] of a solve; the rubbish of what was before is not its own."""
    gc.collect()
    began = time.perf_counter()
    solve()
    return time.perf_counter() - began


def run(arguments: Arguments, console: Console) -> PeerFindings:
    """Look for the settings, then time everyone in turns."""
    known_softwares = softwares()
    for module, name in (("maptor", ocp_maptor.NAME), ("dymos", ocp_dymos.NAME)):
        if not find_spec(module):
            console.print(f"{name} is left out: it is not installed (pip install -e '.[bench]')", markup=False)
    entries: list[Entry] = []
    with progress(console, "problems of optimal control", len(arguments.problems)) as tell:
        for done, name in enumerate(arguments.problems):
            tell(done, name)
            entries += _measured(name, [s for s in known_softwares if name in s.problems], arguments.repetitions)
    return PeerFindings(entries)


def _measured(name: str, contenders: Sequence[Software], repetitions: int) -> list[Entry]:
    known = PROBLEMS[name]
    chosen = [first_setting(software, known) for software in contenders]
    timed: list[list[float]] = [[] for _ in contenders]
    for _ in range(repetitions):
        for software, (setting, _), times in zip(contenders, chosen, timed, strict=True):
            if setting:
                times.append(seconds(software.settings[setting](known.problem())))
    return [
        Entry(name, software.name, setting, error, np.array(times))
        for software, (setting, error), times in zip(contenders, chosen, timed, strict=True)
    ]


def main(arguments: Arguments) -> None:
    alone("ocp_peers", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=Arguments.__doc__))
