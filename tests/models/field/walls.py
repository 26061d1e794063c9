"""Walls that tests are about: a furnished room, and a hall of pillars."""

from __future__ import annotations

import math

from numpy.random import Generator

from mathnavi.models.field.polygon import Polygon

FURNISHED = Polygon(
    (
        ((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (3.5, 4.0), (3.5, 5.0), (0.0, 5.0)),
        ((1.0, 1.2), (2.4, 1.2), (2.4, 2.0), (1.0, 2.0)),
        ((4.0, 2.4), (4.6, 2.9), (4.1, 3.5), (3.5, 3.0)),
        ((0.8, 3.6), (1.2, 3.6), (1.2, 4.0), (0.8, 4.0)),
    ),
    "furnished room",
)


def pillars(rng: Generator, count: int = 10) -> Polygon:
    """Hall with ``count`` x ``count`` square pillars, each turned as drawn."""
    side = 1.2 * count
    holes = []
    for i in range(count):
        for j in range(count):
            x, y = 1.2 * (i + 0.5) + rng.uniform(-0.2, 0.2), 1.2 * (j + 0.5) + rng.uniform(-0.2, 0.2)
            turn = rng.uniform(0.0, math.pi)
            corners = [turn + 0.5 * math.pi * k for k in range(4)]
            holes.append(tuple((x + 0.3 * math.cos(a), y + 0.3 * math.sin(a)) for a in corners))
    return Polygon((((0.0, 0.0), (side, 0.0), (side, side), (0.0, side)), *holes), "pillars")
