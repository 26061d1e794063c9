"""Replans of the flight planner, solved by mathnavi and by other software: thread CPU time and cost.

    python -m benchmarks.flight_solvers [--terrain NAME|FILE.npz] [--problems 600] [--repetitions 5]

Problems are recorded from closed-loop missions of the scenario ``safe-flight`` (N = 13, seeds 1, 2, ...) and then
solved again, in their order and from the planner's guess, by

* the condensed solver (``mathnavi.controllers.flight.sqp``),
* IPOPT and FATROP on CasADi's statement (``mathnavi.controllers.flight.reference``), warm started from the guess and
  from the multipliers of the problem before, in CasADi's virtual machine (VM) and, if there is a C compiler, compiled
  (C),
* do-mpc (extra ``[bench]``) with IPOPT and the same warm start,
* acados, in a separate process (``acados_replan``): full sequential quadratic programming, and one real-time iteration,
  from the guess and the multipliers of the problem before; the first has no multipliers.

In each repetition every solver is built again and solves all problems. Times are those of the thread
(``time.thread_time``). The cost is the same function for all, ``objective`` at the accelerations and climb rate found,
and is compared with the least that any of them found at any tolerance. benchmarks/README.md explains the differences.
"""

from __future__ import annotations

import math
import os
import shutil
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any
from unittest import mock

from annotated_types import Ge

from benchmarks.arguments import read_arguments
from mathnavi.interfaces.bounds import Within, configuration

os.environ.setdefault("MUJOCO_GL", "disable")

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks import acados_replan
from benchmarks.acados_wheel import FOLDER, missing
from benchmarks.comparison import Comparison, alone
from benchmarks.do_mpc_solver import DoMpc
from benchmarks.progress import Report, progress
from mathnavi.controllers.flight import plugin
from mathnavi.controllers.flight.kernels.problem_data import objective
from mathnavi.controllers.flight.planner import Solver
from mathnavi.controllers.flight.problem import PlanSolution, Problem
from mathnavi.controllers.flight.reference import InteriorPoint
from mathnavi.controllers.flight.sqp import CondensedSqp
from mathnavi.interfaces.signals import Array
from mathnavi.sim.scenarios.flight_fields import SafeFlightConfig
from mathnavi.sim.scenarios.safe_flight import SafeFlight

TOLERANCE = 1e-6
SAME_COST = 1e-5
OURS, IPOPT, DO_MPC = "condensed", "ipopt, VM", "do-mpc"
AT_LEAST = {(IPOPT, "mean"): 30.0, (DO_MPC, "mean"): 40.0, (DO_MPC, "median"): 40.0}  # times our time


@configuration
class Arguments:
    """Measure the flight planner's solvers side by side."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    problems: Annotated[int, Within(Ge(1), allowed=">= 1")] = 600
    """least number of problems to record"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 5
    """number of solves of each problem by each solver"""
    acados: Path = FOLDER
    """folder into which pip install --target has put comma-deps-acados"""
    out: Path = Path("renders/out/flight_solvers.json")
    """file of the figures"""


Recorded = list[tuple[Problem, Array]]  # each with its guess
Contestants = Mapping[str, Callable[[], Any]]  # how each solver is built


class Recorder:
    """Solver that records its problems, those with an exact arrival left out."""

    def __init__(self, solver: Solver, into: Recorded) -> None:
        self._solver, self._into = solver, into

    def solve(self, problem: Problem, guess: Array) -> PlanSolution | str:
        if problem.terminal_position is None:
            self._into.append((problem, guess.copy()))
        return self._solver.solve(problem, guess)


def record(terrain: str, count: int, report: Report) -> Recorded:
    """Record at least ``count`` problems from whole missions."""
    recorded: Recorded = []
    build = plugin.solver
    seed = 0
    while len(recorded) < count:
        seed += 1
        mission: Recorded = []
        with mock.patch.object(plugin, "solver", lambda config, into=mission: Recorder(build(config), into)):
            SafeFlight.build(SafeFlightConfig(terrain=terrain), seed).run()
        recorded += mission
        report(len(recorded))
    return recorded


@dataclass(frozen=True, eq=False)
class Result:
    """Results of one solver on every problem."""

    ms: Array  # (R, n) thread CPU time [ms]
    cost: Array  # (n,) NaN where it failed
    iterations: float  # mean

    @property
    def failures(self) -> int:
        return int(np.isnan(self.cost).sum())

    @property
    def mean_ms(self) -> Array:
        """Mean time (R,) [ms] over the problems."""
        mean: Array = self.ms.mean(axis=1)
        return mean

    def percentile_ms(self, percent: float) -> Array:
        """Return a percentile (R,) [ms] of the times over the problems."""
        percentile: Array = np.percentile(self.ms, percent, axis=1)
        return percentile


def cost_of(problem: Problem, solution: PlanSolution) -> float:
    """Return the objective at the unknowns of a solution."""
    return float(objective(solution.unknowns, problem.data))


def measure(contestants: Contestants, problems: Recorded, repetitions: int, console: Console) -> dict[str, Result]:
    """Solve every problem in order with one solver after the other, ``repetitions`` times."""
    n = len(problems)
    ms = {name: np.empty((repetitions, n)) for name in contestants}
    costs = {name: np.empty(n) for name in contestants}
    iterations: dict[str, list[int]] = {name: [] for name in contestants}
    done = 0
    with progress(console, "solving", repetitions * len(contestants) * n) as report:
        for repetition in range(repetitions):
            for name, build in contestants.items():
                doing = f"{name}, {repetition + 1} of {repetitions}"
                report(done, doing)
                solver = build()
                prepare = getattr(solver, "prepare", lambda problem, guess: None)
                prepare(*problems[0])
                solver.solve(*problems[0])  # builds what is built once
                for i, (problem, guess) in enumerate(problems):
                    prepare(problem, guess)
                    began = time.thread_time()
                    outcome = solver.solve(problem, guess)
                    ms[name][repetition, i] = 1e3 * (time.thread_time() - began)
                    solved = isinstance(outcome, PlanSolution)
                    costs[name][i] = cost_of(problem, outcome) if solved else np.nan
                    iterations[name] += [outcome.iterations] if solved else []
                    done += 1
                    report(done, doing)
    return {
        name: Result(ms[name], costs[name], float(np.mean(iterations[name])) if iterations[name] else math.nan)
        for name in contestants
    }


def judged(problems: Recorded, ms: Array, solutions: Sequence[PlanSolution | None]) -> Result:
    """Return the result of a solver that ran in another process."""
    pairs = list(zip(problems, solutions, strict=True))
    costs = [np.nan if found is None else cost_of(problem, found) for (problem, _), found in pairs]
    iterations = [found.iterations for _, found in pairs if found is not None]
    return Result(ms, np.array(costs), float(np.mean(iterations)) if iterations else math.nan)


def solvers() -> Contestants:
    """Return the solvers that are available on this machine."""
    contestants: dict[str, Callable[[], Any]] = {
        OURS: partial(CondensedSqp, TOLERANCE),
        IPOPT: partial(InteriorPoint, "ipopt", TOLERANCE),
        "fatrop, VM": partial(InteriorPoint, "fatrop", TOLERANCE),
    }
    if shutil.which("cc"):
        contestants["ipopt, C"] = partial(InteriorPoint, "ipopt", TOLERANCE, compiled=True)
        contestants["fatrop, C"] = partial(InteriorPoint, "fatrop", TOLERANCE, compiled=True)
    if find_spec("do_mpc"):
        contestants[DO_MPC] = partial(DoMpc, TOLERANCE)
    return contestants


def _gap(cost: Array, best: Array) -> Array:
    return (cost - best) / (1.0 + np.abs(best))


@dataclass(frozen=True, eq=False)
class SolverFindings:
    """Results of every solver, and of two solvers at a tight tolerance."""

    terrain: str
    nodes: int
    results: dict[str, Result]
    condensed_tight: Array  # (n,) costs
    ipopt_tight: Array  # (n,) costs

    @property
    def count(self) -> int:
        return len(self.condensed_tight)

    @property
    def title(self) -> str:
        return f"{self.count} replans"

    @property
    def best(self) -> Array:
        """Least cost (n,) that any solver found."""
        costs = [result.cost for result in self.results.values()]
        best: Array = np.nanmin([*costs, self.condensed_tight, self.ipopt_tight], axis=0)
        return best

    @property
    def beyond_ipopt(self) -> Array:
        """Relative excess (n,) of the cost of condensed over that of ipopt, both at a tight tolerance."""
        return _gap(self.condensed_tight, self.ipopt_tight)

    @property
    def elsewhere(self) -> NDArray[np.bool_]:
        """Whether (n,) condensed and ipopt find different minima at a tight tolerance."""
        return np.abs(self.beyond_ipopt) > SAME_COST

    def comparisons(self) -> list[Comparison]:
        ours = self.results[OURS]
        rows = []
        for name, theirs in self.results.items():
            if name == OURS:
                continue
            software = f"{name} ({theirs.failures} failed)" if theirs.failures else name
            # Failures weigh on a mean: where there are some, the median must agree.
            for what, mine, other in (
                ("mean", ours.mean_ms, theirs.mean_ms),
                ("median", ours.percentile_ms(50.0), theirs.percentile_ms(50.0)),
            ):
                rows.append(
                    Comparison(what, "ms", mine, other, software, "other / ours", at_least=AT_LEAST.get((name, what)))
                )
        return rows

    def claims(self) -> list[dict[str, Any]]:
        """Return the claims on the condensed solver; costs exclude the problems with two minima."""
        ours = self.results[OURS]
        mean, p99 = float(np.median(ours.mean_ms)), float(np.median(ours.percentile_ms(99.0)))
        gap = float(np.nanmax(np.where(self.elsewhere, np.nan, _gap(ours.cost, self.results[IPOPT].cost))))
        listed = (
            ("mean thread CPU time of the condensed solver in ms", mean, 0.5),
            ("99th percentile of it in ms", p99, 1.5),
            (f"its cost above that of {IPOPT}, relative, worst", gap, SAME_COST),
        )
        return [
            {"statement": statement, "expected": f"<= {most:g}", "measured": measured, "holds": measured <= most}
            for statement, measured, most in listed
        ]

    def rows(self) -> list[dict[str, Any]]:
        """Return one row for each solver; times are medians over the repetitions."""
        rows = []
        for name, result in self.results.items():
            gap = _gap(result.cost, self.best)
            row: dict[str, Any] = {"solver": name, "mean_ms": float(np.median(result.mean_ms))}
            row |= {f"p{p}_ms": float(np.median(result.percentile_ms(p))) for p in (50, 99)}
            row |= {"iterations": result.iterations, "failures": result.failures}
            row |= {"worst_gap": float(np.nanmax(gap)), "gaps_above_1e-5": int(np.nansum(gap > SAME_COST))}
            rows.append(row)
        return rows

    def show(self, console: Console) -> None:
        title = f"{self.count} problems, N = {self.nodes}, {self.terrain}, tolerance {TOLERANCE:g}"
        shown = Table(title=title)
        for heading in ("solver", "ms", "p50", "p99", "steps", "failed", "worst gap", "> 1e-5"):
            shown.add_column(heading, justify="left" if heading == "solver" else "right", no_wrap=True)
        for row in self.rows():
            numbers = [f"{row[key]:.3g}" for key in ("mean_ms", "p50_ms", "p99_ms", "iterations")]
            gaps = (f"{row['worst_gap']:.1e}", str(row["gaps_above_1e-5"]))
            shown.add_row(row["solver"], *numbers, str(row["failures"]), *gaps)
        console.print(shown)
        better = int((self.beyond_ipopt < -SAME_COST).sum())
        console.print(
            f"At tight tolerances condensed and ipopt come to different minima in {self.elsewhere.sum()} of "
            f"{self.count} problems, condensed to the better one in {better}."
        )
        for claim in self.claims():
            sign = "holds" if claim["holds"] else "does not hold"
            console.print(f"{claim['statement']}: {claim['measured']:.3g}, wanted {claim['expected']}: {sign}")

    def plain(self) -> dict[str, Any]:
        return {
            "terrain": self.terrain,
            "problems": self.count,
            "tolerance": TOLERANCE,
            "solvers": self.rows(),
            "different_minima": int(self.elsewhere.sum()),
            "different_minima_condensed_better": int((self.beyond_ipopt < -SAME_COST).sum()),
            "claims": self.claims(),
        }


def run(arguments: Arguments, console: Console) -> SolverFindings:
    """Record problems and solve them with every solver."""
    warnings.simplefilter("ignore", FutureWarning)  # CasADi's, of how do-mpc calls it
    if not find_spec("do_mpc"):
        console.print(f"{DO_MPC} is left out: it is not installed (pip install -e '.[bench]')", markup=False)
    with progress(console, f"recording problems over {arguments.terrain}", arguments.problems) as report:
        problems = record(arguments.terrain, arguments.problems, report)
    results = measure(solvers(), problems, arguments.repetitions, console)
    if reason := missing(arguments.acados):
        console.print(f"acados is left out: {reason}", markup=False)
    else:
        for name, (ms, solutions) in acados_replan.solved(arguments.acados, problems, arguments.repetitions).items():
            results[name] = judged(problems, ms, solutions)
    tight = measure(
        {OURS: partial(CondensedSqp, 1e-10, 200), IPOPT: partial(InteriorPoint, "ipopt", 1e-9)}, problems, 1, console
    )
    nodes = problems[0][0].arcs + 1
    return SolverFindings(arguments.terrain, nodes, results, tight[OURS].cost, tight[IPOPT].cost)


def main(arguments: Arguments) -> None:
    alone("flight_solvers", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
