"""Conversion of values to JSON and of arrays to .npz, and JSON files."""

from __future__ import annotations

import errno
import io
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.writing import write_text


def inside(folder: Path, path: Path) -> Path:
    """Return ``path``, which is in ``folder``; PermissionError if a link leads out, OSError for circular links."""
    try:
        there, within = path.resolve(), folder.resolve()
    except RuntimeError:  # links that lead to each other
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path)) from None
    if not there.is_relative_to(within):
        reason = f"a link that leads out of {folder}, to {there}; allowed: what lies within"
        raise PermissionError(errno.EPERM, reason, str(path))
    return path


def jsonable(value: Any) -> Any:
    """Return ``value`` in the types of JSON, with null for NaN and infinity, which it lacks."""
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


def as_json(value: Any) -> str:
    """Return ``value`` as JSON on indented lines."""
    return json.dumps(jsonable(value), indent=2) + "\n"


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as JSON, whole or not at all."""
    write_text(path, as_json(value))


def npz_bytes(arrays: Mapping[str, Array]) -> bytes:
    """Return the content of a compressed .npz file with these arrays, none of objects."""
    archive = io.BytesIO()
    np.savez_compressed(archive, allow_pickle=False, **arrays)
    return archive.getvalue()
