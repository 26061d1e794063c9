"""Place of a camera from which what matters fills the free part of a picture.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.stage import View

_FAR = 1000.0  # [m] from which the search starts at least
_STEPS = 12  # centre, then fill; perspective couples the two only weakly


@dataclass(frozen=True)
class Box:
    """A part of a picture: shares of its width and height, rows counted from the top."""

    left: float
    right: float
    top: float
    bottom: float


def framing(
    points: Array, box: Box, field_of_view: float, aspect: float, sight: tuple[float, float], *, low: bool = False
) -> View:
    """View of points (m, 3) along a line of sight (azimuth, elevation) [degrees].

    ``field_of_view`` [degrees] is vertical, ``aspect`` the picture's width over its height.
    The points lie in the middle of the box, or with ``low`` on its lower edge, if they are wider than tall.
    """
    tangent = math.tan(math.radians(field_of_view) / 2.0)
    far = max(_FAR, 2.0 * float(np.ptp(points, axis=0).max()))
    view = View(0.5 * (points.min(axis=0) + points.max(axis=0)), far, *sight)
    forward = (view.lookat - view.eye) / far
    sideways = np.cross(forward, (0.0, 0.0, 1.0))
    sideways /= np.linalg.norm(sideways)
    upward = np.cross(sideways, forward)
    for _ in range(_STEPS):
        ahead = points - view.eye
        depth = ahead @ forward
        across, along = ahead @ sideways / depth / (tangent * aspect), ahead @ upward / depth / tangent
        wide, tall = np.ptp(across) / (2.0 * (box.right - box.left)), np.ptp(along) / (2.0 * (box.bottom - box.top))
        x = 0.5 * (across.min() + across.max()) - (box.left + box.right - 1.0)
        middle = 0.5 * (along.min() + along.max()) - (1.0 - box.top - box.bottom)
        y = along.min() - (1.0 - 2.0 * box.bottom) if low else middle
        lookat = view.lookat + view.distance * tangent * (aspect * x * sideways + y * upward)
        view = View(lookat, view.distance * max(wide, tall), *sight)
    return view
