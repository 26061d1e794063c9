"""Adaptive Monte Carlo localisation: it uses its readings, adapts its number of particles and recovers."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mathnavi.estimators.ranging.particle import RangeParticle, RangeParticleConfig
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality
from tests.estimators.ranging.runs import START, Run, errors, estimates_of, mission, steps_of
from tests.ranging import driven


def run_of(task: RangingMission, duration: float, seed: int = 0, *, least: int = 500, most: int = 5000) -> Run:
    config = RangeParticleConfig(min_particles=least, max_particles=most, seed=seed)
    return estimates_of(RangeParticle(config, task), steps_of(task, duration, np.random.default_rng(11)))


def figures(run: Run, name: str) -> Array:
    return np.array([estimate.extra[name][0] for _, estimate in run])


def test_readings_thin_out_the_particles_and_resampling_renews_them() -> None:
    """n_eff falls below n / 2 only to be n again; between, most updates do not resample."""
    run = run_of(mission(), 1.0)
    share = figures(run, "effective") / figures(run, "particles")
    assert share.min() < 0.5
    low = np.flatnonzero(share[:-1] < 0.5)
    assert (share[low + 1] > share[low]).mean() > 0.9
    assert len(low) < 0.5 * len(share)


@pytest.mark.parametrize("seed", range(2))
def test_from_an_unknown_start_it_finds_the_pose_and_knows_how_well(seed: int) -> None:
    task = dataclasses.replace(mission("4"), start=None)
    run = run_of(task, 4.0, seed)
    position, heading = errors(task, run)[-50:].max(axis=0)
    assert position < 0.06
    assert heading < 0.06
    P = run[-1][1].covariance
    assert P is not None
    assert 0.002 < math.sqrt(P[0, 0]) < 0.05
    count = figures(run, "particles")
    assert count[0] == 5000
    assert count[-1] < 1000
    assert run[0][1].status is Status.INITIALISING
    assert run[-1][1].status is Status.OK


def test_a_robot_that_was_carried_to_another_place_is_found_again() -> None:
    """Readings that its particles do not explain make it draw new ones; it turns on the spot meanwhile."""
    task = mission("4")
    there = np.array([-1.0, -0.3, -2.0])
    filter_ = RangeParticle(RangeParticleConfig(), task)
    rng, counts = np.random.default_rng(3), []
    turning = np.array([0.0, 0.6])
    for k in range(400):
        pose = (np.array(START) if k < 60 else there) + [0.0, 0.0, 0.006 * k]
        exact, _ = task.curve.ranges(pose, task.alpha)
        rho = exact * (1.0 + 0.05 * rng.standard_normal(len(exact)))
        estimate = filter_.update(0.01 * k, (Measurement("ranges", 0.01 * k, rho),), turning)
        counts.append(estimate.extra["particles"][0])
    assert max(counts[60:]) > 2.0 * counts[59]
    assert np.abs(task.difference(estimate.x, pose)).max() < 0.1
    assert estimate.status is Status.OK


def test_a_robot_that_leaves_a_wall_behind_draws_no_particles_from_anywhere() -> None:
    """Far from walls ranges are noisier and their density is lower, though nothing is wrong."""
    task = dataclasses.replace(mission("4"), start=KnownStart((-3.2, 0.0, 0.0), (0.01, 0.01, 0.01)))
    found = RangeParticle(RangeParticleConfig(), task)
    steps = driven(task, np.array([-3.2, 0.0, 0.0]), 6.0, lambda t: np.array([0.5, 0.0]), np.random.default_rng(11))
    run = estimates_of(found, steps)
    assert figures(run, "particles")[100:].max() <= 550
    assert errors(task, run)[200:].max() < 0.05


def test_without_ranges_nothing_thins_them_out() -> None:
    filter_ = RangeParticle(RangeParticleConfig(), mission())
    for k in range(20):
        estimate = filter_.update(0.01 * k, (), np.array([0.5, 0.3]))
        np.testing.assert_allclose(estimate.extra["effective"], [5000.0])


def test_regularisation_keeps_apart_particles_that_nothing_else_would() -> None:
    """Where the odometry does not err, resampling alone makes copies of ever fewer of them."""
    task = dataclasses.replace(mission("4"), odometry=OdometryQuality())
    run = run_of(task, 2.0, least=200)
    assert all(np.linalg.eigvalsh(np.array(estimate.covariance))[0] > 1e-7 for _, estimate in run)


def test_its_covariance_is_that_of_where_the_start_may_be() -> None:
    """Until anything was read."""
    estimate = RangeParticle(RangeParticleConfig(), mission("2s", 0.02)).update(0.0, (), np.zeros(2))
    np.testing.assert_allclose(np.array(estimate.covariance), 0.02**2 * np.eye(3), atol=0.15 * 0.02**2)
    np.testing.assert_allclose(estimate.x, START, atol=0.01)


def test_the_same_seed_is_the_same_estimate_and_another_is_not() -> None:
    first, same, other = run_of(mission(), 0.3), run_of(mission(), 0.3), run_of(mission(), 0.3, seed=1)
    for (_, one), (_, two) in zip(first, same, strict=True):
        np.testing.assert_array_equal(one.x, two.x)
        np.testing.assert_array_equal(one.covariance, two.covariance)
    assert not np.array_equal(first[-1][1].x, other[-1][1].x)


@pytest.mark.parametrize("particles", [1, 2, 3])
def test_few_particles_do_too(particles: int) -> None:
    run = run_of(mission("4"), 0.5, least=particles, most=particles)
    assert all(np.isfinite(estimate.x).all() for _, estimate in run)
