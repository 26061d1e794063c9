"""Radars as domes: where they are, and while they are on."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.models.terrain.visibility import Radar, RadarTrack
from tests import flight

pytest.importorskip("mujoco")


def test_a_dome_follows_its_radar_and_vanishes_with_it() -> None:
    from mathnavi.renders.scene.landscape import radar_domes

    ground = flight.mountains()
    radar = Radar(3000.0, 4000.0, 900.0, 1.0)
    motions, (dome,) = radar_domes([RadarTrack(radar, 10.0, 60.0, (50.0, -20.0))], ground, 100.0)
    assert np.linalg.norm(dome.vertices, axis=1) == pytest.approx(radar.radius)
    for t, seen in ((0.0, False), (10.0, True), (40.0, True), (61.0, False)):
        pose = motions[str(dome.motion)].at(t)
        assert (pose is not None) == seen
        if pose is not None:
            x, y = 3000.0 + 50.0 * (t - 10.0), 4000.0 - 20.0 * (t - 10.0)
            np.testing.assert_allclose(pose.pos, (x, y, float(ground.height(x, y)) + radar.mast), atol=5.0)
