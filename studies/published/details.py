"""Details of a published problem other than its value and its statement."""

from __future__ import annotations

from typing import TypedDict


class Details(TypedDict, total=False):
    """Fields of ``PublishedOptimum`` that are stated next to a statement; each as there."""

    origin: float
    singular: bool
    same_as: str
    note: str
