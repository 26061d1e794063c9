"""Requirements of a scenario on the figures of a run's summary, and a one-line text of those that a run missed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.sim.records.figure_names import SHORTFALL, label


@dataclass(frozen=True)
class Requirement:
    """Requirement that a figure of the summary, a number or a truth value (False < True), lies between two limits."""

    key: str
    least: float = -math.inf
    most: float = math.inf

    def missed(self, summary: Mapping[str, Any]) -> str:
        """Text on how the summary's figure misses the requirement, "" if it meets it. NaN and None never meet it."""
        value, (name, unit) = summary[self.key], label(self.key)
        if value is None or math.isnan(value):
            return f"{name} is not known"
        if self.least <= value <= self.most:
            return ""
        if isinstance(value, bool):
            return name if value else f"not {name}"
        limit, sign = (self.least, "<") if value < self.least else (self.most, ">")
        digits = next((n for n in (4, 7) if f"{value:.{n}g}" != f"{limit:.{n}g}"), 17)
        figure, bound = (f"{number:.{digits}g} {unit}".strip() for number in (value, limit))
        return f"{name} {figure} {sign} {bound} allowed"


def evaluate(
    summary: Mapping[str, Any], requirements: Sequence[Requirement], reported: Sequence[Requirement] = ()
) -> tuple[dict[str, Any], bool]:
    """Summary, with the requirements that it missed, if any, and whether every requirement is met.

    The ``reported`` ones do not decide; they are mentioned for a run that missed others.
    """
    if not any(requirement.missed(summary) for requirement in requirements):
        return dict(summary), True
    missed = [words for requirement in (*requirements, *reported) if (words := requirement.missed(summary))]
    return {**summary, SHORTFALL: "; ".join(missed)}, False
