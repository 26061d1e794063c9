"""The frame of a mission: no direction of a flight is near the axis of pitch."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from mathnavi.models.missile.mission import MissionFrame

START = (0.0, 0.0, 10.0)


def test_every_direction_of_a_flight_is_off_the_singular_axis() -> None:
    for heading, course, aspect in product(range(-180, 181, 15), (0, 60, 90, 180, -135), (-90.0, -30.0, 0.0)):
        c, h, a = np.radians([course, heading, aspect])
        target = (700 * math.cos(c), 700 * math.sin(c), 0.0)
        frame = MissionFrame.for_flight(heading, START, target, aspect, planar=False)
        nose = frame.axes @ (math.cos(h), math.sin(h), 0.0)
        end = frame.axes @ (math.cos(a), 0.0, math.sin(a))
        assert nose[0] > 0.0, (heading, course, aspect)  # upright
        assert abs(math.degrees(math.asin(nose[1]))) <= 85.0, (heading, course, aspect)
        assert abs(math.degrees(math.asin(end[1]))) <= 60.0, (heading, course, aspect)


def test_the_world_is_kept_where_it_is_good_enough() -> None:
    assert MissionFrame.for_flight(40.0, START, (700.0, 150.0, 0.0), -90.0, planar=False) == MissionFrame(0)
    assert MissionFrame(0).turned((1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)


def test_a_planar_flight_turns_by_half_a_turn_or_not_at_all() -> None:
    frame = MissionFrame.for_flight(180.0, START, (-700.0, 0.0, 0.0), -90.0, planar=True)
    assert frame == MissionFrame(180)
    assert frame.turned((-700.0, 0.0, 5.0)) == (700.0, 0.0, 5.0)
    np.testing.assert_allclose(frame.axes @ frame.axes.T, np.eye(3), atol=1e-12)
