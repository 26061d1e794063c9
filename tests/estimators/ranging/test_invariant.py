"""What is invariant about the filter on SE(2), and what that is worth beside the filter in coordinates."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from mathnavi.estimators.invariant.lie_groups import SE2
from mathnavi.estimators.ranging.pose_filter import RangeEkf, RangeIekf
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.field.curve import ellipse
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality

WIDE = ellipse(60.0, 50.0)
U = np.array([1.0, 0.4])


def task_from(pose: tuple[float, float, float], heading: float = 0.6) -> RangingMission:
    """Exact odometry, and a start whose heading is known to a deviation [rad]."""
    known = KnownStart(pose, (0.05, 0.05, heading))
    return RangingMission(WIDE, (0.0,), RangeQuality(absolute=0.05), OdometryQuality(), known, period=0.1)


def drive(kind: Any, task: RangingMission, seconds: float, ranges: Array | None = None) -> tuple[Array, Array]:
    """Pose (3,) and covariance (3, 3) after so long, by odometry and at the end by ranges."""
    estimator = kind.build(kind.Config(), task)
    n = round(seconds / task.period)
    for k in range(n + 1):
        t = k * task.period
        readings = [Measurement("odometry", t, U)]
        if k == n and ranges is not None:
            readings.append(Measurement("ranges", t, ranges))
        estimate = estimator.update(t, readings, U)
    return estimate.x, estimate.covariance


def in_its_own_axes(x: Array, P: Array) -> Array:
    R = np.eye(3)
    R[:2, :2] = SE2.from_pose(x)[:2, :2]
    axes: Array = R.T @ P @ R
    return axes


def test_the_covariance_in_the_robots_axes_does_not_depend_on_where_it_is() -> None:
    one, other = task_from((0.0, 0.0, 0.0)), task_from((5.0, -7.0, 2.0))
    np.testing.assert_allclose(
        in_its_own_axes(*drive(RangeIekf, one, 5.0)), in_its_own_axes(*drive(RangeIekf, other, 5.0)), atol=1e-12
    )


def test_poses_that_are_carried_by_odometry_are_gaussian_on_the_group_with_the_covariance_that_is_claimed() -> None:
    """A heading known to .6 rad bends the cloud of positions into a banana, of which the logarithm is Gaussian."""
    task, rng = task_from((0.0, 0.0, 0.0)), np.random.default_rng(0)
    x, P = drive(RangeIekf, task, 8.0)
    X, moved = SE2.from_pose(x), SE2.exp(8.0 * np.array([U[0], 0.0, U[1]]))
    starts = np.array([0.05, 0.05, 0.6]) * rng.standard_normal((4000, 3))
    errors = np.array([SE2.log(np.linalg.inv(X) @ SE2.exp(xi) @ moved) for xi in starts])
    np.testing.assert_allclose(np.cov(errors.T), in_its_own_axes(x, P), rtol=0.1, atol=0.02)
    assert np.all(np.abs(errors.mean(axis=0)) < 4.0 * np.sqrt(np.diag(P) / len(errors)))


def test_after_a_drive_by_odometry_ranges_leave_less_error_than_in_coordinates_and_as_much_as_is_claimed() -> None:
    """One reading moves the estimate along the banana, and the filter in coordinates along the tangent of its middle.

    The median of NEES, chi-square of 3 degrees, is 2.4.
    """
    errors, nees = {}, {}
    angles, room, start = (0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi), ellipse(9.0, 5.0), (-1.0, -1.5, 0.3)
    task = dataclasses.replace(task_from(start, 0.3), curve=room, angles=angles)
    for kind in (RangeIekf, RangeEkf):
        found = []
        for seed in range(30):
            truth = np.array(start) + np.array([0.05, 0.05, 0.3]) * np.random.default_rng(seed).standard_normal(3)
            at_end = SE2.pose(SE2.from_pose(truth) @ SE2.exp(5.0 * np.array([U[0], 0.0, U[1]])))
            x, P = drive(kind, task, 5.0, room.ranges(at_end, task.alpha)[0])
            error = task.difference(x, at_end)
            found.append((np.linalg.norm(error[:2]), error @ np.linalg.solve(P, error)))
        errors[kind], nees[kind] = np.median(found, axis=0)
    assert errors[RangeIekf] < 0.8 * errors[RangeEkf]
    assert nees[RangeIekf] < 5.0 < nees[RangeEkf]
