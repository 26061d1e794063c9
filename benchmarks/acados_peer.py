"""Swing-up of the cart-pole by acados and by ``solve()``: CPU time to the same replayed accuracy.

    python -m benchmarks.acados_peer [--repetitions 3] [--folder FOLDER] [--intervals 40 160 ...]

acados holds the control on each of N intervals, so the accuracy grows with N; N is increased until J and the replayed J
are within ``LEVEL`` of the optimum, and ``solve()`` is timed at the same level. acados runs in a separate process
(``acados_cart_pole``), because it brings its own CasADi. The time of acados excludes generation and compilation of its
solver; that of ``solve()`` includes the transcription of the problem.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge
from rich.console import Console

from benchmarks import ocp_ours
from benchmarks.acados_wheel import FOLDER, missing
from benchmarks.arguments import read_arguments
from benchmarks.comparison import Comparison, alone
from benchmarks.ocp_attempts import Attempt, attempts
from benchmarks.ocp_trajectory import Trajectory, judge
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.field_table import TOGETHER

NAME = "cart-pole"
LEVEL = 1e-2
SCRIPT = Path(__file__).with_name("acados_cart_pole.py")


@configuration
class Arguments:
    """Compare the swing-up of the cart-pole by ``solve()`` with acados."""

    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 3
    """number of solves by each solver"""
    intervals: Annotated[tuple[int, ...], TOGETHER] = (20, 40, 80)
    """numbers of intervals tried with acados, in this order"""
    folder: Path = FOLDER
    """folder into which pip install --target has put comma-deps-acados"""
    out: Path = Path("renders/out/acados_peer.json")
    """file of the figures"""


@dataclass(frozen=True)
class RealTime:
    """Real-time iterations from starts close to the solution."""

    ms: float  # CPU time, median
    failures: int
    count: int


@dataclass(frozen=True)
class AcadosFindings:
    """Attempts by ``solve()`` and by acados, with acados' real-time iterations."""

    ours: list[Attempt] = field(default_factory=list)
    acados: dict[int, Attempt] = field(default_factory=dict)  # by the number of intervals
    iterations: dict[int, RealTime] = field(default_factory=dict)

    @property
    def title(self) -> str:
        return "swing-up of the cart-pole"

    def comparisons(self) -> list[Comparison]:
        own = next((attempt for attempt in self.ours if attempt.accuracy <= LEVEL), None)
        pairs = [(n, attempt) for n, attempt in self.acados.items() if attempt.accuracy <= LEVEL]
        if own is None or not pairs:
            return []
        n, other = pairs[0]
        count = min(len(own.seconds), len(other.seconds))
        mine_ms, other_ms = (1e3 * np.array(attempt.seconds[:count]) for attempt in (own, other))
        return [
            Comparison(f"{NAME}, {LEVEL:g}", "ms", mine_ms, other_ms, f"acados, SQP, {n} intervals", "other / ours")
        ]

    def show(self, console: Console) -> None:
        rows = [(f"acados, {n} intervals", attempt) for n, attempt in self.acados.items()]
        rows += [(f"ours, tolerance {attempt.tolerance:g}", attempt) for attempt in self.ours]
        for name, attempt in rows:
            console.print(
                f"{name}: J error {attempt.cost_error:.1e}, accuracy {attempt.accuracy:.1e}, "
                f"{1e3 * np.median(attempt.seconds):.3g} ms, load {attempt.load:.1f}"
            )
        for n, own in self.iterations.items():
            failed = f"{own.failures} of {own.count} failed"
            console.print(f"acados, {n} intervals: {own.ms:.3g} ms for a real-time iteration, {failed}")

    def plain(self) -> dict[str, Any]:
        return {
            "ours": [vars(attempt) for attempt in self.ours],
            "acados": {str(n): vars(attempt) for n, attempt in self.acados.items()},
            "iterations": {str(n): vars(own) for n, own in self.iterations.items()},
        }


def solved(folder: Path, intervals: int, repetitions: int) -> tuple[Attempt, RealTime]:
    """Return one attempt by acados, evaluated by the replay, and its real-time iterations."""
    command = [sys.executable, str(SCRIPT), str(folder), str(intervals), str(repetitions)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"acados: exit code {done.returncode}\n{done.stderr[-2000:]}")
    found = json.loads(done.stdout.splitlines()[-1])
    problem = PROBLEMS[NAME].problem()
    held = [np.array([control]) for control in found["controls"]]
    trajectory = Trajectory(
        problem,
        problem.duration_bounds[0],
        np.linspace(0.0, 1.0, intervals + 1),
        np.array(found["states"]),
        tuple(np.array([0.5]) for _ in held),
        tuple(held),
        found["cost"],
    )
    verdict = judge(trajectory, PROBLEMS[NAME])
    accuracy = verdict.accuracy if found["solved"] else np.inf
    load = os.getloadavg()[0]
    attempt = Attempt(1.0 / intervals, verdict.cost_error, accuracy, tuple(found["seconds"]), load)
    times = found["iteration_seconds"]
    return attempt, RealTime(1e3 * float(np.median(times)), found["iteration_failures"], len(times))


def run(arguments: Arguments, console: Console) -> AcadosFindings:
    """Solve with acados on increasingly many intervals, then with ``solve()``."""
    if reason := missing(arguments.folder):
        console.print(f"acados is left out: {reason}", markup=False)
        return AcadosFindings()
    acados: dict[int, Attempt] = {}
    iterations: dict[int, RealTime] = {}
    for n in arguments.intervals:
        acados[n], iterations[n] = solved(arguments.folder, n, arguments.repetitions)
        if acados[n].accuracy <= LEVEL:
            break
    ours = list(attempts(ocp_ours.solved, PROBLEMS[NAME], arguments.repetitions))
    return AcadosFindings(ours, acados, iterations)


def main(arguments: Arguments) -> None:
    alone("acados_peer", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
