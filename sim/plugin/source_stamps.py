"""Stamps of source files, which reveal changes, and the plain data of the index of plug-ins."""

from __future__ import annotations

import os
from typing import Any

Plain = dict[str, Any]
"""JSON data by name"""


def stamp(file: str) -> list[int]:
    """Return size [bytes] and time of the last change [ns] of a file; empty if it does not exist."""
    try:
        status = os.stat(file)
    except OSError:
        return []
    return [status.st_size, status.st_mtime_ns]
