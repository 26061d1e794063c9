"""Significant digit in which a value first differs from one that is printed."""

from __future__ import annotations

import math
from decimal import Decimal, InvalidOperation

_ROUNDING = Decimal("1e-9")  # of a unit: what is printed was rounded from binary


def first_difference(printed: str, value: float) -> int | None:
    """Return the significant digit, from 1, in which ``value`` first differs from what is printed; None if in none.

    They agree in digit k if they are at most half a unit of it apart: 1.01283 is no rounding of 1.0128369, and differs
    in its sixth digit. A printed zero has no significant digit before its last one. A value that is not finite differs
    in the first. ValueError for a text that is no finite number.
    """
    try:
        number = Decimal(printed)
    except InvalidOperation:
        raise ValueError(f"printed {printed!r}; allowed: a number") from None
    if not number.is_finite():
        raise ValueError(f"printed {printed!r}; allowed: a finite number")
    if not math.isfinite(value):
        return 1
    last = int(number.as_tuple().exponent)
    first = last if number.is_zero() else number.adjusted()
    apart = abs(Decimal(value) - number)
    for place in range(first, last - 1, -1):
        if apart > (Decimal("0.5") + _ROUNDING) * Decimal(1).scaleb(place):
            return first - place + 1
    return None
