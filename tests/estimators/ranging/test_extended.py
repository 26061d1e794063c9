"""filterpy's extended Kalman filter is the textbook's, and knows how good it is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.ranging.pose_filter import PoseFilterConfig, RangeEkf
from mathnavi.interfaces.signals import Array
from mathnavi.sim.metrics.consistency import consistency
from tests.estimators.ranging.runs import START, Run, estimates_of, misplaced, mission, nees, reference, steps_of

RUNS = 15


@pytest.fixture(scope="module")
def runs() -> tuple[list[Run], Array]:
    """Independent runs from a start known to .1 m and .1 rad, within which a range is nearly linear, and their NEES."""
    found, squares = [], []
    for seed in range(RUNS):
        rng = np.random.default_rng(seed)
        task = misplaced(mission("2s", 0.1), rng)
        found.append(estimates_of(RangeEkf(PoseFilterConfig(), task), steps_of(task, 2.5, rng)))
        squares.append(nees(task, found[-1]))
    return found, np.array(squares)


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


def test_it_knows_how_good_it_is(runs: tuple[list[Run], Array]) -> None:
    """With limits that one of 100 consistent filters is beyond."""
    result = consistency(runs[1], 3, 0.99)
    assert result.holds, result.text()


def test_the_nis_of_a_ray_is_one_on_average(runs: tuple[list[Run], Array]) -> None:
    nis = np.array([[estimate.extra["nis"] for _, estimate in run[50:]] for run in runs[0]])
    rays = int(nis[..., 1].sum())
    assert rays > 5900
    assert nis[..., 0].sum() / rays == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / rays))
