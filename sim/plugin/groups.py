"""The groups of entry points that plug-ins are installed in. Nothing heavy is imported here."""

from __future__ import annotations

import sys
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from typing import Any

GROUPS = {  # by kind of plug-in
    kind: f"mathnavi.{kind}" for kind in ("controllers", "estimators", "consensus", "scenarios", "studies", "terrains")
}


def installed(kind: str) -> list[EntryPoint]:
    """The entry points of a kind, in the order of their names."""
    return sorted(_found(tuple(sys.path)).select(group=GROUPS[kind]))


@cache
def _found(path: tuple[str, ...]) -> EntryPoints:
    """All entry points of this process; to find them takes some 20 ms."""
    found: Any = entry_points()  # typeshed has what Python 3.9 gave
    points: EntryPoints = found
    return points
