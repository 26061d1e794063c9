"""Mutations of files: bytes, JSON, and what may stand in the place of a file. Each returns what was done, in words."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from tests.hostile.values import JSON, one_of, text

MARK = "@hostile@"


def bytes_of(rng: Generator, path: Path) -> str:
    """Flip bits, cut off, lengthen or overwrite a file; returns what was done."""
    content = bytearray(path.read_bytes())
    kind = one_of(
        rng,
        ("flips", "truncated", "truncated", "empty", "zeros", "noise", "doubled", "head", "nul", "marked", "utf-16"),
    )
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
    lines = path.read_text(encoding="utf-8").splitlines() or [
        '{"t": 0.0, "agent": "vehicle", "kind": "message", "message": "x"}'
    ]
    k = int(rng.integers(len(lines)))
    lines[k], done = json_text(rng, lines[k])
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", errors="surrogatepass")
    return f"{path.name} line {k + 1}: {done}"
