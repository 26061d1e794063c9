"""Table of results, for a report, a comparison, or a study's page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """Table: rows of text or numbers under the names of their columns."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
