"""Mutations of stores."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from numpy.random import Generator

from tests.hostile.files import json_text
from tests.hostile.values import one_of

CELLS: dict[str, tuple[Any, ...]] = {
    "seed": ("many", -7, 2**63 - 1, 1.5, b"\0", ""),
    "code": ("", "\x1b[31m", b"\xff\xfe", "x" * 9999),
    "status": ("well", "", b"ok", 3),
    "success": (2, "yes", None, -1, b""),
    "scenario": ("", "nothing", "evil_module:Evil", "\x1b[31m", b"\xff", "a\nb", "[/x]"),
    "key": ("", "\0", b"\xff", "k" * 9999),
    "error": (b"\xff", "\x1b[31m", 7, "a\nb"),
}
TIMINGS = ("fast", b"\0", -1.0, 1e308, None, "", 2**62)
FIGURES = ("", "x\ny", "seed", "\x1b[1m")
SCHEMAS = """
DROP TABLE trials
DROP TABLE timings
DELETE FROM trials
ALTER TABLE trials ADD COLUMN more
ALTER TABLE trials RENAME COLUMN seed TO sead
ALTER TABLE trials RENAME TO old
CREATE VIEW v AS SELECT * FROM v
CREATE TABLE jobs (a)
CREATE TABLE results (key)
CREATE TRIGGER t AFTER INSERT ON trials BEGIN DELETE FROM trials; END
PRAGMA application_id = 7
PRAGMA application_id = 0
PRAGMA user_version = 99
PRAGMA user_version = -1
PRAGMA user_version = 0
PRAGMA journal_mode = WAL
"""
CHANGES = ("parameters", "parameters", "summary", "summary", "summary", "cell", "cell", "timing", "schema", "schema")


def store_file(rng: Generator, path: Path) -> str:
    """Change a cell, a table or the schema of a store; returns what was done."""
    with closing(sqlite3.connect(path, isolation_level=None)) as store:
        store.execute("PRAGMA ignore_check_constraints = ON")
        change = one_of(rng, CHANGES)
        everywhere = rng.random() < 0.3
        where = "" if everywhere else "WHERE key = (SELECT min(key) FROM trials)"
        if change in ("parameters", "summary"):
            (document,) = store.execute(f"SELECT {change} FROM trials ORDER BY key LIMIT 1").fetchone()
            made, done = json_text(rng, document)
            content = made.encode("utf-8", "surrogatepass")
            value = content if rng.random() < 0.1 else content.decode("utf-8", "replace")
            store.execute(f"UPDATE trials SET {change} = ? {where}", (value,))
            done = f"{change} {done}"
        elif change == "cell":
            column = one_of(rng, list(CELLS))
            value = one_of(rng, CELLS[column])
            store.execute(f"UPDATE OR IGNORE trials SET {column} = ? {where}", (value,))
            done = f"{column} = {value!r:.40}"
        elif change == "timing":
            value, figure = one_of(rng, TIMINGS), one_of(rng, FIGURES)
            store.execute("UPDATE timings SET value = ?", (value,))
            store.execute("INSERT OR IGNORE INTO timings SELECT key, ?, ? FROM trials", (figure, value))
            done = f"timing {figure!r} = {value!r}"
        else:
            done = one_of(rng, SCHEMAS.strip().splitlines())
            store.execute(done)
    return f"{path.name}: {done}{' everywhere' * everywhere}"
