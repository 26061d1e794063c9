"""Radars as domes: where they are, and while they are on."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.models.terrain.visibility import Radar, RadarTrack
from tests import flight

pytest.importorskip("mujoco")


def test_a_dome_follows_its_radar_and_vanishes_with_it() -> None:
    from mathnavi.renders.landscape import add_domes, landscape, place_domes

    ground = flight.mountains()
    track = RadarTrack(Radar(3000.0, 4000.0, 900.0, 1.0), 10.0, 60.0, (50.0, -20.0))
    spec = landscape(ground, 64, 36, 0)
    add_domes(spec, ground, (track,))
    model = spec.compile()
    dome = model.geom("radar 0 true")
    for t, seen in ((0.0, False), (10.0, True), (40.0, True), (60.0, False)):
        place_domes(model, ground, (track,), t, 0.3)
        assert dome.rgba[3] == pytest.approx(0.3 if seen else 0.0)
        if seen:
            x, y = 3000.0 + 50.0 * (t - 10.0), 4000.0 - 20.0 * (t - 10.0)
            np.testing.assert_allclose(dome.pos, (x, y, float(ground.height(x, y))), atol=1e-3)
    assert model.geom("radar 0 tall").pos[2] > dome.pos[2]
