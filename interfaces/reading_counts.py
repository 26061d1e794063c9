"""Number of the readings that an estimator was given and did not use, by reason.

An estimator has one ``ReadingCounts`` and puts its ``extra`` among the extra arrays of every estimate, so that the log,
the summary of a run and the result of ``mn.estimate`` say the same. Of a sensor whose single rays or components may be
used alone, each counts as a reading. What did not arrive, NaN in place of a ray, is no reading and is not counted.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

import numpy as np

from mathnavi.interfaces.signals import Array

COUNTS = "unused"
"""name of their array in ``Estimate.extra``, numbers so far in the order of ``Unused``"""


class Unused(Enum):
    """Reason why a reading was not used; the value is the word for the user."""

    OUTLIER = "outlier"  # refused by a gate: too unlikely, or out of reach since the last reading
    OUT_OF_RANGE = "out of range"  # beyond what the sensor or the vehicle can have
    MALFORMED = "malformed"
    LATE = "late"  # older than what was used already
    NOT_UNIT = "not of unit length"  # a quaternion, or another value that is no point of the space of configurations
    UNKNOWN_SENSOR = "unknown sensor"
    NOT_FINITE = "not finite"


_PLACES = {reason: place for place, reason in enumerate(Unused)}


class ReadingCounts:
    """Numbers of readings that were not used, since the start."""

    def __init__(self) -> None:
        self._counts = np.zeros(len(Unused))
        self._extra: Mapping[str, Array] | None = None  # of the counts as they are

    def add(self, reason: Unused, count: int = 1) -> None:
        """Count readings that were not used."""
        self._counts[_PLACES[reason]] += count
        self._extra = None

    @property
    def extra(self) -> Mapping[str, Array]:
        """Read-only array of the numbers so far, by the name ``COUNTS``."""
        if self._extra is None:
            counts = self._counts.copy()
            counts.setflags(write=False)
            self._extra = {COUNTS: counts}
        return self._extra


def unused_in(extra: Mapping[str, Array]) -> dict[str, int] | None:
    """Numbers of unused readings by the word for the reason, without zeros, from the extra arrays of an estimate.

    None for an estimator that does not count.
    """
    if COUNTS not in extra:
        return None
    last = extra[COUNTS].reshape(-1, len(Unused))[-1].tolist()
    return {reason.value: int(count) for reason, count in zip(Unused, last, strict=True) if count}


def unused_text(counts: Mapping[str, int]) -> str:
    """Counts as text: "12 outlier, 3 late"."""
    return ", ".join(f"{count} {word}" for word, count in counts.items())
