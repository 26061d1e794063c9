"""Frame of a mission: the world turned about the vertical, so that no nose has to point along the axis of pitch.

A missile that does not roll has the attitude R_y(theta) R_z(psi), which is singular where the nose points along Y, at
psi = +-90 degrees. The axis Y is a choice. A flight surely takes three directions, the nose d_0 at the start, the line
d_1 from the start to the target and the nose d_2 at the target; they are at the angles psi_i = asin(d_i . Y) to the
plane X, Z. The azimuth A of X is that with

    min max(|psi_0| - 50°, |psi_1|, |psi_2|),      Y = (-sin A, cos A, 0),      |psi_0| <= 80°,      d_0 . X > 0,

for a flight leaves the yaw of its start soon, and its planners of pitch and yaw need a line near their plane. The world
itself, A = 0, is kept where it has at most 30 degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array

Point = tuple[float, float, float]

GOOD, LEFT_SOON = math.radians(30.0), math.radians(50.0)
"""greatest yaw [rad] with which the frame of the world is kept, and yaw that counts less at the start"""
MOST_AT_START = math.radians(80.0)
"""greatest yaw [rad] at the start"""
_ROUND_OFF = 1e-9


@dataclass(frozen=True)
class MissionFrame:
    """A frame with X ahead, Y to the left, Z up; X is at a whole number of degrees from the x of the world."""

    azimuth: int = 0  # [deg] to the left

    @staticmethod
    def for_flight(heading: float, start: Point, target: Point, aspect_angle: float, *, planar: bool) -> MissionFrame:
        """The frame of a level start at ``heading`` [deg] to the left; places are those of the world.

        The target is hit at ``aspect_angle`` [deg] over the horizontal and azimuth 0. A ``planar`` flight keeps x, z.
        """
        h, a = math.radians(heading), math.radians(aspect_angle)
        line = np.array(target) - np.array(start)
        length = float(np.linalg.norm(line))
        directions = np.array(
            [
                (math.cos(h), math.sin(h), 0.0),
                line / length if length > 0.0 else (1.0, 0.0, 0.0),
                (math.cos(a), 0.0, math.sin(a)),
            ]
        )
        frames = [MissionFrame(azimuth) for azimuth in ((0, 180) if planar else range(-179, 181))]
        upright = [
            frame for frame in frames if float(frame.axes[0] @ directions[0]) >= math.cos(MOST_AT_START) - _ROUND_OFF
        ]
        world = MissionFrame()
        if world in upright and world._worst(directions) <= GOOD + _ROUND_OFF:
            return world
        return min(upright, key=lambda frame: (round(frame._worst(directions), 9), abs(frame.azimuth)))

    @property
    def axes(self) -> Array:
        """Unit vectors X, Y, Z (3, 3), one in each row, of the world."""
        c, s = math.cos(math.radians(self.azimuth)), math.sin(math.radians(self.azimuth))
        if self.azimuth % 180 == 0:
            s = 0.0  # not 1e-16: a flight in the plane has to stay there
        return np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)])

    def turned(self, vector: Point) -> Point:
        """Transform a vector or place (3,) of the world to this frame."""
        x, y, z = (self.axes @ np.array(vector)).tolist() if self.azimuth else vector
        return x, y, z

    def _worst(self, directions: Array) -> float:
        start, *others = np.arcsin(np.minimum(np.abs(directions @ self.axes[1]), 1.0)).tolist()
        return float(max(start - LEFT_SOON, *others))
