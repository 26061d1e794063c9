"""Lines of a scene that MuJoCo draws keep to what can be seen."""

from __future__ import annotations

import mujoco
import numpy as np

from mathnavi.renders.stage import Optics, Stage, View
from tests.renders.drawn import needs_opengl

WORLD = '<mujoco><statistic extent="10"/><worldbody/></mujoco>'


@needs_opengl
def test_of_a_line_what_is_behind_the_camera_is_left_out_and_points_are_as_far_apart_as_can_be_seen() -> None:
    stage = Stage(mujoco.MjModel.from_xml_string(WORLD), 64, 48, glow=0.5)
    try:
        stage.look(View.between(np.array([0.0, -8.0, 0.0]), np.zeros(3)), Optics(45.0, 0.01, 10.0), (0,))
        stage.begin(fog=True)
        behind, ahead = np.linspace(-100.0, -9.0, 50), np.linspace(-7.0, 0.0, 5000)
        points = np.column_stack([np.ones(5050), np.concatenate([behind, ahead]), np.zeros(5050)])
        (part,) = stage.drawable(points)
        assert len(part) < 500
        assert (part[0] == points[49]).all()  # the last point behind, from which the line comes into sight
        assert (part[-1] == points[-1]).all()
        assert stage.drawable(points[:50]) == []
    finally:
        stage.close()
