"""Conversion of dataclasses to named arrays and back, for the file of a solution.

A field x of a record "solution" is the array "solution.x"; a record in it adds its own fields, "solution.replay.miss".
Numbers, truth values and texts are arrays of one element, an enumeration is its member's name, and "kind" names a
record's class. A field that is None, at its default, or marked as not to be saved is left out. Compiled functions are
tapes (see ``function_tape``); those that cannot be one are left out.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Union, get_args, get_origin, get_type_hints

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.function_tape import taped
from mathnavi.interfaces.signals import Array

KIND = "kind"
_PLAIN = (bool, int, float, str)
_NUMBERS = "biuf"


def encoded(value: Any, name: str) -> dict[str, Array]:
    """Encode a value as arrays whose names begin with ``name``; TypeError for a value of an unsupported type."""
    if value is None:
        return {}
    if isinstance(value, ca.Function):
        return {f"{name}.{part}": array for part, array in (taped(value) or {}).items()}
    if dataclasses.is_dataclass(value) or _is_named_tuple(type(value)):
        parts = [encoded(getattr(value, field), f"{name}.{field}") for field in _written(value)]
        return {f"{name}.{KIND}": np.array(type(value).__name__)} | {
            key: own for part in parts for key, own in part.items()
        }
    if isinstance(value, Enum):
        return {name: np.array(value.name)}
    if isinstance(value, (*_PLAIN, np.ndarray, np.generic)):
        return {name: np.asarray(value)}
    if isinstance(value, tuple) and all(isinstance(item, _PLAIN) for item in value):
        return {name: np.array(value) if value else np.array((), dtype="U1")}
    raise TypeError(f"{name} = {value!r:.80} cannot be written; allowed: records of numbers, texts and functions")


def _written(value: Any) -> Iterator[str]:
    """Names of the fields of a record that are not at their defaults."""
    for field, default in _fields(type(value)).items():
        own = getattr(value, field)
        if not (isinstance(own, (*_PLAIN, tuple)) and type(own) is type(default) and own == default):
            yield field


def _fields(kind: Any) -> dict[str, Any]:
    """Names of the fields of a record, each with its default, or MISSING."""
    if _is_named_tuple(kind):
        return {field: kind._field_defaults.get(field, dataclasses.MISSING) for field in kind._fields}
    return {field.name: field.default for field in dataclasses.fields(kind) if field.metadata.get("saved", field.init)}


def _is_named_tuple(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


@dataclass(frozen=True, eq=False)
class RecordReader:
    """Records from named arrays.

    ``known`` are values by their full names that need not be read, ``kinds`` the classes, by name, that may stand for a
    type which is not a record itself.
    """

    arrays: Mapping[str, Array]
    known: Mapping[str, Any]
    kinds: Mapping[Any, Mapping[str, Any]]

    def record(self, kind: Any, name: str) -> Any:
        """Read the record of a class ``kind`` that was encoded as ``name``; ValueError if it is not one."""
        if kind in self.kinds:
            called = self.text(f"{name}.{KIND}")
            if called not in self.kinds[kind]:
                raise ValueError(f"{name}.{KIND} = {called!r:.60}; allowed: {', '.join(self.kinds[kind])}")
            kind = self.kinds[kind][called]
        hints = get_type_hints(kind)
        values = {}
        for field, default in _fields(kind).items():
            key = f"{name}.{field}"
            if key in self.known:
                values[field] = self.known[key]
            elif default is dataclasses.MISSING or self._is_there(key):
                values[field] = self._value(hints[field], key)
        return kind(**values)

    def text(self, key: str) -> str:
        """Read a text; ValueError if the array is missing or not a text."""
        return str(self._array(key, "U", 0).item())

    def texts(self, key: str) -> tuple[str, ...]:
        """Read texts; ValueError if the array is missing or has no texts."""
        return tuple(self._array(key, "U", 1).tolist())

    def numbers(self, key: str) -> Array:
        """Read numbers of any shape; ValueError if the array is missing or has no numbers."""
        return self._array(key, _NUMBERS, None).astype(float)

    def _is_there(self, key: str) -> bool:
        return any(other == key or other.startswith(f"{key}.") for other in self.arrays)

    def _value(self, kind: Any, key: str) -> Any:
        if get_origin(kind) in (Union, types.UnionType):
            if not self._is_there(key):
                return None
            (kind,) = (each for each in get_args(kind) if each is not types.NoneType)
        if kind in self.kinds or dataclasses.is_dataclass(kind) or _is_named_tuple(kind):
            return self.record(kind, key)
        if get_origin(kind) is tuple:
            if get_args(kind) == (int, ...):
                return tuple(self._array(key, "iu", 1).tolist())
            if get_args(kind) == (float, ...):
                return tuple(self._array(key, _NUMBERS, 1).astype(float).tolist())
            return self.texts(key) if get_args(kind)[0] is str else self._pair(key, len(get_args(kind)))
        if isinstance(kind, type) and issubclass(kind, Enum):
            called = self.text(key)
            if called not in kind.__members__:
                raise ValueError(f"{key} = {called!r:.60}; allowed: {', '.join(kind.__members__)}")
            return kind[called]
        if kind is str:
            return self.text(key)
        if kind in (int, bool, float):
            return kind(self._array(key, _NUMBERS, 0).item())
        return self.numbers(key)

    def _pair(self, key: str, size: int) -> tuple[float, ...]:
        values = self._array(key, _NUMBERS, 1)
        if len(values) != size:
            raise ValueError(f"array {key!r} of {len(values)} numbers; allowed: {size}")
        return tuple(values.tolist())

    def _array(self, key: str, letters: str, dimensions: int | None) -> Array:
        if key not in self.arrays:
            raise ValueError(f"there is no array {key!r}")
        array = self.arrays[key]
        if array.dtype.kind not in letters or (dimensions is not None and array.ndim != dimensions):
            wanted = "texts" if letters == "U" else "numbers"
            shape = "any shape" if dimensions is None else f"{dimensions} dimensions"
            raise ValueError(f"array {key!r} of {array.dtype} {array.shape}; allowed: {wanted} in {shape}")
        return array
