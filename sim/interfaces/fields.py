"""Fields of frozen dataclasses as plain data: to JSON and back, and one at a time by dotted names ("noise.rate")."""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from mathnavi.sim.interfaces.checks import allowed_for
from mathnavi.sim.interfaces.errors import FieldError
from mathnavi.sim.interfaces.failures import failures_named

_PLAIN = (bool, int, float, str)
_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


def plain(value: Any) -> Any:
    """A dataclass, or what its fields hold, as mappings, lists and what JSON has by itself."""
    if value is None or type(value) in _PLAIN:
        return value
    if dataclasses.is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, (tuple, list)):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Enum):
        return value.value
    return str(value) if isinstance(value, Path) else value


def instance(config: type, fields: Mapping[str, Any], where: str) -> Any:
    """The dataclass ``config`` with the fields that are given as plain data.

    FieldError for a field that it does not have and for a value that is not of the declared type.
    """
    _check_names(config, fields, where)
    hints = _hints(config)
    values = {name: value_as(hints[name], value, f"{where}.{name}") for name, value in fields.items()}
    with _refusing(config, where):
        return config(**values)


def with_fields(config: Any, fields: Mapping[str, Any], where: str = "") -> Any:
    """``config`` with some fields replaced, by dotted names; FieldError as for ``instance``."""
    own: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    for name, value in fields.items():
        first, _, rest = name.partition(".")
        _check_names(type(config), (first,), where)
        if rest:
            nested.setdefault(first, {})[rest] = value
        else:
            own[first] = value_as(_hints(type(config))[first], value, _joined(where, first))
    for first, inner in nested.items():
        part = own.get(first, getattr(config, first))
        if not dataclasses.is_dataclass(part):
            raise FieldError(f"{_joined(where, first)} has no fields of its own; allowed: {_joined(where, first)}")
        own[first] = with_fields(part, inner, _joined(where, first))
    with _refusing(type(config), where):
        return dataclasses.replace(config, **own)


def leaf(config: Any, name: str) -> Any:
    """The value of the field with a dotted name."""
    for part in name.split("."):
        config = getattr(config, part)
    return config


def leaf_type(config: Any, name: str) -> Any:
    """The declared type of the field with a dotted name; that of an optional field is what it holds when given."""
    above, _, last = name.rpartition(".")
    hint = _hints(type(leaf(config, above) if above else config))[last]
    return _given(hint) if get_origin(hint) in (typing.Union, types.UnionType) else hint


def flattened(fields: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one, with dotted names."""
    flat: dict[str, Any] = {}
    for name, value in fields.items():
        if isinstance(value, Mapping):
            flat |= flattened(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def of_type(kind: type | tuple[type, ...], value: Any, where: str) -> Any:
    """``value`` if it is of that kind, and FieldError if not; a truth value is no number."""
    if not isinstance(value, kind) or isinstance(value, bool):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        raise FieldError(f"{where} = {value!r}; allowed: {' or '.join(one.__name__ for one in kinds)}")
    return value


def value_as(hint: Any, value: Any, where: str) -> Any:
    """Plain data in the type that a dataclass declares; FieldError if it is of another."""
    origin, choices = get_origin(hint), get_args(hint)
    if isinstance(value, np.generic):
        value = value.item()
    if dataclasses.is_dataclass(hint):
        if isinstance(value, typing.cast(type, hint)):
            return value
        return instance(typing.cast(type, hint), of_type(dict, value, where), where)
    if origin in (typing.Union, types.UnionType):
        return None if value is None and type(None) in choices else value_as(_given(hint), value, where)
    if origin in (tuple, list):
        items = list(of_type((list, tuple), value, where))
        if origin is list or choices[-1] is Ellipsis:
            choices = (choices[0],) * len(items)
        if len(choices) != len(items):
            raise FieldError(f"{where} = {value!r}; allowed: {len(choices)} values")
        return origin(value_as(choice, item, where) for choice, item in zip(choices, items, strict=True))
    if origin is typing.Literal:
        if value not in choices:
            raise FieldError(f"{where} = {value!r}; allowed: {', '.join(map(str, choices))}")
        return value
    if hint is bool:
        if not isinstance(value, bool):
            raise FieldError(f"{where} = {value!r}; allowed: true, false")
        return value
    if hint is float:
        return float(of_type((int, float), value, where))
    if hint is Path:
        return Path(of_type((str, Path), value, where))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint(value)
    return value if hint is Any else of_type(origin or hint, value, where)


def _refusing(config: type, where: str) -> AbstractContextManager[None]:
    """A configuration refuses values by a ValueError; whatever else a plug-in's own raises in here is a FieldError."""
    return failures_named(
        f"{where or 'fields'}: {config.__module__}.{config.__qualname__} failed:", FieldError, (ValueError,)
    )


def _given(hint: Any) -> Any:
    return next(choice for choice in get_args(hint) if choice is not type(None))


def _joined(where: str, name: str) -> str:
    return f"{where}.{name}".strip(".")


def _check_names(config: type, names: typing.Iterable[str], where: str) -> None:
    known = [field.name for field in dataclasses.fields(config)]
    for name in names:
        if name not in known:
            raise FieldError(f"{_joined(where, name)} is not a field; {allowed_for(name, known)}")
