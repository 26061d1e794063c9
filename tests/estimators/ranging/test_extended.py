"""Kalman filters know how good they are; the unscented one is the extended where a range is linear."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.ranging.pose_filter import PoseFilterConfig, RangeEkf
from mathnavi.estimators.ranging.unscented import RangeUkf, RangeUkfConfig
from mathnavi.sim.metrics.consistency import consistency
from tests.estimators.ranging.runs import START, estimates_of, misplaced, mission, nees, reference, steps_of


@pytest.mark.parametrize("sensors", ["2s", "2t", "4"])
def test_every_step_is_that_of_the_textbook(sensors: str) -> None:
    task = mission(sensors, 0.02)
    x, P = np.array([*START, 0.0]), np.diag(np.square([0.02] * 4))
    for step, estimate in estimates_of(
        RangeEkf(PoseFilterConfig(), task), steps_of(task, 1.0, np.random.default_rng(3))
    ):
        x, P, nis = reference(task, step, x, P)
        np.testing.assert_allclose(estimate.x, x[:3], atol=1e-7)
        np.testing.assert_allclose(np.array(estimate.covariance), P[:3, :3], rtol=1e-4, atol=1e-9)
        np.testing.assert_allclose(estimate.extra["nis"], [nis, task.sensors], rtol=1e-5)


def test_where_a_range_is_linear_every_step_is_that_of_the_extended_filter() -> None:
    task = mission("4", 0.004)
    x, P = np.array([*START, 0.0]), np.diag(np.square([0.004, 0.004, 0.004, 0.02]))
    for step, estimate in estimates_of(RangeUkf(RangeUkfConfig(), task), steps_of(task, 0.5, np.random.default_rng(3))):
        x, P, nis = reference(task, step, x, P)
        deviation = np.sqrt(np.diag(P)[:3])
        assert estimate.covariance is not None
        assert (np.abs(estimate.x - x[:3]) < 0.05 * deviation).all()
        np.testing.assert_allclose(
            estimate.covariance / np.outer(deviation, deviation), P[:3, :3] / np.outer(deviation, deviation), atol=0.02
        )
        np.testing.assert_allclose(estimate.extra["nis"], [nis, 4], rtol=0.02)


@pytest.mark.parametrize("kind", [RangeEkf, RangeUkf], ids=lambda kind: kind.__name__)
def test_it_knows_how_good_it_is(kind: Any) -> None:
    """From a start known to .1 m and .1 rad, within which a range is nearly linear; the NIS of a ray is one on average.

    With limits that one of 100 consistent filters is beyond.
    """
    squares, nis = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        task = misplaced(mission("2s", 0.1), rng)
        run = estimates_of(kind(kind.Config(), task), steps_of(task, 2.0, rng))
        squares.append(nees(task, run))
        nis += [estimate.extra["nis"] for _, estimate in run[50:]]
    result, (total, rays) = consistency(squares, 3, 0.99), np.sum(nis, axis=0)
    assert result.holds, result.text()
    assert rays > 2900
    assert total / rays == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / rays))
