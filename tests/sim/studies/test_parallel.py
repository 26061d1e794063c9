"""Results come in the order of the arguments, from this process or from several."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim.store import Store
from sim.studies.parallel import computed
from sim.studies.study import Setup
from sim.sweep.execution import Progress


def process_and_square(x: int) -> tuple[int, int]:
    return os.getpid(), x * x


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
