"""Types of kernel arguments by their names in numba, for lists of kernels to compile ahead of a run."""

from __future__ import annotations

from typing import Any

from numba import float64
from numba.core import types


def array(dimensions: int, of: Any = float64, readonly: bool = False) -> Any:
    """Return the type of an array in C order."""
    return types.Array(of, dimensions, "C", readonly)


def combined(*parts: Any) -> Any:
    """Return the type of a tuple."""
    build: Any = types.Tuple  # which has no types itself
    return build(parts)


def named(kind: type, *parts: Any) -> Any:
    """Return the type of a named tuple."""
    build: Any = types
    return build.NamedTuple(parts, kind) if len({*parts}) > 1 else build.NamedUniTuple(parts[0], len(parts), kind)


ONE, TWO, THREE = (array(dimensions) for dimensions in (1, 2, 3))
ONE_READ, TWO_READ = (array(dimensions, readonly=True) for dimensions in (1, 2))
