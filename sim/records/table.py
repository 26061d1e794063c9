"""Table of results, for a report, a comparison, or a study's page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Row = Mapping[str, Any]
"""values by name, a row of a CSV"""


@dataclass(frozen=True)
class Table:
    """Table: rows of text or numbers under the names of their columns."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]

    @staticmethod
    def of(title: str, rows: Iterable[Row], columns: Sequence[tuple[str, str | Callable[[Row], object]]]) -> Table:
        """Return the table with a line for each of ``rows``.

        A column is its head and what stands under it: the name of a value, a format of several, such as
        "{arrived} of {missions}", or a function of the row. KeyError for a value that a row lacks.
        """
        cells = [tuple(_cell(row, content) for _, content in columns) for row in rows]
        return Table(title, [head for head, _ in columns], cells)


def _cell(row: Row, content: str | Callable[[Row], object]) -> object:
    if callable(content):
        return content(row)
    return content.format_map(row) if "{" in content else row[content]
