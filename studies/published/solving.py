"""Plain ``solve()`` of one published problem in its own process, which cannot end its caller.

    python -m mathnavi.studies.published.solving '{"problem": "PSOPT: breakwell", "draw": null, "setting": "as it is"}'

A process computes on one core. It prints its figures as a line of JSON; an exception is a figure too, and so are a
crash and a process that has spent ``SECONDS`` of CPU time, which the kernel ends. CPU times are those of the statement
and of ``solve()``, all threads included, without imports.

A **draw** perturbs the stated guess: each value by ``PERTURBATION`` of its variable's scale times a normal deviate. A
**setting** makes one machine round as another: glibc's functions without fused multiply-add differ in last digits, and
so do BLAS kernels for an old processor.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mathnavi.controllers.ocp.phase_solutions import MultiPhaseSolution
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.solution import ReplayResult, Solution
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.sweep.child import ENVIRONMENT
from mathnavi.studies.published.library import EVERY

SECONDS = 120  # of CPU time for a problem
HANGING = 20 * SECONDS  # [s] of wall-clock time after which a process that computes nothing is ended
PERTURBATION = 1e-12  # of a guess, relative to the scale
AS_IT_IS = "as it is"
_NO_FMA = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"
SETTINGS: dict[str, dict[str, str]] = {
    AS_IT_IS: {},
    "libm without FMA": {"GLIBC_TUNABLES": _NO_FMA},
    "no AVX2 or FMA": {
        "GLIBC_TUNABLES": f"{_NO_FMA},-AVX",
        "OPENBLAS_CORETYPE": "Nehalem",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3",
    },
}
"""environment of a process by the name of its setting; a variable that a platform does not know changes nothing"""
TIMED_OUT, FAILED = "time limit", "error"
"""statuses of what returned no solution"""


@dataclass(frozen=True)
class Attempt:
    """A solve of a problem."""

    problem: str  # name in ``library.EVERY``
    draw: int | None = None  # seed of the generator that perturbs the guess; None for the guess as it is stated
    setting: str = AS_IT_IS


def attempted(attempt: Attempt) -> dict[str, Any]:
    """A job: the figures of an attempt, also where its process ends early."""
    command = [sys.executable, "-P", "-m", "mathnavi.studies.published.solving", json.dumps(asdict(attempt))]
    environment = os.environ | ENVIRONMENT | SETTINGS[attempt.setting]
    began = time.perf_counter()
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, env=environment, timeout=HANGING, stdin=subprocess.DEVNULL,
            check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return without_solution(TIMED_OUT, f"ended after {HANGING} s by the clock", time.perf_counter() - began)
    return told(done.returncode, done.stdout, done.stderr, time.perf_counter() - began)


def told(code: int, output: str, errors: str, seconds: float) -> dict[str, Any]:
    """Return the figures that a process has printed, or how it ended without any."""
    lines = [line for line in output.splitlines() if line.startswith("{")]
    if code == 0 and lines:
        found: dict[str, Any] = json.loads(lines[-1])
        return found | {"cpu_s": MeasuredTime(found["cpu_s"]), "wall_s": MeasuredTime(found["wall_s"])}
    if code == -signal.SIGXCPU:
        return without_solution(TIMED_OUT, f"ended after {SECONDS} s of CPU time", seconds)
    last = errors.strip().rpartition("\n")[2]
    ended = f"ended by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return without_solution(FAILED, f"{ended}: {last}" if last else ended, seconds)


def without_solution(status: str, message: str, seconds: float) -> dict[str, Any]:
    """Return the figures of an attempt that has no solution, after ``seconds`` by the clock."""
    spent = MeasuredTime(seconds)
    return {"status": status, "message": message, **no_figures(), "cpu_s": spent, "wall_s": spent}


def no_figures() -> dict[str, Any]:
    """Return the figures of no solution."""
    missing = ("cost", "cost_replayed", "miss", "miss_by_intervals", "path_violation", "cost_error")
    return {**dict.fromkeys(missing, math.nan), "solved": False, "nodes": 0, "iterations": 0}


def figures(found: Solution) -> dict[str, Any]:
    """Return J, the figures of its replay, and how much it took."""
    taken = no_figures() | {"cost": found.cost, "solved": found.solved}
    taken |= {"nodes": found.nodes, "iterations": found.iterations}
    replay = found.replay
    if replay is None:
        return taken
    return taken | {
        "cost_replayed": replay.cost,
        "miss": miss_in_one_piece(replay),
        "miss_by_intervals": replay.miss if replay.by_intervals else math.nan,
        "path_violation": replay.path_violation,
        "cost_error": replay.cost_error,
    }


def miss_in_one_piece(replay: ReplayResult) -> float:
    """Return the miss at the end of a flight from the start; NaN where intervals alone were flown."""
    return math.nan if replay.by_intervals else replay.miss


def solved(problem: OptimalControlProblem | MultiPhaseProblem) -> dict[str, Any]:
    """Return the figures of plain ``solve()``; an exception is a status too."""
    try:
        found: Solution | MultiPhaseSolution = problem.solve(progress=False)
    except Exception as error:  # what ends one problem is a row of a table of many
        reason = f"{type(error).__name__}: {error}".partition("\n")[0]
        return {"status": FAILED, "message": reason, **no_figures()}
    whole = found.stacked if isinstance(found, MultiPhaseSolution) else found
    return {"status": found.status.name.lower(), "message": found.message, **figures(whole)}


def perturbed(functions: ProblemFunctions, generator: np.random.Generator) -> ProblemFunctions:
    """Return a problem with every value of its guess moved by ``PERTURBATION`` of its scale, inside its bounds."""

    def moved(values: Array, scale: Array, bounds: Interval) -> Array:
        deviates = generator.standard_normal(values.shape)
        return np.asarray(np.clip(values + PERTURBATION * scale * deviates, *bounds))

    T = functions.guess_duration * (1.0 + PERTURBATION * float(generator.standard_normal()))
    return dataclasses.replace(
        functions,
        guess_states=moved(functions.guess_states, functions.state_scale, functions.state_bounds),
        guess_controls=moved(functions.guess_controls, functions.control_scale, functions.control_bounds),
        guess_duration=float(np.clip(T, *functions.duration_bounds)),
    )


def performed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of an attempt that is made in this process."""
    attempt = Attempt(**document)
    state = EVERY[attempt.problem].statement
    assert state is not None
    cpu, wall = time.process_time(), time.perf_counter()
    problem = state()
    if attempt.draw is not None:
        moved = perturbed(problem.functions(), np.random.default_rng(attempt.draw))
        vars(problem)["functions"] = lambda: moved  # the one place at which solve() takes the guess
    found = solved(problem)
    return found | {"cpu_s": time.process_time() - cpu, "wall_s": time.perf_counter() - wall}


def main(argument: str) -> None:
    """Make an attempt, within the limit of CPU time."""
    soft, hard = math.ceil(time.process_time()) + SECONDS, resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (soft, hard))  # ended by SIGXCPU: nothing else ends a solver that hangs
    print(json.dumps(performed(json.loads(argument))), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
