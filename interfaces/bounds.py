"""Bounds that are declared with a field, and dataclasses whose fields are checked against them.

::

    @configuration
    class ObserverConfig:
        bandwidth: Positive = 2.0
        damping: Annotated[float, Interval(gt=0.0, le=1.0), FINITE] = 0.7
        rate: Positive | None = None
        form: Literal["x", "z"] = "x"

``ObserverConfig(damping=3.0)`` raises ``FieldError``: "damping = 3.0; allowed: a finite value > 0 and <= 1". Bounds are
metadata of ``typing.Annotated``: ``Gt``, ``Ge``, ``Lt``, ``Le`` and ``Interval`` of the package annotated-types, and
those defined here. A ``Literal`` allows the values that it lists, and None is allowed if the type includes it.
"""

from __future__ import annotations

import dataclasses
import math
import operator
import typing
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

from annotated_types import Ge, GroupedMetadata, Gt, Interval, Le, Lt, Predicate

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import Form, fields_of
from mathnavi.interfaces.value_types import type_test

Made = TypeVar("Made")

MOST_IN_MEMORY = 1_000_000  # of anything
MOST_TO_COMPUTE = 100_000  # missions, trials, repetitions
MOST_PROCESSES = 1024
FARTHEST = 1e9  # [m, m/s] of a point or a velocity: its square is a number too
LARGEST_SEED = 2**63 - 1  # that a store has room for
FINITE = Predicate(math.isfinite)
ANEW = object()
"""Mark of a field's type in a subclass: its bounds replace those of the base class."""
_MARK = "checks_bounds"  # attribute of the __post_init__ that a configuration is given


def _no_hint(value: Any) -> str:
    return ""


@dataclass(frozen=True)
class Condition:
    """Test of one value, with the words for the allowed values, and a hint at the intended one if it fails."""

    holds: Callable[[Any], bool]
    allowed: str
    hint: Callable[[Any], str] = _no_hint


class Within(GroupedMetadata):
    """Bounds that are checked after those that stand alone, optionally with special words for the allowed values."""

    def __init__(self, *bounds: Any, allowed: str = "") -> None:
        self.bounds, self.allowed = bounds, allowed

    def __iter__(self) -> Iterator[Any]:
        return iter(self.bounds)


class Each:
    """Bounds that hold for every item of a tuple.

    A message shows the item; with special words for the allowed values it shows the whole tuple.
    """

    def __init__(self, *bounds: Any, allowed: str = "") -> None:
        self.bounds, self.allowed = bounds, allowed


def whole_ticks(tick: float) -> Condition:
    """Return the condition that a duration [s] is a whole number of ticks [s]."""
    return Condition(
        lambda duration: abs(duration / tick - round(duration / tick)) <= 1e-6,
        f"a whole number of ticks of {tick:g} s",
    )


@dataclass(frozen=True)
class TickRate(GroupedMetadata):
    """Bounds of a rate [Hz] whose period is a whole number of physics ticks [s]."""

    tick: float

    def __iter__(self) -> Iterator[object]:
        yield Gt(0.0)
        yield Le(1.0 / self.tick + 1e-9)
        yield FINITE
        yield Condition(self._is_whole, f"{1.0 / self.tick:g} Hz over a whole number")

    def _is_whole(self, rate: float) -> bool:
        share = rate * self.tick
        if not 0.0 < share < math.inf:  # a rate so low that it is practically zero
            return False
        ticks = 1.0 / share
        return math.isfinite(ticks) and abs(ticks - round(ticks)) <= 1e-9


Finite = Annotated[float, FINITE]
Positive = Annotated[float, Gt(0.0), FINITE]
NonNegative = Annotated[float, Ge(0.0), FINITE]
Fraction = Annotated[float, Interval(ge=0.0, le=1.0), FINITE]
PositiveFraction = Annotated[float, Interval(gt=0.0, le=1.0), FINITE]
Probability = Annotated[
    float, Within(Interval(gt=0.0, lt=1.0), allowed="between 0 and 1")
]  # neither impossible nor certain
Count = Annotated[int, Interval(ge=1, le=MOST_TO_COMPUTE)]
CountInMemory = Annotated[int, Interval(ge=1, le=MOST_IN_MEMORY)]
Processes = Annotated[int, Interval(ge=1, le=MOST_PROCESSES)]
Seed = Annotated[int, Interval(ge=0, le=LARGEST_SEED)]

FINITE_NUMBERS = Each(FINITE, allowed="finite numbers")
_COORDINATE = Interval(ge=-FARTHEST, le=FARTHEST)
TWO_FINITE_NUMBERS = Each(_COORDINATE, FINITE, allowed=f"two finite numbers, none beyond {FARTHEST:g}")
THREE_FINITE_NUMBERS = Each(_COORDINATE, FINITE, allowed=f"three finite numbers, none beyond {FARTHEST:g}")


@typing.overload
def configuration(made: type[Made], /) -> type[Made]: ...
@typing.overload
def configuration(*, prefix: str = "", eq: bool = True) -> Callable[[type[Made]], type[Made]]: ...
@typing.dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def configuration(made: type[Any] | None = None, /, *, prefix: str = "", eq: bool = True) -> Any:
    """Make a frozen dataclass whose fields are checked against their declared bounds when an instance is made.

    A ``__post_init__`` of the class is called after that, and checks conditions on several fields together.
    Messages name a field with ``prefix`` before it; "{name}" in the prefix stands for the value of the field ``name``.
    """
    if made is None:
        return partial(_configuration, prefix=prefix, eq=eq)
    return _configuration(made, prefix=prefix, eq=eq)


def _configuration(made: type[Any], prefix: str, eq: bool) -> Any:
    own: Callable[[Any], None] | None = getattr(made, "__post_init__", None)

    def post_init(self: Any) -> None:
        kind: Any = type(self)
        if _most_derived(kind) is made:  # a configuration made of this one has checked every field
            check_bounds(self, prefix)
        if own is not None:
            own(self)

    post_init.__name__, post_init.__qualname__ = "__post_init__", f"{made.__qualname__}.__post_init__"
    post_init.__module__ = made.__module__
    vars(post_init)[_MARK] = True
    setattr(made, "__post_init__", post_init)  # noqa: B010 - mypy knows no such attribute of every class
    return dataclass(frozen=True, eq=eq)(made)


@cache
def _most_derived(made: Any) -> type[Any]:
    """Return the class itself if it is a configuration, else the most derived configuration that it inherits from."""
    bases: Sequence[type[Any]] = made.__mro__
    return next(base for base in bases if hasattr(vars(base).get("__post_init__"), _MARK))


def check_bounds(fields: Any, prefix: str = "") -> None:
    """Raise FieldError for the first field of a dataclass's instance that is not within its declared bounds."""
    kind: Any = type(fields)
    for name, optional, each, holds, allowed, hint in (*_types(kind), *declared(kind)):
        value = getattr(fields, name)
        if value is None and optional:
            continue
        for item in value if each else (value,):
            if not holds(item):
                raise FieldError(f"{prefix.format_map(vars(fields))}{name} = {item!r}; allowed: {allowed}{hint(item)}")


class Declared(NamedTuple):
    """Bound of a field."""

    name: str
    optional: bool  # whether None is allowed too
    each: bool  # whether it holds for every item
    holds: Callable[[Any], bool]
    allowed: str
    hint: Callable[[Any], str]


@cache
def declared(config: Any) -> tuple[Declared, ...]:
    """Return the bounds that a dataclass declares, in the order of its fields.

    A field that a subclass declares again, with another default for example, keeps the bounds that it has in the base
    class, unless its type in the subclass is marked with ``ANEW``.
    """
    return tuple(
        Declared(field.name, optional, each, condition.holds, condition.allowed, condition.hint)
        for field in fields_of(config)
        for form in _since_anew(field.declared)
        for optional, each, condition in _conditions(form)
    )


@cache
def _types(config: Any) -> tuple[Declared, ...]:
    """Return the conditions on the types of a dataclass's fields, which hold before a bound can be compared with."""
    found = []
    for field in fields_of(config):
        form = field.declared[-1]
        if (test := type_test(form)) is not None:
            accepted, words = test
            bounds = [bound.allowed for bound in declared(config) if bound.name == field.name and not bound.each]
            found.append(Declared(field.name, form.optional, False, accepted, bounds[0] if bounds else words, _no_hint))
    return tuple(found)


def _since_anew(forms: Sequence[Form]) -> Sequence[Form]:
    """Return the types of a field, base classes first, from the last one that is marked with ``ANEW`` on, or all."""
    marked = [k for k, form in enumerate(forms) if ANEW in form.marks]
    return forms[max(marked, default=0) :]


def _conditions(form: Form) -> Iterator[tuple[bool, bool, Condition]]:
    """Return the conditions of a type on a value: each with whether None is allowed and whether it holds for every
    item.
    """
    if form.origin is Literal:
        values = tuple(form.values.values())
        yield form.optional, False, Condition(values.__contains__, ", ".join(map(str, values)))
    for each, condition in _marked(form.kind, form.marks):
        yield form.optional, each, condition


def _marked(kind: Any, marks: Sequence[Any]) -> Iterator[tuple[bool, Condition]]:
    """Return the conditions in the metadata of one ``Annotated``, with whether each holds for every item: interval
    first.
    """
    flat = list(_flat(marks))
    limits = [
        (name, getattr(mark, name)) for mark in flat for name, order in _ORDER.items() if isinstance(mark, order.mark)
    ]
    finite = FINITE in flat
    if limits or finite:
        tests = [partial(_ORDER[name].compared, limit) for name, limit in limits] + [math.isfinite] * finite
        yield False, Condition(lambda value: all(test(value) for test in tests), _words(kind, limits, finite))
    for mark in flat:
        if isinstance(mark, Condition):
            yield False, mark
        elif isinstance(mark, Within):
            for each, condition in _marked(kind, mark.bounds):
                yield each, Condition(condition.holds, mark.allowed or condition.allowed)
        elif isinstance(mark, Each):
            for _, condition in _marked(float, mark.bounds):
                yield (False, _of_all(condition, mark.allowed)) if mark.allowed else (True, condition)


def _of_all(condition: Condition, allowed: str) -> Condition:
    return Condition(lambda values: all(map(condition.holds, values)), allowed)


def _flat(marks: Iterable[Any]) -> Iterator[Any]:
    for mark in marks:
        if isinstance(mark, GroupedMetadata) and not isinstance(mark, Within):
            yield from _flat(mark)
        else:
            yield mark


class _Order(NamedTuple):
    mark: type[Any]
    compared: Callable[[Any, Any], bool]  # (limit, value): false for a value that is not a number
    sign: str


_ORDER = {
    "gt": _Order(Gt, operator.lt, ">"),
    "ge": _Order(Ge, operator.le, ">="),
    "lt": _Order(Lt, operator.gt, "<"),
    "le": _Order(Le, operator.ge, "<="),
}


def _words(kind: Any, limits: Sequence[tuple[str, Any]], finite: bool) -> str:
    """Return the words for an interval: "a finite value > 0 and <= 1", "a whole number from 1 to 60"."""
    if kind is int and not finite:
        if [name for name, _ in limits] == ["ge", "le"]:
            return f"a whole number from {limits[0][1]} to {limits[1][1]}"
        return "a whole number " + " and ".join(f"{_ORDER[name].sign} {limit}" for name, limit in limits)
    if not limits:
        return "a finite number"
    value = "a finite value" if finite else "a value"
    return f"{value} " + " and ".join(f"{_ORDER[name].sign} {limit:g}" for name, limit in limits)
