"""Rows of the short tables that an interpreter shows of an optimal control problem."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mathnavi.interfaces.short_tables import Row

MOST_ROWS = 12  # of one kind


def limits_text(lower: float, upper: float) -> str:
    """Limits in a few characters: "0 to 1", ">= 0", "= 3", "free"."""
    if lower == upper:
        return f"= {lower:.4g}"
    if math.isinf(lower) and math.isinf(upper):
        return "free"
    if math.isinf(lower):
        return f"<= {upper:.4g}"
    return f">= {lower:.4g}" if math.isinf(upper) else f"{lower:.4g} to {upper:.4g}"


def limit_rows(kind: str, limited: Sequence[tuple[str, float, float]]) -> list[Row]:
    """A row for each name of a kind with its limits (name, lower, upper); the last row counts what is too many."""
    rows = [(f"{kind} {name}".strip(), limits_text(lower, upper), "") for name, lower, upper in limited[:MOST_ROWS]]
    more = len(limited) - MOST_ROWS
    return rows if more <= 0 else [*rows, (f"{more} more of {kind}", "", "")]


def duration_row(lower: float, upper: float) -> Row:
    """The row of the final time."""
    return "T", limits_text(lower, upper), "s"
