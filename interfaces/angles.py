"""Bounds, with their unit, of fields that hold an angle or its rate.

An angle in degrees given for one in radians is far out of range, and is refused. One in radians given for one in
degrees is a small angle within range: it is refused if it is a common fraction of a turn, written in radians as
1.5708 for example, which is not a plausible value in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from annotated_types import GroupedMetadata

from mathnavi.interfaces.bounds import Condition
from mathnavi.interfaces.errors import FieldError

_TURNS = tuple(sorted({*range(2, 25, 2), *range(3, 25, 3)}))  # of pi / 12, to 2 pi
_FEWEST, _MOST = 4, 17  # digits with which such an angle is written
_SHORT = (0.785, 1.57, 3.14, 6.28)  # usual with fewer


@dataclass(frozen=True)
class Degrees(GroupedMetadata):
    """Bounds of an angle in degrees; with ``open_low`` it must exceed ``low``."""

    low: float = -360.0  # [deg]
    high: float = 360.0  # [deg]
    open_low: bool = False

    def __iter__(self) -> Iterator[object]:
        yield self.condition

    @property
    def condition(self) -> Condition:
        """Return the condition on one value."""
        return Condition(self._holds, _range(self.low, self.high, self.open_low, "deg"), self._hint)

    def _holds(self, value: float) -> bool:
        return _within(value, self.low, self.high, self.open_low) and not _is_written_in_radians(value)

    def _hint(self, value: float) -> str:
        meant = math.degrees(value)
        if not (_is_written_in_radians(value) and _within(round(meant), self.low, self.high, self.open_low)):
            return ""
        return f"; did you mean {round(meant)} deg, which are {value:g} rad?"


@dataclass(frozen=True)
class Radians(GroupedMetadata):
    """Bounds of an angle in radians, or of its rate with ``unit`` "rad/s"; with ``open_low`` it must exceed ``low``."""

    low: float = -2.0 * math.pi  # [rad]
    high: float = 2.0 * math.pi  # [rad]
    open_low: bool = False
    unit: str = "rad"

    def __iter__(self) -> Iterator[object]:
        yield self.condition

    @property
    def condition(self) -> Condition:
        """Return the condition on one value."""
        allowed = _range(self.low, self.high, self.open_low, self.unit)
        return Condition(lambda value: _within(value, self.low, self.high, self.open_low), allowed, self._hint)

    def _hint(self, value: float) -> str:
        meant = math.radians(value)
        if not _within(meant, self.low, self.high, self.open_low):
            return ""
        return f"; did you mean {meant:.4g} {self.unit}, which are {value:g} {self.unit.replace('rad', 'deg')}?"


def check_angle(value: float, name: str, bounds: Degrees | Radians) -> None:
    """Raise FieldError for an angle out of ``bounds``, or in the other unit; also for an item of a tuple."""
    condition = bounds.condition
    if not condition.holds(value):
        raise FieldError(f"{name} = {value!r}; allowed: {condition.allowed}{condition.hint(value)}")


def _within(value: float, low: float, high: float, open_low: bool) -> bool:
    return math.isfinite(value) and (low < value if open_low else low <= value) and value <= high


def _range(low: float, high: float, open_low: bool, unit: str) -> str:
    return f"> {low:.4g} and <= {high:.4g} {unit}" if open_low else f"{low:.4g} to {high:.4g} {unit}"


def _is_written_in_radians(value: float) -> bool:
    """Return True for a common fraction of a turn in radians, with a usual number of digits."""
    size = abs(value)
    written = (float(f"{k * math.pi / 12.0:.{digits}g}") for k in _TURNS for digits in range(_FEWEST, _MOST + 1))
    return 0.0 < size < 6.5 and (size in _SHORT or any(size == angle for angle in written))
