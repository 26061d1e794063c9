"""Short tables, which an interpreter shows for a run, a plan, an estimate or a solution."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any

Row = tuple[str, str, str]
"""name, value, unit"""


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: "1 trial", "2 trials"."""
    return f"{number} {noun}{'s' * (number != 1)}"


def short_table(title: str, rows: Sequence[Row]) -> str:
    """Return a title, and below it a line for each row, values aligned to the right."""
    if not rows:
        return title
    left = max(len(name) for name, _, _ in rows)
    right = max(len(value) for _, value, _ in rows)
    lines = [f"  {name:{left}}  {value:>{right}}  {unit}".rstrip() for name, value, unit in rows]
    return "\n".join([title, *lines])


def html_table(title: str, rows: Sequence[Row]) -> str:
    """Return the same as HTML, for a notebook."""
    cells = "".join(
        f"<tr><td>{escape(name)}</td><td style='text-align:right'>{escape(value)}</td><td>{escape(unit)}</td></tr>"
        for name, value, unit in rows
    )
    return f"<b>{escape(title)}</b><table>{cells}</table>"


def value_text(value: Any) -> str:
    """Return a figure of a summary in a few characters; "-" if it is not known."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:,.1f}" if abs(value) >= 10.0 else f"{value:.3g}"
    return str(value)


def vector_text(values: Sequence[float] | Any, digits: int = 4) -> str:
    """Return the components of a vector as text, "(1.5, 0, -2)"."""
    return f"({', '.join(f'{float(value) + 0.0:.{digits}g}' for value in values)})"
