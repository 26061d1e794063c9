"""The entry points of mathnavi's groups. Nothing heavy is imported here."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from functools import cache
from importlib.metadata import Distribution, EntryPoint, distributions
from pathlib import Path

from mathnavi.sim.interfaces.errors import PluginError

PREFIX = "mathnavi."  # of every group


def entry_points_of(group: str) -> list[EntryPoint]:
    """The entry points of a group, in the order of their names.

    The current folder installs nothing, though a user's own modules are imported from it: what lies there may be
    somebody else's.
    """
    try:
        here = os.getcwd()
    except FileNotFoundError:  # it is gone
        here = ""
    return sorted(point for point in _found(_installed_path(tuple(sys.path), here)) if point.group == group)


@cache
def _installed_path(path: tuple[str, ...], here: str) -> tuple[str, ...]:
    """A ``sys.path`` without the current folder, unless Python itself is installed there."""
    folder = Path(here)
    if folder.is_relative_to(sys.prefix) or folder.is_relative_to(sys.base_prefix):
        return path
    return tuple(entry for entry in path if entry and os.path.realpath(entry) != here)


@cache
def _found(path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """The entry points of all groups, of each distribution the first on the path; to find them takes some 20 ms."""
    found: dict[str, list[EntryPoint]] = {}
    for distribution in distributions(path=list(path)):
        own = [point for point in distribution.entry_points if point.group.startswith(PREFIX)]
        if own:
            found.setdefault(distribution.name, own)
    return tuple(point for own in found.values() for point in own)


def named(points: Iterable[EntryPoint], kind: str, name: str, besides: str = "") -> EntryPoint | None:
    """The entry point with a name, or None.

    Raises PluginError for a name that several distributions have given, with all of these and ``besides``, what may be
    said in place of the name: which of them would be taken is the order of installation, and nobody's intention.
    """
    found = [point for point in points if point.name == name]
    if len(found) > 1:
        homes = " and ".join(f"{home(point)} ({point.value})" for point in sorted(found, key=home))
        raise PluginError(
            f"{kind}: {name!r} is the name of {len(found)} plug-ins, of {homes}; allowed: a name that one distribution "
            f"has, so uninstall the other{f', or give {besides}' if besides else ''}"
        )
    return found[0] if found else None


def home(point: EntryPoint) -> str:
    """Name and version of the distribution that an entry point is installed with, "" for none."""
    return _titled(point.dist) if point.dist else ""


@cache
def _titled(distribution: Distribution) -> str:
    """Name and version of a distribution, which to read takes a millisecond."""
    return f"{distribution.name} {distribution.version}"
