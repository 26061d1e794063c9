"""Common properties of the Kalman and particle filters, with valid and with malformed readings."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.ranging.particle import RangeParticle
from mathnavi.estimators.ranging.pose_filter import RangeEkf, RangeIekf
from mathnavi.estimators.ranging.unscented import RangeUkf
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.field.curve import BEAN
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from tests.estimators.ranging.runs import (
    START,
    Run,
    errors,
    estimates_of,
    misplaced,
    mission,
    steps_of,
    with_odometry,
    with_ranges,
)
from tests.ranging import driven

KALMAN = (RangeEkf, RangeUkf, RangeIekf)
FILTERS = (*KALMAN, RangeParticle)

kalman = pytest.mark.parametrize("kind", KALMAN, ids=lambda kind: kind.__name__)
filters = pytest.mark.parametrize("kind", FILTERS, ids=lambda kind: kind.__name__)


def made(kind: Any, task: RangingMission, **fields: object) -> Estimator:
    estimator: Estimator = kind.build(kind.Config(**fields), task)
    return estimator


def assert_same(one: Run, other: Run, atol: float = 0.0) -> None:
    for (_, first), (_, second) in zip(one, other, strict=True):
        assert first.covariance is not None
        assert second.covariance is not None
        np.testing.assert_allclose(first.x, second.x, rtol=0.0, atol=atol)
        np.testing.assert_allclose(first.covariance, second.covariance, rtol=0.0, atol=atol)


@filters
def test_from_a_start_that_is_roughly_known_it_converges(kind: Any) -> None:
    """Nothing but ranges takes the error from .3 m to a tenth of that."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        task = misplaced(mission(), rng)
        position, heading = errors(task, estimates_of(made(kind, task), steps_of(task, 3.0, rng)))[-50:].max(axis=0)
        assert position < 0.06
        assert heading < 0.05


@filters
def test_a_lost_ray_is_as_if_there_were_no_sensor(kind: Any) -> None:
    task, one = mission("3", 0.05), [0, 2]
    fewer = dataclasses.replace(task, angles=tuple(task.alpha[one]))
    steps = steps_of(task, 0.5, np.random.default_rng(1))
    without = estimates_of(made(kind, fewer), [with_ranges(step, lambda rho: rho[one]) for step in steps])
    lost = estimates_of(
        made(kind, task), [with_ranges(step, lambda rho: np.where([0, 1, 0], np.nan, rho)) for step in steps]
    )
    assert_same(lost, without, 1e-12)


@filters
def test_odometry_is_believed_and_not_the_command(kind: Any) -> None:
    """With readings too coarse to mend it, a robot that is commanded back but drives on is found driving on."""
    task = dataclasses.replace(mission("4", 1e-3), ranging=RangeQuality(0.5))
    steps = [dataclasses.replace(step, command=-step.command) for step in steps_of(task, 2.0, np.random.default_rng(0))]
    run = estimates_of(made(kind, task), steps)
    assert np.linalg.norm(steps[-1].truth[:2] - START[:2]) > 0.5
    assert errors(task, run).max() < 0.1


@filters
def test_without_odometry_the_command_is_believed(kind: Any) -> None:
    task = mission("4", 0.05)
    steps = steps_of(task, 0.5, np.random.default_rng(0))
    commands = [step.command for step in steps]
    right = [with_odometry(step, u) for step, u in zip(steps, commands, strict=True)]
    left_out = [with_odometry(step, None) for step in steps]
    nonsense = [with_odometry(step, np.array([math.nan, 0.0])) for step in steps]
    runs = [estimates_of(made(kind, task), seen) for seen in (right, left_out, nonsense)]
    assert_same(runs[0], runs[1])
    assert_same(runs[0], runs[2])


@filters
def test_outliers_are_survived(kind: Any) -> None:
    task, rng = mission("4", 0.1), np.random.default_rng(7)

    def corrupted(ranges: Array) -> Array:
        return np.where(rng.random(len(ranges)) < 0.2, rng.uniform(0.1, 7.0, len(ranges)), ranges)

    steps = [with_ranges(step, corrupted) for step in steps_of(task, 2.0, np.random.default_rng(2))]
    position, heading = errors(task, estimates_of(made(kind, task), steps))[-100:].max(axis=0)
    assert position < 0.05
    assert heading < 0.02


@kalman
def test_a_ray_beyond_the_gate_is_as_if_it_were_lost(kind: Any) -> None:
    task = mission("3", 0.02)
    steps = steps_of(task, 0.5, np.random.default_rng(1))
    wrong = [with_ranges(s, lambda rho: rho * [1.0, 3.0, 1.0]) if s.t == steps[20].t else s for s in steps]
    lost = [with_ranges(s, lambda rho: np.where([0, 1, 0], np.nan, rho)) if s.t == steps[20].t else s for s in steps]
    gated, without = estimates_of(made(kind, task), wrong), estimates_of(made(kind, task), lost)
    assert_same(gated, without)
    assert [estimate.extra["nis"][1] for _, estimate in gated[19:22]] == [3.0, 2.0, 3.0]


@kalman
def test_what_lasts_beyond_the_gate_is_the_filters_own_error(kind: Any) -> None:
    """Sure of a wrong start it refuses ten readings, believes the eleventh, and is right again."""
    wrong = KnownStart((1.0, -0.2, 0.8), (0.02, 0.02, 0.02))
    task = dataclasses.replace(mission("3"), ranging=RangeQuality(0.005), start=wrong)
    run = estimates_of(made(kind, task), steps_of(task, 2.0, np.random.default_rng(1)))
    nis = np.array([estimate.extra["nis"] for _, estimate in run])
    assert np.isnan(nis[:10]).all()
    assert nis[10, 0] > 100.0
    error = errors(task, run)
    assert error[9, 0] > 0.3
    assert error[-50:, 0].max() < 0.05
    assert error[-50:, 1].max() < 0.03


@kalman
@pytest.mark.parametrize("before", [0.2, 0.002])
def test_a_wall_that_half_a_turn_maps_onto_itself_gives_the_same_estimates_half_a_turn_on(
    kind: Any, before: float
) -> None:
    """Through the heading 0, and so through pi, where headings wrap: in a prediction, and in the first update."""
    start, turned = np.array([0.6, -0.4, -before]), np.array([-0.6, 0.4, math.pi - before])
    estimates = []
    for pose in (start, turned):
        task = dataclasses.replace(mission("4"), start=KnownStart(tuple(pose)))
        run = estimates_of(made(kind, task), driven(task, pose, 1.0, rng=np.random.default_rng(5)))
        estimates.append(np.array([estimate.x for _, estimate in run]))
    assert (np.abs(estimates[1][:, 2]) <= math.pi).all()
    assert (estimates[1][0, 2] < 0.0) == (before < 0.1)
    assert estimates[1][-1, 2] < 0.0
    np.testing.assert_allclose(estimates[1][:, :2], -estimates[0][:, :2], atol=1e-9)
    np.testing.assert_allclose(np.cos(estimates[1][:, 2] - estimates[0][:, 2]), -1.0, atol=1e-9)


@filters
def test_whatever_is_read_the_estimate_is_finite_and_within_the_wall(kind: Any) -> None:
    task = RangingMission(BEAN, (-1.0, 0.0, 1.0), RangeQuality(0.05), OdometryQuality((0.05, 0.05), 0.02))
    fields = {"max_particles": 1000} if kind is RangeParticle else {}  # as many as that change nothing but the time
    for seed, start in ((0, None), (1, KnownStart(tuple(BEAN.draw(np.random.default_rng(1))), (1.0, 1.0, 1.0)))):
        rng, estimator = np.random.default_rng(seed), made(kind, dataclasses.replace(task, start=start), **fields)
        for k in range(60):
            rho = np.where(rng.random(3) < 0.2, rng.choice([np.nan, np.inf, -1.0, 0.0], 3), rng.uniform(0.01, 9.0, 3))
            u = rng.normal(scale=3.0, size=2)
            readings = (Measurement("ranges", 0.1 * k, rho), Measurement("odometry", 0.1 * k, u))
            estimate = estimator.update(0.1 * k, readings, u)
            assert estimate.covariance is not None
            assert BEAN.contains(estimate.x)
            assert np.isfinite(estimate.covariance).all()
            assert np.linalg.eigvalsh(estimate.covariance)[0] > -1e-9


@filters
def test_its_status_tells_whether_there_were_ranges_of_late(kind: Any) -> None:
    task = mission("2s", 0.05)
    steps = steps_of(task, 1.0, np.random.default_rng(0))
    blind = [with_ranges(step, lambda rho: np.full_like(rho, np.nan)) for step in steps]
    seen = [*blind[:5], *steps[5:10], *blind[10:]]
    statuses = [estimate.status for _, estimate in estimates_of(made(kind, task, timeout=0.3), seen)]
    assert statuses[:5] == [Status.INITIALISING] * 5
    assert statuses[5:40] == [Status.OK] * 35
    assert statuses[40:] == [Status.LOST] * (len(statuses) - 40)


@filters
def test_without_ranges_it_is_the_motion_and_its_covariance_grows_by_what_odometry_errs(kind: Any) -> None:
    """Along a line: the position's error along it is that of b, which lasts, and of n independent readings."""
    task = dataclasses.replace(
        mission("2s", 0.03),
        start=KnownStart((-2.0, 0.0, 0.0), (0.03, 0.03, 0.03)),
        odometry=OdometryQuality((1.0, 0.5), 0.05),
    )
    n, dt = 100, task.period
    estimator, u = made(kind, task), np.array([1.0, 0.0])
    for k in range(n + 1):
        estimate = estimator.update(k * dt, (Measurement("odometry", k * dt, u),), u)
    P = np.array(estimate.covariance)
    np.testing.assert_allclose(estimate.x, [-1.0, 0.0, 0.0], atol=0.02)
    assert P[0, 0] == pytest.approx(0.03**2 + 0.05**2 + n * (1.0 * dt) ** 2, rel=0.15)
    assert P[2, 2] == pytest.approx(0.03**2 + n * (0.5 * dt) ** 2, rel=0.15)
