"""Results come in the order of the arguments, from this process or from several, and none of these is left behind."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mathnavi.sim.records.store import Store
from mathnavi.sim.studies.framework.parallel import computed
from mathnavi.sim.studies.framework.study import Setup
from mathnavi.sim.sweep.execution import Progress

LATE = 60.0  # [s]


def process_and_square(x: int) -> tuple[int, int]:
    return os.getpid(), x * x


def noted_and_asleep(place: str) -> None:
    Path(place).write_text(str(os.getpid()), encoding="utf-8")
    time.sleep(LATE)


def leave_to_workers(store: str, places: list[str]) -> None:
    with Store.open(Path(store)) as opened:
        computed(Setup(None, opened, 2), noted_and_asleep, places)


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_arguments(workers: int, tmp_path: Path) -> None:
    told: list[Progress] = []
    with Store.open(tmp_path / "trials.db") as store:
        results = computed(Setup(None, store, workers, told.append), process_and_square, range(5))
    assert [square for _, square in results] == [0, 1, 4, 9, 16]
    assert ({pid for pid, _ in results} == {os.getpid()}) is (workers == 1)
    assert {progress.total for progress in told} == {5}


def test_what_is_raised_there_is_raised_here(tmp_path: Path) -> None:
    with Store.open(tmp_path / "trials.db") as store, pytest.raises(ZeroDivisionError):
        computed(Setup(None, store), (1.0).__truediv__, [1.0, 0.0, 4.0])


def test_no_worker_outlives_a_study_that_is_killed(tmp_path: Path) -> None:
    places = [tmp_path / "0", tmp_path / "1"]
    asked = f"[{', '.join(repr(str(place)) for place in places)}]"
    code = f"from tests.sim.studies.test_parallel import *; leave_to_workers({str(tmp_path / 'trials.db')!r}, {asked})"
    study = subprocess.Popen([sys.executable, "-c", code])
    workers = [int(waited_for(place)) for place in places]
    study.kill()
    study.wait()
    until = time.monotonic() + 0.5 * LATE
    while any(runs(worker) for worker in workers):
        assert time.monotonic() < until
        time.sleep(0.05)


def waited_for(place: Path) -> str:
    until = time.monotonic() + LATE
    while not (place.exists() and place.read_text(encoding="utf-8")):
        assert time.monotonic() < until
        time.sleep(0.05)
    return place.read_text(encoding="utf-8")


def runs(pid: int) -> bool:
    """Whether a process does; one that has ended and that nobody has waited for does not."""
    stat = Path(f"/proc/{pid}/stat")
    try:
        return stat.read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
