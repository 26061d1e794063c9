"""Files that are written whole or not at all: a reader never meets half of one."""

from __future__ import annotations

import errno
import json
import math
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    descriptor, scratch = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        os.chmod(scratch, 0o644)
        os.replace(scratch, path)
    except BaseException:
        Path(scratch).unlink(missing_ok=True)
        raise


@contextmanager
def partial_file(path: Path) -> Iterator[Path]:
    """A file beside ``path``, to be written in the block, that takes its place at the end, or goes if the block fails.

    A link of its name is replaced and not followed: nothing is written to where it leads.
    """
    partial = path.with_name(f".{path.name}.partial")
    partial.unlink(missing_ok=True)
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def inside(folder: Path, path: Path) -> Path:
    """``path``, which lies in ``folder``; PermissionError if a link there leads out of the folder."""
    if not path.resolve().is_relative_to(folder.resolve()):
        reason = f"a link that leads out of {folder}, to {path.resolve()}; allowed: what lies within"
        raise PermissionError(errno.EPERM, reason, str(path))
    return path


def jsonable(value: Any) -> Any:
    """``value`` in the types of JSON, with null for what it lacks: NaN and infinity."""
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if isinstance(value, np.ndarray):
        return jsonable(value.tolist())
    if isinstance(value, np.generic):
        return jsonable(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as JSON, whole or not at all."""
    write_text(path, json.dumps(jsonable(value), indent=2) + "\n")
