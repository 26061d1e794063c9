"""Fields of frozen dataclasses as plain data: to JSON and back, and one at a time by dotted names ("noise.rate")."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from contextlib import AbstractContextManager
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.failures import failures_named, raising
from mathnavi.interfaces.field_table import field_of
from mathnavi.interfaces.schema import known_fields, unknown_field, validated

_PLAIN = (bool, int, float, str)


def plain(value: Any) -> Any:
    """Return a dataclass, or the value of a field, as mappings, lists and the other types of JSON."""
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
    """Return the dataclass ``config`` with the fields that are given as plain data.

    Raises FieldError for a field that it does not have and for a value that is not of the declared type.
    """
    with _refusing(config, where):
        return validated(config, _native(fields), where)


def with_fields(config: Any, fields: Mapping[str, Any], where: str = "") -> Any:
    """Return ``config`` with some fields replaced, by dotted names; FieldError as for ``instance``."""
    own: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    for name, value in fields.items():
        first, _, rest = name.partition(".")
        if first not in known_fields(type(config)):
            raise unknown_field(type(config), first, where)
        if rest:
            nested.setdefault(first, {})[rest] = value
        else:
            own[first] = validated(field_of(type(config), first).form.hint, _native(value), _joined(where, first))
    for first, inner in nested.items():
        part = own.get(first, getattr(config, first))
        if not dataclasses.is_dataclass(part):
            raise FieldError(f"{_joined(where, first)} has no fields; allowed: {_joined(where, first)}")
        own[first] = with_fields(part, inner, _joined(where, first))
    with _refusing(type(config), where):
        return dataclasses.replace(config, **own)


def flat(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return fields by dotted names, arrays as lists: {"noise": {"position": 5.0}} is {"noise.position": 5.0}."""
    return {
        name: value.tolist() if isinstance(value, np.ndarray | np.generic) else value
        for name, value in flattened(fields).items()
    }


def configured(base: Any, fields: Mapping[str, Any], where: str = "") -> Any:
    """Return the configuration ``base`` with some fields set; messages name them from ``where`` on.

    Raises FieldError for a field that it does not have, and for a value of another type or out of its range.
    """
    with raising(FieldError):
        return with_fields(base, flat(fields), where)


def leaf(config: Any, name: str) -> Any:
    """Return the value of the field with a dotted name."""
    for part in name.split("."):
        config = getattr(config, part)
    return config


def leaf_type(config: Any, name: str) -> Any:
    """Return the declared type of the field with a dotted name; for an optional field without its None."""
    above, _, last = name.rpartition(".")
    return field_of(type(leaf(config, above) if above else config), last).form.kind


def flattened(fields: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Flatten nested mappings to one, with dotted names."""
    flat: dict[str, Any] = {}
    for name, value in fields.items():
        if isinstance(value, Mapping):
            flat |= flattened(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def _native(value: Any) -> Any:
    """Return ``value`` with Python's numbers in place of NumPy's."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (tuple, list)):
        return [_native(item) for item in value]
    return {name: _native(item) for name, item in value.items()} if isinstance(value, Mapping) else value


def _refusing(config: type, where: str) -> AbstractContextManager[None]:
    """Let a ValueError, by which a configuration refuses values, pass; raise any other exception as a FieldError."""
    return failures_named(
        f"{where or 'fields'}: {config.__module__}.{config.__qualname__} failed:", FieldError, (ValueError,)
    )


def _joined(where: str, name: str) -> str:
    return f"{where}.{name}".strip(".")
