"""Jobs, computations that are no scenario, are stored, resumed, and the same wherever they run."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.child import RefusedError
from mathnavi.sim.sweep.execution import Progress, run_jobs, run_trials
from mathnavi.sim.sweep.job import Job, job
from mathnavi.sim.sweep.trial import trial
from tests.sim.sweep import computations
from tests.sim.sweep.computations import Walk, Walked, drawn_globally, mishap, process, returned, timed, walked

COIN = "tests.sim.sweep.scenarios:Coin"
LATE = 60.0  # [s]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store.db") as opened:
        yield opened


def walks(count: int, steps: int = 50, **fields: Any) -> list[Job]:
    return [job(walked, Walk(steps, seed, **fields), seed=seed, offset=0.5) for seed in range(count)]


def content(found: Walked) -> tuple[Any, ...]:
    return found.path.dtype, found.path.shape, found.path.tobytes(), found.end, found.side, found.by_key


def test_results_are_the_same_in_this_process_in_children_and_resumed(store: Store, tmp_path: Path) -> None:
    jobs = [*walks(6), *walks(2, steps=3)]
    here = [content(each.call()) for each in jobs]
    with Store.open(tmp_path / "two.db") as other:
        several = run_jobs(jobs[::-1], other, workers=2)[::-1]
    run_jobs(jobs[2:4], store)
    resumed = run_jobs(jobs, store)
    again = run_jobs(jobs, store)
    assert [content(record.value) for record in several] == here
    assert [content(record.value) for record in resumed] == here
    assert again == resumed
    for one, two in zip(several, resumed, strict=True):
        assert (one.key, one.result, one.arrays, one.arguments) == (two.key, two.result, two.arrays, two.arguments)


def test_global_generators_are_seeded(store: Store) -> None:
    one, same, other = (record.value for record in run_jobs([job(drawn_globally, 3, seed=k) for k in (1, 1, 2)], store))
    np.random.seed(1)
    assert one == same == np.random.random(3).tolist()
    assert one != other


def test_the_key_is_that_of_function_arguments_seed_and_code(monkeypatch: pytest.MonkeyPatch) -> None:
    walk = Walk(3, 1)
    values = (walk, (1, 2), [1, 2], 1, 1.0, True, "1", {"1": 1}, {1: 1}, np.float64(1.0))
    jobs = [
        *(job(walked, walk), job(walked, Walk(4, 1)), job(walked, walk, offset=1.0), job(walked, walk, seed=1)),
        *(job(returned, value) for value in values),
    ]
    keys = [each.key for each in jobs]
    assert len(set(keys)) == len(keys)
    assert job(walked, Walk(3, 1)).key == keys[0]
    monkeypatch.setattr("mathnavi.sim.sweep.job.code_version", lambda *_: "another")
    assert job(walked, Walk(3, 1)).key != keys[0]


def test_what_goes_wrong_is_recorded_and_run_again_when_it_is_asked_for(store: Store) -> None:
    jobs = [job(mishap, kind) for kind in ("fine", "raise", "die", "hang", "object")]
    records = run_jobs(jobs, store, workers=2, timeout=2.0)
    assert [record.status for record in records] == ["ok", "raised", "crashed", "timed-out", "raised"]
    assert (records[1].error or "").endswith("RuntimeError: out of order")
    assert "SIGKILL" in (records[2].error or "")
    assert "cannot be stored" in (records[4].error or "")
    with pytest.raises(ValueError, match="returned nothing"):
        _ = records[1].value
    seen: list[Progress] = []
    run_jobs(jobs, store, timeout=2.0, retry=True, progress=seen.append)
    assert (seen[0].found, seen[-1].done, seen[-1].failed, seen[-1].unsuccessful) == (3, 5, 4, 0)


@pytest.mark.usefixtures("trials_here")
def test_what_is_timed_is_stored_as_a_timing(store: Store) -> None:
    (record,) = run_jobs([job(timed, 1000)], store)
    assert {"taken_s[0]", "job_wall_s"} == record.timings.keys()
    assert record.result == '{"total":499500,"taken_s":[{"$timing":"taken_s[0]"}]}'
    assert type(record.value["taken_s"][0]) is MeasuredTime
    (again,) = run_jobs([job(timed, 1000)], store)
    assert again.value == record.value  # as it was measured


@pytest.mark.usefixtures("trials_here")
def test_trials_and_jobs_share_a_store_and_sqlite_reads_both(store: Store) -> None:
    assert store.job_endings() == {}
    run_trials([trial(COIN, 3)], store)
    run_jobs(walks(2), store)
    assert (len(store.keys()), len(store.job_endings())) == (1, 2)
    with closing(sqlite3.connect(store.path)) as database:
        (named,) = database.execute("SELECT DISTINCT function FROM jobs").fetchall()
        assert named == ("tests.sim.sweep.computations:walked",)
    with Store.existing(store.path) as reopened:
        assert len(reopened.job_endings()) == 2


@pytest.mark.usefixtures("trials_here")
def test_a_store_of_trials_alone_has_no_tables_of_jobs(store: Store) -> None:
    run_trials([trial(COIN, 3)], store)
    with closing(sqlite3.connect(store.path)) as database:
        tables = database.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name").fetchall()
    assert tables == [("environments",), ("origins",), ("timings",), ("trials",)]


@pytest.mark.parametrize("function", [lambda: 0, (1.0).__truediv__, Walk(3, 1).__eq__])
def test_only_a_function_of_a_module_is_a_job(function: Any) -> None:
    with pytest.raises(ValueError, match="is defined in a module"):
        job(function)


def test_arguments_are_plain() -> None:
    with pytest.raises(TypeError, match="plain data"):
        job(returned, np.zeros(1000))
    with pytest.raises(TypeError, match="cannot be stored"):
        job(returned, object())


def test_sources_that_changed_meanwhile_end_the_jobs(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mathnavi.sim.sweep.job.code_version", lambda *_: "as it was")
    with pytest.raises(RefusedError, match="other sources or files"):
        run_jobs(walks(1), store)
    assert not store.job_endings()


def test_workers_are_processes_of_their_own(store: Store) -> None:
    pids = {record.value for record in run_jobs([job(process, k) for k in range(4)], store)}
    assert len(pids) == 1
    assert os.getpid() not in pids


CALLED = """
import sys
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.execution import run_jobs
from tests.sim.sweep.test_jobs import walks
with Store.open(sys.argv[1]) as store:
    run_jobs(walks(8, marks=sys.argv[2], wait=0.4), store, workers=2)
"""


@pytest.mark.usefixtures("trials_here")  # which go on with what the workers of another process have begun
def test_after_a_kill_only_what_is_missing_is_computed(tmp_path: Path) -> None:
    path, marks = tmp_path / "store.db", tmp_path / "marks"
    marks.mkdir()
    parent = subprocess.Popen([sys.executable, "-c", CALLED, str(path), str(marks)], stderr=subprocess.DEVNULL)
    until = time.monotonic() + LATE
    while time.monotonic() < until and parent.poll() is None and stored(path) < 3:
        time.sleep(0.05)
    parent.kill()
    parent.wait()
    jobs = walks(8, marks=str(marks), wait=0.4)
    with Store.open(path) as store:
        before = set(store.job_endings())
        assert 3 <= len(before) < 8
        begun = len(list(marks.iterdir()))
        records = run_jobs(jobs, store, workers=2)
    assert len(list(marks.iterdir())) - begun == 8 - len(before)
    assert [content(record.value) for record in records] == [content(each.value) for each in records]
    assert [record.value.path.tobytes() for record in records] == [
        computations.walked(Walk(50, seed), offset=0.5).path.tobytes() for seed in range(8)
    ]


def stored(path: Path) -> int:
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
            return int(database.execute("SELECT count(*) FROM jobs").fetchone()[0])
    except sqlite3.Error:
        return 0
