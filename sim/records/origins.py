"""Origins of the records of a store: the hash of the computation, and the computing environment of its execution.

    environments(digest, description)           description is JSON: versions, processor, BLAS kernels by name
    origins(key, content, environment)          of each trial and job; content: hash of all but the environment

The key of a record is the hash of both. Records of the same content from two environments differ by rounding, and by
what a solver makes of it, so both are kept, and are mixed only on request. A record that an earlier version wrote has
no origin.
"""

from __future__ import annotations

import json
import sqlite3
from collections import Counter
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field

from mathnavi.interfaces.errors import StoreError
from mathnavi.interfaces.reading.files import decoded
from mathnavi.sim.records.computing_environment import UNKNOWN, difference, environment_digest

CREATE = """
CREATE TABLE IF NOT EXISTS environments (
    digest TEXT PRIMARY KEY,
    description TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS origins (
    key TEXT PRIMARY KEY,
    content TEXT NOT NULL,
    environment TEXT NOT NULL REFERENCES environments (digest)
) WITHOUT ROWID;
"""


@dataclass(frozen=True)
class Origin:
    """Content hash of a record, and its environment; both empty for a record of an earlier version."""

    content: str = ""
    environment: Mapping[str, str] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Digest of the environment, UNKNOWN if none exists."""
        return environment_digest(self.environment) if self.environment else UNKNOWN


def add_origin(connection: sqlite3.Connection, key: str, origin: Origin) -> None:
    """Insert the origin of a record within a transaction."""
    if not origin.content:
        return
    for statement in filter(str.strip, CREATE.split(";")):
        connection.execute(statement)
    description = json.dumps(dict(origin.environment), separators=(",", ":"))
    connection.execute("INSERT OR IGNORE INTO environments VALUES (?, ?)", (origin.digest, description))
    connection.execute("INSERT OR IGNORE INTO origins VALUES (?, ?, ?)", (key, origin.content, origin.digest))


def environments(connection: sqlite3.Connection) -> dict[str, dict[str, str]]:
    """Return the description of every environment by its digest."""
    if not _are_there(connection):
        return {}
    described = connection.execute("SELECT * FROM environments")
    return {digest: decoded(text, dict[str, str], f"environment {digest}", StoreError) for digest, text in described}


def keys_by_content(connection: sqlite3.Connection, keys: Container[str]) -> dict[str, dict[str, str]]:
    """Return, for each content, those of ``keys`` (existing records) that have it, by the environment's digest."""
    found: dict[str, dict[str, str]] = {}
    if _are_there(connection):
        for key, content, digest in connection.execute("SELECT key, content, environment FROM origins ORDER BY key"):
            if key in keys:
                found.setdefault(content, {})[digest] = key
    return found


def origins(connection: sqlite3.Connection) -> dict[str, Origin]:
    """Return the origin of every record that has one, by its key."""
    if not _are_there(connection):
        return {}
    described = environments(connection)
    rows = connection.execute("SELECT key, content, environment FROM origins")
    return {key: Origin(content, described[digest]) for key, content, digest in rows}


def _are_there(connection: sqlite3.Connection) -> bool:
    named = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'origins'"
    return connection.execute(named).fetchone() is not None


@dataclass
class Elsewhere:
    """Counts of tasks whose records in a store come from other environments, by the digest of the environment."""

    taken: Counter[str] = field(default_factory=Counter)
    """number of those taken in place of a record of this environment, as requested"""
    left: Counter[str] = field(default_factory=Counter)
    """number of those computed here all the same"""

    def chosen(
        self, contents: Iterable[str], stored: Mapping[str, Mapping[str, str]], here: str, mix: bool
    ) -> dict[str, str]:
        """Return the key of the record of each stored content: that of the environment ``here``, given by its digest.

        With ``mix`` one from another environment is accepted if none exists; it is counted in either case.
        """
        chosen: dict[str, str] = {}
        for content in contents:
            keys = stored.get(content, {})
            if here in keys:
                chosen[content] = keys[here]
            elif keys:
                digest = min(keys)
                (self.taken if mix else self.left)[digest] += 1
                if mix:
                    chosen[content] = keys[digest]
        return chosen

    def words(self, described: Mapping[str, Mapping[str, str]]) -> list[str]:
        """Return sentences on the records from other environments; none if there are no such records."""
        said = [
            f"from another environment, {difference(described.get(digest, {}))}: {count}; they may differ from "
            "results of this one, by rounding or by the minimum that a solver ends in"
            for digest, count in sorted(self.taken.items())
        ]
        return said + [
            f"stored from another environment, {difference(described.get(digest, {}))}: {count}; they are computed "
            "here again, and --mix-environments accepts them unchanged"
            for digest, count in sorted(self.left.items())
        ]
