"""Stamps of source files, by which a change is seen, and the plain data of the index of plug-ins."""

from __future__ import annotations

import os
from typing import Any

Plain = dict[str, Any]
"""Data as JSON has them, by name."""


def stamp(file: str) -> list[int]:
    """Size [bytes] and time of the last change [ns] of a file; empty if it is gone."""
    try:
        status = os.stat(file)
    except OSError:
        return []
    return [status.st_size, status.st_mtime_ns]
