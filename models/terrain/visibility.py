"""Radars: points within their range and in their line of sight are exposed (thesis, A.7, Figure A.6)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike

from mathnavi.interfaces.bounds import FINITE, TWO_FINITE_NUMBERS, Finite, Positive, configuration
from mathnavi.interfaces.errors import ArgumentError, FieldError, MissionError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.kernels import Booleans


@configuration(prefix="radar: ")
class Radar:
    """A radar on a mast. The larger its ``weight``, the higher a planner sets the costs c_ij in its sight."""

    x: Finite  # [m] east, map frame
    y: Finite  # [m] north, map frame
    radius: Positive  # [m] of the sphere around its antenna
    weight: Annotated[float, Interval(ge=0.0, le=1e6), FINITE]
    mast: Annotated[float, Interval(ge=0.0, le=1e6), FINITE] = 10.0  # [m] height of the antenna above the ground

    def position(self, terrain: HeightField) -> Array:
        """Position (3,) [m] of the antenna on ``terrain``, map frame.

        Raises MissionError for a radar off the map.
        """
        if not terrain.contains(self.x, self.y):
            raise MissionError(
                f"radar: ({self.x}, {self.y}) m is not on the terrain {terrain.name!r}; "
                f"allowed: 0 to {terrain.width} m east and 0 to {terrain.depth} m north"
            )
        return np.array([self.x, self.y, float(terrain.height(self.x, self.y)) + self.mast])

    def exposed(self, terrain: HeightField, points: ArrayLike) -> Booleans:
        """True (n,) where points (n, 3) [m] are within the radius and in line of sight.

        Raises ArgumentError for another shape.
        """
        antenna = self.position(terrain)
        positions = np.asarray(points, dtype=np.float64)
        if positions.ndim != 2 or positions.shape[1] != 3:
            raise ArgumentError(f"points has shape {positions.shape}; allowed: (n, 3)")
        exposed: Booleans = np.linalg.norm(positions - antenna, axis=1) <= self.radius
        exposed[exposed] = terrain.visible(antenna, positions[exposed])  # sight lines only where the range allows
        return exposed


@configuration(prefix="radar: ")
class RadarTrack:
    """A radar that is on from ``time`` to ``until`` [s] and drives at a constant velocity, on the map."""

    radar: Radar  # where it is when it is switched on
    time: Finite = 0.0  # [s]
    until: float = math.inf  # [s]
    velocity: Annotated[tuple[float, float], TWO_FINITE_NUMBERS] = (0.0, 0.0)  # [m/s] east, north

    def __post_init__(self) -> None:
        if not self.until > self.time:
            raise FieldError(f"radar: until = {self.until!r}; allowed: later than time = {self.time:g} s")

    def at(self, t: float, terrain: HeightField) -> Radar | None:
        """Radar at ``t`` [s]; None while it is off. Where it reaches the edge of the map it stays."""
        if not self.time <= t < self.until:
            return None
        elapsed = t - self.time
        for place, velocity, side in zip(
            (self.radar.x, self.radar.y), self.velocity, (terrain.width, terrain.depth), strict=True
        ):
            if velocity != 0.0:
                elapsed = min(elapsed, ((side if velocity > 0.0 else 0.0) - place) / velocity)
        east, north = self.velocity
        x = min(max(self.radar.x + east * elapsed, 0.0), terrain.width)  # but for rounding on it already
        y = min(max(self.radar.y + north * elapsed, 0.0), terrain.depth)
        return replace(self.radar, x=x, y=y)

    def exposed(self, terrain: HeightField, t: Array, points: Array) -> Booleans:
        """True (n,) where points (n, 3) [m] are exposed at times t (n,) [s]; a driving radar moves once a second."""
        exposed = np.zeros(len(t), dtype=bool)
        seconds = np.floor(t) if any(self.velocity) else np.full(len(t), self.time)
        on = (t >= self.time) & (t < self.until)
        for second in np.unique(seconds[on]):
            now = on & (seconds == second)
            radar = self.at(max(float(second), self.time), terrain)
            if radar is not None:
                exposed[now] = radar.exposed(terrain, points[now])
        return exposed
