"""Mutations of files: bytes, JSON, archives of arrays, stores, and what may stand in the place of a file."""

from __future__ import annotations

import io
import json
import os
import shutil
import sqlite3
import struct
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from tests.hostile.values import JSON, one_of, text

MARK = "@hostile@"
HEADER = b"\x93NUMPY\x01\x00"


def bytes_of(rng: Generator, path: Path) -> str:
    """Flip bits, cut off, lengthen or overwrite a file; returns what was done."""
    content = bytearray(path.read_bytes())
    kind = one_of(rng, ("flips", "truncated", "truncated", "empty", "zeros", "noise", "doubled", "head", "nul", "marked", "utf-16"))
    if kind == "flips":
        for k in rng.integers(0, max(1, len(content)), int(rng.integers(1, 9))):
            content[k : k + 1] = bytes([int(rng.integers(256))])
    elif kind == "truncated":
        del content[int(rng.integers(max(1, len(content)))) :]
    elif kind in ("empty", "zeros", "noise"):
        size = 0 if kind == "empty" else max(1, len(content) % 20_000)
        content = bytearray(size) if kind != "noise" else bytearray(rng.integers(0, 256, size, np.uint8).tobytes())
    elif kind == "doubled":
        content *= 2
    elif kind == "head":
        del content[: int(rng.integers(1, 64))]
    elif kind == "nul":
        k = int(rng.integers(len(content) + 1))
        content[k:k] = b"\0\0\0"
    elif kind == "marked":
        content[:0] = b"\xef\xbb\xbf"
    else:
        content = bytearray(content.decode("latin-1").encode("utf-16"))
    path.write_bytes(content)
    return f"{path.name}: {kind}"


def place_of_file(rng: Generator, path: Path) -> str:
    """Put something else where a file was, or nothing; returns what was done."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    kind = one_of(rng, ("missing", "folder", "pipe", "loop", "dangling", "device", "outside"))
    if kind == "folder":
        path.mkdir()
        (path / "inside.txt").write_text("kept")
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "loop":
        path.symlink_to(path.name)
    elif kind == "dangling":
        path.symlink_to("nowhere-at-all")
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "outside":
        path.symlink_to("../outside/precious.txt")
    return f"{path.name}: {kind}"


# ---- JSON


def _paths(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value[:3]) if isinstance(value, list) else ()
    for name, item in items:
        yield from _paths(item, (*path, name))


def json_text(rng: Generator, document: str) -> tuple[str, str]:
    """A document with a hostile value at any of its places, or without it, and what was done."""
    value = json.loads(document)
    places = list(_paths(value))
    path = one_of(rng, places)
    where = "/".join(map(str, path)) or "(all)"
    how = one_of(rng, ("value", "value", "value", "value", "gone", "renamed", "twice", "again"))
    raw = one_of(rng, JSON)
    if not path:
        return raw, f"{where} = {raw[:40]}"
    holder = value
    for name in path[:-1]:
        holder = holder[name]
    last = path[-1]
    if how == "gone":
        del holder[last]
    elif how == "renamed" and isinstance(last, str):
        holder[text(rng)] = holder.pop(last)
    elif how == "again" and isinstance(last, str):
        holder[f"{last}{text(rng)}"] = MARK
    elif how == "twice" and isinstance(last, str):
        holder[last] = [holder[last], MARK] if rng.random() < 0.5 else {last: holder[last]}
    else:
        holder[last] = MARK
    made = json.dumps(value)
    if how == "twice":
        key = json.dumps(last)
        made = made.replace(f"{key}:", f"{key}: {raw}, {key}:", 1)
    return made.replace(f'"{MARK}"', raw), f"{where} {how} {raw[:40]}"


def json_file(rng: Generator, path: Path) -> str:
    made, done = json_text(rng, path.read_text(encoding="utf-8"))
    path.write_text(made, encoding="utf-8", errors="surrogatepass")
    return f"{path.name}: {done}"


def json_lines(rng: Generator, path: Path) -> str:
    """Mutate a line of a file of JSON, which has one at least."""
    lines = path.read_text(encoding="utf-8").splitlines() or ['{"t": 0.0, "agent": "vehicle", "kind": "message", "message": "x"}']
    k = int(rng.integers(len(lines)))
    lines[k], done = json_text(rng, lines[k])
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", errors="surrogatepass")
    return f"{path.name} line {k + 1}: {done}"


# ---- archives of arrays


def _npy(array: Any) -> bytes:
    block = io.BytesIO()
    np.lib.format.write_array(block, np.asanyarray(array), allow_pickle=True)
    return block.getvalue()


def header(descr: str, shape: str) -> bytes:
    """An array's header of any type and shape, with little behind it."""
    words = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode("latin-1")
    words += b" " * (63 - (len(HEADER) + 2 + len(words)) % 64) + b"\n"
    return HEADER + struct.pack("<H", len(words)) + words + bytes(64)


HEADERS = (
    ("'<f8'", "(99999999999999,)"), ("'<f8'", "(9223372036854775807, 9223372036854775807)"), ("'<f8'", "(-1, 3)"), ("'<f8'", "(3000000000,)"),
    ("'|O'", "(1,)"), ("'<U99999999'", "(4,)"), ("'<f8'", "'x'"), ("'nonsense'", "(1,)"), ("[('a', '<f8'), ('b', '<i4')]", "(2,)"),
    ("'<f8'", "(" + "1, " * 200 + ")"), ("'<M8[s]'", "(3,)"), ("'|V8'", "(3,)"), ("__import__('os').system('x')", "(1,)"), ("'<f8'", "(2.5,)"),
)  # fmt: skip


def _changed(rng: Generator, array: Any) -> tuple[bytes, str]:
    kind = one_of(
        rng,
        ("nan", "inf", "huge", "negative", "scalar", "empty", "rows", "columns", "axis", "flat", "object", "text", "bytes", "complex", "bool", "int",
         "zeros", "reversed", "one", "half", "header", "header", "dates"),
    )  # fmt: skip
    rows = array.reshape(1) if array.ndim == 0 else array
    numeric = array.dtype.kind in "fiub"
    if kind in ("nan", "inf", "huge", "negative") and numeric and array.size:
        made = np.array(array, dtype=float)
        flat = made.reshape(-1)
        chosen = rng.integers(0, flat.size, int(rng.integers(1, 4))) if rng.random() < 0.6 else slice(None)
        flat[chosen] = {"nan": np.nan, "inf": np.inf, "huge": 1e308, "negative": -1e6}[kind]
    elif kind == "header":
        descr, shape = one_of(rng, HEADERS)
        return header(descr, shape), f"{descr} {shape}"[:60]
    else:
        simple: dict[str, Any] = {
            "scalar": lambda: np.array(5.0), "empty": lambda: rows[:0], "rows": lambda: rows[: len(rows) // 2], "one": lambda: rows[:1],
            "columns": lambda: rows[:, :1] if rows.ndim > 1 else np.stack([rows, rows], 1), "axis": lambda: array[None],
            "flat": lambda: array.reshape(-1), "object": lambda: np.array([{"a": 1}, None], dtype=object), "text": lambda: array.astype(str),
            "bytes": lambda: np.array([b"abc"]), "complex": lambda: array.astype(complex) if numeric else array, "half": lambda: rows.astype("f2") if numeric else rows,
            "bool": lambda: array.astype(bool) if numeric else array, "int": lambda: np.full(array.shape, -(2**63), np.int64), "zeros": lambda: np.zeros(array.shape),
            "reversed": lambda: rows[::-1], "dates": lambda: np.zeros(array.shape, "M8[s]"),
        }  # fmt: skip
        made = simple.get(kind, lambda: np.zeros((0, 0, 0)))()
    return _npy(made), kind


def npz_file(rng: Generator, path: Path) -> str:
    """Change, drop, double or add an array of an archive; returns what was done."""
    with np.load(path, allow_pickle=False) as archive:
        members = {f"{name}.npy": _npy(archive[name]) for name in archive.files}
        name = one_of(rng, archive.files)
        array = archive[name]
    extra: list[tuple[str, bytes]] = []
    kind = one_of(rng, ("array", "array", "array", "array", "gone", "renamed", "twice", "more", "text", "none"))
    if kind == "array":
        members[f"{name}.npy"], kind = _changed(rng, array)
    elif kind == "gone":
        del members[f"{name}.npy"]
    elif kind == "renamed":
        members[f"{text(rng)[:500]}.npy"] = members.pop(f"{name}.npy")
    elif kind == "twice":
        extra.append((f"{name}.npy", _changed(rng, array)[0]))
    elif kind == "more":
        extra.append((one_of(rng, ("../../outside/new.npy", "/etc/x.npy", "plan.offsets.npy", "estimate.x.npy", "\x1b[31m.npy")), _changed(rng, array)[0]))
    elif kind == "text":
        members[f"{name}.npy"] = b"not an array"
    else:
        members = {}
    way = one_of(rng, (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(path, "w", way) as archive_out:
        for member, content in [*members.items(), *extra]:
            try:
                archive_out.writestr(zipfile.ZipInfo(member), content)
            except (ValueError, UnicodeError, struct.error):  # a name that no archive can hold
                archive_out.writestr(zipfile.ZipInfo("unnamed.npy"), content)
    return f"{path.name}: {name} {kind}"


# ---- stores

CELLS: dict[str, tuple[Any, ...]] = {
    "seed": ("many", -7, 2**63 - 1, 1.5, b"\0", ""),
    "code": ("", "\x1b[31m", b"\xff\xfe", "x" * 9999),
    "status": ("well", "", b"ok", 3),
    "success": (2, "yes", None, -1, b""),
    "scenario": ("", "nothing", "evil_module:Evil", "\x1b[31m", b"\xff", "a\nb", "[/x]"),
    "key": ("", "\0", b"\xff", "k" * 9999),
    "error": (b"\xff", "\x1b[31m", 7, "a\nb"),
}


def store_file(rng: Generator, path: Path) -> str:
    """Change a cell, a table or the schema of a store; returns what was done."""
    connection = sqlite3.connect(path)
    try:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        kind = one_of(rng, ("parameters", "parameters", "summary", "summary", "summary", "cell", "cell", "timing", "table", "pragma"))
        if kind in ("parameters", "summary"):
            rows = connection.execute(f"SELECT key, {kind} FROM trials ORDER BY key").fetchall()
            key, document = one_of(rng, rows)
            made, done = json_text(rng, document)
            value: Any = made.encode("utf-8", "surrogatepass") if rng.random() < 0.1 else made.encode("utf-8", "replace").decode()
            everywhere = rng.random() < 0.3
            connection.execute(f"UPDATE trials SET {kind} = ?{'' if everywhere else ' WHERE key = ?'}", (value,) if everywhere else (value, key))
            done = f"{kind} {done}{' of all' if everywhere else ''}"
        elif kind == "cell":
            column = one_of(rng, list(CELLS))
            value = one_of(rng, CELLS[column])
            where = "WHERE key = (SELECT min(key) FROM trials)" if column == "key" or rng.random() < 0.5 else ""
            connection.execute(f"UPDATE trials SET {column} = ? {where}", (value,))
            done = f"{column} = {value!r:.40}"
        elif kind == "timing":
            value = one_of(rng, ("fast", b"\0", -1.0, 1e308, None, "", 2**62))
            connection.execute("UPDATE timings SET value = ?", (value,))
            connection.execute("INSERT OR IGNORE INTO timings SELECT key, ?, ? FROM trials", (one_of(rng, ("", "x\ny", "seed", "\x1b[1m")), value))
            done = f"timing = {value!r}"
        else:
            statements = {
                "table": ("DROP TABLE trials", "DROP TABLE timings", "ALTER TABLE trials ADD COLUMN more", "ALTER TABLE trials RENAME COLUMN seed TO sead",
                          "ALTER TABLE trials RENAME TO old", "DELETE FROM trials", "CREATE VIEW v AS SELECT * FROM v", "CREATE TABLE jobs (a)",
                          "CREATE TRIGGER t AFTER INSERT ON trials BEGIN DELETE FROM trials; END", "CREATE TABLE results (key)"),
                "pragma": ("PRAGMA application_id = 7", "PRAGMA user_version = 99", "PRAGMA user_version = -1", "PRAGMA encoding = 'UTF-16'",
                           "PRAGMA journal_mode = WAL", "PRAGMA user_version = 0", "PRAGMA application_id = 0"),
            }  # fmt: skip
            done = one_of(rng, statements[kind])
            connection.execute(done)
        connection.commit()
    finally:
        connection.close()
    return f"{path.name}: {done}"
