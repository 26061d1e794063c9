"""Entry points of mathnavi's groups. Nothing heavy is imported here."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from functools import cache
from importlib.metadata import Distribution, EntryPoint, distributions
from pathlib import Path

from mathnavi.interfaces.errors import PluginError

PREFIX = "mathnavi."  # of every group


def entry_points_of(group: str) -> list[EntryPoint]:
    """Return the entry points of a group, in the order of their names.

    Those of distributions in the current folder are ignored, though a user's modules are imported from it: the folder
    may belong to someone else.
    """
    try:
        here = os.getcwd()
    except FileNotFoundError:  # it is gone
        here = ""
    return sorted(point for point in _found(_installed_path(tuple(sys.path), here)) if point.group == group)


@cache
def _installed_path(path: tuple[str, ...], here: str) -> tuple[str, ...]:
    """Return ``sys.path`` without the current folder, unless Python itself is installed there."""
    folder = Path(here)
    if folder.is_relative_to(sys.prefix) or folder.is_relative_to(sys.base_prefix):
        return path
    return tuple(entry for entry in path if entry and os.path.realpath(entry) != here)


@cache
def _found(path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return the entry points of all groups, from the first of each distribution on the path; this takes some 20 ms."""
    found: dict[str, list[EntryPoint]] = {}
    for distribution in distributions(path=list(path)):
        own = [point for point in distribution.entry_points if point.group.startswith(PREFIX)]
        if own:
            found.setdefault(distribution.name, own)
    return tuple(point for own in found.values() for point in own)


def named(points: Iterable[EntryPoint], kind: str, name: str, besides: str = "") -> EntryPoint | None:
    """Return the entry point with a name, or None.

    Raises PluginError for a name that several distributions have, since the order of installation would decide between
    them. The message lists all of these and ``besides``, which may be given in place of the name.
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
    """Return name and version of the distribution that an entry point is installed with, "" without one."""
    return _titled(point.dist) if point.dist else ""


@cache
def _titled(distribution: Distribution) -> str:
    """Return name and version of a distribution; reading them takes a millisecond."""
    return f"{distribution.name} {distribution.version}"
