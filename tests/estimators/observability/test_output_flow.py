"""Output flows distinguish feasible states as soon as the robot moves, and only then (Proposition C.1)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.observability.continuation import trace_curve
from mathnavi.estimators.observability.feasible_set import FeasibleSet, feasible_set
from mathnavi.estimators.observability.output_flow import equal_rates, intersection, mismatch
from mathnavi.estimators.observability.range_outputs import RangeOutputs, motion_under, pose_difference
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from tests.estimators.observability.fields import CIRCLE, EGG, ELLIPSE, THESIS, THESIS_START, sensors

TURNING = (0.5, 0.5)


def rate_mismatch(x_1: Array, x_0: Array) -> float:
    """[m/s] the largest difference of the output rates of two states: zero where Q is."""
    differences, _ = equal_rates(THESIS, x_0, TURNING)(x_1)
    return float(np.abs(differences).max())


@pytest.fixture(scope="module")
def feasible() -> FeasibleSet:
    return feasible_set(THESIS, THESIS.at(THESIS_START)[0], step=0.03)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_state_and_its_image_have_one_output_flow(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = motion_under(lambda t: (0.3, 1.0), 0.5, 5)
    x, other = ELLIPSE.draw(rng, 0.3), ELLIPSE.draw(rng, 0.3)
    image = ELLIPSE.images(x)[1]
    assert mismatch(THESIS, image, x, motion) < 1e-12
    assert rate_mismatch(image, x) < 1e-10
    assert mismatch(THESIS, other, x, motion) == pytest.approx(mismatch(THESIS, x, other, motion))
    assert mismatch(THESIS, np.array([3.7, 0.0, 0.0]), x, motion_under(lambda t: (1.0, 0.0), 1.0)) == math.inf


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_for_a_short_time_the_mismatch_is_that_of_the_rates(seed: int) -> None:
    rng, T = np.random.default_rng(seed), 1e-5
    x, other = ELLIPSE.draw(rng, 0.4), ELLIPSE.draw(rng, 0.4)
    short = mismatch(THESIS, other, x, motion_under(lambda t: TURNING, T, 2)) / T
    assert short == pytest.approx(rate_mismatch(other, x), rel=1e-2, abs=1e-2)


def test_equal_rates_are_a_curve_on_which_the_output_flow_differs() -> None:
    """{Q = 0} contains the states of the same output flow, and more."""
    curve = trace_curve(equal_rates(THESIS, THESIS_START, TURNING), THESIS_START, step=0.05, difference=pose_difference)
    assert len(curve.points) > 20
    motion = motion_under(lambda t: TURNING, 0.3)
    mismatches = np.array([mismatch(THESIS, x, THESIS_START, motion) for x in curve.points])
    far = np.linalg.norm(pose_difference(curve.points, THESIS_START), axis=1) > 0.1
    assert max(rate_mismatch(x, THESIS_START) for x in curve.points) < 1e-9
    assert mismatches[far].min() > 1e-3


@pytest.mark.parametrize("u", [(0.5, 0.0), (0.0, 1.0), (0.5, 0.5), (0.5, -0.5)])
def test_in_motion_only_the_image_is_left(feasible: FeasibleSet, u: tuple[float, float]) -> None:
    found = intersection(THESIS, THESIS_START, motion_under(lambda t: u, 0.5), feasible)
    (other,) = found.others
    np.testing.assert_allclose(pose_difference(other, ELLIPSE.images(THESIS_START)[1]), 0.0, atol=1e-6)
    assert found.isolation > 1e-2
    assert found.is_singleton
    assert found.nearest == pytest.approx(np.linalg.norm(pose_difference(other, THESIS_START)))


def test_standing_still_two_sensors_leave_a_curve(feasible: FeasibleSet) -> None:
    found = intersection(THESIS, THESIS_START, motion_under(lambda t: (0.0, 0.0), 0.5), feasible)
    assert found.nearest == 0.0
    assert not found.is_singleton


def test_in_a_circle_no_motion_isolates_a_state() -> None:
    outputs, x = sensors(CIRCLE, -60.0, 60.0), np.array([0.7, 0.2, 0.3])
    feasible = feasible_set(outputs, outputs.at(x)[0], step=0.1)
    assert intersection(outputs, x, motion_under(lambda t: TURNING, 0.5), feasible).nearest == 0.0


@pytest.mark.parametrize(("curve", "left"), [(ELLIPSE, 1), (EGG, 0)])
def test_three_sensors_leave_the_images_in_motion_and_may_leave_more_standing_still(curve: Curve, left: int) -> None:
    outputs: RangeOutputs = sensors(curve, 0.0, 120.0, 240.0)
    x = np.array([0.8, -0.4, 0.5])
    feasible = feasible_set(outputs, outputs.at(x)[0])
    moving = intersection(outputs, x, motion_under(lambda t: TURNING, 0.5), feasible)
    still = intersection(outputs, x, motion_under(lambda t: (0.0, 0.0), 0.5), feasible)
    assert len(moving.others) == left
    assert len(still.others) == len(feasible.points) - 1 > left


def test_a_motion_out_of_the_field_is_refused(feasible: FeasibleSet) -> None:
    with pytest.raises(ValueError, match="the motion leaves the field"):
        intersection(THESIS, THESIS_START, motion_under(lambda t: (9.0, 0.0), 1.0), feasible)
