"""Records of jobs (computations without a scenario), and their tables in a store.

    jobs(key, function, arguments, seed, code, status, result, arrays, error)      one row for each job
    job_timings(key, figure, value)                                                figures that depend on the clock

``arguments`` and ``result`` are JSON as encoded by ``mathnavi.sim.records.encoding``; ``arrays`` is an .npz file of the
larger arrays of the result. The tables are made when the first job is stored, so a store of trials alone has none.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from mathnavi.interfaces.errors import StoreError
from mathnavi.interfaces.reading.files import checked, parsed
from mathnavi.sim.records.encoding import Encoded, decoded
from mathnavi.sim.records.origins import Origin

CREATE = """
CREATE TABLE IF NOT EXISTS jobs (
    key TEXT PRIMARY KEY,
    function TEXT NOT NULL,
    arguments TEXT NOT NULL,
    seed INTEGER NOT NULL,
    code TEXT NOT NULL,
    status TEXT NOT NULL CHECK (status IN ('ok', 'raised', 'crashed', 'timed-out')),
    result TEXT,
    arrays BLOB,
    error TEXT
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS job_timings (
    key TEXT NOT NULL REFERENCES jobs (key),
    figure TEXT NOT NULL,
    value REAL,
    PRIMARY KEY (key, figure)
) WITHOUT ROWID;
"""
INSERT = """
INSERT INTO jobs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (key) DO UPDATE SET
    status = excluded.status, result = excluded.result, arrays = excluded.arrays, error = excluded.error
WHERE ? AND jobs.status IN ('crashed', 'timed-out')
"""


@dataclass(frozen=True)
class JobRecord:
    """Record of a job: the function that was called, its arguments, and how the call ended."""

    key: str
    function: str  # "package.module:function"
    arguments: str  # JSON
    seed: int
    code: str  # version
    status: str  # "ok": it returned; "raised", "crashed" or "timed-out": it did not
    result: str | None = None  # JSON
    arrays: bytes | None = None  # .npz
    timings: dict[str, float | None] = field(default_factory=dict)
    error: str | None = None
    origin: Origin = field(default_factory=Origin)

    @property
    def success(self) -> None:
        """Always None: a job has no mission that may fail."""
        return None

    @property
    def value(self) -> Any:
        """Return the value that the function returned; ValueError if it did not return."""
        if self.result is None:
            raise ValueError(f"{self.function} {self.status}: it returned nothing")
        return decoded(Encoded(parsed(self.result, self.function, StoreError), self.arrays, self.timings))


def add_job(connection: sqlite3.Connection, record: JobRecord, retried: bool) -> None:
    """Insert a record within a transaction; one that timed out or crashed is replaced if ``retried``."""
    for statement in filter(str.strip, CREATE.split(";")):
        connection.execute(statement)
    row = (record.key, record.function, record.arguments, record.seed, record.code, record.status, record.result)
    before = connection.total_changes
    connection.execute(INSERT, (*row, record.arrays, record.error, retried))
    if connection.total_changes > before:
        connection.execute("DELETE FROM job_timings WHERE key = ?", (record.key,))
        timings = [(record.key, figure, value) for figure, value in record.timings.items()]
        connection.executemany("INSERT INTO job_timings VALUES (?, ?, ?)", timings)


def job_statuses(connection: sqlite3.Connection) -> dict[str, str]:
    """Return the status of every job, by its key."""
    known = connection.execute("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'jobs'").fetchone()
    return dict(connection.execute("SELECT key, status FROM jobs").fetchall()) if known else {}


def job_records(connection: sqlite3.Connection, keys: Iterable[str]) -> list[JobRecord]:
    """Return the jobs with these keys, in their order; KeyError for a missing one."""
    return [_record(connection, key) for key in keys]


def _record(connection: sqlite3.Connection, key: str) -> JobRecord:
    columns = ("key", "function", "arguments", "seed", "code", "status", "result", "arrays", "error")
    row = connection.execute(f"SELECT {', '.join(columns)} FROM jobs WHERE key = ?", (key,)).fetchone()
    if row is None:
        raise KeyError(key)
    timings = connection.execute("SELECT figure, value FROM job_timings WHERE key = ? ORDER BY figure", (key,))
    values = {**dict(zip(columns, row, strict=True)), "timings": dict(timings.fetchall())}
    record: JobRecord = checked(JobRecord, values, f"job {key}", StoreError)
    return record
