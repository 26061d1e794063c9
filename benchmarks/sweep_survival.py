"""Sweeps that are killed repeatedly, or run on other workers, leave the same table of trials.

    python -m benchmarks.sweep_survival [--trials 2000] [--kills 10] [--folder renders/out/survival]

The same sweep of short missions with mixed faults runs undisturbed on one process and on two, on a local Dask cluster,
and on two processes that are killed (SIGKILL) at random moments and started again by the same command. The tables
``trials`` are compared row by row, and SQLite checks the integrity of each store. All stores are empty at first, so
that times are those of all trials.
"""

from __future__ import annotations

import hashlib
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge
from rich.console import Console
from rich.table import Table

from benchmarks.arguments import read_arguments
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.errors import FieldError

SWEEP = (
    "safe-flight", "--terrain", "jacksboro", "--drawn-separation", "0.2", "0.3", "--drawn-heights", "0.5", "60",
    "--vary", "faults.solver-failure-rate=0..0.9", "--vary", "faults.late-plan-rate=0..0.5",
    "--vary", "faults.gust-rms=0..1.5", "--vary", "faults.dropout-rate=0..0.2",
)  # fmt: skip
ALONE, UNDISTURBED, KILLED = "1 process", "2 processes", "2 processes, killed"
CLUSTER = "Dask, 2 workers"
STORES = {ALONE: "processes-1.db", UNDISTURBED: "processes-2.db", CLUSTER: "dask.db", KILLED: "killed.db"}


@configuration
class Arguments:
    """Kill a sweep repeatedly, and compare the stored trials with those of an undisturbed sweep."""

    trials: Annotated[int, Within(Ge(1), allowed=">= 1")] = 2000
    """number of missions in each sweep"""
    kills: Annotated[int, Within(Ge(1), allowed=">= 1")] = 10
    """number of times that the sweep is killed"""
    folder: Path = Path("renders/out/survival")
    """folder of the stores; it must not hold stores of an earlier run"""
    seed: int = 0
    """seed of the moments at which the sweep is killed"""
    cluster: bool = True
    """whether to run a sweep on a local Dask cluster too"""

    def __post_init__(self) -> None:
        for store in STORES.values():
            if (self.folder / store).exists():
                raise FieldError(f"folder = {self.folder}: {store} exists; allowed: a folder without it")


@dataclass(frozen=True)
class Left:
    """State of a store after a sweep."""

    seconds: float
    kills: int
    rows: int
    digest: str  # of the whole table of trials
    integrity: str


def command(trials: int, store: Path, *workers: str) -> list[str]:
    return [
        str(Path(sys.executable).with_name("mathnavi")), "sweep", *SWEEP,
        "--trials", str(trials), "--store", str(store), *workers,
    ]  # fmt: skip


def stored(store: Path) -> int:
    """Return the number of trials in a store, while another process writes it."""
    if not store.exists():
        return 0
    connection = sqlite3.connect(f"{store.absolute().as_uri()}?mode=ro", uri=True, timeout=60.0)
    try:
        return int(connection.execute("SELECT count(*) FROM trials").fetchone()[0])
    except sqlite3.OperationalError:  # it has no tables yet
        return 0
    finally:
        connection.close()


def left(store: Path, seconds: float, kills: int) -> Left:
    connection = sqlite3.connect(store)
    try:
        rows = connection.execute("SELECT * FROM trials ORDER BY key").fetchall()
        integrity = str(connection.execute("PRAGMA integrity_check").fetchone()[0])
    finally:
        connection.close()
    return Left(seconds, kills, len(rows), hashlib.sha256(repr(rows).encode()).hexdigest()[:16], integrity)


def undisturbed(trials: int, store: Path, *workers: str) -> Left:
    began = time.perf_counter()
    subprocess.run(command(trials, store, *workers), check=True, stdout=subprocess.DEVNULL)
    return left(store, time.perf_counter() - began, 0)


def killed(trials: int, store: Path, kills: int, rng: np.random.Generator) -> Left:
    """Run a sweep that is killed ``kills`` times, each a random moment after a random share of its trials."""
    began, done = time.perf_counter(), 0
    for share in np.sort(rng.uniform(0.0, 0.95, kills)):
        process = subprocess.Popen(command(trials, store, "--workers", "2"), stdout=subprocess.DEVNULL)
        while process.poll() is None and stored(store) < share * trials:
            time.sleep(0.05)
        time.sleep(float(rng.uniform(0.0, 2.0)))  # in the middle of whatever it does
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            done += 1
        process.wait()
    finished = undisturbed(trials, store, "--workers", "2")
    return Left(time.perf_counter() - began, done, finished.rows, finished.digest, finished.integrity)


@contextmanager
def local_cluster(workers: int) -> Iterator[str]:
    """Start a local Dask cluster of workers with one thread, and yield the address of its scheduler."""
    from distributed import LocalCluster  # an extra

    make: Any = LocalCluster  # distributed has no types
    with make(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def verdict(found: Mapping[str, Left], arguments: Arguments) -> dict[str, bool]:
    """Return each requirement, and whether it is met."""
    first = found[UNDISTURBED]
    same = all((one.rows, one.digest, one.integrity) == (first.rows, first.digest, "ok") for one in found.values())
    return {
        "every trial exactly once, the same table in all": same and first.rows == arguments.trials,
        f"killed {arguments.kills} times": found[KILLED].kills == arguments.kills,
    }


def main(arguments: Arguments) -> int:
    os.environ.setdefault("MUJOCO_GL", "disable")
    arguments.folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, Left] = {}
    stores = {name: arguments.folder / store for name, store in STORES.items()}
    for workers, name in ((1, ALONE), (2, UNDISTURBED)):
        found[name] = undisturbed(arguments.trials, stores[name], "--workers", str(workers))
    if arguments.cluster:
        with local_cluster(2) as address:
            found[CLUSTER] = undisturbed(arguments.trials, stores[CLUSTER], "--cluster", address)
    rng = np.random.default_rng(arguments.seed)
    found[KILLED] = killed(arguments.trials, stores[KILLED], arguments.kills, rng)
    table = Table("sweep", "seconds", "killed", "trials", "digest of the table", "integrity", title="Sweeps")
    for name, one in found.items():
        table.add_row(name, f"{one.seconds:.0f}", str(one.kills), str(one.rows), one.digest, one.integrity)
    console = Console()
    console.print(table)
    answers = verdict(found, arguments)
    for question, answer in answers.items():
        console.print(f"{question}: {'yes' if answer else 'NO'}")
    console.print(f"two processes are {found[ALONE].seconds / found[UNDISTURBED].seconds:.2f} times as fast as one")
    return 0 if all(answers.values()) else 1


if __name__ == "__main__":
    sys.exit(main(read_arguments(Arguments)))
