"""Groups of entry points in which plug-ins are installed. Nothing heavy is imported here."""

from __future__ import annotations

from importlib.metadata import EntryPoint

from mathnavi.interfaces.entry_points import PREFIX, entry_points_of

GROUPS = {  # by kind of plug-in
    kind: f"{PREFIX}{kind}"
    for kind in ("controllers", "estimators", "consensus", "scenarios", "studies", "terrains", "drawings", "logs")
}
KINDS = {"controller": "controllers", "estimator": "estimators"}
"""kind of the plug-in of each part of a run"""
PREFIXES = {"controllers": "planner", "estimators": "estimator"}
"""prefix of the fields on the command line, by kind; those of another kind have none"""
PICTURES = f"{PREFIX}pictures"  # what draws the episodes of an environment; there is one, and nobody names it


def installed(kind: str) -> list[EntryPoint]:
    """Return the entry points of a kind, in the order of their names."""
    return entry_points_of(GROUPS[kind])
