"""Metrics of a missile's flight: the closest approach is exact, angles and the cost are those of the thesis."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL
from mathnavi.models.missile.mission import CASES, MissileMission, Target, TargetMotion
from mathnavi.sim.engine.log import AgentRecorder
from mathnavi.sim.metrics.missile import attack_angles, closest_approach, cost, references
from mathnavi.sim.records.figure_names import SUMMARY_GROUPS, is_wall_clock, label
from tests.missile import fly


def fall(offset: float, period: float, count: int = 60) -> tuple[Array, Array]:
    """Times (n,) and joints (n, 6) of a vertical fall past x = 700 m at ``offset`` m from it, 100 m/s at z = 0."""
    t = period * np.arange(count, dtype=np.float64)
    passing = 0.6180339 * t[-1]
    s = t - passing
    joints = np.zeros((count, 6))
    joints[:, 0] = 700.0 + offset
    joints[:, 1], joints[:, 4] = -100.0 * s - 4.9 * s**2, -100.0 - 9.8 * s
    joints[:, 2] = -0.5 * math.pi
    return t, joints


@given(offset=st.floats(-5.0, 5.0), period=st.sampled_from([0.004, 0.02, 0.1]))
def test_the_miss_does_not_depend_on_where_the_samples_fall(offset: float, period: float) -> None:
    t, joints = fall(offset, period)
    found = closest_approach(t, joints, PLANAR, TargetMotion.along((700.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert found.miss == pytest.approx(abs(offset), abs=1e-6)
    assert found.t == pytest.approx(0.6180339 * t[-1], abs=1e-4)
    assert PLANAR.velocity(found.x)[2] == pytest.approx(100.0, abs=1e-2)


def test_the_miss_is_measured_to_the_target_where_it_is_then() -> None:
    t, joints = fall(0.0, 0.01)
    passing = 0.6180339 * float(t[-1])
    there = TargetMotion.along((700.0 - 30.0 * passing, 0.0, 0.0), (30.0, 0.0, 0.0))
    assert closest_approach(t, joints, PLANAR, there).miss < 1e-3
    gone = TargetMotion.along((700.0, 0.0, 0.0), (30.0, 0.0, 0.0))
    distance = 30.0 * passing * 100.0 / math.hypot(100.0, 30.0)  # perpendicular to the relative velocity
    assert closest_approach(t, joints, PLANAR, gone).miss == pytest.approx(distance, rel=1e-2)


def test_a_flight_that_ends_early_is_nearest_at_its_end() -> None:
    t, joints = fall(0.0, 0.01)
    found = closest_approach(t[:20], joints[:20], PLANAR, TargetMotion.along((700.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert found.t == pytest.approx(t[19], abs=1e-6)
    assert found.miss == pytest.approx(joints[19, 1], abs=1e-5)


def test_the_angle_of_attack_is_that_between_nose_and_velocity() -> None:
    x = np.zeros((3, 10))
    x[:, 0] = 100.0, 100.0, -1.0
    x[1, 1:3] = 3.0, 4.0
    np.testing.assert_allclose(attack_angles(x, SPATIAL), [0.0, math.atan2(5.0, 100.0), math.pi], atol=1e-12)


def test_the_cost_counts_up_to_the_impact() -> None:
    mission = MissileMission((120.0, 0, 0, 0, 0, -10.0), Target((700.0, 0, 0)), CASES["SM"])
    t = np.linspace(0.0, 2.0, 21)
    x = np.tile(mission.start_state, (21, 1))
    u = np.tile([mission.body.mass * mission.body.gravity, 0.0, 0.0], (21, 1))
    assert cost(t, x, u, mission, 2.0) == pytest.approx(4.0)
    assert cost(t, x, u, mission, 1.25) == pytest.approx(2.5)


def test_a_reference_is_of_the_plan_being_flown() -> None:
    mission = MissileMission((120.0, 0, 0, 0, 0, -10.0), Target((700.0, 0, 0)), CASES["SM"])
    first, second = (
        Plan(
            np.array([t0, t0 + 5.0]), np.array([[speed, 0, 0, 0, 0, 0.0]] * 2), np.zeros((1, 3)), np.zeros(1, np.int64)
        )
        for t0, speed in ((0.5, 100.0), (1.0, 200.0))
    )
    agent = AgentRecorder("missile", [], np.zeros((4, 3)), {})
    agent.adopted(0.5, first)
    agent.adopted(1.0, second)
    speeds = references(np.array([0.0, 0.5, 0.75, 1.0]), agent.plans, mission.coordinates, mission.body)[:, 0]
    np.testing.assert_allclose(speeds, [np.nan, 100.0, 100.0, 200.0])


def test_every_figure_of_the_summary_has_a_place_in_its_tables() -> None:
    known = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    rest = {key for key in fly().summary if key not in known}
    assert rest == {"seed", "real_time_factor"}
    assert is_wall_clock("real_time_factor")
    assert label("aspect_error_deg") == ("aspect error", "deg")
