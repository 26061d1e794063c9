"""Workers of a cluster that differ are left out and named; those that match do the work, whoever joins, leaves or dies.

A cluster is played here, one survey after the other, but for one whose second worker computes as on another processor.
"""

from __future__ import annotations

import logging
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mathnavi.sim.plugin.code_version import code_version
from mathnavi.sim.records.computing_environment import environment
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep import cluster
from mathnavi.sim.sweep.child import RefusedError
from mathnavi.sim.sweep.cluster import DaskCluster, RefusingWorkerError
from mathnavi.sim.sweep.distribution import AHEAD, MOST_DEATHS, Distribution
from mathnavi.sim.sweep.execution import run_trials
from mathnavi.sim.sweep.task import Ended, Message
from tests.sim.sweep.test_execution import coins

distributed = pytest.importorskip("distributed")

HERE = dict(environment())
FOREIGN = HERE | {"blas": "OpenBLAS Sandybridge", "numba": "0.1"}


class KilledError(Exception):
    """As Dask raises it for a task that has killed too many workers."""


class PlayedFuture:
    """A future, which the test ends."""

    def __init__(self, content: str, workers: list[str]) -> None:
        self.content, self.workers = content, workers
        self.outcome: Any = None
        self.cancelled = False

    def add_done_callback(self, call: Callable[[Any], None]) -> None:
        self.call = call

    def end(self, outcome: Any) -> None:
        self.outcome = outcome
        self.call(self)

    def result(self) -> Any:
        if isinstance(self.outcome, BaseException):
            raise self.outcome
        return self.outcome

    def release(self) -> None:
        pass


class PlayedClient:
    """The part of Dask's client that a backend uses."""

    def __init__(self, kinds: Mapping[str, Any]) -> None:
        self.kinds = dict(kinds)  # what each worker answers when it is asked for its environment
        self.futures: list[PlayedFuture] = []

    def scheduler_info(self) -> Any:
        return {"workers": {each: {"nthreads": 1} for each in self.kinds}}

    def run(self, call: Any, workers: Any = None, on_error: str = "") -> dict[str, Any]:
        kinds = {worker: self.kinds[worker] for worker in workers or ()}
        return {worker: (code_version(), kind) if isinstance(kind, dict) else kind for worker, kind in kinds.items()}

    def submit(self, run: Any, task: Any, content: str, *, workers: list[str], **_: Any) -> PlayedFuture:
        self.futures.append(PlayedFuture(content, workers))
        return self.futures[-1]

    def cancel(self, futures: list[PlayedFuture]) -> None:
        for future in futures:
            future.cancelled = True
            future.end(RuntimeError("cancelled"))

    def close(self, timeout: float) -> None:
        pass

    def running(self) -> list[PlayedFuture]:
        return [future for future in self.futures if future.outcome is None]

    def places(self) -> set[str]:
        return {worker for future in self.running() for worker in future.workers}


class Play:
    """A backend on a played cluster, and what it has reported."""

    def __init__(self, client: PlayedClient, mixed: bool = False) -> None:
        self.client, self.messages = client, list[Message]()
        self.backend = DaskCluster("tcp://s", mixed)
        self.tasks = {trial.content: trial for trial in coins(9)}
        self.backend.start(self.tasks, None, self.messages.append)

    def end(self, future: PlayedFuture) -> None:
        future.end(self.tasks[future.content].record(future.content, "ok"))

    def look(self) -> None:
        self.backend._look()

    def end_all(self) -> None:
        while running := self.client.running():
            for future in running:
                self.end(future)

    def records(self) -> list[Ended]:
        return [message for message in self.messages if isinstance(message, Ended)]


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Play]]:
    begun: list[Play] = []

    def begin(kinds: Mapping[str, Any], **options: Any) -> Play:
        client = PlayedClient(kinds)
        dask = SimpleNamespace(Client=lambda *_, **__: client, KilledWorker=KilledError)
        monkeypatch.setattr(cluster, "_dask", lambda: dask)
        monkeypatch.setattr(cluster, "check", lambda address: None)
        monkeypatch.setattr(cluster, "SURVEY", 3600.0)  # a test looks when it wants to
        begun.append(Play(client, **options))
        return begun[-1]

    yield begin
    for each in begun:
        each.backend.stop()


def test_those_that_match_work_and_the_others_are_named_in_one_line(
    play: Callable[..., Play], caplog: pytest.LogCaptureFixture
) -> None:
    kinds: dict[str, Any] = {f"tcp://{k}": FOREIGN for k in range(5)}
    kinds |= {"tcp://bare": ModuleNotFoundError("No module named 'mathnavi'"), "tcp://old": ("0.0.1+ab", HERE)}
    now = play(kinds | {"tcp://m": HERE})
    now.end_all()
    assert len(now.records()) == 9
    assert all(future.workers == ["tcp://m"] for future in now.client.futures)
    (line,) = (record.getMessage() for record in caplog.records if record.levelno == logging.WARNING)
    for words in (
        "left out tcp://0, tcp://1, tcp://2 and 2 more (another computing environment, ",
        f"numba 0.1 (here {HERE['numba']})", "blas OpenBLAS Sandybridge (here ",
        "tcp://bare (mathnavi does not run there, ModuleNotFoundError: No module named 'mathnavi')",
        f"tcp://old (other sources, mathnavi 0.0.1+ab (here {code_version()}))",
    ):  # fmt: skip
        assert words in line
    now.look()
    now.backend.start(now.tasks, None, now.messages.append)  # of a pool, once more
    assert len(caplog.records) == 1  # named once


def test_where_none_matches_the_sweep_ends_with_what_differs(play: Callable[..., Play]) -> None:
    now = play({"tcp://f": FOREIGN})
    (error,) = now.messages
    assert isinstance(error, RefusedError)
    assert str(error).startswith("no worker of the cluster matches: tcp://f (another computing environment, ")
    assert str(error).endswith("; allowed: the same environment, or --mix-environments")
    assert not now.client.futures


def test_with_environments_mixed_all_work(play: Callable[..., Play]) -> None:
    now = play({"tcp://f": FOREIGN, "tcp://m": HERE}, mixed=True)
    assert now.client.places() == {"tcp://f", "tcp://m"}


def test_who_joins_later_has_a_share_or_is_left_out(
    play: Callable[..., Play], caplog: pytest.LogCaptureFixture
) -> None:
    now = play({})
    assert not now.client.futures
    assert not now.messages  # a cluster may start its workers later
    now.client.kinds |= {"tcp://a": HERE, "tcp://gone": OSError("connection closed")}
    now.look()
    assert now.client.places() == {"tcp://a"}
    now.client.kinds |= {"tcp://b": HERE, "tcp://f": FOREIGN}
    now.look()
    assert now.client.places() == {"tcp://a", "tcp://b"}
    assert "left out tcp://f" in caplog.text
    now.end_all()
    assert len(now.records()) == 9


def test_the_tasks_of_workers_that_leave_go_to_others(play: Callable[..., Play]) -> None:
    now = play({"tcp://a": HERE, "tcp://b": HERE, "tcp://f": FOREIGN})
    given = now.client.running()
    del now.client.kinds["tcp://a"]
    now.look()
    assert now.client.running() == given  # Dask runs them on b
    del now.client.kinds["tcp://b"]
    now.look()
    assert all(future.cancelled for future in given)
    assert not now.messages  # b may come back, with another address
    now.client.kinds["tcp://c"] = HERE
    now.look()
    now.end_all()
    assert len({record.origin.content for record in now.records()}) == 9
    assert {record.status for record in now.records()} == {"ok"}


def test_where_the_last_that_matched_does_not_come_back_the_sweep_ends(
    play: Callable[..., Play], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = play({"tcp://a": HERE, "tcp://f": FOREIGN})
    del now.client.kinds["tcp://a"]
    now.look()
    assert not now.messages
    monkeypatch.setattr(cluster, "RETURN", -1.0)
    now.look()
    (error,) = now.messages
    assert isinstance(error, RefusedError)
    assert "tcp://f" in str(error)


def test_a_task_under_which_one_worker_after_the_other_dies_has_crashed(play: Callable[..., Play]) -> None:
    now = play({})
    for k in range(MOST_DEATHS + 1):
        now.client.kinds = {f"tcp://{k}": HERE}
        now.look()
    now.client.kinds = {"tcp://last": HERE}
    now.look()
    crashed = now.records()
    assert [record.status for record in crashed] == ["crashed"] * AHEAD
    assert "workers of the cluster died" in (crashed[0].error or "")
    now.end_all()
    assert len(now.records()) == 9


def test_one_with_other_sources_is_left_out_when_it_refuses(
    play: Callable[..., Play], caplog: pytest.LogCaptureFixture
) -> None:
    now = play({"tcp://a": HERE, "tcp://b": HERE})
    words = "other sources or files than the sweep began with: its code is"
    for future in now.client.running()[:2]:
        future.end(RefusingWorkerError("tcp://a", f"{words} 0.1"))
    for future in now.client.running():
        now.end(future)
    assert now.client.places() == {"tcp://b"}
    assert caplog.text.count(f"left out tcp://a ({words} 0.1)") == 1
    now.client.running()[-1].end(RefusingWorkerError("tcp://b", f"{words} 0.2"))
    error = now.messages[-1]
    assert isinstance(error, RefusedError)
    assert "restart the workers of the cluster" in str(error)
    assert "0.1" in str(error)
    assert "0.2" in str(error)


def test_a_refusal_is_read_by_the_client_as_the_worker_meant_it() -> None:
    read = pickle.loads(pickle.dumps(RefusingWorkerError("tcp://a", "other sources")))
    assert (read.worker, read.differing) == ("tcp://a", "other sources")


def test_no_more_tasks_are_given_out_than_run_soon() -> None:
    distribution = Distribution(str(k) for k in range(20))
    distribution.join("a", 2)
    distribution.join("b", 1)
    assert [workers for _, workers in distribution.give()] == [["a", "b"]] * 3 * AHEAD
    assert not distribution.give()
    distribution.join("c", 1)
    assert [workers for _, workers in distribution.give()] == [["a", "b", "c"]] * AHEAD
    distribution.leave("c")
    assert not distribution.give()  # those of c are with the others, which have more than they run soon
    assert not distribution.done


@pytest.mark.skipif("openblas" not in HERE["blas"], reason="another BLAS than OpenBLAS")
def test_a_worker_on_another_kind_of_processor_is_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    kind = "Nehalem" if "Nehalem" not in HERE["blas"] else "Haswell"
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address=None,
        silence_logs=50,
    ) as made:
        command = [sys.executable, "-m", "distributed.cli.dask_worker", made.scheduler_address, "--no-nanny"]
        foreign = subprocess.Popen(
            [*command, "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)],
            env={**os.environ, "OPENBLAS_CORETYPE": kind}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            while len(made.scheduler.workers) < 2:
                assert foreign.poll() is None
                time.sleep(0.02)
            with Store.open(tmp_path / "store.db") as store:
                records = run_trials(coins(3), store, cluster=made.scheduler_address)
        finally:
            foreign.terminate()
            foreign.wait()
    assert [record.status for record in records] == ["ok"] * 3
    assert f"another computing environment, blas {HERE['blas'].rpartition(' ')[0]} {kind} (here " in caplog.text
