"""A table of results, whatever shows it: a report, a comparison, or a study's page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """Rows of text or numbers under their columns' names."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
