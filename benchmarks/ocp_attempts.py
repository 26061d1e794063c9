"""Attempts of one solver on one problem: a script that prints a line of JSON for each tolerance.

    python -m benchmarks.ocp_attempts ours|maptor|dymos|collocation PROBLEM REPETITIONS SECONDS

The tolerances become finer until the replay is within the problem's precision. An attempt that reaches a finer level of
accuracy than those before it is repeated to measure its time. Times are CPU times of the process
(``time.process_time``), all threads included; imports and the replay are excluded. After SECONDS of CPU time, imports
excluded, the kernel ends the process, for nothing else ends a solver that does not return.
"""

from __future__ import annotations

import json
import math
import os
import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib import import_module

import casadi as ca

from benchmarks.ocp_trajectory import Trajectory, Verdict, judge
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.library import PROBLEMS, KnownOptimum

Solve = Callable[[ProblemFunctions, float], Trajectory | None]

MODULES = {
    "ours": "benchmarks.ocp_ours",
    "maptor": "benchmarks.ocp_maptor",
    "dymos": "benchmarks.ocp_dymos",
    "collocation": "benchmarks.ocp_collocation",
}
PACKAGES = {"maptor", "dymos"}  # whose import is not in their time
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # that a software is given, in this order
LEVELS = (1e-3, 1e-4, 1e-5, 1e-6)  # of accuracy that are distinguished


@dataclass(frozen=True)
class Attempt:
    """Attempt of one solver on one problem at one tolerance."""

    tolerance: float  # that it was given
    cost_error: float  # of J and replayed J, the larger; None in JSON is infinite
    accuracy: float  # with the replay's miss and violation; infinite without a solution
    seconds: tuple[float, ...]  # (R,) CPU time
    load: float  # of the machine over the last minute


def level(accuracy: float) -> float | None:
    """Return the finest level of ``LEVELS`` that an accuracy reaches; None if it reaches no level."""
    return min((own for own in LEVELS if accuracy <= own), default=None)


def attempts(solve: Solve, known: KnownOptimum, repetitions: int) -> Iterator[Attempt]:
    """Yield attempts from coarse to fine tolerances, until one is within the problem's precision."""
    finest = float("inf")
    for tolerance in TOLERANCES:
        seconds = []
        trajectory, spent = _timed(solve, known.problem(), tolerance)
        seconds.append(spent)
        verdict = Verdict(*3 * [float("inf")]) if trajectory is None else judge(trajectory, known)
        reached = level(verdict.accuracy)
        if reached is not None and reached < finest:
            finest = reached
            seconds += [_timed(solve, known.problem(), tolerance)[1] for _ in range(repetitions - 1)]
        load = os.getloadavg()[0]
        yield Attempt(tolerance, verdict.cost_error, verdict.accuracy, tuple(seconds), load)
        if verdict.accuracy <= known.precision:
            return


def _timed(solve: Solve, problem: ProblemFunctions, tolerance: float) -> tuple[Trajectory | None, float]:
    began = time.process_time()
    try:
        found = solve(problem, tolerance)
    except (RuntimeError, ValueError, ArithmeticError) as error:  # a peer's own failure is an attempt without a result
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        found = None
    return found, time.process_time() - began


def main(software: str, problem: str, repetitions: int, limit: int) -> None:
    solve: Solve = import_module(MODULES[software]).solved
    ca.load_nlpsol("ipopt")  # what is loaded once in a process is not in the first time
    if software in PACKAGES:
        import_module(software)
    soft, hard = math.ceil(time.process_time()) + limit, resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (soft, hard))  # ended by SIGXCPU
    for attempt in attempts(solve, PROBLEMS[problem], repetitions):
        print(json.dumps(asdict(attempt)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
