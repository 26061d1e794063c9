"""Mutations of archives of arrays (.npz)."""

from __future__ import annotations

import io
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from tests.hostile.values import one_of, text

MAGIC = b"\x93NUMPY\x01\x00"
HEADERS = (  # types and shapes that an array's header may declare
    ("'<f8'", "(99999999999999,)"),
    ("'<f8'", "(9223372036854775807, 9223372036854775807)"),
    ("'<f8'", "(3000000000,)"),
    ("'<f8'", "(-1, 3)"),
    ("'<f8'", "(2.5,)"),
    ("'<f8'", "'x'"),
    ("'<f8'", f"({'1, ' * 200})"),
    ("'|O'", "(1,)"),
    ("'|V8'", "(3,)"),
    ("'<U99999999'", "(4,)"),
    ("'<M8[s]'", "(3,)"),
    ("'nonsense'", "(1,)"),
    ("[('a', '<f8'), ('b', '<i4')]", "(2,)"),
    ("__import__('os').system('x')", "(1,)"),
)
VALUES = {"nan": np.nan, "infinite": np.inf, "huge": 1e308, "negative": -1e6}
OTHERS: dict[str, Callable[[Any], Any]] = {  # of an array that has rows
    "scalar": lambda rows: np.array(5.0),
    "empty": lambda rows: rows[:0],
    "nothing": lambda rows: np.zeros((0, 0, 0)),
    "half of the rows": lambda rows: rows[: len(rows) // 2],
    "one row": lambda rows: rows[:1],
    "another axis": lambda rows: rows[None],
    "one axis": lambda rows: rows.reshape(-1),
    "columns": lambda rows: rows[:, :1] if rows.ndim > 1 else np.stack([rows, rows], 1),
    "reversed": lambda rows: rows[::-1],
    "objects": lambda rows: np.array([{"a": 1}, None], dtype=object),
    "text": lambda rows: rows.astype(str),
    "bytes": lambda rows: np.array([b"abc"]),
    "dates": lambda rows: np.zeros(rows.shape, "M8[s]"),
    "truth values": lambda rows: np.ones(rows.shape, bool),
    "complex": lambda rows: np.zeros(rows.shape, complex),
    "half precision": lambda rows: np.ones(rows.shape, "f2"),
    "whole numbers": lambda rows: np.full(rows.shape, -(2**63), np.int64),
    "zeros": lambda rows: np.zeros(rows.shape),
}
MEMBERS = "../../outside/new /etc/x plan.offsets estimate.x \x1b[31m"
CHANGES = ("array", "array", "array", "array", "gone", "renamed", "twice", "more", "no array", "none")


def npz_file(rng: Generator, path: Path) -> str:
    """Change, drop, double or add an array of an archive; returns what was done."""
    with np.load(path, allow_pickle=False) as archive:
        members = {f"{name}.npy": _npy(archive[name]) for name in archive.files}
        name = one_of(rng, archive.files)
        array = archive[name]
    done, added = one_of(rng, CHANGES), []
    if done == "array":
        members[f"{name}.npy"], done = _changed(rng, array)
    elif done == "gone":
        del members[f"{name}.npy"]
    elif done == "renamed":
        members[f"{text(rng)[:500]}.npy"] = members.pop(f"{name}.npy")
    elif done in ("twice", "more"):
        other = name if done == "twice" else one_of(rng, MEMBERS.split())
        added.append((f"{other}.npy", _changed(rng, array)[0]))
    elif done == "no array":
        members[f"{name}.npy"] = b"not an array"
    else:
        members = {}
    way = one_of(rng, (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(path, "w", way) as written:
        for member, content in [*members.items(), *added]:
            try:
                written.writestr(zipfile.ZipInfo(member), content)
            except (ValueError, UnicodeError, struct.error):  # a name that no archive can hold
                written.writestr(zipfile.ZipInfo("unnamed.npy"), content)
    return f"{path.name}: {name}: {done}"


def _changed(rng: Generator, array: Any) -> tuple[bytes, str]:
    """The file of a changed array, and what was changed."""
    kind = one_of(rng, (*VALUES, *OTHERS, "header", "header"))
    if kind == "header":
        declared = one_of(rng, HEADERS)
        return _header(*declared), " ".join(declared)[:60]
    if kind in OTHERS:
        return _npy(OTHERS[kind](array.reshape(1) if array.ndim == 0 else array)), kind
    if array.dtype.kind not in "fiub" or not array.size:
        return _npy(array), "as it was"
    made = np.array(array, dtype=float)
    flat = made.reshape(-1)
    chosen = rng.integers(0, flat.size, int(rng.integers(1, 4))) if rng.random() < 0.6 else slice(None)
    flat[chosen] = VALUES[kind]
    return _npy(made), kind


def _npy(array: Any) -> bytes:
    block = io.BytesIO()
    np.lib.format.write_array(block, np.asanyarray(array), allow_pickle=True)
    return block.getvalue()


def _header(kind: str, shape: str) -> bytes:
    """An array's header with little behind it."""
    words = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}".encode("latin-1")
    words += b" " * (63 - (len(MAGIC) + 2 + len(words)) % 64) + b"\n"
    return MAGIC + struct.pack("<H", len(words)) + words + bytes(64)
