"""Speed-up of a sweep by a second process: the same short flights by one worker and by two, each into an empty store.

    python -m benchmarks.sweep_scaling [--trials 40] [--repetitions 3] [--workers 2]

``mathnavi.sim.sweep`` is compared with ``concurrent.futures.ProcessPoolExecutor``, which builds and runs the same
trials in processes with one thread each, and stores nothing. The time until as many trials have ended as there are
workers, in which their processes start, import and load compiled kernels, counts as the start; the rate is that of the
rest. The total time is also shown.

The largest possible gain depends on the machine: processes that share nothing, each flying its part of the same trials
from a common start, are timed concurrently and one alone.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any
from unittest import mock

from annotated_types import Ge

from benchmarks.arguments import read_arguments
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.errors import FieldError

os.environ.setdefault("MUJOCO_GL", "disable")

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.comparison import Comparison, alone
from benchmarks.progress import progress
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.child import ENVIRONMENT
from mathnavi.sim.sweep.execution import Progress, run_trials
from mathnavi.sim.sweep.trial import Trial, trial

OURS, POOL, MACHINE = "run_trials", "ProcessPoolExecutor", "processes that share nothing"
AT_LEAST = 1.9  # times as fast with two workers as with one

Kind = tuple[str, int]  # what runs a sweep, and with how many workers
Seconds = dict[Kind, Array]  # (R,) [s] of every kind


@configuration
class Arguments:
    """Measure the speed-up of a sweep by more processes."""

    terrain: str = "jacksboro"
    """name of a terrain, or an .npz file"""
    trials: int = 40
    """number of flights in a sweep"""
    workers: Annotated[int, Within(Ge(2), allowed=">= 2")] = 2
    """number of processes, which is compared with one"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 3
    """number of sweeps of each kind"""
    out: Path = Path("renders/out/sweep_scaling.json")
    """file of the figures"""

    def __post_init__(self) -> None:
        if self.trials < 3 * self.workers:
            raise FieldError(f"trials = {self.trials}; allowed: >= {3 * self.workers}")


@dataclass(frozen=True)
class Course:
    """Times at which the trials of one sweep ended."""

    start: float  # [s] until as many had ended as there are workers
    interval: float  # [s] between the ends of two trials after that
    whole: float  # [s] from the call to its return

    @staticmethod
    def from_ends(ends: Sequence[float], workers: int, whole: float) -> Course:
        """Return the course of a sweep from the ends [s] of its trials since the call, in order."""
        start = ends[workers - 1]
        return Course(start, (ends[-1] - start) / (len(ends) - workers), whole)


def swept(trials: Sequence[Trial], workers: int) -> Course:
    """Run the trials with ``mathnavi.sim.sweep`` into an empty store."""
    ends: list[float] = []

    def note(state: Progress) -> None:
        ends.extend([time.perf_counter() - began] * (state.done - len(ends)))

    with tempfile.TemporaryDirectory() as folder, Store.open(Path(folder) / "sweep.db") as store:
        began = time.perf_counter()
        records = run_trials(trials, store, workers=workers, progress=note)
        whole = time.perf_counter() - began
    for record in records:
        if record.status != "ok":
            raise RuntimeError(f"trial of seed {record.seed}: {record.status}: {record.error}")
    return Course.from_ends(ends, workers, whole)


def fly(trial: Trial) -> dict[str, Any]:
    """Return the summary of one trial, in a process of the pool."""
    return trial.flown().summary


def pooled(trials: Sequence[Trial], workers: int) -> Course:
    """Run the trials with a process pool of the standard library."""
    ends: list[float] = []
    with mock.patch.dict(os.environ, ENVIRONMENT):  # one thread to a process, as in a sweep
        began = time.perf_counter()
        with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
            for future in as_completed([pool.submit(fly, trial) for trial in trials]):
                future.result()
                ends.append(time.perf_counter() - began)
        whole = time.perf_counter() - began
    return Course.from_ends(ends, workers, whole)


def side_by_side(trials: Sequence[Trial], processes: int) -> Course:
    """Run the trials in processes that share nothing: each flies its part, and all begin at once."""
    parts = [trials[k::processes] for k in range(processes)]
    context = get_context("spawn")
    with mock.patch.dict(os.environ, ENVIRONMENT), context.Manager() as manager:
        began = time.perf_counter()
        together = manager.Barrier(processes)
        with ProcessPoolExecutor(processes, context) as pool:
            spans = [each.result() for each in [pool.submit(fly_part, part, together) for part in parts]]
        whole = time.perf_counter() - began
    return Course(whole - max(spans), sum(spans) / processes / len(trials), whole)


def fly_part(trials: Sequence[Trial], together: Any) -> float:
    """Return the time [s] of the trials, from when all processes have finished their imports."""
    fly(trials[0])
    together.wait()
    began = time.perf_counter()
    for each in trials:
        fly(each)
    return time.perf_counter() - began


@dataclass(frozen=True)
class SweepFindings:
    """Courses of all sweeps in the order of the repetitions."""

    trials: int
    workers: int  # of the larger sweeps
    courses: dict[Kind, list[Course]]

    @property
    def title(self) -> str:
        return f"sweep of {self.trials} flights"

    def comparisons(self) -> list[Comparison]:
        flights, wholes = self._seconds(lambda course: course.interval), self._seconds(lambda course: course.whole)
        one, many, itself = 1, self.workers, "the same, 1 worker"

        def row(
            what: str, seconds: Seconds, ours: Kind, other: Kind, software: str, at_least: float | None = None
        ) -> Comparison:
            return Comparison(what, "s", seconds[ours], seconds[other], software, "other / ours", at_least)

        return [
            row(
                f"a flight, {many} workers", flights, (OURS, many), (OURS, one), itself, AT_LEAST if many == 2 else None
            ),
            row(f"a flight, {many} processes", flights, (MACHINE, many), (MACHINE, one), f"{MACHINE}, 1"),
            row(f"a flight, {many} workers", flights, (OURS, many), (MACHINE, many), MACHINE),
            row(f"the whole, {many} workers", wholes, (OURS, many), (OURS, one), itself),
            row("a flight, 1 worker", flights, (OURS, one), (POOL, one), POOL),
            row(f"a flight, {many} workers", flights, (OURS, many), (POOL, many), POOL),
            row(f"the whole, {many} workers", wholes, (OURS, many), (POOL, many), POOL),
        ]

    def show(self, console: Console) -> None:
        shown = Table(title="medians")
        for heading in ("", "workers", "start [s]", "a flight [s]", "whole [s]", "times as fast as one"):
            shown.add_column(heading, justify="right" if heading else "left")
        for row in self.plain()["sweeps"]:
            numbers = [f"{row[key]:.3g}" for key in ("start_s", "flight_s", "whole_s", "speed_up")]
            shown.add_row(row["by"], str(row["workers"]), *numbers)
        console.print(shown)

    def plain(self) -> dict[str, Any]:
        columns = {
            "start_s": self._seconds(lambda course: course.start),
            "flight_s": (flights := self._seconds(lambda course: course.interval)),
            "whole_s": self._seconds(lambda course: course.whole),
            "speed_up": {(by, workers): flights[by, 1] / flights[by, workers] for by, workers in flights},
        }
        sweeps = [
            {"by": by, "workers": workers}
            | {name: float(np.median(figures[by, workers])) for name, figures in columns.items()}
            for by, workers in self.courses
        ]
        return {"trials": self.trials, "sweeps": sweeps}

    def _seconds(self, figure: Callable[[Course], float]) -> Seconds:
        return {kind: np.array([figure(course) for course in courses]) for kind, courses in self.courses.items()}


def run(arguments: Arguments, console: Console) -> SweepFindings:
    """Sweep with one worker and with more, in turns."""
    workers = arguments.workers
    trials = [
        trial(seed=seed, terrain=arguments.terrain, drawn_separation=(0.2, 0.3)) for seed in range(arguments.trials)
    ]
    fly(trials[0])  # numba compiles here what its cache may lack
    # what is compared stands side by side
    kinds = [(MACHINE, 1), (MACHINE, workers), (OURS, workers), (OURS, 1), (POOL, 1), (POOL, workers)]
    by_name = {OURS: swept, POOL: pooled, MACHINE: side_by_side}
    courses: dict[Kind, list[Course]] = {kind: [] for kind in kinds}
    with progress(console, "sweeping", arguments.repetitions * len(kinds)) as report:
        for repetition in range(arguments.repetitions):
            for i, (by, count) in enumerate(kinds):
                report(repetition * len(kinds) + i, f"{by}, {count} of {workers} workers")
                courses[by, count].append(by_name[by](trials, count))
    return SweepFindings(arguments.trials, workers, courses)


def main(arguments: Arguments) -> None:
    alone("sweep_scaling", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
