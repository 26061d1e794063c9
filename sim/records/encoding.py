"""Encoding of results as JSON and a block of arrays, and decoding: the same values, of the same types, bit for bit.

JSON has no tuples, infinities or classes, so such a value is an object with one tag:

    {"$tuple": [...]}              {"$float": "nan"}           {"$pairs": [[key, value], ...]}     any other mapping
    {"$class": place, "$fields": {...}}                        dataclasses and NamedTuples, by "module:Class"
    {"$enum": [place, name]}       {"$path": "a/b"}            {"$number": [dtype, value]}         a scalar of NumPy
    {"$array": [dtype, shape, [...]]}                          a small array
    {"$block": [name, row]}                                   a larger one, a row of an array of the block, an .npz file
    {"$block": name}                                           one that is a whole array of the block
    {"$timing": name}                                          a ``MeasuredTime``, which is kept separately

A class is found again by its name, so it must be defined in a module, not in a function.
"""

from __future__ import annotations

import dataclasses
import importlib
import io
import math
import sys
from collections.abc import Mapping
from enum import Enum
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import ArgumentError, StoreError
from mathnavi.interfaces.reading.arrays import decoded_npz
from mathnavi.interfaces.signals import Array
from mathnavi.sim.plugin.groups import GROUPS, installed
from mathnavi.sim.plugin.trust import is_trusted

SMALL = 32  # largest number of elements of an array within the text
_AS_TEXT = "biuf"  # kinds of arrays that may be within the text
_IN_A_BLOCK = "biufcSUmM"  # all kinds but those of objects and of records
_PLAIN = (bool, int, str)


class MeasuredTime(float):
    """Duration measured on this machine, in any unit; it is kept, but another run does not repeat it."""


@dataclasses.dataclass(frozen=True)
class Encoded:
    """Value as JSON, its larger arrays as the bytes of an .npz file, and its timings by their place in the value."""

    tree: Any
    arrays: bytes | None = None
    timings: Mapping[str, float | None] = dataclasses.field(default_factory=dict)


def encoded(value: Any) -> Encoded:
    """Encode ``value`` as plain data; TypeError, with its place, for a part that cannot be decoded again."""
    writer = _Writer()
    tree = writer.tree(value, "")
    arrays = writer.arrays()
    if not arrays:
        return Encoded(tree, None, writer.timings)
    block = io.BytesIO()
    np.savez_compressed(block, allow_pickle=False, **arrays)
    return Encoded(tree, block.getvalue(), writer.timings)


def decoded(coded: Encoded) -> Any:
    """Decode an encoded value.

    Raises StoreError for data that is not such a value, and StoreError or ImportError if a class no longer exists.
    """
    arrays: dict[str, Array] = {}
    if coded.arrays is not None:
        arrays = decoded_npz(coded.arrays, "the arrays of a result", StoreError, kinds=_IN_A_BLOCK)
    try:
        return _Reader(arrays, coded.timings).value(coded.tree)
    except StoreError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise StoreError(f"not a stored result: {error!r}") from None


def place_of(kind: Any) -> str:
    """Return the name "module:Name" under which a class or a function is found again; ArgumentError if it has none."""
    module, name = getattr(kind, "__module__", ""), getattr(kind, "__qualname__", "")
    if module == "__main__":
        raise ArgumentError(f"{name} is defined in the script that runs; allowed: a module")
    place = f"{module}:{name}"
    try:
        found = at_place(place)
    except (ImportError, AttributeError, ValueError):
        found = None
    if found is not kind:
        raise ArgumentError(f"{kind!r} is not found at {place!r}; allowed: what is defined in a module")
    return place


@cache
def at_place(place: str) -> Any:
    """Return the class or function at "module:Name"."""
    module, _, name = place.partition(":")
    return attrgetter(name)(importlib.import_module(module))


class _Writer:
    """Encoder of one value, which collects larger arrays and timings separately."""

    def __init__(self) -> None:
        self.timings: dict[str, float | None] = {}
        self._whole: dict[str, Array] = {}
        self._stacks: dict[tuple[str, tuple[int, ...]], tuple[str, list[Array]]] = {}  # by type and shape

    def arrays(self) -> dict[str, Array]:
        """Return the arrays of the block by their names: arrays of one type and shape are stacked, and read at once."""
        return self._whole | {name: np.stack(rows) for name, rows in self._stacks.values()}

    def tree(self, value: Any, place: str) -> Any:
        if value is None or type(value) in _PLAIN:
            return value
        if isinstance(value, MeasuredTime):
            self.timings[place or "time"] = None if math.isnan(value) else float(value)
            return {"$timing": place or "time"}
        if type(value) is float:
            return value if math.isfinite(value) else {"$float": repr(value)}
        if type(value) is list:
            return self._items(value, place)
        if type(value) is tuple:
            return {"$tuple": self._items(value, place)}
        if isinstance(value, Mapping):
            return self._mapping(value, place)
        if isinstance(value, np.ndarray):
            return self._array(value, place)
        if isinstance(value, np.generic):
            return {"$number": [value.dtype.str, self.tree(value.item(), place)]}
        return self._object(value, place)

    def _items(self, items: list[Any] | tuple[Any, ...], place: str) -> list[Any]:
        return [self.tree(item, f"{place}[{k}]") for k, item in enumerate(items)]

    def _mapping(self, value: Mapping[Any, Any], place: str) -> dict[str, Any]:
        if all(type(name) is str and not name.startswith("$") for name in value):
            return {name: self.tree(item, f"{place}.{name}".lstrip(".")) for name, item in value.items()}
        pairs = [[self.tree(name, place), self.tree(item, f"{place}[{name}]")] for name, item in value.items()]
        return {"$pairs": pairs}

    def _array(self, value: Array, place: str) -> dict[str, Any]:
        if value.dtype.hasobject:
            raise TypeError(f"{place or 'the result'} is an array of objects; allowed: an array of numbers")
        if value.size <= SMALL and value.dtype.kind in _AS_TEXT:
            return {"$array": [value.dtype.str, list(value.shape), self._items(value.ravel().tolist(), place)]}
        if not value.flags.c_contiguous or not value.dtype.isnative:  # the rows of a stack have one order
            name = f"a{len(self._whole)}"
            self._whole[name] = value
            return {"$block": name}
        name, rows = self._stacks.setdefault((value.dtype.str, value.shape), (f"s{len(self._stacks)}", []))
        rows.append(value)
        return {"$block": [name, len(rows) - 1]}

    def _object(self, value: Any, place: str) -> dict[str, Any]:
        kind = type(value)
        if isinstance(value, Enum):
            return {"$enum": [place_of(kind), value.name]}
        if isinstance(value, Path):
            return {"$path": str(value)}
        if dataclasses.is_dataclass(value):
            names = [entry.name for entry in dataclasses.fields(value) if entry.init]
        elif isinstance(value, tuple) and hasattr(value, "_fields"):
            names = list(value._fields)
        else:
            raise TypeError(
                f"{place or 'the result'} is a {kind.__name__}, which cannot be stored; allowed: plain data"
            )
        fields = {name: self.tree(getattr(value, name), f"{place}.{name}".lstrip(".")) for name in names}
        return {"$class": place_of(kind), "$fields": fields}


class _Reader:
    """Decoder of one value."""

    def __init__(self, arrays: Mapping[str, Array], timings: Mapping[str, float | None]) -> None:
        self._arrays, self._timings = arrays, timings
        self._classes: dict[str, Any] = {}  # by place

    def value(self, tree: Any) -> Any:
        if isinstance(tree, list):
            return [self.value(item) for item in tree]
        if not isinstance(tree, dict):
            return tree
        if not any(name.startswith("$") for name in tree):
            return {name: self.value(item) for name, item in tree.items()}
        match tree:
            case {"$tuple": items}:
                return tuple(self.value(items))
            case {"$float": text}:
                return float(text)
            case {"$timing": name}:
                time = self._timings[name]
                return MeasuredTime(math.nan if time is None else time)
            case {"$pairs": pairs}:
                return {self.value(name): self.value(item) for name, item in pairs}
            case {"$array": [dtype, shape, items]}:
                kind = np.dtype(dtype)
                if kind.kind not in _AS_TEXT or len(items) > SMALL:
                    raise StoreError(f"$array = {dtype!r}, {len(items)} elements; allowed: at most {SMALL} numbers")
                return np.array(self.value(items), dtype=kind).reshape(shape)
            case {"$block": [name, row]}:
                return self._arrays[name][_row(row, len(self._arrays[name]))].copy()
            case {"$block": name}:
                return self._arrays[name]
            case {"$number": [dtype, item]}:
                return np.dtype(dtype).type(self.value(item))
            case {"$path": text}:
                return Path(text)
            case {"$enum": [place, name]}:
                return _class_at(place, Enum)[name]
            case {"$class": place, "$fields": fields}:
                if place not in self._classes:
                    self._classes[place] = _class_at(place, object)
                return self._classes[place](**{name: self.value(item) for name, item in fields.items()})
        return {name: self.value(item) for name, item in tree.items()}


def _row(row: Any, count: int) -> int:
    """Return ``row`` if it is the index of one of ``count`` rows. Raises StoreError for anything else."""
    if type(row) is not int or not 0 <= row < count:
        raise StoreError(f"$block row = {row!r}; allowed: a whole number from 0 to {count - 1}")
    return row


def _class_at(place: str, base: type) -> Any:
    """Return a class that holds data, by its place; ValueError for anything else that a file may name.

    Outside of ``trusting()`` only mathnavi's packages and those of installed plug-ins are imported for it. The package
    of a user's job has been imported before its result is read.
    """
    package = place.partition(":")[0].partition(".")[0]
    if not (is_trusted() or package in sys.modules or package in _installed_packages()):
        raise StoreError(f"{place!r} is not installed; allowed: classes of mathnavi and of installed plug-ins")
    kind = at_place(place)
    holds_data = isinstance(kind, type) and (
        issubclass(kind, Enum)
        or dataclasses.is_dataclass(kind)
        or (issubclass(kind, tuple) and hasattr(kind, "_fields"))
    )
    if not (holds_data and issubclass(kind, base)):
        raise StoreError(f"{place!r} is not a class of data; allowed: a dataclass, a NamedTuple or an Enum")
    return kind


def _installed_packages() -> set[str]:
    return {"mathnavi", *(point.module.partition(".")[0] for kind in GROUPS for point in installed(kind))}
