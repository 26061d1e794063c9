"""Regions of first estimates from which an estimator converges, for one run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.studies.ranging.observability.figure import Region
from mathnavi.sim.studies.ranging.observability.maps import (
    STANDARD,
    MapCase,
    RegionAttempt,
    drawn_start,
    driven_path,
    egged,
)


@dataclass(frozen=True)
class WantedRegion:
    """A run, and the places of the first estimate from which it is tried."""

    title: str
    case: MapCase
    start: Array  # (3,)
    spacing: float  # [m]
    attempts: Sequence[RegionAttempt]

    def drawn(self, shares: Sequence[float]) -> Region:
        """Region of the picture, of the shares that converged by place."""
        c, s = math.cos(self.start[2]), math.sin(self.start[2])
        path = self.start[:2] + driven_path()[:, :2] @ np.array([[c, s], [-s, c]])
        places = np.array([attempt.place for attempt in self.attempts])
        return Region(self.title, self.case.curve, self.start, places, np.array(shares), self.spacing, path)


def wanted_regions(places: int, headings: int, seconds: float) -> list[WantedRegion]:
    """Regions of two estimators in the standard ellipse, and of the observer where the wall is nearly symmetric."""
    ellipse, egg = MapCase("ellipse", 0.0, STANDARD, "2t"), MapCase("egg", 0.1, egged(0.1), "2s")
    regions = []
    for case, estimator, title in (
        (ellipse, "observer", "(g) observer, 2t"),
        (ellipse, "EKF", "(h) EKF, 2t"),
        (egg, "observer", "(i) observer, nearly symmetric"),
    ):
        start = drawn_start(case.curve, np.random.default_rng(4))
        spacing = math.sqrt(case.curve.area / places)
        x_1, x_2, phi = start.tolist()
        attempts = [
            RegionAttempt(case, estimator, (x_1, x_2, phi), place, headings, seconds) for place in _grid(case, spacing)
        ]
        regions.append(WantedRegion(title, case, start, spacing, attempts))
    return regions


def _grid(case: MapCase, spacing: float) -> list[tuple[float, float]]:
    """Places [m] on a square grid within the wall."""
    low, high = case.curve.polyline.min(axis=0), case.curve.polyline.max(axis=0)
    axes: list[Array] = []
    for a, b in zip(low, high, strict=True):
        n = max(1, int((b - a) / spacing))
        axes.append(0.5 * (a + b) + spacing * (np.arange(n) - 0.5 * (n - 1)))
    return [(float(x), float(y)) for x in axes[0] for y in axes[1] if case.curve.contains(np.array([x, y]))]
