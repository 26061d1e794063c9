"""Comparison of two results side by side, of any kind, and the format of its cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.renders.page import UNKNOWN, Drawn, number
from mathnavi.sim.records.folder_names import names_of
from mathnavi.sim.records.sweep_data import format_value, is_number
from mathnavi.sim.records.table import Table

SAME = "the same in both"
LEAST = 1e-3  # of a difference; a smaller one has a power of ten
ROUNDING = 1e-12  # share of a figure, up to which a difference is one of rounding
MOST = 1e6  # times as large
LONGEST_NAME, AROUND, ELLIPSIS = 20, 6, "…"  # [characters] of a name, and around what differs in a longer one
LONGEST = 60  # [characters] of a value in a cell

Names = tuple[str, str]


def names_of_two(left: Path, right: Path) -> Names:
    """Return short names of two places, by which columns and curves are called."""
    one, other = names_of([left, right])
    return shortened(one.removesuffix(".db"), other.removesuffix(".db"))


def shortened(one: str, other: str) -> Names:
    """Return two names; those too long for a column without most of what both begin and end with.

    What differs, with a few characters around it, stays: a column of a terminal shows it.
    """
    if max(len(one), len(other)) <= LONGEST_NAME or one == other:
        return one, other
    same = _common(one, other)
    tail = _common(one[same:][::-1], other[same:][::-1])
    begin = max(same - AROUND, 0)

    def part(name: str) -> str:
        end = min(len(name) - tail + AROUND, len(name))
        return f"{ELLIPSIS * (begin > 0)}{name[begin:end]}{ELLIPSIS * (end < len(name))}"

    return part(one), part(other)


def _common(one: str, other: str) -> int:
    """Return the number of characters with which both begin."""
    shorter = min(len(one), len(other))
    return next((k for k in range(shorter) if one[k] != other[k]), shorter)


@dataclass(frozen=True)
class Comparison:
    """Two results of one kind: verdict, tables and figures."""

    title: str
    verdict: str  # in a sentence
    names: Names  # of both, short
    left: str  # where the one is
    right: str  # and the other
    tables: Sequence[Table]  # that with the fields that differ comes first
    draw: Callable[[], Sequence[Drawn]]  # the figures, drawn where there is a page to show them


def differing_fields(left: Mapping[str, Any], right: Mapping[str, Any], names: Names) -> Table:
    """Return the fields that are not the same on both sides, in the order of the left one's."""
    rows = [
        (name, _value(left, name), _value(right, name))
        for name in dict.fromkeys([*left, *right])
        if name not in left or name not in right or left[name] != right[name]
    ]
    return Table("Fields that differ", ("field", *names), rows or [("every field", SAME, SAME)])


def _value(fields: Mapping[str, Any], name: str) -> str:
    if name not in fields:
        return UNKNOWN
    text = format_value(fields[name])
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def differences(left: object, right: object) -> tuple[str, str]:
    """Return right - left and right / left if they are finite numbers, else a dash."""
    if not (is_number(left) and is_number(right) and math.isfinite(left) and math.isfinite(right)):
        return UNKNOWN, UNKNOWN
    difference = right - left
    size = abs(difference)
    if size <= ROUNDING * max(abs(left), abs(right)):
        difference = size = 0
    shown = f"{size:.2g}" if 0.0 < size < LEAST else f"{size:,}" if isinstance(size, int) else number(size)
    comparable = abs(left) * MOST > abs(right)  # or the left one is round-off, if not zero
    return f"{'+' if difference > 0 else '−' * bool(size)}{shown}", f"{right / left:.3g}" if comparable else UNKNOWN
