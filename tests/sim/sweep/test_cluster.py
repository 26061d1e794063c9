"""A Dask cluster leaves the same store as this machine does."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep import cluster
from mathnavi.sim.sweep.child import RefusedError
from mathnavi.sim.sweep.cluster import check
from mathnavi.sim.sweep.execution import Pool, run_jobs, run_trials
from mathnavi.sim.sweep.job import job
from tests.sim.sweep.computations import mishap
from tests.sim.sweep.test_execution import TIMEOUT, coins
from tests.sim.sweep.test_jobs import walks

distributed = pytest.importorskip("distributed")
dask_config = pytest.importorskip("dask.config")

FEW_MISHAPS: dict[str, Any] = {"raise_at": (1,), "segfault_at": (2,), "hang_at": (3,), "chatter": True}


@pytest.fixture(scope="module")
def dask() -> Iterator[Any]:
    """Two workers in processes of their own; a trial that costs one of them is not tried again."""
    with (
        dask_config.set({"distributed.scheduler.allowed-failures": 0, "distributed.worker.profile.enabled": False}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs=50
        ) as made,
    ):
        yield made


def test_the_records_are_those_of_this_machine(dask: Any, tmp_path: Path) -> None:
    trials = coins(6, **FEW_MISHAPS)
    with Store.open(tmp_path / "here.db") as here, Store.open(tmp_path / "there.db") as there:
        local = run_trials(trials, here, workers=2, timeout=TIMEOUT)
        remote = run_trials(trials, there, cluster=dask.scheduler_address, timeout=TIMEOUT)
    assert [replace(record, timings={}) for record in remote] == [replace(record, timings={}) for record in local]


def test_a_pool_on_a_cluster_runs_one_list_after_the_other(dask: Any, tmp_path: Path) -> None:
    with Store.open(tmp_path / "store.db") as store, Pool(cluster=dask.scheduler_address) as pool:
        counts = [len(run_trials(coins(count), store, pool=pool)) for count in (2, 4)]
        assert counts == [2, 4]
        assert len(store.keys()) == 4


def test_the_results_of_jobs_are_those_of_this_machine(dask: Any, tmp_path: Path) -> None:
    jobs = [*walks(4), *(job(mishap, kind) for kind in ("raise", "die", "hang"))]
    with Store.open(tmp_path / "here.db") as here, Store.open(tmp_path / "there.db") as there:
        local = run_jobs(jobs, here, workers=2, timeout=TIMEOUT)
        run_jobs(jobs[:2], there)  # a store is gone on with wherever it was begun
        remote = run_jobs(jobs, there, cluster=dask.scheduler_address, timeout=TIMEOUT)
    assert [replace(record, timings={}) for record in remote] == [replace(record, timings={}) for record in local]
    assert [record.status for record in remote] == [*["ok"] * 4, "raised", "crashed", "timed-out"]


def test_what_ends_before_an_interrupt_is_stored_and_the_rest_is_called_off(dask: Any, tmp_path: Path) -> None:
    trials = coins(6, hang_at=(4, 5))
    with Store.open(tmp_path / "store.db") as store:
        later = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))

        def interrupt(now: Any) -> None:
            if now.done == 4 and not later.is_alive() and not later.finished.is_set():
                later.start()

        began = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            run_trials(trials, store, cluster=dask.scheduler_address, progress=interrupt)
        assert len(store.keys()) == 4
        assert len(run_trials(trials[:4], store, cluster=dask.scheduler_address)) == 4
        # The workers are free again, though what they were at would have taken an hour.
        run_trials(coins(2, bias=0.1), store, cluster=dask.scheduler_address)
        assert time.monotonic() - began < 600.0


def test_a_worker_with_other_sources_ends_the_sweep(dask: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mathnavi.sim.records.run_spec.code_version", lambda *_: "as it was")
    with Store.open(tmp_path / "store.db") as store:
        with pytest.raises(RefusedError, match=r"other sources or files.*restart the workers of the cluster"):
            run_trials(coins(2), store, cluster=dask.scheduler_address)
        assert not store.keys()


def children(dask: Any) -> set[int]:
    """The processes that the workers have started and that are still there."""
    workers = {worker.pid for worker in dask.workers.values()}
    found = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, parent = stat.read_text().rpartition(")")[2].split()[:2]
            command = stat.with_name("cmdline").read_bytes()
            if int(parent) in workers and state != "Z" and b"mathnavi.sim.sweep.serve" in command:
                found.add(int(stat.parent.name))
    return found


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks processes up in /proc")
def test_no_child_outlives_its_sweep_but_those_of_another_go_on(dask: Any, tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()
    with Store.open(tmp_path / "one.db") as store:
        during: list[set[int]] = []
        run_trials(coins(3), store, cluster=dask.scheduler_address, progress=lambda _: during.append(children(dask)))
    assert any(during)
    assert not children(dask)

    def other() -> None:
        with Store.open(tmp_path / "other.db") as store:
            statuses.extend(r.status for r in run_trials(coins(1, wait=3.0, marks=str(marks)), store, cluster=address))

    statuses: list[str] = []
    address = dask.scheduler_address
    sweep = threading.Thread(target=other)
    sweep.start()
    while not list(marks.iterdir()):
        time.sleep(0.02)
    with Store.open(tmp_path / "two.db") as store:
        run_trials(coins(1), store, cluster=address)
    assert len(children(dask)) == 1
    sweep.join()
    assert statuses == ["ok"]
    assert not children(dask)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "carrier-pigeon://127.0.0.1:8786"])
def test_a_cluster_that_does_not_answer_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with pytest.raises(ValueError, match=f"cluster = '{address}'.*allowed: the address of a Dask scheduler"):
        check(address)


def test_what_answers_has_to_be_a_scheduler(dask: Any) -> None:
    address = next(iter(dask.workers.values())).worker_address
    with pytest.raises(ValueError, match="is a Worker; allowed"):
        check(address)


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match=r"pip install 'mathnavi\[cluster\]'"):
        check("tcp://127.0.0.1:8786")


def test_a_trial_that_costs_its_worker_is_recorded_as_crashed(dask: Any, tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()

    def kill_workers() -> None:
        while not list(marks.iterdir()):
            time.sleep(0.05)
        for worker in dask.workers.values():
            worker.close_gracefully()  # nobody needs another in its place: this is the last test of the cluster
            os.kill(worker.pid, signal.SIGKILL)

    threading.Thread(target=kill_workers, daemon=True).start()
    with Store.open(tmp_path / "store.db") as store:
        (record,) = run_trials(coins(1, marks=str(marks), hang_at=(0,)), store, cluster=dask.scheduler_address)
    assert record.status == "crashed"
    assert "workers of the cluster died" in (record.error or "")
