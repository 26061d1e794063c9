"""Sweeps of trials that do nothing: how many a second one process after the other, a Dask cluster and the store hold.

The cluster's workers are processes of this machine that reach their scheduler through a relay which holds every byte
back, as a network would.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.store import Store
from mathnavi.sim.studies.introduction.scaling.relay import delayed
from mathnavi.sim.sweep.execution import Progress, run_jobs
from mathnavi.sim.sweep.job import Job, job

PATIENCE = 60.0  # [s] until the workers of a cluster are there


@dataclass(frozen=True)
class SweepCase:
    """A sweep."""

    workers: int
    trials: int
    delay: float | None = None  # [s] one way, between a cluster's scheduler and its workers; None: no cluster


@dataclass(frozen=True)
class SweepRate:
    """Rate of a sweep."""

    workers: int
    delay: float | None  # [s]
    start: MeasuredTime  # [s] until every worker had ended a trial
    interval: MeasuredTime  # [s] between the ends of two trials after that

    @property
    def rate(self) -> float:
        """Trials a second; infinite where all others had ended when the last worker's first had."""
        return 1.0 / self.interval if self.interval > 0.0 else math.inf


def nothing(number: int) -> int:
    """A trial."""
    return number


def trials(count: int) -> list[Job]:
    """So many trials that do nothing."""
    return [job(nothing, number) for number in range(count)]


def swept(cases: Sequence[SweepCase]) -> list[SweepRate]:
    """A job: the sweeps, one after the other; those on a cluster only where Dask is installed."""
    return [_swept(case) for case in cases if case.delay is None or importlib.util.find_spec("distributed")]


def written(count: int) -> MeasuredTime:
    """A job: [s] in which the store commits a record, each by itself."""
    made = [each.record(each.content, "ok", result=str(number)) for number, each in enumerate(trials(count))]
    with tempfile.TemporaryDirectory() as folder, Store.open(Path(folder) / "trials.db") as store:
        began = time.perf_counter()
        for record in made:
            store.add(record)
        return MeasuredTime((time.perf_counter() - began) / count)


def _swept(case: SweepCase) -> SweepRate:
    ends: list[float] = []

    def note(state: Progress) -> None:
        ends.extend([time.perf_counter() - began] * (state.done - len(ends)))

    with ExitStack() as opened:
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
        store = opened.enter_context(Store.open(folder / "trials.db"))
        address = None if case.delay is None else opened.enter_context(_cluster(case.workers, case.delay))
        began = time.perf_counter()
        run_jobs(trials(case.trials), store, workers=case.workers, cluster=address, progress=note)
    start = ends[case.workers - 1]
    interval = (ends[-1] - start) / (len(ends) - case.workers)
    return SweepRate(case.workers, case.delay, MeasuredTime(start), MeasuredTime(interval))


@contextmanager
def _cluster(workers: int, delay: float) -> Iterator[str]:
    """The address of a Dask scheduler on this machine, with workers that are ``delay`` away from it."""
    dask: Any = importlib.import_module("distributed")  # an extra, without types
    with dask.LocalCluster(n_workers=0, dashboard_address=None) as cluster, ExitStack() as opened:
        scheduler = str(cluster.scheduler_address)
        host, _, port = scheduler.rpartition("/")[2].rpartition(":")
        relay = opened.enter_context(delayed(host, int(port), delay))
        command = [
            sys.executable, "-m", "distributed.cli.dask_worker", f"tcp://127.0.0.1:{relay}", "--nthreads", "1",
            "--no-dashboard", "--no-nanny",
        ]  # fmt: skip
        for _ in range(workers):
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            opened.callback(process.wait)
            opened.callback(process.terminate)
        with dask.Client(scheduler, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=PATIENCE)
        yield scheduler
