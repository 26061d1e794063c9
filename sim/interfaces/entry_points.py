"""The plug-in that a name stands for among the installed entry points."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import EntryPoint

from mathnavi.sim.interfaces.errors import PluginError


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
    return f"{point.dist.name} {point.dist.version}" if point.dist else ""
