"""Line of sight and radars."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar, RadarTrack
from tests import flight

RIDGE = HeightField(np.array([[0.0, 0.0, 100.0, 0.0, 0.0]] * 5), 100.0)  # runs north at x = 200 m
ROUGH = HeightField(np.random.default_rng(0).uniform(0.0, 300.0, (7, 9)), 100.0)
places = st.tuples(st.floats(0.0, 800.0), st.floats(0.0, 600.0), st.floats(-10.0, 500.0))


@given(places, places)
def test_line_of_sight_is_symmetric(p: tuple[float, ...], q: tuple[float, ...]) -> None:
    assert ROUGH.line_of_sight(p, q) == ROUGH.line_of_sight(q, p)


@given(places, places)
def test_line_of_sight_is_a_clearance_of_the_segment(p: tuple[float, ...], q: tuple[float, ...]) -> None:
    clearance = ROUGH.arc_clearance(p, np.subtract(q, p), np.zeros(3), 1.0)
    if abs(clearance) > 1e-5:
        assert ROUGH.line_of_sight(p, q) == (clearance > 0.0)


def test_a_ridge_hides_what_lies_behind_and_below_it() -> None:
    observer = [50.0, 200.0, 50.0]
    assert not RIDGE.line_of_sight(observer, [350.0, 200.0, 50.0])
    assert RIDGE.line_of_sight(observer, [350.0, 200.0, 151.0])
    assert not RIDGE.line_of_sight(observer, [350.0, 200.0, 149.0])
    assert RIDGE.line_of_sight(observer, [50.0, 390.0, 1.0])


def test_points_that_rest_on_the_ground_can_see_and_be_seen() -> None:
    crest, foot = [200.0, 130.0, 100.0], [50.0, 270.0, 0.0]
    assert RIDGE.line_of_sight(crest, foot)
    assert RIDGE.line_of_sight([10.0, 10.0, 0.0], [90.0, 350.0, 0.0])  # along flat ground
    assert not RIDGE.line_of_sight([10.0, 10.0, -0.001], [90.0, 350.0, 1.0])


def test_nothing_is_seen_beyond_the_map() -> None:
    assert not RIDGE.line_of_sight([50.0, 200.0, 500.0], [-1.0, 200.0, 500.0])


def test_visible_is_line_of_sight_of_each() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform([0.0, 0.0, 0.0], [800.0, 600.0, 500.0], (200, 3))
    observer = [400.0, 300.0, 310.0]
    seen = ROUGH.visible(observer, points)
    assert seen.tolist() == [ROUGH.line_of_sight(observer, point) for point in points]
    assert 0 < seen.sum() < 200
    assert ROUGH.visible(observer, np.empty((0, 3))).shape == (0,)


def test_a_radar_exposes_what_is_in_range_and_in_sight() -> None:
    radar = Radar(x=50.0, y=200.0, radius=320.0, weight=3.0, mast=50.0)
    np.testing.assert_allclose(radar.position(RIDGE), [50.0, 200.0, 50.0])
    points = [
        [350.0, 200.0, 151.0],  # 317 m away, above the ridge's shadow
        [350.0, 200.0, 149.0],  # in the shadow
        [360.0, 200.0, 170.0],  # in sight, 332 m away
        [50.0, 200.0, 50.0],  # the antenna itself
    ]
    assert radar.exposed(RIDGE, points).tolist() == [True, False, False, True]


def test_the_range_is_a_sphere_with_its_border() -> None:
    radar = Radar(x=0.0, y=0.0, radius=100.0, weight=1.0, mast=300.0)
    points = [[0.0, 0.0, 400.0], [0.0, 0.0, 400.001], [60.0, 80.0, 300.0]]
    assert radar.exposed(RIDGE, points).tolist() == [True, False, True]


def test_a_radar_off_the_map_is_refused() -> None:
    with pytest.raises(ValueError, match=r"radar: \(401\.0, 5\.0\) m is not on the terrain"):
        Radar(401.0, 5.0, 10.0, 1.0).position(RIDGE)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"x": math.nan}, "x = nan; allowed"),
        ({"y": math.inf}, "y = inf; allowed"),
        ({"radius": 0.0}, r"radius = 0\.0; allowed"),
        ({"radius": math.inf}, "radius = inf; allowed"),
        ({"weight": -1.0}, r"weight = -1\.0; allowed"),
        ({"mast": -0.5}, r"mast = -0\.5; allowed"),
    ],
)
def test_a_bad_radar_names_its_culprit(changed: dict[str, float], message: str) -> None:
    fields: dict[str, Any] = {"x": 1.0, "y": 2.0, "radius": 3.0, "weight": 4.0}
    with pytest.raises(ValueError, match=message):
        Radar(**(fields | changed))


def test_points_of_the_wrong_shape_are_named() -> None:
    with pytest.raises(ValueError, match=r"points has shape \(3,\)"):
        Radar(1.0, 2.0, 3.0, 4.0).exposed(RIDGE, [1.0, 2.0, 3.0])


def test_a_radar_that_drives_is_where_it_drives_to_and_stays_at_the_edge() -> None:
    ground = flight.mountains()
    track = RadarTrack(Radar(3000.0, 4000.0, 900.0, 1.0), 10.0, 500.0, (50.0, 0.0))
    assert track.at(9.9, ground) is None
    assert track.at(500.0, ground) is None
    assert track.at(10.0, ground) == track.radar
    there = track.at(30.0, ground)
    assert there is not None
    assert (there.x, there.y) == (4000.0, 4000.0)
    last = track.at(499.0, ground)
    assert last is not None
    assert last.x == ground.width
    aslant = RadarTrack(Radar(11_000.0, 4000.0, 900.0, 1.0), 0.0, 500.0, (50.0, 20.0))
    assert aslant.at(100.0, ground) == aslant.at(20.0, ground) == Radar(ground.width, 4400.0, 900.0, 1.0)


@pytest.mark.parametrize("fields", [(math.nan,), (5.0, 5.0), (0.0, 9.0, (math.nan, 0.0))])
def test_a_track_that_cannot_be_is_refused(fields: Any) -> None:
    with pytest.raises(ValueError, match=r"radar: .*allowed"):
        RadarTrack(Radar(3000.0, 4000.0, 900.0, 1.0), *fields)


def test_who_flies_over_a_radar_that_drives_is_exposed_while_it_is_there_and_on() -> None:
    ground = flight.mountains()
    track = RadarTrack(Radar(3000.0, 4000.0, 900.0, 1.0), 10.0, 40.0, (50.0, 0.0))
    t = np.arange(0.0, 60.0, 0.5)
    over = np.column_stack([np.full(len(t), 4000.0), np.full(len(t), 4000.0), np.full(len(t), 0.0)])
    over[:, 2] = float(ground.height(4000.0, 4000.0)) + 500.0
    seen = t[track.exposed(ground, t, over)]
    assert len(seen) > 10
    # within 750 m of it, at 50 m/s, about the 30 s at which it is below
    assert 10.0 <= seen[0] <= 16.0
    assert 39.0 <= seen[-1] < 40.0
