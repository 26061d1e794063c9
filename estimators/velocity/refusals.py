"""Reason why a reading of a position is not used."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import Measurement
from mathnavi.models.manifold.manifold import Manifold
from mathnavi.models.manifold.mission import POSITION


def refusal(manifold: Manifold, reading: Measurement) -> Unused | None:
    """Reason why a reading is no point of the manifold; None for one that is."""
    if reading.name != POSITION:
        return Unused.UNKNOWN_SENSOR
    if reading.value.shape != (manifold.size,):
        return Unused.MALFORMED
    if not np.isfinite(reading.value).all():
        return Unused.NOT_FINITE
    try:
        manifold.check(reading.value)
    except ValueError:
        return Unused.NOT_UNIT
    return None
