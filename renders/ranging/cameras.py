"""Views of a robot in its field: from above, the whole field in sight, and from behind it at a slant.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.models.field.arena import WALL_HEIGHT, WALL_THICKNESS
from mathnavi.models.field.curve import Curve
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.renders.stage import Optics, View

# The backdrop stands at 0.57 of the far plane, which therefore is far.
OPTICS = {"top": Optics(11.0, 2.0, 150.0), "chase": Optics(42.0, 0.1, 40.0)}
# Left, right, top and bottom of the parts of a picture that are free of words: above the panels, between them.
FREE = ((0.02, 0.98, 0.13, 0.745), (0.222, 0.805, 0.11, 0.95))
CHASE_DISTANCE, CHASE_ELEVATION = 2.7, -38.0  # [m], [degrees]
CHASE_MEMORY = 2.0  # [s] before and after, over which the camera behind the robot takes the mean of its headings
CHASE_AHEAD = 0.15  # [m] point of aim of that camera in front of the robot


def top_view(curve: Curve, aspect: float) -> View:
    """View from above in which the field fills the free part of a picture of that width over height."""
    reach = 2.0 * WALL_THICKNESS
    low, high = curve.polyline.min(axis=0) - reach, curve.polyline.max(axis=0) + reach
    wide, tall = high - low
    tangent = math.tan(math.radians(OPTICS["top"].field_of_view) / 2.0)
    heights = [max(wide / ((right - left) * aspect), tall / (bottom - top)) for left, right, top, bottom in FREE]
    k = int(np.argmin(heights))
    left, right, top, bottom = FREE[k]
    seen = heights[k]  # [m] from the lower to the upper edge of the picture
    middle = 0.5 * (low + high) - seen * np.array([(0.5 * (left + right) - 0.5) * aspect, 0.5 - 0.5 * (top + bottom)])
    return View(np.array([*middle, WALL_HEIGHT]), 0.5 * seen / tangent, 90.0, -89.99)


def chase_view(run: RangingRun, t: float, turn: float) -> View:
    """Behind the robot, slower to turn than it is; ``turn`` is in degrees."""
    times = np.linspace(max(0.0, t - CHASE_MEMORY), min(run.duration, t + CHASE_MEMORY), 41)
    headings = np.array([run.pose[run.index(float(s)), 2] for s in times])
    azimuth = math.atan2(float(np.sin(headings).mean()), float(np.cos(headings).mean()))
    ahead = CHASE_AHEAD * np.array([math.cos(azimuth), math.sin(azimuth)])
    lookat = np.array([*(run.joints(t)[:2] + ahead), 0.1])
    return View(lookat, CHASE_DISTANCE, math.degrees(azimuth) + turn, CHASE_ELEVATION)
