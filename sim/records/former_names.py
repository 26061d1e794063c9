"""Present names of modules and fields that an earlier version recorded.

Until version 0.1 the packages were called ``models``, ``sim``, ``controllers``, ``estimators`` and ``renders``. A run's
config.json that was written then names its plug-ins and its drawing so: "controllers.flight.plugin:SafeFlight",
"renders.flight.drawing".
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

PACKAGE = "mathnavi"
FOLDERS = ("controllers", "estimators", "models", "renders", "sim")  # packages of their own, formerly
MOVED = {
    "controllers.exciting.plugin:Exciting": "mathnavi.controllers.active_sensing.plugin:ActiveSensing",
    "controllers.flight.literal:LiteralFlight": "mathnavi.controllers.flight.as_printed:AsPrintedFlight",
    "controllers.flight.plugin:SafeFlight": "mathnavi.controllers.flight.plugin:FlightController",
    "mathnavi.controllers.flight.plugin:SafeFlight": "mathnavi.controllers.flight.plugin:FlightController",
    "controllers.missile.plugin:MissileGuidance": "mathnavi.controllers.missile.plugin:MissileController",
    "mathnavi.controllers.missile.plugin:MissileGuidance": "mathnavi.controllers.missile.plugin:MissileController",
}
"""Plug-ins that have another module or class name now, by their former places"""
FIELDS = {"missile-guidance": {"target_told": "target_announcement_delay"}}
"""Fields of scenarios that have another name now, by their former names"""


def present_name(place: str) -> str:
    """The present place of a module, or of a class at "package.module:Class"; itself where nothing has changed.

    A user's own package may be called ``controllers`` too: a module that mathnavi has not is left as it is.
    """
    if place in MOVED:
        return MOVED[place]
    module = place.partition(":")[0]
    if module.partition(".")[0] not in FOLDERS:
        return place
    try:
        return f"{PACKAGE}.{place}" if find_spec(f"{PACKAGE}.{module}") is not None else place
    except ModuleNotFoundError:  # not even its package
        return place


def present_fields(scenario: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """The recorded fields of a scenario under their present names."""
    renamed = FIELDS.get(scenario, {})
    return {renamed.get(name, name): value for name, value in fields.items()}


def with_present_names(config: Mapping[str, Any]) -> dict[str, Any]:
    """A run's configuration with its fields and the places of its drawing and plug-ins under their present names."""
    present = dict(config)
    if isinstance(fields := config.get("fields"), Mapping):
        present["fields"] = present_fields(str(config.get("scenario")), fields)
    if isinstance(drawing := config.get("drawing"), str):
        present["drawing"] = present_name(drawing)
    for kind in ("controller", "estimator"):
        plugin = config.get(kind)
        if isinstance(plugin, Mapping) and isinstance(plugin.get("name"), str):
            present[kind] = {**plugin, "name": present_name(plugin["name"])}
    return present
