"""What the fields of scenarios are held to; each raises ValueError that names the field, its value, what is allowed."""

from __future__ import annotations

import math


def check(value: float, name: str, low: float, high: float = math.inf, *, open_low: bool = False) -> None:
    """A finite value from ``low``, which with ``open_low`` it must exceed, to ``high``."""
    allowed = f"{'>' if open_low else '>='} {low:g}" + (f" and <= {high:g}" if high < math.inf else "")
    inside = low < value <= high if open_low else low <= value <= high
    if not (math.isfinite(value) and inside):
        raise ValueError(f"{name} = {value!r}; allowed: a finite value {allowed}")


def check_rate(rate: float, name: str, tick: float) -> None:
    """A rate [Hz] whose period is a whole number of physics ticks [s]."""
    check(rate, name, 0.0, 1.0 / tick + 1e-9, open_low=True)
    every = 1.0 / (rate * tick)  # [ticks]
    if abs(every - round(every)) > 1e-9:
        raise ValueError(f"{name} = {rate!r}; allowed: {1.0 / tick:g} Hz over a whole number")
