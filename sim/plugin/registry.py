"""Plug-ins: entry points, or "package.module:Class" for a class that declares a frozen configuration.

A plug-in is a class with a frozen dataclass ``Config`` and a static ``build``. The built-in ones enter by the same
door as a stranger's package, and what any of them builds is checked before it flies.
"""

from __future__ import annotations

import dataclasses
import importlib
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from numbers import Real
from typing import Any, TypeVar, get_type_hints

from mathnavi.sim.interfaces.checks import allowed_for
from mathnavi.sim.interfaces.errors import PluginError
from mathnavi.sim.interfaces.protocols import Consensus, Estimator, Planner, Sensor
from mathnavi.sim.plugin.groups import installed

Quality = TypeVar("Quality")

_PLACE = "or package.module:Class"

NEEDED = {  # of the class itself, beside Config
    "controllers": ("build",),
    "estimators": ("build", "sensors", "quality"),
    "consensus": ("build", "within_starts"),
    "scenarios": ("build", "controller", "estimator"),
    "studies": ("run", "quick", "title"),
}


@dataclass(frozen=True)
class PluginSpec:
    """A plug-in and its configuration."""

    plugin: Any
    config: Any

    @staticmethod
    def of(plugin: Any, **fields: Any) -> PluginSpec:
        """A plug-in class with some fields of its configuration set."""
        return PluginSpec(plugin, plugin.Config(**fields))

    @property
    def name(self) -> str:
        return f"{self.plugin.__module__}:{self.plugin.__qualname__}"


def names(kind: str) -> tuple[str, ...]:
    """Names of the installed plug-ins of a kind, in order."""
    return tuple(point.name for point in installed(kind))


def called(kind: str, place: str) -> str:
    """What the command line calls the class at "package.module:Class": its entry point, or that place itself."""
    return next((point.name for point in installed(kind) if point.value == place), place)


def load(kind: str, name: str) -> Any:
    """The plug-in called ``name``, or the class at "package.module:Class".

    Raises PluginError if there is none, naming those that exist, or if it declares no frozen configuration.
    """
    points = {point.name: point for point in installed(kind)}
    if name not in points and ":" not in name:
        raise PluginError(f"{kind}: {name!r} is not known; {allowed_for(name, sorted(points), _PLACE)}")
    try:
        plugin = points[name].load() if name in points else _at(name)
    except Exception as error:  # whatever a stranger's module does when it is imported
        raise PluginError(f"{kind}: {name!r} cannot be imported: {_told(error)}") from error
    _check_class(kind, plugin, name)
    return plugin


def checked_controller(part: PluginSpec, mission: Any, bound: type | None = None) -> tuple[Planner, Any]:
    """The planner and the tracker that a controller builds; the tracker's ``bound`` is of the type given, if one is.

    PluginError if the build fails or anything that the loop needs is missing.
    """
    _check_class("controllers", part.plugin, part.name)
    pair = _called("controllers", part, "build", mission)
    said = f"controllers: {part.name!r}: build() returned"
    if not (isinstance(pair, tuple) and len(pair) == 2):
        raise PluginError(f"{said} {_kind(pair)}; allowed: a pair (planner, tracker)")
    planner, tracker = pair
    _check_made(f"{said} the planner", planner, "plan")
    _check_made(f"{said} the tracker", tracker, "command")
    if bound is not None and not isinstance(getattr(tracker, "bound", None), bound):
        given = _kind(tracker.bound) if hasattr(tracker, "bound") else "no bound"
        raise PluginError(f"{said} the tracker {_kind(tracker)} with {given}; allowed: bound is a {bound.__name__}")
    return planner, tracker


def checked_estimator(part: PluginSpec, mission: Any) -> Estimator:
    """The estimator that a plug-in builds; PluginError as for a controller."""
    _check_class("estimators", part.plugin, part.name)
    estimator: Estimator = _called("estimators", part, "build", mission)
    _check_made(f"estimators: {part.name!r}: build() returned the estimator", estimator, "update")
    return estimator


def checked_consensus(part: PluginSpec, mission: Any) -> Consensus:
    """What a vehicle agrees with others by; PluginError as for a controller."""
    _check_class("consensus", part.plugin, part.name)
    consensus: Consensus = _called("consensus", part, "build", mission)
    for method in ("exchange", "start"):
        _check_made(f"consensus: {part.name!r}: build() returned", consensus, method)
    for attribute in ("value", "outlier", "refused"):
        if not hasattr(consensus, attribute):
            raise PluginError(
                f"consensus: {part.name!r}: build() returned {_kind(consensus)} without {attribute}; allowed: one that "
                "has period, value, outlier, refused, start and exchange"
            )
    return consensus


def checked_sensors(part: PluginSpec, mission: Any) -> tuple[Sensor, ...]:
    """What a vehicle carries for an estimator; PluginError as for a controller."""
    _check_class("estimators", part.plugin, part.name)
    sensors = _called("estimators", part, "sensors", mission)
    said = f"estimators: {part.name!r}: sensors() returned"
    if not isinstance(sensors, Sequence):
        raise PluginError(f"{said} {_kind(sensors)}; allowed: a tuple of sensors")
    for sensor in sensors:
        if missing := [name for name in ("name", "size", "rate", "read") if not hasattr(sensor, name)]:
            raise PluginError(
                f"{said} {_kind(sensor)} without {' and '.join(missing)}; allowed: name, size, rate, read()"
            )
    return tuple(sensors)


def checked_quality(part: PluginSpec, mission: Any, quality: type[Quality]) -> Quality:
    """How good a plug-in's estimates are, of the type given; PluginError as for a controller."""
    _check_class("estimators", part.plugin, part.name)
    answer = _called("estimators", part, "quality", mission)
    if not isinstance(answer, quality):
        raise PluginError(f"estimators: {part.name!r}: quality() returned {_kind(answer)}; allowed: {quality.__name__}")
    return answer


def _check_class(kind: str, plugin: Any, name: str) -> None:
    config = getattr(plugin, "Config", None)
    if not (isinstance(config, type) and dataclasses.is_dataclass(config) and _frozen(config)):
        raise PluginError(f"{kind}: {name!r} declares no frozen dataclass named Config, so it is not a plug-in")
    for field in dataclasses.fields(config):
        if field.init and field.default is field.default_factory is dataclasses.MISSING:
            raise PluginError(f"{kind}: {name!r}: Config.{field.name} has no default; allowed: fields with defaults")
    needed = NEEDED.get(kind, ("build",))
    if missing := [attribute for attribute in needed if not hasattr(plugin, attribute)]:
        allowed = f"allowed: {', '.join(needed)} and Config"
        raise PluginError(f"{kind}: {name!r} has no {' and no '.join(missing)}; {allowed}")


def _frozen(config: type) -> bool:
    parameters: Any = vars(config).get("__dataclass_params__")
    return parameters is not None and bool(parameters.frozen)


def _at(name: str) -> Any:
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)


def _called(kind: str, part: PluginSpec, method: str, mission: Any) -> Any:
    """What a plug-in's method makes of its configuration and a mission."""
    if wanted := _unfit(part.plugin, mission):
        raise PluginError(
            f"{kind}: {called(kind, part.name)!r} is for a {wanted} and this scenario has a {type(mission).__name__}; "
            f"allowed: {', '.join(_fitting(kind, mission))}, or package.module:Class"
        )
    try:
        return getattr(part.plugin, method)(part.config, mission)
    except Exception as error:
        if isinstance(error, ValueError) and "allowed" in str(error):
            raise  # it refuses its configuration or the mission, and says why
        raise PluginError(f"{kind}: {called(kind, part.name)!r}: {method}() failed: {_told(error)}") from error


def _unfit(plugin: Any, mission: Any) -> str:
    """The kind of mission that a plug-in says it is built for, where that is another one; else ""."""
    try:
        kind = get_type_hints(plugin.build).get("mission")
        fits = not isinstance(kind, type) or isinstance(mission, kind)
    except (NameError, TypeError):  # hints that mean nothing here, or a protocol that cannot be asked
        return ""
    return "" if fits or kind is None else kind.__name__


def _fitting(kind: str, mission: Any) -> list[str]:
    """Names of the installed plug-ins that a mission fits."""
    return [name for name in names(kind) if not _unfit(load(kind, name), mission)]


def _told(error: Exception) -> str:
    """What was raised, and where."""
    machinery = ("<frozen", __file__, importlib.__file__, metadata.__file__)
    frames = traceback.extract_tb(error.__traceback__)
    where = [f" ({frame.filename}:{frame.lineno})" for frame in frames if not frame.filename.startswith(machinery)]
    return f"{type(error).__name__}: {error}{''.join(where[-1:])}"


def _check_made(said: str, made: Any, method: str) -> None:
    period = getattr(made, "period", None)
    missing = [] if isinstance(period, Real) and not isinstance(period, bool) else ["period [s]"]
    missing += [] if callable(getattr(made, method, None)) else [f"{method}()"]
    if missing:
        raise PluginError(f"{said} {_kind(made)} without {' and '.join(missing)}; allowed: period [s] and {method}()")


def _kind(value: Any) -> str:
    return "None" if value is None else f"a {type(value).__name__}"
