"""Store of trials: one SQLite file that survives the death of the process that writes it, and that ``sqlite3`` reads.

    trials(key, scenario, seed, code, status, success, parameters, summary, error)     one row for each trial
    timings(key, figure, value)                                                        figures that depend on the clock

the tables of ``mathnavi.sim.records.origins``, and, if computations without a scenario are stored, those of
``mathnavi.sim.records.jobs``.

``key`` is the hash of scenario, resolved parameters, seed, code version and computing environment. ``parameters`` and
``summary`` are JSON. No figure in ``trials`` depends on the time, on the load of the machine or on the number of
workers, so two sweeps of the same trials in the same environment leave the same table, with one exception: the machine
may be the cause of a trial that timed out, or crashed for lack of memory. Such trials may be run again, and their rows
replaced.

SQLite's rollback journal is kept on purpose: between commits the one file is the whole store, which may be copied,
moved to a network drive or read from a read-only folder. Every commit waits for the disk.
"""

from __future__ import annotations

import csv
import io
import json
import re
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import FieldError, StoreError
from mathnavi.interfaces.fields import flattened, plain
from mathnavi.interfaces.reading.files import checked, parsed
from mathnavi.interfaces.schema import shortened
from mathnavi.interfaces.writing import write_text
from mathnavi.sim.records.computing_environment import environment_digest
from mathnavi.sim.records.documents import TrialParameters, check_summary
from mathnavi.sim.records.field_names import PARTS, recorded_fields, split
from mathnavi.sim.records.jobs import JobRecord, add_job, job_records, job_statuses
from mathnavi.sim.records.origins import Elsewhere, Origin, add_origin, environments, keys_by_content, origins

APPLICATION = 0x6D6E6176  # "mnav", in the header of the file: what kind of database it is
SCHEMA = 1
STUDY_STORE = "trials.db"  # next to the files of the studies whose trials and jobs it holds
STATUSES = ("ok", "raised", "crashed", "timed-out")
TRANSIENT = ("crashed", "timed-out")  # statuses that may differ the next time
TABLES = {
    "trials": ("key", "scenario", "seed", "code", "status", "success", "parameters", "summary", "error"),
    "timings": ("key", "figure", "value"),
}
LATER_TABLES = {  # made with the first job, and with the first result that has an origin
    "jobs": ("key", "function", "arguments", "seed", "code", "status", "result", "arrays", "error"),
    "job_timings": ("key", "figure", "value"),
    "environments": ("digest", "description"),
    "origins": ("key", "content", "environment"),
}
CREATE = f"""
CREATE TABLE trials (
    key TEXT PRIMARY KEY,
    scenario TEXT NOT NULL,
    seed INTEGER NOT NULL,
    code TEXT NOT NULL,
    status TEXT NOT NULL CHECK (status IN {STATUSES}),
    success INTEGER CHECK (success IN (0, 1)),
    parameters TEXT NOT NULL,
    summary TEXT NOT NULL,
    error TEXT
) WITHOUT ROWID;
CREATE TABLE timings (
    key TEXT NOT NULL REFERENCES trials (key),
    figure TEXT NOT NULL,
    value REAL,
    PRIMARY KEY (key, figure)
) WITHOUT ROWID;
"""
INSERT = f"""
INSERT INTO trials VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (key) DO UPDATE SET
    status = excluded.status, success = excluded.success, summary = excluded.summary, error = excluded.error,
    parameters = excluded.parameters
WHERE ? AND trials.status IN {TRANSIENT}
"""
PATIENCE = 60.0  # [s] to wait for another process that is writing

_NOT_FINITE = re.compile(r'"(?:[^"\\]|\\.)*"|-?Infinity|NaN')  # strings are matched so that they stay unchanged
_AS_JSON = {"Infinity": "9e999", "-Infinity": "-9e999", "NaN": "null"}


class StoreWriteError(RuntimeError):
    """Store that is no longer usable: the disk is full, or it may no longer be written."""


@dataclass(frozen=True)
class Record:
    """Record of a trial: its request, and how it ended."""

    key: str
    scenario: str
    parameters: dict[str, Any]  # config, controller {name, fields}, estimator {name, fields}, inputs
    seed: int
    code: str  # version
    status: str  # "ok": it ran to its end; "raised", "crashed" or "timed-out": it did not
    success: bool | None  # whether the mission succeeded; None if it did not run to its end
    summary: dict[str, Any]
    timings: dict[str, float | None] = field(default_factory=dict)
    error: str | None = None
    origin: Origin = field(default_factory=Origin)

    @cached_property
    def fields(self) -> dict[str, Any]:
        """Return the parameters by their names on the command line: "faults.gust_rms", "planner.nodes"."""
        return recorded_fields(self.parameters)


class Ending(NamedTuple):
    """End of a trial, as in its record."""

    status: str
    success: bool | None


def canonical_json(value: Any) -> str:
    """Return ``value`` as JSON, always the same text for the same value.

    An infinity is a number too large for a double, which every reader reads as one; NaN is null.
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, default=_plain)
    if "NaN" in text or "Infinity" in text:
        return _NOT_FINITE.sub(lambda found: _AS_JSON.get(found[0], found[0]), text)
    return text


def _plain(value: Any) -> Any:
    made = plain(value)
    if made is value:
        raise TypeError(f"{value!r} of type {type(value).__name__} cannot be stored; allowed: what JSON can say")
    return made


class Store:
    """Open store. It belongs to the thread that opened it."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection

    @staticmethod
    def open(path: Path | str) -> Store:
        """Open the store at ``path`` for reading and writing; it is made, with its folder, if there is no such file.

        Raises ValueError for a file that is not a store, a store of another schema, and one that cannot be written;
        they are left unchanged.
        """
        path = Path(path)
        with _opening(path):
            found = path.exists()
            if path.is_symlink() and not found:
                raise StoreError(f"{path}: a link to a file that does not exist; allowed: a store, or a new file")
            made = [folder for folder in path.parents if not folder.exists()]
        try:
            with _opening(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                store = Store(path, _connect(path, "rwc"))
            with store._closed_on_error():
                if not store._created():
                    store._check()
                    store._try_to_write()
            return store
        except BaseException:
            with suppress(OSError):  # nothing is left of what was begun
                if not found and path.stat().st_size == 0:
                    path.unlink()
            with suppress(OSError):
                for folder in made:
                    folder.rmdir()
            raise

    @staticmethod
    def existing(path: Path | str) -> Store:
        """Open the store at ``path`` for reading; ValueError as for ``open``, and if it does not exist."""
        path = Path(path)
        with _opening(path):
            if not path.is_file():
                raise StoreError(f"{path}: no such file; allowed: a store that `mathnavi sweep` has written")
            store = Store(path, _connect(path, "rw"))
        with store._closed_on_error():
            store._check()
        return store

    def close(self) -> None:
        """Close the connection to the file."""
        self._connection.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(self, *records: Record | JobRecord, retried: bool = False) -> None:
        """Commit records, all or none, before this returns.

        A record whose key the store has stays unchanged; one that timed out or crashed is replaced if ``retried``.
        Raises StoreWriteError if they cannot be written. Earlier commits stay readable.
        """
        with self._errors_named(), self._transaction():
            for record in records:
                add_origin(self._connection, record.key, record.origin)
                if isinstance(record, JobRecord):
                    add_job(self._connection, record, retried)
                    continue
                success = None if record.success is None else int(record.success)
                parameters, summary = canonical_json(record.parameters), canonical_json(record.summary)
                row = (record.key, record.scenario, record.seed, record.code, record.status, success, parameters)
                before = self._connection.total_changes
                self._connection.execute(INSERT, (*row, summary, record.error, retried))
                if self._connection.total_changes > before:
                    self._connection.execute("DELETE FROM timings WHERE key = ?", (record.key,))
                    self._connection.executemany(
                        "INSERT INTO timings VALUES (?, ?, ?)",
                        [(record.key, figure, value) for figure, value in record.timings.items()],
                    )

    def keys(self) -> set[str]:
        """Return the keys of all trials."""
        return set(self.endings())

    def endings(self) -> dict[str, Ending]:
        """Return the end of every trial, by its key."""
        with self._reading():
            rows = self._connection.execute("SELECT key, status, success FROM trials")
            return {key: Ending(status, None if success is None else bool(success)) for key, status, success in rows}

    def records(self, keys: Iterable[str] | None = None) -> list[Record]:
        """Return the trials with these keys, in their order; all of them in the order of their keys if none are given.

        Raises KeyError for a key that the store does not have.
        """
        if keys is None:
            keys = sorted(self.keys())
        with self._reading():
            known = origins(self._connection)
            return [self._record(key, known.get(key, Origin())) for key in keys]

    def job_endings(self) -> dict[str, Ending]:
        """Return the end of every job, by its key."""
        with self._reading():
            return {key: Ending(status, None) for key, status in job_statuses(self._connection).items()}

    def jobs(self, keys: Iterable[str]) -> list[JobRecord]:
        """Return the jobs with these keys, in their order; KeyError for a key that the store does not have."""
        with self._reading():
            known = origins(self._connection)
            found = job_records(self._connection, keys)
            return [replace(record, origin=known.get(record.key, Origin())) for record in found]

    def keys_of(
        self, contents: Iterable[str], mix_environments: bool = False, elsewhere: Elsewhere | None = None
    ) -> dict[str, str]:
        """Return the key of the record of each content hash, if the store has one that was made in this environment.

        With ``mix_environments`` one from another environment is accepted if none exists; ``elsewhere`` counts those.
        """
        with self._reading():
            stored = keys_by_content(self._connection, self.keys() | job_statuses(self._connection).keys())
        return (elsewhere or Elsewhere()).chosen(contents, stored, environment_digest(), mix_environments)

    def input_digests(self, field: str, value: str) -> dict[str, int]:
        """Count the trials in which a field that names a file has a value, by the digest that the file had then.

        ``field`` is named as on the command line.
        """
        prefix, name = split(field)
        part = f"{PARTS[prefix]}.fields" if prefix else PARTS[prefix]
        query = (
            "SELECT json_extract(parameters, ?) AS digest, COUNT(*) FROM trials "
            "WHERE json_extract(parameters, ?) = ? GROUP BY digest HAVING digest IS NOT NULL"
        )
        with self._reading():
            return dict(self._connection.execute(query, (f'$.inputs."{field}"', f"$.{part}.{name}", value)).fetchall())

    def environments(self) -> dict[str, dict[str, str]]:
        """Return the description of the environments of the records, by their digests."""
        with self._reading():
            return environments(self._connection)

    def rows(self) -> list[dict[str, Any]]:
        """Return the trials as a table: parameters and figures by column, ordered by key."""
        return [_row(record) for record in self.records()]

    def export_csv(self, path: Path) -> None:
        """Write one line for each trial: parameters and figures as columns, ordered by key; the whole file or none.

        Raises FieldError for a ``path`` that is the store.
        """
        check_spares(path, [self.path])
        write_text(path, as_csv(self.rows()))

    def export_jsonl(self, path: Path) -> None:
        """Write one JSON object for each trial, ordered by key; FieldError and the file as with ``export_csv``."""
        check_spares(path, [self.path])
        names = [entry.name for entry in fields(Record)]
        objects = ({name: getattr(record, name) for name in names} for record in self.records())
        write_text(path, "".join(f"{canonical_json(each)}\n" for each in objects))

    def _record(self, key: str, origin: Origin) -> Record:
        selected = f"SELECT {', '.join(TABLES['trials'])} FROM trials WHERE key = ?"
        values = self._connection.execute(selected, (key,)).fetchone()
        if values is None:
            raise KeyError(key)
        named = dict(zip(TABLES["trials"], values, strict=True))
        success = None if named["success"] is None else bool(named["success"])
        figures = self._connection.execute("SELECT figure, value FROM timings WHERE key = ? ORDER BY figure", (key,))
        where = f"{self.path}: trial {key}"
        if named["status"] not in STATUSES:
            raise StoreError(f"{where}: status = {shortened(named['status'])}; allowed: {', '.join(STATUSES)}")
        for name, kind in (("parameters", TrialParameters), ("summary", dict[str, Any])):
            named[name] = parsed(named[name], f"{where}: {name}", StoreError)
            checked(kind, named[name], f"{where}: {name}", StoreError)
        try:
            check_summary(named["summary"])
        except FieldError as error:
            raise StoreError(f"{where}: summary: {error}") from None
        row = {**named, "success": success, "timings": dict(figures.fetchall())}
        record: Record = checked(Record, row, where, StoreError)
        return replace(record, origin=origin)

    def _created(self) -> bool:
        """Return True if the file was empty; it is a store now."""
        with _opening(self.path), self._transaction():
            if self.path.stat().st_size > 0:
                return False
            for statement in filter(str.strip, CREATE.split(";")):
                self._connection.execute(statement)
            # Both are in the file's header, so a store that was half made when its process died does not count as one.
            self._connection.execute(f"PRAGMA application_id = {APPLICATION}")
            self._connection.execute(f"PRAGMA user_version = {SCHEMA}")
            return True

    def _check(self) -> None:
        with _opening(self.path):
            if self._pragma("application_id") != APPLICATION:
                raise StoreError(f"{self.path}: a database of another kind; allowed: a store of trials or a new file")
            if (schema := self._pragma("user_version")) != SCHEMA:
                raise StoreError(f"{self.path}: a store of schema {schema}; allowed: schema {SCHEMA}")
            if others := self._connection.execute(
                "SELECT type, name FROM sqlite_master WHERE type NOT IN ('table', 'index')"
            ).fetchall():
                raise StoreError(f"{self.path}: it has a {others[0][0]} {others[0][1]}; allowed: tables alone")
            for table, columns in (TABLES | LATER_TABLES).items():
                found = tuple(row[1] for row in self._connection.execute(f"PRAGMA table_info({table})"))
                if found != columns and (found or table in TABLES):
                    raise StoreError(
                        f"{self.path}: its table {table} has the columns {', '.join(found) or 'of no table'}; "
                        f"allowed: {', '.join(columns)}"
                    )
            if odd := self._connection.execute("SELECT key FROM trials WHERE typeof(key) != 'text' LIMIT 1").fetchone():
                raise StoreError(f"{self.path}: trial {shortened(odd[0])}: allowed as its key: a text")
            if (fault := self._connection.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
                raise StoreError(f"{self.path}: a damaged store ({fault}); allowed: a whole one")

    def _try_to_write(self) -> None:
        """Begin a change, which needs the file and a journal next to it, and roll it back."""
        with _opening(self.path):
            self._connection.execute("BEGIN IMMEDIATE")
            self._connection.execute(f"PRAGMA user_version = {SCHEMA}")
            self._connection.execute("ROLLBACK")

    def _pragma(self, name: str) -> int:
        return int(self._connection.execute(f"PRAGMA {name}").fetchone()[0])

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            if self._connection.in_transaction:  # SQLite itself may have rolled back
                self._connection.execute("ROLLBACK")
            raise

    @contextmanager
    def _closed_on_error(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            self.close()
            raise

    @contextmanager
    def _reading(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: {error}; allowed: a whole store of trials") from error

    @contextmanager
    def _errors_named(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise StoreWriteError(f"{self.path}: {error}") from error


def stored_results(path: Path) -> int | None:
    """Return the number of trials and jobs in a store that another thread may be writing; None if it cannot be read
    now.
    """
    if not path.is_file():
        return 0
    try:
        with closing(_connect(path, "ro", timeout=0.2)) as connection:
            tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            counted = [f"SELECT count(*) FROM {name}" for name in ("trials", "jobs") if name in tables]
            return sum(int(connection.execute(each).fetchone()[0]) for each in counted)
    except sqlite3.Error:
        return None


def _connect(path: Path, mode: str, timeout: float = PATIENCE) -> sqlite3.Connection:
    address = f"{path.absolute().as_uri()}?mode={mode}"
    return sqlite3.connect(address, uri=True, timeout=timeout, isolation_level=None)


@contextmanager
def _opening(path: Path) -> Iterator[None]:
    """Raise StoreError for any error while a store is opened: the path is wrong."""
    try:
        yield
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror}; allowed: a file in a folder that can be made") from error
    except sqlite3.Error as error:
        raise StoreError(f"{path}: {error}; allowed: a store of trials that can be written, or a new file") from error


def _row(record: Record) -> dict[str, Any]:
    """Return the values of a trial by column."""
    row: dict[str, Any] = {
        "key": record.key,
        "scenario": record.scenario,
        "seed": record.seed,
        "status": record.status,
        "success": record.success,
    }
    columns: tuple[tuple[str, Mapping[str, Any]], ...] = (
        ("parameters", record.fields),
        ("summary", flattened(record.summary)),
        ("timings", record.timings),
    )
    for kind, cells in columns:
        for name, value in cells.items():
            row[f"{kind}.{name}" if name in row else name] = value
    return row | {"code": record.code, "environment": record.origin.digest, "error": record.error}


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows as CSV, with the columns of a store's table of trials if there is no row."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns_of(rows), lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: cell(value) for name, value in row.items()} for row in rows)
    return text.getvalue()


def columns_of(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the columns of all rows in order, those of a store's table of trials if there is no row."""
    return list(dict.fromkeys(name for row in rows for name in row)) or list(TABLES["trials"])


def cell(value: Any) -> Any:
    """Return numbers and texts unchanged, nothing for None, the rest as JSON."""
    return value if value is None or type(value) in (int, float, str) else canonical_json(value)
