"""Result of a check of Pontryagin's conditions (see ``pontryagin``): each condition with its verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from mathnavi.interfaces.short_tables import html_table, short_table


class ConditionVerdict(Enum):
    """Verdict on a condition; the value is its word in a table."""

    HOLDS = "holds"
    VIOLATED = "violated"
    NOT_JUDGED = "not judged"


@dataclass(frozen=True)
class OptimalityCondition:
    """Result for one of Pontryagin's conditions along a solution."""

    name: str
    verdict: ConditionVerdict
    residual: float = math.nan  # NaN where it is not judged
    reason: str = ""  # why it is not judged

    def __str__(self) -> str:
        """The verdict in a few words, "Hamiltonian violated, 2.1e-01"."""
        return f"{self.name} {self.verdict.value}, {self.reason or f'{self.residual:.1e}'}"


@dataclass(frozen=True, repr=False)
class PontryaginCheck:
    """All conditions of a solution, with the result for each."""

    problem: str
    tolerance: float
    conditions: tuple[OptimalityCondition, ...]

    @property
    def holds(self) -> bool:
        """True if no condition that can be judged is violated."""
        return not self.violated

    @property
    def violated(self) -> tuple[OptimalityCondition, ...]:
        """The conditions that are violated."""
        return tuple(condition for condition in self.conditions if condition.verdict is ConditionVerdict.VIOLATED)

    @property
    def not_judged(self) -> tuple[OptimalityCondition, ...]:
        """The conditions that cannot be judged, each with its reason."""
        return tuple(condition for condition in self.conditions if condition.verdict is ConditionVerdict.NOT_JUDGED)

    @property
    def summary(self) -> str:
        """One line: the conditions that are violated, each with its residual; otherwise how many hold."""
        if self.violated:
            return "; ".join(str(each) for each in self.violated)
        more = f", {len(self.not_judged)} not judged" if self.not_judged else ""
        return f"{len(self.conditions) - len(self.not_judged)} hold{more}"

    def __getitem__(self, name: str) -> OptimalityCondition:
        """The condition of a name; KeyError names those that exist."""
        for condition in self.conditions:
            if condition.name == name:
                return condition
        raise KeyError(f"{name!r} is not a condition; allowed: {', '.join(each.name for each in self.conditions)}")

    def __repr__(self) -> str:
        """A table: each condition, its verdict, and its residual or the reason why it was not judged."""
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        """The same table, for a notebook."""
        return html_table(*self._table())

    def _table(self) -> tuple[str, list[tuple[str, str, str]]]:
        rows = [(each.name, each.verdict.value, each.reason or f"{each.residual:.1e}") for each in self.conditions]
        return f"Pontryagin's conditions of {self.problem}, residuals up to {self.tolerance:g}", rows
