"""Plug-ins: entry points, or "package.module:Class" for a class that declares a frozen configuration.

A plug-in is a class with a frozen dataclass ``Config`` and a static ``build``. The built-in ones enter by the same
door as a stranger's package.
"""

from __future__ import annotations

import dataclasses
import importlib
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any

GROUPS = {
    kind: f"mathnavi.{kind}" for kind in ("controllers", "estimators", "consensus", "scenarios", "studies", "terrains")
}


@dataclass(frozen=True)
class Part:
    """A plug-in and its configuration."""

    plugin: Any
    config: Any

    @staticmethod
    def of(plugin: Any, **fields: Any) -> Part:
        """A plug-in class with some fields of its configuration set."""
        return Part(plugin, plugin.Config(**fields))

    @property
    def name(self) -> str:
        return f"{self.plugin.__module__}:{self.plugin.__qualname__}"


def names(kind: str) -> tuple[str, ...]:
    """Names of the installed plug-ins of a kind, in order."""
    return tuple(sorted(point.name for point in entry_points(group=GROUPS[kind])))


def load(kind: str, name: str) -> Any:
    """The plug-in called ``name``, or the class at "package.module:Class".

    Raises ValueError if there is none, naming those that exist, or if it declares no frozen configuration.
    """
    points = {point.name: point for point in entry_points(group=GROUPS[kind])}
    if name in points:
        try:
            plugin = points[name].load()
        except (ImportError, AttributeError) as error:
            raise ValueError(f"{kind}: {name!r} cannot be imported: {error}") from None
    elif ":" in name:
        plugin = _imported(kind, name)
    else:
        known = ", ".join(sorted(points)) or "none"
        raise ValueError(f"{kind}: {name!r} is not known; allowed: {known}, or package.module:Class")
    config = getattr(plugin, "Config", None)
    if not (isinstance(config, type) and dataclasses.is_dataclass(config) and _frozen(config)):
        raise ValueError(f"{kind}: {name!r} declares no frozen dataclass named Config, so it is not a plug-in")
    if not callable(getattr(plugin, "build", None)):
        raise ValueError(f"{kind}: {name!r} has no build(), so it is not a plug-in")
    return plugin


def _frozen(config: type) -> bool:
    parameters: Any = vars(config)["__dataclass_params__"]
    return bool(parameters.frozen)


def _imported(kind: str, name: str) -> Any:
    module, _, attribute = name.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:  # ValueError: no module before the colon
        raise ValueError(f"{kind}: {name!r} cannot be imported: {error}") from None
