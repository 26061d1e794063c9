"""Views of a missile: next to it, from the side of its whole path, next to its target.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.renders.framing import Box, framing
from mathnavi.renders.missile.run_data import MissileRun
from mathnavi.renders.stage import Optics, View

OPTICS = {"chase": Optics(40.0, 1e-3, 40.0), "side": Optics(22.0, 0.05, 60.0), "target": Optics(48.0, 1e-3, 40.0)}
SIDE_BOX = Box(0.07, 0.93, 0.13, 0.60)  # what the path takes of the picture; a low one lies on its lower edge
SIDE_ELEVATION = -5.0  # [degrees]
CHASE_DISTANCE = 11.5  # [m]
TARGET_AZIMUTH, TARGET_ELEVATION = 54.0, -9.0  # [degrees]
TARGET_DISTANCE = 24.0  # [m] at least
TARGET_SHARE = 0.62  # of the picture's height: what lies between the target and the missile


def chase_view(run: MissileRun, t: float, turn: float) -> View:
    """Return the view behind and next to the missile; the steeper it flies, the more from above. ``turn`` is in
    degrees.
    """
    window = np.linspace(max(0.0, t - 0.5), min(run.duration, t + 0.5), 11)
    pitch = float(np.mean([run.joints(s)[run.coordinates.joints.index("theta")] for s in window]))
    down = max(0.0, -pitch) / (0.5 * math.pi)
    lookat = run.place(t) + np.array([0.9, 0.0, -0.2 * down])
    return View(lookat, CHASE_DISTANCE, 58.0 + turn, -8.0 - 54.0 * down)


def target_view(run: MissileRun, t: float) -> View:
    """Return the view next to the target, with it and the missile in the picture: the camera comes nearer as the
    missile does.
    """
    tall = 2.0 * math.tan(math.radians(OPTICS["target"].field_of_view) / 2.0) * TARGET_SHARE
    distance = max(run.distance(t) / tall, TARGET_DISTANCE)
    lookat = 0.5 * (run.target_at(t) + run.place(t)) + np.array([0.0, 0.0, 2.0])
    return View(lookat, distance, TARGET_AZIMUTH, TARGET_ELEVATION)


def side_view(run: MissileRun, aspect: float) -> View:
    """View from the side, so that path and target fill the free part of a picture of that width over height."""
    ends = np.array([run.target_at(t) for t in (0.0, run.duration)])
    points = np.vstack([run.path, ends, *(run.plan_ahead(plan.t_start, 40) for plan in run.log.plans[:1])])
    low, high = points.min(axis=0), points.max(axis=0)
    box = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, high[2])])
    return framing(box, SIDE_BOX, OPTICS["side"], aspect, (90.0, SIDE_ELEVATION), low=True)
