"""Plug-ins: entry points, or "package.module:Class" for a class that declares a frozen configuration.

A plug-in is a class with a frozen dataclass ``Config`` and a static ``build``. The built-in ones are found in the same
way as those of third-party packages, and what any of them builds is checked before it flies.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from numbers import Real
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_type_hints

from mathnavi.interfaces.checks import allowed_for, plain_name
from mathnavi.interfaces.entry_points import named
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.failures import explained, failures_named
from mathnavi.interfaces.field_table import fields_of
from mathnavi.sim.plugin.groups import GROUPS, installed
from mathnavi.sim.plugin.trust import check_loaded

if TYPE_CHECKING:  # numpy, which takes as long to import as the command line
    from mathnavi.interfaces.protocols import Consensus, Estimator, Planner, Sensor

Quality = TypeVar("Quality")

_PLACE = "package.module:Class"
_OWN = "mathnavi"  # the package of the built-in plug-ins

NEEDED = {  # of the class itself, besides Config
    "controllers": ("build",),
    "estimators": ("build", "sensors"),
    "consensus": ("build", "within_starts"),
    "scenarios": ("build", "controller", "estimator"),
    "studies": ("run", "quick", "title"),
    "logs": ("accepts", "read"),
}

MOUNTED = ("name", "size", "rate", "read")  # of a sensor on a vehicle, which is read at its rate
LOGGED = ("name", "size")  # of one whose readings a log has; it is never read again
DECLARED = ("numbers", "figures")  # names that an estimator may declare


class OtherMissionError(PluginError):
    """Plug-in that is for a mission of another type."""


@dataclass(frozen=True)
class PluginSpec:
    """Plug-in with its configuration."""

    plugin: Any
    config: Any

    @staticmethod
    def with_fields(plugin: Any, **fields: Any) -> PluginSpec:
        """Return a plug-in class with some fields of its configuration set."""
        return PluginSpec(plugin, plugin.Config(**fields))

    @property
    def name(self) -> str:
        """Place of the class, "package.module:Class"."""
        return f"{self.plugin.__module__}:{self.plugin.__qualname__}"


def names(kind: str) -> tuple[str, ...]:
    """Return the names of the installed plug-ins of a kind, in order, each once."""
    return tuple(dict.fromkeys(point.name for point in installed(kind)))


def called(kind: str, place: str) -> str:
    """Return the name of the class at "package.module:Class" on the command line.

    It is the name of its entry point, unless another plug-in has it too; else that place itself.
    """
    points = installed(kind)
    taken = Counter(point.name for point in points)
    return next((point.name for point in points if point.value == place and taken[point.name] == 1), place)


def load(kind: str, name: str) -> Any:
    """Load the plug-in called ``name``, or the class at "package.module:Class".

    Raises PluginError if none exists, naming those that exist, if several have the name, naming the origin of each,
    or if it declares no frozen configuration.
    """
    point = point_of(kind, name)
    if point.value == name:
        plugin = class_at(kind, name)
    else:
        check_loaded(name)
        with failures_named(f"{kind}: {name!r} cannot be imported:", PluginError):
            plugin = point.load()
    check_class(kind, plugin, name)
    return plugin


def class_at(kind: str, place: str) -> Any:
    """Return the class at "package.module:Class"; PluginError if it cannot be imported. It may be no plug-in."""
    check_loaded(place)
    with failures_named(f"{kind}: {place!r} cannot be imported:", PluginError):
        return _at(kind, place)


def point_of(kind: str, name: str) -> EntryPoint:
    """Return the entry point called ``name``, or one for "package.module:Class"; PluginError as of ``load``."""
    point = named(installed(kind), kind, name, _PLACE)
    if point is not None:
        _check_name(kind, point)
        return point
    if ":" not in name:
        raise PluginError(f"{kind}: {name!r} is not known; {allowed_for(name, names(kind), f'or {_PLACE}')}")
    return EntryPoint(name, name, GROUPS[kind])


@contextmanager
def of_stranger(plugin: Any, subject: str) -> Iterator[None]:
    """Raise a PluginError that begins with ``subject`` for any exception of a plug-in's code within the block.

    Refusals pass: exceptions of mathnavi, an OSError, and a ValueError that says what is allowed. Any exception of
    mathnavi's own plug-ins is a defect, and passes too, but not SystemExit.
    """
    try:
        yield
    except (KeyboardInterrupt, OSError):
        raise
    except BaseException as error:
        refuses = _is_own(type(error)) or (isinstance(error, ValueError) and "allowed" in str(error))
        if refuses or (_is_own(plugin) and isinstance(error, Exception)):
            raise
        raise PluginError(f"{subject} {explained(error)}") from error


def _is_own(kind: Any) -> bool:
    return str(getattr(kind, "__module__", "")).partition(".")[0] == _OWN


def loadable(kind: str) -> dict[str, Any]:
    """Return the installed plug-ins of a kind by name, without those that cannot be loaded."""
    found = {}
    for name in names(kind):
        with suppress(PluginError):
            found[name] = load(kind, name)
    return found


def checked_controller(spec: PluginSpec, mission: Any, bound: type | None = None) -> tuple[Planner, Any]:
    """Return the planner and the tracker that a controller builds; the tracker's ``bound`` has the given type, if any.

    Raises PluginError if the build fails or anything that the loop needs is missing.
    """
    check_class("controllers", spec.plugin, spec.name)
    pair = _invoke("controllers", spec, "build", mission)
    subject = f"controllers: {spec.name!r}: build() returned"
    if not (isinstance(pair, tuple) and len(pair) == 2):
        raise PluginError(f"{subject} {_kind(pair)}; allowed: a pair (planner, tracker)")
    planner, tracker = pair
    _check_made(f"{subject} the planner", planner, "plan")
    _check_made(f"{subject} the tracker", tracker, "command")
    if bound is not None and not isinstance(getattr(tracker, "bound", None), bound):
        given = _kind(tracker.bound) if hasattr(tracker, "bound") else "no bound"
        raise PluginError(f"{subject} the tracker {_kind(tracker)} with {given}; allowed: bound is a {bound.__name__}")
    from mathnavi.interfaces.boundary import guest  # both import numpy
    from mathnavi.sim.plugin.guest_tracker import GuestTracker

    return planner, GuestTracker(tracker, bound) if guest(tracker) else tracker


def checked_estimator(spec: PluginSpec, mission: Any) -> Estimator:
    """Return the estimator that a plug-in builds; PluginError as for a controller.

    Names of its estimates' numbers are those of the estimator. Declared on the plug-in's class alone they would be
    ignored, so they are refused there.
    """
    check_class("estimators", spec.plugin, spec.name)
    estimator: Estimator = _invoke("estimators", spec, "build", mission)
    _check_made(f"estimators: {spec.name!r}: build() returned the estimator", estimator, "update")
    for name in DECLARED:
        names = getattr(spec.plugin, name, None)
        if names and not callable(names) and not hasattr(estimator, name):
            own = type(estimator).__name__
            raise PluginError(
                f"estimators: {spec.name!r} declares {name}, and the estimator that build() returns, "
                f"{_kind(estimator)}, does not; allowed: in class {own}: {name} = {names!r:.200}"
            )
    return estimator


def checked_consensus(spec: PluginSpec, mission: Any) -> Consensus:
    """Return the consensus by which a vehicle agrees with others; PluginError as for a controller."""
    check_class("consensus", spec.plugin, spec.name)
    consensus: Consensus = _invoke("consensus", spec, "build", mission)
    for method in ("exchange", "start"):
        _check_made(f"consensus: {spec.name!r}: build() returned", consensus, method)
    for attribute in ("value", "outlier", "refused"):
        if not hasattr(consensus, attribute):
            raise PluginError(
                f"consensus: {spec.name!r}: build() returned {_kind(consensus)} without {attribute}; allowed: one that "
                "has period, value, outlier, refused, start and exchange"
            )
    return consensus


def checked_sensors(spec: PluginSpec, mission: Any, needed: Sequence[str] = MOUNTED) -> tuple[Sensor, ...]:
    """Return the sensors that an estimator reads, each with the attributes that are ``needed``.

    Those are MOUNTED for the sensors of a vehicle, LOGGED for those of a log. PluginError as for a controller.
    """
    check_class("estimators", spec.plugin, spec.name)
    sensors = _invoke("estimators", spec, "sensors", mission)
    subject = f"estimators: {spec.name!r}: sensors() returned"
    if not isinstance(sensors, Sequence):
        raise PluginError(f"{subject} {_kind(sensors)}; allowed: a tuple of sensors")
    for sensor in sensors:
        if missing := [name for name in needed if not hasattr(sensor, name)]:
            logged = not set(missing) & {*LOGGED} and needed is MOUNTED
            raise PluginError(
                f"{subject} {_kind(sensor)} without {' and '.join(missing)}; allowed: {', '.join(needed)}"
                f"{'; over a log name and size are enough' if logged else ''}"
            )
    return tuple(sensors)


def checked_quality(spec: PluginSpec, mission: Any, quality: type[Quality]) -> Quality:
    """Return the quality of a plug-in's estimates, of the given type; PluginError as for a controller.

    Only scenarios that rely on it ask for it, and only these refuse a plug-in without ``quality``.
    """
    check_class("estimators", spec.plugin, spec.name)
    answer = _invoke("estimators", spec, "quality", mission)
    if not isinstance(answer, quality):
        raise PluginError(f"estimators: {spec.name!r}: quality() returned {_kind(answer)}; allowed: {quality.__name__}")
    return answer


def check_class(kind: str, plugin: Any, name: str) -> None:
    """Raise PluginError for a class that is no plug-in of a kind."""
    config = getattr(plugin, "Config", None)
    if not (isinstance(config, type) and dataclasses.is_dataclass(config) and _frozen(config)):
        raise PluginError(f"{kind}: {name!r} declares no frozen dataclass named Config, so it is not a plug-in")
    for field in dataclasses.fields(config):
        if field.init and field.default is field.default_factory is dataclasses.MISSING:
            raise PluginError(f"{kind}: {name!r}: Config.{field.name} has no default; allowed: fields with defaults")
    with failures_named(f"{kind}: {name!r}: Config() failed:", PluginError):
        fields_of(config)
        config()
    needed = NEEDED.get(kind, ("build",))
    if missing := [attribute for attribute in needed if not hasattr(plugin, attribute)]:
        allowed = f"allowed: {', '.join(needed)} and Config"
        raise PluginError(f"{kind}: {name!r} has no {' and no '.join(missing)}; {allowed}")


def _check_name(kind: str, point: EntryPoint) -> None:
    """Raise PluginError for the name of an entry point that cannot be part of a path, since paths of results contain
    it.
    """
    try:
        plain_name(point.name, f"{kind}: the name of {point.value}")
    except ValueError as error:
        raise PluginError(str(error)) from None


def _frozen(config: type) -> bool:
    parameters: Any = vars(config).get("__dataclass_params__")
    return parameters is not None and bool(parameters.frozen)


def _at(kind: str, place: str) -> Any:
    """Return the class at "package.module:Class"; PluginError if there is no such module, or no such class in it."""
    name, _, attribute = place.partition(":")
    if not all(part.isidentifier() for part in name.split(".")):
        raise PluginError(
            f"{kind}: {place!r} cannot be imported: {name!r} is not the name of a module; allowed: {_PLACE}, from the "
            "folder in which the module is"
        )
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):
            raise  # the module exists, and another one that it imports does not
        ending = f" (the module of {name} is {name.removesuffix('.py')})" if name.endswith(".py") else ""
        raise PluginError(
            f"{kind}: {place!r} cannot be imported: there is no module {error.name!r} in the present folder, and none "
            f"is installed; allowed: {_PLACE}{ending}"
        ) from None
    if not hasattr(module, attribute):
        found = getattr(module, "__file__", None) or name
        classes = {each: value for each, value in vars(module).items() if isinstance(value, type)}
        own = [each for each, value in classes.items() if f"{value.__module__}.".startswith(f"{name}.")]
        needed = NEEDED.get(kind, ("build",))
        built = [each for each in own if all(hasattr(classes[each], attribute) for attribute in needed)]
        allowed = allowed_for(attribute, built) if built else f"allowed: {_PLACE}"
        wrong = f"{found} has no {attribute}" if attribute else "it names no class"
        raise PluginError(f"{kind}: {place!r} cannot be imported: {wrong}; {allowed}")
    return getattr(module, attribute)


def _invoke(kind: str, spec: PluginSpec, method: str, mission: Any) -> Any:
    """Call a plug-in's method with its configuration and a mission.

    Raises PluginError if the mission does not fit, or the method fails in any way but a refusal that says what is
    allowed.
    """
    if wanted := _unfit(spec.plugin, mission):
        raise OtherMissionError(
            f"{kind}: {called(kind, spec.name)!r} is for a {wanted}, and the mission is a {type(mission).__name__}; "
            f"allowed: {_allowed_for_mission(kind, mission, wanted)}"
        )
    if not hasattr(spec.plugin, method):
        raise PluginError(
            f"{kind}: {called(kind, spec.name)!r} has no {method}, which this scenario needs; allowed: a static method "
            f"{method}(config, mission)"
        )
    if not _is_own(spec.plugin):
        from mathnavi.interfaces.boundary import lent  # which imports numpy

        mission = lent(mission)
    with failures_named(f"{kind}: {called(kind, spec.name)!r}: {method}() failed:", PluginError):
        return getattr(spec.plugin, method)(spec.config, mission)


def _unfit(plugin: Any, mission: Any) -> str:
    """Return the kind of mission that a plug-in is built for if it is another one; else ""."""
    try:
        kind = get_type_hints(plugin.build).get("mission")
        fits = not isinstance(kind, type | UnionType) or isinstance(mission, kind)
    except (NameError, TypeError):  # hints that mean nothing here, or a protocol that cannot be checked
        return ""
    if fits or kind is None:
        return ""
    return " or ".join(each.__name__ for each in get_args(kind)) or str(kind.__name__)


def _fitting(kind: str, mission: Any) -> list[str]:
    """Return the names of the installed plug-ins that fit a mission."""
    return [name for name, plugin in loadable(kind).items() if not _unfit(plugin, mission)]


def _allowed_for_mission(kind: str, mission: Any, wanted: str) -> str:
    """Return the plug-ins of a kind that fit a mission; where none does, what would make one fit."""
    if fitting := _fitting(kind, mission):
        return f"{', '.join(fitting)}, or {_PLACE}"
    own = type(mission).__name__
    lacking = {name: _lacking(plugin, mission) for name, plugin in loadable(kind).items()}
    nearest = min((name for name in lacking if lacking[name]), key=lambda name: len(lacking[name]), default=None)
    extended = f", or {nearest} if {own} had {', '.join(lacking[nearest])}" if nearest is not None else ""
    return f"a {wanted} as the mission, or {_PLACE} of one for a {own}, which fits none that is installed{extended}"


def _lacking(plugin: Any, mission: Any) -> list[str]:
    """Return what a mission lacks of the protocol that a plug-in needs; nothing for one that needs a class."""
    with suppress(NameError, TypeError):
        kind = get_type_hints(plugin.build).get("mission")
        if isinstance(kind, type) and getattr(kind, "_is_protocol", False):
            members = {name for base in kind.__mro__ for name in vars(base) if getattr(base, "_is_protocol", False)}
            return sorted(name for name in members if not name.startswith("_") and not hasattr(mission, name))
    return []


def _check_made(subject: str, built: Any, method: str) -> None:
    period = getattr(built, "period", None)
    missing = [] if isinstance(period, Real) and not isinstance(period, bool) else ["period [s]"]
    missing += [] if callable(getattr(built, method, None)) else [f"{method}()"]
    if missing:
        raise PluginError(
            f"{subject} {_kind(built)} without {' and '.join(missing)}; allowed: period [s] and {method}()"
        )


def _kind(value: Any) -> str:
    return "None" if value is None else with_article(type(value).__name__)


def with_article(word: str) -> str:
    """Return a word behind "a" or "an"."""
    return f"{'an' if word[0] in 'AEIOUaeiou' else 'a'} {word}"
