"""Validation of plain data, usually from a file, against the type that a dataclass declares.

``msgspec`` generates the check from the dataclass and its annotations; the bounds of a ``configuration`` are checked as
its instances are made. An error names the place in the file, the value there, and what is allowed::

    $.controller.fields.nodes = '13'; allowed: int
"""

from __future__ import annotations

import dataclasses
import re
import reprlib
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import msgspec

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import Form, fields_of, form_of, leaves_of

ROOT = "$"  # the whole file, in place of a value
_STEP = re.compile(r"\.([^.\[\]]+)|\[(\d+|\.\.\.)\]")  # in a place: a field, the number of an item, or any key
_KINDS = {"object": "an object of names and values", "array": "a list", "null": "null"}
_ANY = form_of(Any)
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
        _check_names(form_of(kind), tree, where)
    try:
        return msgspec.convert(tree, kind, strict=True, dec_hook=_decoded)
    except msgspec.ValidationError as error:
        raise FieldError(_explained(error, form_of(kind), tree, where)) from None
    except TypeError as error:
        raise FieldError(f"{where or 'value'}: {kind} cannot be read from plain data ({error})") from None


def known_fields(kind: Any) -> list[str]:
    """Return the names of the fields of a dataclass that its instances are made from."""
    return [field.name for field in fields_of(kind) if field.init]


def unknown_field(kind: Any, name: object, where: str) -> FieldError:
    """Return the error for a name that a dataclass does not have; it names a field of a part that is called so."""
    known = known_fields(kind)
    inner = [leaf.path for leaf in leaves_of(kind) if leaf.path.rpartition(".")[2] == name]
    if inner:
        meant = f"did you mean {' or '.join(inner)}? allowed: {', '.join(known)}"
    else:
        meant = allowed_for(str(name), known)
    return FieldError(f"{_joined(where, str(name))} is not a field; {meant}")


def _decoded(kind: Any, value: Any) -> Any:
    """Decode values for which JSON has no type."""
    if isinstance(kind, type) and issubclass(kind, Path) and isinstance(value, str):
        return kind(value)
    raise TypeError(f"Expected `{'str' if kind is Path else getattr(kind, '__name__', kind)}`")


def _check_names(form: Form, tree: Any, where: str) -> None:
    if dataclasses.is_dataclass(form.kind) and isinstance(tree, Mapping):
        known = known_fields(form.kind)
        for name, value in tree.items():
            if name not in known:
                raise unknown_field(form.kind, name, where)
            _check_names(_inside(form, name), value, _joined(where, name))
    elif form.origin in (tuple, list) and isinstance(tree, (tuple, list)):
        for k, value in enumerate(tree):
            if dataclasses.is_dataclass((item := _inside(form, k)).kind):
                _check_names(item, value, f"{where}[{k}]")
    elif form.origin is dict and isinstance(tree, Mapping):
        for name, value in tree.items():
            _check_names(_inside(form, ""), value, f"{where}[{name!r}]")


def _inside(form: Form, step: str | int) -> Form:
    """Return the type of a field or an item of a type; ``Any`` if it is not known."""
    kind: Any = form.kind
    if dataclasses.is_dataclass(kind):
        return next((field.form for field in fields_of(form.kind) if field.name == step), _ANY)
    if isinstance(step, int) and form.origin in (tuple, list) and form.members:
        return form.members[step if form.fixed else 0] if step < len(form.members) or not form.fixed else _ANY
    return form.members[1] if form.origin is dict and form.members else _ANY


def _explained(error: msgspec.ValidationError, form: Form, tree: Any, where: str) -> str:
    """Return the message for a fault: its place, the value there, and what is allowed."""
    reason, _, tail = str(error).rpartition(" - at ")
    if not reason:
        reason, tail = str(error), ""
    place, value = where, tree
    for name, number in _STEP.findall(tail.strip("`")):
        if number == "...":
            form = _inside(form, "")
            key, value = _culprit(form, value)
            place = f"{place}[{key!r}]"
        elif number:
            place, value, form = f"{place}[{number}]", value[int(number)], _inside(form, int(number))
        else:
            place, value, form = _joined(place, name), value[name], _inside(form, name)
    if isinstance(error.__cause__, ValueError):  # a configuration refuses a value of the right type
        return _joined(place, reason) if re.match(r"\w+ = ", reason) else f"{place}: {reason}".removeprefix(": ")
    if missing := re.fullmatch(r"Object missing required field `(.*)`", reason):
        return f"{_joined(place, missing[1])} is missing; allowed: {', '.join(known_fields(form.kind))}"
    return f"{place or 'value'} = {shortened(value)}; allowed: {_allowed(reason, form)}"


def _culprit(form: Form, values: Any) -> tuple[Any, Any]:
    """Return the first key and value of a mapping that the type of its values does not allow."""
    for key, value in values.items():
        try:
            msgspec.convert(value, form.hint, strict=True, dec_hook=_decoded)
        except msgspec.ValidationError:
            return key, value
    key = next(iter(values))
    return key, values[key]


def _allowed(reason: str, form: Form) -> str:
    """Return the values that a type allows, in words."""
    if form.kind is bool:
        return "true, false"
    if form.values:
        return ", ".join(str(each.value if isinstance(each, Enum) else each) for each in form.values.values())
    if length := re.match(r"Expected `array` of length (\d+)", reason):
        return f"{length[1]} values"
    if expected := re.match(r"Expected `([^`]*)`", reason):
        kinds = [kind for kind in expected[1].split(" | ") if kind != "null" or expected[1] == "null"]
        return " or ".join(_KINDS.get(kind, kind) for kind in kinds)
    return "a number that a double holds" if reason == "Number out of range" else reason


def _joined(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name
