"""Figures of the places that an estimator has found of beacons which it was not given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array


def found_figures(
    found: Mapping[int, tuple[Array, float]], truth: Sequence[Sequence[float]], unknown: Sequence[int], decimals: int
) -> dict[str, Any]:
    """Figures of the ``unknown`` beacons, which are at ``truth`` (n, d) [m]: of those ``found``, by their numbers, the
    place (d,) [m] and its standard deviation [m]. Empty without any.
    """
    if not unknown:
        return {}
    words, errors, deviations = [], [], []
    for i in unknown:
        if i not in found:
            words.append(f"{i}: not found")
            continue
        place, deviation = found[i]
        errors.append(float(np.linalg.norm(place - np.array(truth[i]))))
        deviations.append(deviation)
        where = ", ".join(f"{each:.{decimals}f}" for each in place.tolist())
        words.append(f"{i}: ({where}) m, sigma {deviation:.2g} m, error {errors[-1]:.2g} m")
    return {
        "beacons_found": len(errors),
        "beacon_error_max_m": max(errors, default=None),
        "beacon_deviation_max_m": max(deviations, default=None),
        "beacon_places": "; ".join(words),
    }
