"""Blocks of lines that hold numbers and nothing else, converted as a whole.

pyarrow converts a large block, where it is installed, some three times as fast as numpy does. Both accept the same
numbers, and refuse "1_5", "0x1f" and digits of other scripts; what either refuses has to be read cell by cell.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from functools import cache
from itertools import repeat
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array

LARGE = 2**16  # [characters] from which on a block is worth the import of pyarrow


def numbers_only(text: str, sep: str, count: int, places: Sequence[int]) -> Array | None:
    """Return some columns (n, len(places)) of lines with ``count`` cells each, by their places; NaN for empty cells.

    ``text`` has a line feed behind each line, and no quotes. The result is None for a block that holds anything else
    than numbers in these columns, infinite ones included, or another number of cells in some line.
    """
    arrow = _arrow() if len(text) >= LARGE and "nan(" not in text else None  # "nan(1)" is a number for pyarrow
    try:
        values = _by_numpy(text, sep, count, places) if arrow is None else _by_arrow(arrow, text, sep, count, places)
    except ValueError:  # ArrowInvalid is one too
        return None
    # Both pass over blank lines, and take a number that is too large for an infinite one.
    return values if len(values) == text.count("\n") and not np.isinf(values).any() else None


def _by_arrow(arrow: Any, text: str, sep: str, count: int, places: Sequence[int]) -> Array:
    names, content = [str(k) for k in range(count)], text.encode()
    used = [names[place] for place in places]
    csv = arrow.csv
    table = csv.read_csv(
        arrow.BufferReader(content),
        read_options=csv.ReadOptions(column_names=names, block_size=len(content), use_threads=False),
        parse_options=csv.ParseOptions(delimiter=sep, quote_char=False),
        convert_options=csv.ConvertOptions(
            column_types=dict(zip(used, repeat(arrow.float64()))),
            include_columns=[*dict.fromkeys(used)],
            null_values=[""],
        ),
    )
    values: Array = np.column_stack([table.column(name).to_numpy() for name in used])
    return values


def _by_numpy(text: str, sep: str, count: int, places: Sequence[int]) -> Array:
    if sep * 2 in text or f"\n{sep}" in f"\n{text}" or f"{sep}\n" in text:  # an empty cell, which numpy refuses
        text = f"\n{text}".replace(sep * 2, f"{sep}nan{sep}").replace(sep * 2, f"{sep}nan{sep}")
        text = text.replace(f"\n{sep}", f"\nnan{sep}").replace(f"{sep}\n", f"{sep}nan\n")[1:]
    lines = text.split("\n")[:-1]
    if {line.count(sep) for line in lines} != {count - 1}:
        raise ValueError("lines with other numbers of cells")
    values: Array = np.loadtxt(lines, delimiter=sep, comments=None, usecols=places, ndmin=2)
    return values


@cache
def _arrow() -> Any:
    """Return pyarrow with its reader; None where it is not installed."""
    try:
        importlib.import_module("pyarrow.csv")
    except ModuleNotFoundError:
        return None
    return importlib.import_module("pyarrow")
