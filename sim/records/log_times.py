"""Times of a log: numbers in a unit, or ISO 8601, as seconds without loss.

A double resolves 0.2 us of a time since 1970 in seconds, and 256 ns of one in nanoseconds. So times since an epoch are
counted from the first of them, which is subtracted while they are whole or decimal numbers:

    t_k = (T_k - T_0) / unit,    T_0 kept as a ``Decimal`` [s]
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation

import numpy as np

from mathnavi.interfaces.signals import Array

ISO = "iso"
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
UNITS = (*PER_SECOND, ISO)
_SINCE_EPOCH = 10**8  # [s] from which on times are since an epoch: 1973 by that of Unix, three years after any other
_LATEST = 10**10  # [s] the year 2286
_PRESENT = range(9 * 10**8, 42 * 10**8)  # [s] 1998 to 2103
_STAMP = re.compile(
    r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)(?:[.,](\d{1,18}))?\s*(Z|UTC|(?:UTC)?[+-]\d\d(?::?\d\d)?)?",
    re.ASCII | re.IGNORECASE,
)
_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


class TimeError(ValueError):
    """Cell that is no time in the unit, with its place among the cells, and what is wrong with it."""

    def __init__(self, place: int, what: str) -> None:
        super().__init__(what)
        self.place = place


def is_exact(cell: str, unit: str) -> bool:
    """Return True if times that begin with this cell have to be read as text, for a double would lose digits."""
    if unit == ISO:
        return True
    number = _decimal(cell)
    return number is not None and abs(number) >= _SINCE_EPOCH * PER_SECOND[unit]


def epoch_of(stamps: Array, unit: str) -> float:
    """Return what to subtract from stamps (n,) in a unit: the least if they are since an epoch, else 0."""
    first = float(stamps.min()) if stamps.size else 0.0
    return first if abs(first) >= _SINCE_EPOCH * PER_SECOND[unit] else 0.0


def check_unit(cell: str, unit: str) -> None:
    """Raise TimeError for the first time of a log that obviously has another unit; ``what`` names it."""
    if _STAMP.fullmatch(cell):
        if unit != ISO:
            raise TimeError(0, "is a date; time_unit='iso' allows it")
        return
    number = _decimal(cell)
    if unit == ISO:
        fitting = next((name for name in PER_SECOND if number is not None and _is_epoch(number, name)), "")
        advice = f"; time_unit={fitting!r} allows it" if fitting else ""
        raise TimeError(0, f"is no date; allowed: ISO 8601, as in 2024-05-01T10:00:00.050+02:00{advice}")
    if number is not None and abs(number) >= _LATEST * PER_SECOND[unit]:
        fitting = next((name for name in PER_SECOND if _is_epoch(number, name)), "")
        advice = f"time_unit={fitting!r} allows it" if fitting else f"allowed with time_unit=UNIT: {', '.join(UNITS)}"
        raise TimeError(0, f"is no time in {unit}; {advice}")


def exact_seconds(cells: Sequence[str], unit: str) -> tuple[Array, Decimal]:
    """Return times (n,) [s] from the first on, and the first [s], since 1970 in UTC for dates with a zone.

    Raises TimeError for a cell that is no time.
    """
    if unit == ISO:
        stamps, per_second = _nanoseconds(cells), PER_SECOND["ns"]
    else:
        per_second = PER_SECOND[unit]
        digits = "".join(cells)
        stamps = [int(cell) for cell in cells] if digits.isascii() and digits.isdigit() and all(cells) else []
        if not stamps:
            numbers = [_number(k, cell) for k, cell in enumerate(cells)]
            start = numbers[0]
            return np.array([float((each - start) / per_second) for each in numbers]), start / per_second
    first = stamps[0]
    t: Array = np.array([each - first for each in stamps], dtype=np.float64) / per_second
    return t, Decimal(first) / per_second


def _nanoseconds(cells: Sequence[str]) -> list[int]:
    """Return dates as whole nanoseconds since 1970."""
    found, zoned = [], None
    for k, cell in enumerate(cells):
        parts = _STAMP.fullmatch(cell)
        try:
            if parts is None:
                raise ValueError
            day, clock, fraction, zone = parts.groups()
            moment = datetime.datetime.fromisoformat(f"{day}T{clock}{(zone or '').upper().removeprefix('UTC') or 'Z'}")
        except ValueError:
            raise TimeError(k, "is no date; allowed: ISO 8601, as in 2024-05-01T10:00:00.050+02:00") from None
        if zoned is not None and zoned != bool(zone):
            raise TimeError(k, "has a zone where others have none; allowed: all or none")
        zoned = bool(zone)
        if fraction and fraction[9:].strip("0"):
            raise TimeError(k, "is finer than a nanosecond; allowed: at most nine decimals")
        since = moment - _EPOCH
        found.append((since.days * 86400 + since.seconds) * 10**9 + int((fraction or "0").ljust(9, "0")[:9]))
    return found


def _number(place: int, cell: str) -> Decimal:
    number = _decimal(cell)
    if number is None:
        raise TimeError(place, "is no number; allowed: a time")
    return number


def _decimal(cell: str) -> Decimal | None:
    """Return the finite number in a cell; None for anything else."""
    try:
        number = Decimal(cell) if cell.isascii() and "_" not in cell else Decimal("nan")
    except InvalidOperation:
        return None
    return number if number.is_finite() else None


def _is_epoch(number: Decimal, unit: str) -> bool:
    return int(number / PER_SECOND[unit]) in _PRESENT
