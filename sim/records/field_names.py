"""Names of the fields of a run, as on the command line with underscores.

"terrain" and "faults.gust_rms" are fields of the scenario, "planner.nodes" of the controller, "estimator.rate" of the
estimator.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mathnavi.interfaces.fields import flattened

PARTS = {"": "config", "planner": "controller", "estimator": "estimator"}
"""part of a run whose fields have a prefix, by the prefix"""


def split(name: str) -> tuple[str, str]:
    """Return the prefix of a field's name, and its name in the configuration of that part."""
    prefix, _, rest = name.partition(".")
    return (prefix, rest) if rest and prefix in PARTS else ("", name)


def joined(prefix: str, name: str) -> str:
    """Return the name of a field from its prefix and its name in the configuration of that part."""
    return f"{prefix}.{name}" if prefix else name


def recorded_fields(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields in a config.json, or in the parameters of a stored trial, by their names, and the plug-ins."""
    named = flattened(document.get("config", document.get("fields", {})))
    for prefix, part in PARTS.items():
        if prefix:
            entry = document.get(part, {})
            named |= {part: entry.get("name"), **flattened(entry.get("fields", {}), f"{prefix}.")}
    return named
