"""Trials run in child processes, whatever they do there, and a store has each of them once."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.sim.plugin import code_version as code
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.sweep.child import RefusedError, Worker, module_path
from mathnavi.sim.sweep.execution import Pool, Progress, run_jobs, run_trials
from mathnavi.sim.sweep.job import job
from mathnavi.sim.sweep.trial import Trial, trial
from tests.sim.sweep.computations import returned
from tests.sim.sweep.scenarios import SLOW

COIN = "tests.sim.sweep.scenarios:Coin"
MISHAPS: dict[str, Any] = {
    "raise_at": (2,),
    "exit_at": (3,),
    "segfault_at": (4, 5),
    "die_at": (6,),
    "hang_at": (7,),
    "chatter": True,
}
TIMEOUT = 1.0  # [s]


def coins(count: int, **fields: Any) -> list[Trial]:
    return [trial(COIN, seed, **fields) for seed in range(count)]


def comparable(records: Sequence[Record]) -> list[Record]:
    """The records without what depends on the time."""
    return [replace(record, timings={}) for record in records]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store.db") as opened:
        yield opened


@pytest.fixture(scope="module")
def mishaps(tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    with Store.open(tmp_path_factory.mktemp("mishaps") / "store.db") as opened:
        return run_trials(coins(10, **MISHAPS), opened, workers=2, timeout=TIMEOUT)


def test_what_goes_wrong_is_recorded_and_stops_nothing(mishaps: list[Record]) -> None:
    statuses = ["ok", "ok", "raised", "raised", "crashed", "crashed", "crashed", "timed-out", "ok", "ok"]
    assert [record.status for record in mishaps] == statuses
    assert [record.seed for record in mishaps] == list(range(10))
    for record in mishaps:
        assert (record.success is None) == (record.error is not None) == (record.status != "ok")


def test_an_error_is_reported_with_where_it_was_raised(mishaps: list[Record]) -> None:
    error = mishaps[2].error or ""
    assert error.startswith("Traceback")
    assert "RuntimeError: seed 2 is out of order\n" in error
    last = error.splitlines()[-1]
    assert f"scenarios: '{COIN}': a run failed: RuntimeError: seed 2 is out of order (" in last
    assert "scenarios.py:" in last
    assert f"scenarios: '{COIN}': a run failed: SystemExit: enough (" in (mishaps[3].error or "")


def test_a_crash_is_reported_with_its_cause_and_last_output(mishaps: list[Record]) -> None:
    fault, ended, hung = (mishaps[k].error or "" for k in (4, 6, 7))
    assert fault.startswith("the process was killed by SIGSEGV\n")
    for word in ("last words", "Segmentation fault", "scenarios.py"):
        assert word in fault
    assert ended.startswith("the process ended itself with exit code 7")
    assert hung == "no end within 1 s"


def test_results_are_those_of_the_same_process(mishaps: list[Record]) -> None:
    for k in (0, 1, 8, 9):
        x = float(np.random.default_rng(k).random())
        expected = {"heads": x < 0.5, "x_m": x, "least_m": -np.inf, "mean": None}
        assert mishaps[k].summary == {**expected, "stray": mishaps[k].summary["stray"]}
        assert mishaps[k].success == (x < 0.5)
        assert mishaps[k].timings.keys() == {"real_time_factor", "trial_wall_s"}


def test_order_and_number_of_workers_change_nothing(store: Store, mishaps: list[Record]) -> None:
    seeds = (9, 7, 4, 3, 0)  # one of each ending
    trials = coins(10, **MISHAPS)
    records = run_trials([trials[seed] for seed in seeds], store, workers=1, timeout=TIMEOUT)
    assert comparable(records) == comparable([mishaps[seed] for seed in seeds])


@pytest.mark.usefixtures("trials_here")
def test_a_measure_joins_the_summary(store: Store) -> None:
    (record,) = run_trials([trial(COIN, measure="tests.sim.sweep.scenarios:twice")], store)
    assert record.summary["twice_x_m"] == 2.0 * record.summary["x_m"]
    assert record.parameters["measure"] == "tests.sim.sweep.scenarios:twice"


@pytest.mark.usefixtures("trials_here")
def test_what_the_store_has_is_not_run_again(store: Store, tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()
    trials = coins(8, marks=str(marks))
    first = run_trials(trials[2:5], store)
    everything = run_trials([*trials, *trials], store, workers=2)
    assert everything[2:5] == first
    assert everything[:8] == everything[8:]
    seeds = sorted(int(mark.name.partition("-")[0]) for mark in marks.iterdir())
    assert seeds == list(range(8))


def test_what_timed_out_or_crashed_is_run_again_when_it_is_asked_for(store: Store, tmp_path: Path) -> None:
    ready = tmp_path / "ready"
    trials = coins(4, raise_at=(1,), **{"segfault_at": (2,), "hang_at": (3,), "well_once": str(ready)})
    first = run_trials(trials, store, workers=2, timeout=TIMEOUT)
    assert [record.status for record in first] == ["ok", "raised", "crashed", "timed-out"]
    ready.mkdir()  # what was in the way is gone
    assert run_trials(trials, store) == first
    seen: list[Progress] = []
    again = run_trials(trials, store, retry=True, progress=seen.append)
    assert [record.status for record in again] == ["ok", "raised", "ok", "ok"]
    assert again[:2] == first[:2]
    assert again[3].error is None
    assert again[3].summary["x_m"] == np.random.default_rng(3).random()
    assert {"real_time_factor", "trial_wall_s"} <= again[3].timings.keys()
    assert (seen[0].found, seen[-1].done, seen[-1].failed) == (2, 4, 1)


def test_records_name_files_as_they_were_asked_for(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = [tmp_path / "one", tmp_path / "other"]
    for file in files:
        file.write_text("the same")
    monkeypatch.setattr("mathnavi.sim.records.run_spec.code_version", lambda *_: "any")
    one, other = (coins(1, table=str(file))[0] for file in files)
    assert one.key == other.key
    store.add(one.record(one.content, "ok", success=True))
    for asked in (one, other):
        (record,) = run_trials([asked], store)
        assert record.fields["table"] == asked.spec.config.table


@pytest.mark.usefixtures("trials_here")
def test_progress_tells_what_was_found_and_what_failed_now_or_before(store: Store) -> None:
    trials = coins(6, raise_at=(1, 4), bias=0.0)
    run_trials(trials[:2], store)
    seen: list[Progress] = []
    run_trials(trials, store, workers=2, progress=seen.append)
    assert seen[0] == Progress(total=6, found=2, done=2, failed=1, unsuccessful=1, compiling=False)
    assert seen[-1] == Progress(total=6, found=2, done=6, failed=2, unsuccessful=4, compiling=False)
    assert [now.done for now in seen] == sorted(now.done for now in seen)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"workers": 0}, "workers = 0"),
        ({"timeout": 0.0}, "timeout = 0.0"),
        ({"timeout": float("nan")}, "timeout = nan"),
    ],
)
def test_bad_arguments_are_refused(store: Store, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        run_trials(coins(1), store, **arguments)
    assert not store.keys()


def test_sources_that_changed_meanwhile_end_the_sweep(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mathnavi.sim.records.run_spec.code_version", lambda *_: "as it was")
    with pytest.raises(RefusedError, match="other sources or files"):
        run_trials(coins(3), store)
    assert not store.keys()


def test_a_child_from_before_a_change_of_the_sources_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"penny_{tmp_path.name}"
    file = tmp_path / f"{name}.py"
    file.write_text("from tests.sim.sweep.scenarios import Coin\n\nclass Penny(Coin):\n    pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    penny = trial(f"{name}:Penny")
    before = penny.content
    worker = Worker(module_path())
    try:
        assert worker.run(penny, before).status == "ok"
        file.write_text(f"{file.read_text()}# changed\n")
        code._stranger.cache_clear()
        assert penny.content != before
        assert worker.run(penny, penny.content).status == "ok"
    finally:
        worker.close()


def test_a_pool_runs_one_list_after_the_other_in_the_same_process(store: Store, tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()
    with Pool(1) as pool:
        for count in (2, 3, 3):
            run_trials(coins(count, marks=str(marks)), store, pool=pool)
    assert len(list(marks.iterdir())) == 3
    (process,) = {int(mark.name.rpartition("-")[2]) for mark in marks.iterdir()}
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


def test_a_pool_goes_on_after_a_mishap(store: Store) -> None:
    with Pool(2) as pool:
        first = run_trials(coins(3, segfault_at=(0,), hang_at=(1,)), store, timeout=TIMEOUT, pool=pool)
        second = run_trials(coins(3, bias=0.4), store, pool=pool)
    assert [record.status for record in first] == ["crashed", "timed-out", "ok"]
    assert [record.status for record in second] == ["ok", "ok", "ok"]


def test_a_pool_has_a_worker() -> None:
    with pytest.raises(ValueError, match="workers = 0"):
        Pool(0)


def test_what_numba_compiles_does_not_count(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = f"slow_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(SLOW)
    monkeypatch.syspath_prepend(tmp_path)
    seen: list[Progress] = []
    records = run_trials([trial(f"{name}:Slow", seed) for seed in (0, 1)], store, timeout=0.2, progress=seen.append)
    assert [record.status for record in records] == ["ok", "ok"], records[0].error
    assert (records[0].timings["trial_wall_s"] or 0.0) > 0.2
    assert any(now.compiling for now in seen)


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


PARENT = """
import sys
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.execution import run_trials
from tests.sim.sweep.test_execution import coins
with Store.open(sys.argv[1]) as store:
    run_trials(coins(4, marks=sys.argv[2], hang_at=(0, 1, 2, 3)), store, workers=2)
"""


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks processes up in /proc")
def test_children_end_with_their_parent(tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(tmp_path / "store.db"), str(marks)])
    until = time.monotonic() + 30.0
    while len(list(marks.iterdir())) < 2 and time.monotonic() < until and parent.poll() is None:
        time.sleep(0.05)
    children = [int(mark.name.rpartition("-")[2]) for mark in marks.iterdir()]
    assert len(children) == 2
    assert all(map(is_running, children))
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    while any(map(is_running, children)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(is_running, children))


@pytest.mark.usefixtures("trials_here")
def test_results_of_another_environment_are_computed_anew_unless_they_are_mixed(
    store: Store, elsewhere: Callable[[str], None]
) -> None:
    there = run_trials(coins(3), store)
    jobs = [job(returned, k) for k in range(2)]
    called = run_jobs(jobs, store)
    elsewhere("9.9")
    counts = Elsewhere()
    mixed = run_trials(coins(3), store, mix_environments=True, elsewhere=counts)
    assert comparable(mixed) == comparable(there)
    assert counts.taken.total() == 3
    assert run_jobs(jobs, store, mix_environments=True) == called
    here = run_trials(coins(4), store, elsewhere=counts)
    assert counts.left.total() == 3
    assert not {record.key for record in here} & {record.key for record in there}
    assert [record.summary["x_m"] for record in here[:3]] == [record.summary["x_m"] for record in there]
    assert len(store.keys()) == 7
    assert {record.key for record in run_jobs(jobs, store)}.isdisjoint(record.key for record in called)


def test_a_worker_in_another_environment_is_refused(store: Store, elsewhere: Callable[[str], None]) -> None:
    elsewhere("9.9")  # the child computes with the version that is installed
    with pytest.raises(RefusedError, match=r"in another environment, numpy .* \(here 9\.9\).*--mix-environments"):
        run_trials(coins(1), store)
    (record,) = run_trials(coins(1), store, mix_environments=True)
    assert record.origin.environment["numpy"] != "9.9"
