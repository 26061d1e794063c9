"""Outputs along a motion equal the readings of the moved robot, and poses that fit are found."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.observability.range_outputs import (
    STILL,
    RangeOutputs,
    different_poses,
    motion_under,
    pose_difference,
)
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.patterns import figure_eight
from tests.estimators.observability.fields import BEAN, CURVES, ELLIPSE, THESIS, THESIS_START, sensors
from tests.ranging import driven

SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
def test_outputs_along_a_motion_are_those_of_a_robot_that_drives(curve: Curve) -> None:
    outputs, start = sensors(curve, -60.0, 60.0, 180.0), np.array([0.6, -0.2, 0.4])
    motion = motion_under(lambda t: figure_eight(t, 0.5, 8.0), 2.0, 201)
    mission = RangingMission(curve, outputs.angles)
    read = [step.measurements[0].value for step in driven(mission, start, 2.0)]
    np.testing.assert_allclose(outputs.along(start, motion)[0], np.concatenate(read), atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS)
def test_the_derivative_along_a_motion_is_that_of_the_outputs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    outputs = sensors(ELLIPSE, *rng.uniform(-180.0, 180.0, 2))
    motion = motion_under(lambda t: (0.3, 0.8), 1.0, 4)
    x = ELLIPSE.draw(rng, 0.4)
    _, J = outputs.along(x, motion)
    e = 1e-6 * np.eye(3)
    numeric = np.column_stack([(outputs.along(x + d, motion)[0] - outputs.along(x - d, motion)[0]) / 2e-6 for d in e])
    np.testing.assert_allclose(J, numeric, rtol=1e-5, atol=1e-6 * np.abs(J).max())


def test_outside_the_wall_nothing_is_read() -> None:
    assert np.isnan(THESIS.at(np.array([5.0, 0.0, 0.0]))[0]).all()
    y, _ = THESIS.along(np.array([3.4, 0.0, 0.0]), motion_under(lambda t: (1.0, 0.0), 1.0, 3))
    assert list(np.isnan(y)) == [False, False, True, True, True, True]


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS)
def test_a_pose_that_fits_is_found_from_nearby(seed: int) -> None:
    rng = np.random.default_rng(seed)
    outputs, x = sensors(ELLIPSE, -60.0, 60.0), ELLIPSE.draw(rng, 0.5)
    motion = motion_under(lambda t: (0.2, 1.0), 1.0, 10)
    y, _ = outputs.along(x, motion)
    found = outputs.fit(y, x + rng.normal(0.0, 0.02, 3), motion)
    assert found is not None
    np.testing.assert_allclose(found, x, atol=1e-7)


def test_where_many_poses_fit_one_near_the_start_is_found() -> None:
    y, _ = THESIS.at(THESIS_START)
    start = THESIS_START + np.array([0.05, 0.02, -0.03])
    found = THESIS.fit(y, start)
    assert found is not None
    np.testing.assert_allclose(THESIS.at(found)[0], y, atol=1e-9)
    _, J = THESIS.at(found)
    along = np.linalg.svd(J)[2][-1]  # the feasible curve: the step there was across it
    assert abs(along @ (found - start)) < 0.1 * np.linalg.norm(found - start)


@pytest.mark.parametrize("y", [[1.0, 50.0], [30.0, 30.0]])
def test_ranges_that_no_pose_reads_are_not_fitted(y: list[float]) -> None:
    assert THESIS.fit(np.array(y), THESIS_START) is None
    assert THESIS.fit(np.array(y), np.array([9.0, 9.0, 0.0])) is None


def test_rates_are_the_derivative_of_the_outputs_in_time() -> None:
    outputs, x, u, dt = sensors(BEAN, 0.0, 100.0), np.array([0.8, 0.1, -0.7]), (0.4, -0.6), 1e-5
    ahead = outputs.along(x, motion_under(lambda t: u, dt, 2))[0][2:]
    behind = outputs.along(x, motion_under(lambda t: (-u[0], -u[1]), dt, 2))[0][2:]
    np.testing.assert_allclose(outputs.rate(x, u), (ahead - behind) / (2.0 * dt), atol=1e-8)


def test_headings_are_compared_the_short_way_round() -> None:
    a, b = np.array([1.0, 2.0, math.pi - 0.1]), np.array([1.0, 2.0, -math.pi + 0.1])
    np.testing.assert_allclose(pose_difference(a, b), [0.0, 0.0, -0.2], atol=1e-12)
    assert len(different_poses(np.array([a, b + np.array([0.0, 0.0, 4.0 * math.pi]), a]), 0.3)) == 1
    assert len(different_poses(np.array([a, b, a]), 0.1)) == 2


def test_a_motion_is_seen_from_its_start() -> None:
    motion = motion_under(lambda t: (1.0, 0.5 * math.pi), 1.0, 50)
    np.testing.assert_allclose(motion[0], 0.0)
    np.testing.assert_allclose(motion[-1], [2.0 / math.pi, 2.0 / math.pi, 0.5 * math.pi], atol=1e-12)
    assert STILL.shape == (1, 3)


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match=r"angles = \(\); allowed"):
        RangeOutputs(ELLIPSE, ())
    for duration, instants in ((0.0, 5), (math.nan, 5), (1.0, 1)):
        with pytest.raises(ValueError, match=r"duration = .*allowed"):
            motion_under(lambda t: (1.0, 0.0), duration, instants)
