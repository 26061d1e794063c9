"""The store keeps what it was given, refuses what is none, and survives what happens to it."""

from __future__ import annotations

import csv
import json
import math
import os
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.fields import plain
from mathnavi.sim.records.store import APPLICATION, SCHEMA, STATUSES, Record, Store, StoreWriteError, canonical_json


def record(key: str = "a", **changes: Any) -> Record:
    given: dict[str, Any] = {
        "key": key,
        "scenario": "flat",
        "parameters": {
            "config": {"noise": {"rate": 2.0}, "start": [1.0, 2.0], "name": "Gipfel ü", "none": None},
            "controller": {"name": "mine", "fields": {"nodes": 3}},
            "estimator": {"name": "theirs", "fields": {"rate": 10.0}},
            "inputs": {},
        },
        "seed": 7,
        "code": "1+abc",
        "status": "ok",
        "success": True,
        "summary": {"arrived": True, "path_m": 12.5, "least_m": -math.inf, "count": 3, "none": None},
        "timings": {"solve_ms_mean": 0.5},
    }
    return Record(**{**given, **changes})


def trials_of(path: Path) -> list[tuple[Any, ...]]:
    with sqlite3.connect(path) as connection:
        return connection.execute("SELECT * FROM trials ORDER BY key").fetchall()


def is_whole(path: Path) -> bool:
    with sqlite3.connect(path) as connection:
        return connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "store.db"


def test_a_record_comes_back_as_it_went(path: Path) -> None:
    failed = record("b", status="raised", success=None, summary={}, timings={}, error="Traceback ...\nValueError: no")
    with Store.open(path) as store:
        store.add(record())
        store.add(failed)
    with Store.open(path) as store:
        assert store.records(["b", "a"]) == [failed, record()]
        assert store.records() == [record(), failed]
        assert store.keys() == {"a", "b"}


def test_what_is_no_number_is_nothing(path: Path) -> None:
    with Store.open(path) as store:
        store.add(record(summary={"mean": math.nan}, timings={"solve_ms_mean": math.nan}))
        (found,) = store.records()
    assert found.summary == {"mean": None}
    assert found.timings == {"solve_ms_mean": None}


def test_a_key_is_stored_once_and_stays_as_it_was(path: Path) -> None:
    with Store.open(path) as store:
        store.add(record())
        store.add(record(summary={"path_m": 0.0}, timings={"other_ms": 1.0}), record("b"))
        assert store.records(["a"]) == [record()]
        assert store.keys() == {"a", "b"}


@pytest.mark.parametrize("status", STATUSES)
def test_only_what_timed_out_or_crashed_is_replaced_and_only_when_retried(path: Path, status: str) -> None:
    failed = record(status=status, success=None, summary={}, timings={"trial_wall_s": 9.0, "gone_ms": 1.0}, error="no")
    with Store.open(path) as store:
        store.add(failed)
        store.add(record())
        assert store.records() == [failed]
        store.add(record(), record("b"), retried=True)
        assert store.records(["a"]) == [record() if status in ("timed-out", "crashed") else failed]
        assert store.endings() == {key: (found.status, found.success) for key in "ab" for found in store.records([key])}


def test_a_replacement_is_whole_or_not_at_all(path: Path) -> None:
    failed = record(status="timed-out", success=None, summary={}, error="no end within 1 s")
    with Store.open(path) as store:
        store.add(failed)
        with pytest.raises(StoreWriteError, match="CHECK constraint failed"):
            store.add(record(), record("b", status="lost"), retried=True)
        assert store.records() == [failed]


def test_records_are_added_all_or_none(path: Path) -> None:
    with Store.open(path) as store:
        with pytest.raises(TypeError, match="cannot be stored"):
            store.add(record("a"), record("b", summary={"thing": object()}))
        with pytest.raises(StoreWriteError, match="CHECK constraint failed"):
            store.add(record("a"), record("b", status="lost"))
        assert store.keys() == set()
        store.add(record("a"))
        assert store.keys() == {"a"}


def test_an_unknown_key_is_reported(path: Path) -> None:
    with Store.open(path) as store, pytest.raises(KeyError, match="nowhere"):
        store.records(["nowhere"])


def test_plain_sqlite_reads_it(path: Path) -> None:
    with Store.open(path) as store:
        store.add(record())
    with sqlite3.connect(path) as connection:
        question = "SELECT seed, json_extract(summary, '$.path_m'), json_extract(parameters, '$.config.noise.rate') "
        assert connection.execute(f"{question} FROM trials").fetchall() == [(7, 12.5, 2.0)]
        assert connection.execute("SELECT json_extract(summary, '$.least_m') FROM trials").fetchone() == (-math.inf,)
        assert connection.execute("SELECT * FROM timings").fetchall() == [("a", "solve_ms_mean", 0.5)]
        assert connection.execute("PRAGMA application_id").fetchone() == (APPLICATION,)
        assert connection.execute("PRAGMA user_version").fetchone() == (SCHEMA,)


def test_between_commits_the_file_is_the_whole_store(path: Path) -> None:
    with Store.open(path) as store:
        store.add(record())
        assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_two_may_write_one_store(path: Path) -> None:
    with Store.open(path) as one, Store.open(path) as other:
        for k in range(5):
            one.add(record(f"one {k}"), record("both"))
            other.add(record(f"other {k}"), record("both"))
        assert one.keys() == other.keys()
        assert len(one.keys()) == 11


def test_an_empty_file_becomes_a_store(path: Path) -> None:
    path.touch()
    with Store.open(path) as store:
        store.add(record())
    assert len(trials_of(path)) == 1


def test_missing_folders_are_made_and_go_again_if_there_is_no_store(tmp_path: Path) -> None:
    with Store.open(tmp_path / "a/b/store.db") as store:
        store.add(record())
    with pytest.raises(ValueError, match=r"name\.db"):
        Store.open(tmp_path / ("c/d/" + 300 * "long" + "name.db"))
    assert not (tmp_path / "c").exists()


def foreign(path: Path, *statements: str) -> None:
    with sqlite3.connect(path) as connection:
        for statement in statements:
            connection.execute(statement)
    connection.close()


def a_text(path: Path) -> None:
    path.write_text("key,seed,status\n" * 300)


def of_something_else(path: Path) -> None:
    foreign(path, "CREATE TABLE trials (key TEXT)")


def of_another_schema(path: Path) -> None:
    Store.open(path).close()
    foreign(path, f"PRAGMA user_version = {SCHEMA + 1}")


def of_other_columns(path: Path) -> None:
    Store.open(path).close()
    foreign(path, "ALTER TABLE trials RENAME COLUMN status TO state")


def of_other_jobs(path: Path) -> None:
    Store.open(path).close()
    foreign(path, "CREATE TABLE jobs (a)")


def of_another_key(path: Path) -> None:
    with Store.open(path) as store:
        store.add(record("a"), record("b"))
    foreign(path, "UPDATE trials SET key = x'ff' WHERE key = 'b'")


def cut_off(path: Path) -> None:
    with Store.open(path) as store:
        store.add(*(record(f"{k}") for k in range(100)))
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2)


def a_folder(path: Path) -> None:
    path.mkdir()


def a_link_to_nothing(path: Path) -> None:
    path.symlink_to("elsewhere.db")


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (a_text, "file is not a database"),
        (of_something_else, "another kind"),
        (of_another_schema, f"schema {SCHEMA + 1}; allowed: schema {SCHEMA}"),
        (of_other_columns, "its table trials has the columns"),
        (of_other_jobs, "its table jobs has the columns a; allowed: key, function"),
        (of_another_key, r"trial b'\xff'"),
        (cut_off, "malformed"),
        (a_folder, "unable to open"),
        (a_link_to_nothing, "a link to a file that does not exist"),
    ],
)
def test_what_is_no_store_is_refused_and_left_alone(path: Path, make: Callable[[Path], None], expected: str) -> None:
    make(path)
    before = path.read_bytes() if path.is_file() else None
    for refuse in (Store.open, Store.existing):
        with pytest.raises(ValueError, match=r"store\.db: ") as info:
            refuse(path)
        if path.is_file() or refuse is Store.open:
            assert expected in str(info.value)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    assert (path.read_bytes() if path.is_file() else None) == before


def test_a_store_to_be_read_has_to_be_there(path: Path) -> None:
    with pytest.raises(ValueError, match=r"store\.db: no such file"):
        Store.existing(path)
    assert not path.exists()


@pytest.fixture
def anybody() -> Iterator[Path]:
    """A folder of a user who may not write everywhere, who this process is for a while if it is root."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "open").mkdir()
        if os.geteuid() == 0:
            folder.chmod(0o755)
            os.chown(folder / "open", 65534, 65534)
            os.seteuid(65534)
        try:
            yield folder / "open"
        finally:
            if os.getuid() == 0:
                os.seteuid(0)
            (folder / "open").chmod(0o777)


def test_a_store_that_cannot_be_written_is_refused_but_may_be_read(anybody: Path) -> None:
    path = anybody / "store.db"
    with Store.open(path) as store:
        store.add(record())
    before = path.read_bytes()
    for file_mode, folder_mode in ((0o444, 0o777), (0o644, 0o555)):  # of the file; of the folder, for the journal
        path.chmod(file_mode)
        anybody.chmod(folder_mode)
        with pytest.raises(ValueError, match=r"store\.db: .*(readonly|unable to open)"):
            Store.open(path)
        with Store.existing(path) as store:
            assert store.records() == [record()]
        assert path.read_bytes() == before
        anybody.chmod(0o777)


def test_a_store_cannot_be_made_where_nothing_may_be(anybody: Path) -> None:
    anybody.chmod(0o555)
    for name in ("store.db", "folder/store.db"):
        with pytest.raises(ValueError, match=r"store\.db: "):
            Store.open(anybody / name)
    assert not list(anybody.iterdir())


def test_where_no_file_can_be_made_the_name_is_reported() -> None:
    with pytest.raises(ValueError, match=r"/proc/store\.db: "):
        Store.open("/proc/store.db")


def add_many(store: Store) -> None:
    for k in range(1000):
        store.add(record(f"{k:04}"))


def test_a_full_disk_ends_in_one_error_and_keeps_what_was_committed(path: Path) -> None:
    with Store.open(path) as store:
        store.add(record("first"))
        store._connection.execute("PRAGMA max_page_count = 20")
        with pytest.raises(StoreWriteError, match=r"store\.db: database or disk is full"):
            add_many(store)
        kept = store.keys()
        assert store.records() == [record(key) for key in sorted(kept)]
    assert {"first", "0000"} <= kept
    assert is_whole(path)
    with Store.open(path) as store:  # where there is room again
        store.add(record("last"))
        assert store.keys() == kept | {"last"}


def test_a_store_that_turns_read_only_ends_in_one_error(path: Path) -> None:
    with Store.open(path) as store:
        store.add(record("first"))
        store._connection.execute("PRAGMA query_only = 1")
        with pytest.raises(StoreWriteError, match="readonly"):
            store.add(record("second"))
        assert store.keys() == {"first"}


WRITER = """
import sys
from tests.sim.records.test_store import record
from mathnavi.sim.records.store import Store
with Store.open(sys.argv[1]) as store:
    for k in range(100000):
        store.add(record(f"{k:06}"))
        print(k, flush=True)
"""


def test_a_writer_that_is_killed_loses_nothing_that_it_has_announced(path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        for expected in writer.stdout:
            if int(expected) >= 20:
                writer.kill()
                break
        expected = (expected + writer.stdout.read()).split()[-1]
    with Store.open(path) as store:
        assert len(store.keys()) in (int(expected) + 1, int(expected) + 2)
    assert is_whole(path)


def test_the_table_has_a_line_a_trial_and_a_column_a_figure(path: Path, tmp_path: Path) -> None:
    failed = record("b", status="crashed", success=None, summary={}, timings={}, error='killed, "by" all\nof us')
    with Store.open(path) as store:
        store.add(failed, record("a"))
        store.export_csv(tmp_path / "table.csv")
        store.export_jsonl(tmp_path / "table.jsonl")
    with (tmp_path / "table.csv").open(newline="", encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    expected = {"key": "a", "seed": "7", "status": "ok", "success": "true", "scenario": "flat", "code": "1+abc"}
    expected |= {"noise.rate": "2.0", "start": "[1.0,2.0]", "controller": "mine", "planner.nodes": "3"}
    expected |= {"estimator": "theirs", "estimator.rate": "10.0", "path_m": "12.5", "arrived": "true", "none": ""}
    expected |= {"least_m": "-inf", "solve_ms_mean": "0.5", "name": "Gipfel ü"}
    assert first == {**first, **expected}
    assert second == {**second, "key": "b", "success": "", "path_m": "", "error": failed.error}
    lines = [json.loads(line) for line in (tmp_path / "table.jsonl").read_text(encoding="utf-8").splitlines()]
    assert lines == [plain(record("a")), plain(failed)]


def test_a_figure_with_the_name_of_a_field_has_a_column_of_its_own(path: Path, tmp_path: Path) -> None:
    with Store.open(path) as store:
        store.add(record(summary={"noise.rate": 9.0, "seed": 1}))
        store.export_csv(tmp_path / "table.csv")
    with (tmp_path / "table.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert (row["noise.rate"], row["summary.noise.rate"]) == ("2.0", "9.0")
    assert (row["seed"], row["summary.seed"]) == ("7", "1")


def test_an_empty_store_has_an_empty_table(path: Path, tmp_path: Path) -> None:
    with Store.open(path) as store:
        store.export_csv(tmp_path / "table.csv")
    assert (tmp_path / "table.csv").read_text() == "key,scenario,seed,code,status,success,parameters,summary,error\n"


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
)


@given(values)
def test_canonical_json_says_it_all(value: Any) -> None:
    assert json.loads(canonical_json(value)) == value


@given(st.dictionaries(st.text(), values, max_size=5))
def test_canonical_json_does_not_depend_on_the_order(value: dict[str, Any]) -> None:
    assert canonical_json(value) == canonical_json(dict(reversed(value.items())))


def test_words_that_look_like_numbers_stay_words() -> None:
    text = canonical_json({"Infinity": "NaN", 'a"b': "-Infinity", "x": [math.inf, -math.inf, math.nan]})
    assert text == '{"Infinity":"NaN","a\\"b":"-Infinity","x":[9e999,-9e999,null]}'
