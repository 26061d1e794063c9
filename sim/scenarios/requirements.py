"""What a scenario asks of the figures of a run's summary, and in one line what of it a run did not do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.sim.records.figure_names import SHORTFALL, label


@dataclass(frozen=True)
class Requirement:
    """A figure of the summary lies between two limits: a number, or a truth value, False before True."""

    key: str
    least: float = -math.inf
    most: float = math.inf

    def missed(self, summary: Mapping[str, Any]) -> str:
        """What is wrong with the summary's figure, "" if nothing is. What is no number meets nothing."""
        value, (name, unit) = summary[self.key], label(self.key)
        if value is None or math.isnan(value):
            return f"{name} is not known"
        if self.least <= value <= self.most:
            return ""
        if isinstance(value, bool):
            return name if value else f"not {name}"
        limit, sign = (self.least, "<") if value < self.least else (self.most, ">")
        digits = next((n for n in (4, 7) if f"{value:.{n}g}" != f"{limit:.{n}g}"), 17)
        told = [f"{number:.{digits}g} {unit}".strip() for number in (value, limit)]
        return f"{name} {told[0]} {sign} {told[1]} allowed"


def judged(
    summary: Mapping[str, Any], requirements: Sequence[Requirement], told: Sequence[Requirement] = ()
) -> tuple[dict[str, Any], bool]:
    """The summary, with what it falls short of if it does, and whether every demand is met.

    What ``told`` demands beside that does not decide; it is told of a run that fell short.
    """
    if not any(requirement.missed(summary) for requirement in requirements):
        return dict(summary), True
    missed = [words for requirement in (*requirements, *told) if (words := requirement.missed(summary))]
    return {**summary, SHORTFALL: "; ".join(missed)}, False
