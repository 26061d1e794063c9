"""Stamps of a channel: rate, jitter, gaps, stamps that are late or doubled, and numbers that do not change.

The period is the median of the differences between different stamps in their order. A gap is a difference of more than
``GAP`` periods; what is missing in it are the readings that a period apart would fill it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array

GAP = 1.5
"""periods between two readings from which on some are missing"""


@dataclass(frozen=True)
class Timing:
    """Figures of the stamps of a channel; times [s] since the start of the log."""

    count: int
    first: float
    last: float
    period: float  # [s] NaN for less than two different stamps
    jitter: float  # [s] half the range of the middle 90 % of the differences; NaN likewise
    gaps: int
    missing: int  # readings in the gaps
    longest_gap: float  # [s] 0 if there is none
    longest_gap_at: float  # [s] its beginning; NaN if there is none
    late: int  # stamps before one that stands before them
    first_late: int | None  # index of the first of them
    doubled: int  # stamps that another reading has too, less one for each

    @property
    def rate(self) -> float:
        """Rate [Hz], NaN for less than two different stamps."""
        return 1.0 / self.period

    @property
    def orderly(self) -> bool:
        """True if the stamps increase."""
        return not self.late and not self.doubled


def timing_of(t: Array) -> Timing:
    """Return the figures of stamps (n,) [s] in the order of their recording, n >= 1."""
    late = np.flatnonzero(t[1:] < np.maximum.accumulate(t)[:-1]) + 1
    stamps = np.unique(t)
    steps = np.diff(stamps)
    period = jitter = longest_at = np.nan
    gaps, missing, longest = np.empty(0, dtype=np.int64), 0, 0.0
    if len(steps):
        period = float(np.median(steps))
        low, high = np.quantile(steps, [0.05, 0.95])
        jitter = 0.5 * float(high - low)
        gaps = np.flatnonzero(steps > GAP * period)
        missing = int((np.rint(steps[gaps] / period) - 1).sum())
        if len(gaps):
            widest = int(gaps[np.argmax(steps[gaps])])
            longest, longest_at = float(steps[widest]), float(stamps[widest])
    return Timing(
        len(t), float(stamps[0]), float(stamps[-1]), period, jitter, len(gaps), missing, longest, longest_at,
        len(late), int(late[0]) if len(late) else None, len(t) - len(stamps),
    )  # fmt: skip


def longest_constant(t: Array, values: Array) -> tuple[float, float]:
    """Return how long [s] a number (n,) stayed the same at longest, and from when on [s]; (0, NaN) if it never did.

    Readings are taken in the order of their stamps. Those that are missing, NaN, neither end a stretch nor begin one.
    """
    order = np.argsort(t, kind="stable")
    there = order[np.isfinite(values[order])]
    if len(there) < 2:
        return 0.0, np.nan
    t, values = t[there], values[there]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1])
    ends = np.append(starts[1:], len(values)) - 1
    lengths = t[ends] - t[starts]
    widest = int(np.argmax(lengths))
    return (float(lengths[widest]), float(t[starts[widest]])) if lengths[widest] > 0.0 else (0.0, np.nan)
