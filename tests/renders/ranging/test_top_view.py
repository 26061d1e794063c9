"""The view from above holds all that it is made for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.renders.ranging.scene import OPTICS, top_view


@pytest.mark.parametrize("beacons", [[], [(9.0, 2.0), (-3.0, -12.0)], [(0.0, 30.0)]])
def test_the_view_from_above_holds_the_wall_and_the_beacons_outside_it(beacons: list[tuple[float, float]]) -> None:
    wall = [(-3.8, -1.4), (3.8, 1.4)]
    points, aspect = np.array([*wall, *beacons]), 16.0 / 9.0
    view = top_view(points, aspect)
    half = view.distance * math.tan(math.radians(0.5 * OPTICS["top"].field_of_view))
    assert (np.abs(points - view.lookat[:2]) < half * np.array([aspect, 1.0])).all()
