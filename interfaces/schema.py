"""Validation of plain data, usually from a file, against the type that a dataclass declares.

``msgspec`` generates the check from the dataclass and its annotations; the bounds of a ``configuration`` are checked as
its instances are made. An error names the place in the file, the value there, and what is allowed::

    $.controller.fields.nodes = '13'; allowed: int
"""

from __future__ import annotations

import dataclasses
import re
import reprlib
import types
import typing
from collections.abc import Callable, Mapping
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import FieldError

ROOT = "$"  # the whole file, in place of a value
_STEP = re.compile(r"\.([^.\[\]]+)|\[(\d+|\.\.\.)\]")  # in a place: a field, the number of an item, or any key
_KINDS = {"object": "an object of names and values", "array": "a list", "null": "null"}
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80
_SHORT.maxdict = _SHORT.maxlist = _SHORT.maxtuple = 6
_SHORT.maxlevel = 3


def shortened(value: object) -> str:
    """Return a value as a message shows it, without its middle if it is long."""
    return _SHORT.repr(value)


def validated(kind: Any, tree: Any, where: str = ROOT, *, closed: bool = True) -> Any:
    """Return an instance of the type ``kind`` from plain data; FieldError with the place, below ``where``, of an error.

    An object with a name that its dataclass does not have is wrong too, unless ``closed`` is False.
    """
    if closed:
        _check_names(kind, tree, where)
    try:
        return msgspec.convert(tree, kind, strict=True, dec_hook=_decoded)
    except msgspec.ValidationError as error:
        raise FieldError(_explained(error, kind, tree, where)) from None
    except TypeError as error:
        raise FieldError(f"{where or 'value'}: {kind} cannot be read from plain data ({error})") from None


def known_fields(kind: Any) -> list[str]:
    """Return the names of the fields of a dataclass that its instances are made from."""
    return [entry.name for entry in dataclasses.fields(kind) if entry.init]


def unknown_field(kind: Any, name: object, where: str) -> FieldError:
    """Return the error for a name that a dataclass does not have."""
    return FieldError(f"{_joined(where, str(name))} is not a field; {allowed_for(str(name), known_fields(kind))}")


def _decoded(kind: Any, value: Any) -> Any:
    """Decode values for which JSON has no type."""
    if isinstance(kind, type) and issubclass(kind, Path) and isinstance(value, str):
        return kind(value)
    raise TypeError(f"Expected `{'str' if kind is Path else getattr(kind, '__name__', kind)}`")


def _check_names(kind: Any, tree: Any, where: str) -> None:
    kind = _bare(kind)
    if dataclasses.is_dataclass(kind) and isinstance(tree, Mapping):
        known, hints = known_fields(kind), _hints(kind)
        for name, value in tree.items():
            if name not in known:
                raise unknown_field(kind, name, where)
            _check_names(hints[name], value, _joined(where, name))
    elif get_origin(kind) in (tuple, list) and isinstance(tree, (tuple, list)):
        for k, value in enumerate(tree):
            if dataclasses.is_dataclass(item := _bare(_inside(kind, k))):
                _check_names(item, value, f"{where}[{k}]")
    elif get_origin(kind) is dict and isinstance(tree, Mapping):
        for name, value in tree.items():
            _check_names(get_args(kind)[1], value, f"{where}[{name!r}]")


_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


def _bare(hint: Any) -> Any:
    """Return a type without its bounds; an optional one without its None."""
    while True:
        if get_origin(hint) is Annotated:
            hint = get_args(hint)[0]
        elif get_origin(hint) in (typing.Union, types.UnionType):
            given = [choice for choice in get_args(hint) if choice is not types.NoneType]
            if len(given) != 1:
                return hint
            hint = given[0]
        else:
            return hint


def _inside(hint: Any, step: str | int) -> Any:
    """Return the type of a field or an item of a type; ``Any`` if it is not known."""
    kind, items = _bare(hint), get_args(_bare(hint))
    if dataclasses.is_dataclass(kind):
        return _hints(kind).get(str(step), Any)
    if isinstance(step, int) and get_origin(kind) in (tuple, list):
        if get_origin(kind) is list or items[-1] is Ellipsis:
            return items[0]
        return items[step] if step < len(items) else Any
    return items[1] if get_origin(kind) is dict else Any


def _explained(error: msgspec.ValidationError, kind: Any, tree: Any, where: str) -> str:
    """Return the message for a fault: its place, the value there, and what is allowed."""
    reason, _, tail = str(error).rpartition(" - at ")
    if not reason:
        reason, tail = str(error), ""
    place, value, hint = where, tree, kind
    for name, number in _STEP.findall(tail.strip("`")):
        if number == "...":
            key, value = _culprit(_bare(hint), value)
            place, hint = f"{place}[{key!r}]", _inside(hint, "")
        elif number:
            place, value, hint = f"{place}[{number}]", value[int(number)], _inside(hint, int(number))
        else:
            place, value, hint = _joined(place, name), value[name], _inside(hint, name)
    if isinstance(error.__cause__, ValueError):  # a configuration refuses a value of the right type
        return _joined(place, reason) if re.match(r"\w+ = ", reason) else f"{place}: {reason}".removeprefix(": ")
    if missing := re.fullmatch(r"Object missing required field `(.*)`", reason):
        return f"{_joined(place, missing[1])} is missing; allowed: {', '.join(known_fields(_bare(hint)))}"
    return f"{place or 'value'} = {shortened(value)}; allowed: {_allowed(reason, _bare(hint))}"


def _culprit(hint: Any, values: Any) -> tuple[Any, Any]:
    """Return the first key and value of a mapping that its type does not allow."""
    kind = get_args(hint)[1]
    for key, value in values.items():
        try:
            msgspec.convert(value, kind, strict=True, dec_hook=_decoded)
        except msgspec.ValidationError:
            return key, value
    key = next(iter(values))
    return key, values[key]


def _allowed(reason: str, hint: Any) -> str:
    """Return the values that a type allows, in words."""
    if get_origin(hint) is Literal:
        return ", ".join(map(str, get_args(hint)))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return ", ".join(str(member.value) for member in hint)
    if hint is bool:
        return "true, false"
    if length := re.match(r"Expected `array` of length (\d+)", reason):
        return f"{length[1]} values"
    if expected := re.match(r"Expected `([^`]*)`", reason):
        kinds = [kind for kind in expected[1].split(" | ") if kind != "null" or expected[1] == "null"]
        return " or ".join(_KINDS.get(kind, kind) for kind in kinds)
    return "a number that a double holds" if reason == "Number out of range" else reason


def _joined(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name
