"""The tracker: exploring inputs as they are, and the way back onto a path."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.active_sensing.belief import pose_on
from mathnavi.controllers.active_sensing.planner import PathTracker
from mathnavi.controllers.active_sensing.policies import InputSequence
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.unicycle.mission import DrivePhase, RangingMission
from tests.controllers.active_sensing.robots import START, built, mission, winding_path

SPEED, BANDWIDTH = 0.5, 2.0


def along(phase: DrivePhase, u: tuple[float, float] = (SPEED, 0.4), duration: float = 40.0) -> Plan:
    return InputSequence(np.array([duration]), np.array([u]), phase).plan(0.0, START, math.nan)


def error(x: Array, plan: Plan, t: float) -> tuple[float, float]:
    """|e| [m] and d [rad] of a pose (3,) from a plan."""
    difference = pose_on(plan, t) - x
    return math.hypot(difference[0], difference[1]), abs(math.remainder(float(difference[2]), 2.0 * math.pi))


def followed(task: RangingMission, plan: Plan, x: Array, duration: float) -> list[tuple[float, float]]:
    tracker, errors = PathTracker(task, BANDWIDTH, SPEED), []
    for k in range(round(duration / task.period)):
        t = k * task.period
        errors.append(error(x, plan, t))
        x = task.flow(x, tracker.command(t, Estimate(t, x), plan), task.period)
    return errors


@given(x=st.floats(-0.3, 0.3), y=st.floats(-0.3, 0.3), turned=st.floats(-1.5, 1.5), rate=st.floats(-0.8, 0.8))
@settings(max_examples=15, deadline=None)
def test_from_off_the_path_it_comes_onto_it_and_its_function_falls(
    x: float, y: float, turned: float, rate: float
) -> None:
    task, plan = mission(speed_max=10.0, turn_rate_max=50.0), along(DrivePhase.CRUISE, (SPEED, rate))
    errors = followed(task, plan, START + np.array([x, y, turned]), 12.0)
    V = [0.5 * (BANDWIDTH / SPEED) ** 2 * e**2 + 0.5 * d**2 for e, d in errors]
    assert all(later <= earlier + 2e-3 * V[0] + 1e-12 for earlier, later in itertools.pairwise(V))
    assert V[-1] <= 1e-3 * V[0] + 1e-12


def test_near_the_path_the_deviation_across_it_is_critically_damped() -> None:
    task, plan = mission(), along(DrivePhase.CRUISE, (SPEED, 0.0))
    across = START + 0.01 * np.array([-math.sin(START[2]), math.cos(START[2]), 0.0])
    errors = followed(task, plan, across, 4.0)
    for k in (50, 100, 200):
        t = k * task.period
        assert errors[k][0] == pytest.approx(0.01 * (1.0 + BANDWIDTH * t) * math.exp(-BANDWIDTH * t), abs=2e-4)


def test_inputs_stay_within_what_the_robot_can_do() -> None:
    task, plan = mission(speed_max=0.6, turn_rate_max=0.7), along(DrivePhase.CRUISE)
    tracker, rng = PathTracker(task, BANDWIDTH, SPEED), np.random.default_rng(0)
    for t in rng.uniform(0.0, 50.0, 100):
        u = tracker.command(t, Estimate(t, rng.uniform(-3.0, 3.0, 3)), plan)
        assert (np.abs(u) <= np.array([0.6, 0.7]) + 1e-12).all()


@pytest.mark.parametrize("phase", [DrivePhase.OPTIMISED, DrivePhase.MANOEUVRE])
def test_inputs_that_explore_are_driven_whatever_the_estimate_says(phase: DrivePhase) -> None:
    tracker = PathTracker(mission(), BANDWIDTH, SPEED)
    for x in (START, np.array([-3.0, 1.0, 2.0])):
        np.testing.assert_allclose(tracker.command(1.0, Estimate(1.0, x), along(phase)), [SPEED, 0.4])


@pytest.mark.parametrize("phase", list(DrivePhase)[:2])
def test_after_the_end_of_a_plan_that_explores_the_robot_rests(phase: DrivePhase) -> None:
    tracker, plan = PathTracker(mission(), BANDWIDTH, SPEED), along(phase, duration=1.0)
    np.testing.assert_array_equal(tracker.command(1.5, Estimate(1.5, START), plan), [0.0, 0.0])
    np.testing.assert_allclose(tracker.command(0.995, Estimate(0.995, START), plan), [0.5 * SPEED, 0.2])


def test_a_pose_on_a_plan_is_where_its_inputs_lead() -> None:
    task = mission()
    plan = winding_path(task)
    x, h = plan.x[0], 1e-3
    for k in range(round(plan.t_end / h)):
        middle = (k + 0.5) * h
        arc = int(np.searchsorted(plan.t, middle, side="right")) - 1
        x = task.flow(x, plan.u[arc], h)
    np.testing.assert_allclose(pose_on(plan, plan.t_end), x, atol=2e-3)
    np.testing.assert_array_equal(pose_on(plan, -1.0), plan.x[0])
    np.testing.assert_array_equal(pose_on(plan, plan.t_end + 9.0), plan.x[-1])


def test_a_bandwidth_too_fast_for_the_commands_is_refused() -> None:
    with pytest.raises(ValueError, match=r"bandwidth = 21\.0; allowed: at most 20 rad/s"):
        built(mission(), bandwidth=21.0)
