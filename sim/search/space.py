"""Space of a search: the fields that it varies, each over a range or over listed values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.interfaces.errors import ArgumentError

Values = Mapping[str, Any]  # of the fields of a search, by name


@dataclass(frozen=True)
class Range:
    """Field with a value from ``low`` to ``high``, whole numbers if both are, uniform in the logarithm if ``log``."""

    name: str
    low: float
    high: float
    log: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low <= self.high):
            raise ArgumentError(f"{self.name} = {self.low!r}..{self.high!r}; allowed: finite numbers, LOW <= HIGH")
        if self.log and self.low <= 0:
            raise ArgumentError(f"{self.name} = {self.low!r}..{self.high!r}; allowed on a logarithmic scale: LOW > 0")

    @property
    def whole(self) -> bool:
        """True for whole numbers."""
        return isinstance(self.low, int) and isinstance(self.high, int)

    def at(self, share: float) -> float:
        """Return value at a share, from 0 to less than 1, of the range: the inverse of its distribution function."""
        low, high = (self.low, self.high + 1) if self.whole else (self.low, self.high)
        value = low * (high / low) ** share if self.log else low + share * (high - low)
        return min(math.floor(value), self.high) if self.whole else min(value, self.high)


@dataclass(frozen=True)
class Choice:
    """Field with one of several values, which need not be numbers."""

    name: str
    values: tuple[Any, ...]

    def at(self, share: float) -> Any:
        """Return the value at a share, from 0 to less than 1, of the list."""
        return self.values[int(share * len(self.values))]


Dimension = Range | Choice


def drawn(space: Sequence[Dimension], shares: Sequence[float]) -> dict[str, Any]:
    """Return the values of all fields at these shares (n,) of their ranges, from 0 to less than 1."""
    return {dimension.name: dimension.at(share) for dimension, share in zip(space, shares, strict=True)}
