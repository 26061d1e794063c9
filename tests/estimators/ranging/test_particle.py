"""The particle filter uses its readings, keeps its particles apart, and leaves numpy's global generator alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.estimators.ranging.particle import RangeParticle, RangeParticleConfig
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import OdometryQuality
from mathnavi.sim.interfaces.signals import Array
from tests.estimators.ranging.runs import START, Run, estimates_of, mission, steps_of


def run_of(task: RangingMission, duration: float, seed: int = 0, *, particles: int = 1000) -> Run:
    config = RangeParticleConfig(particles=particles, seed=seed)
    return estimates_of(RangeParticle(config, task), steps_of(task, duration, np.random.default_rng(11)))


def effective(run: Run) -> Array:
    return np.array([estimate.extra["effective"][0] for _, estimate in run])


def test_what_is_read_thins_out_the_particles_and_resampling_renews_them() -> None:
    """N_eff falls from N, never stays below N / 2, and is N again after each resampling."""
    N = 1000
    kept = effective(run_of(mission(), 1.0, particles=N))
    assert kept.min() >= 0.5 * N
    assert kept.min() < 0.8 * N
    assert np.count_nonzero(np.isclose(kept, N)) > 3


def test_without_ranges_nothing_thins_them_out() -> None:
    task = mission()
    filter_ = RangeParticle(RangeParticleConfig(), task)
    for k in range(20):
        estimate = filter_.update(0.01 * k, (), np.array([0.5, 0.3]))
        np.testing.assert_allclose(estimate.extra["effective"], [1000.0])


def test_roughening_keeps_apart_particles_that_nothing_else_would() -> None:
    """Where the odometry does not err, resampling alone makes copies of ever fewer of them."""
    task = dataclasses.replace(mission("4"), odometry=OdometryQuality())
    run = run_of(task, 2.0, particles=200)
    assert all(np.linalg.eigvalsh(np.array(estimate.covariance))[0] > 1e-7 for _, estimate in run)


def test_its_covariance_is_that_of_where_the_start_may_be() -> None:
    """Until anything was read."""
    estimate = RangeParticle(RangeParticleConfig(particles=5000), mission("2s", 0.05)).update(0.0, (), np.zeros(2))
    np.testing.assert_allclose(np.array(estimate.covariance), 0.05**2 * np.eye(3), atol=0.15 * 0.05**2)
    np.testing.assert_allclose(estimate.x, START, atol=0.01)


def test_the_same_seed_is_the_same_estimate_and_another_is_not() -> None:
    """Whatever was drawn from numpy's global generator, whose state is not changed."""
    np.random.seed(1)
    first = run_of(mission(), 0.5)
    np.random.seed(2)
    before = np.random.get_state()
    same, other = run_of(mission(), 0.5), run_of(mission(), 0.5, seed=1)
    after = np.random.get_state()
    assert np.count_nonzero(np.isclose(effective(first), 1000.0)) > 3  # it was drawn from in between
    for part, kept in zip(before, after, strict=True):
        np.testing.assert_array_equal(part, kept)
    for (_, one), (_, two) in zip(first, same, strict=True):
        np.testing.assert_array_equal(one.x, two.x)
        np.testing.assert_array_equal(one.covariance, two.covariance)
    assert not np.array_equal(first[-1][1].x, other[-1][1].x)


@pytest.mark.parametrize(
    ("field", "value"), [("particles", 0), ("particles", 10**7), ("roughening", 0.0), ("seed", -1)]
)
def test_a_field_of_its_own_out_of_range_is_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{field} = .*; allowed: "):
        RangeParticleConfig(**{field: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("particles", [1, 2, 3])
def test_few_particles_do_too(particles: int) -> None:
    assert all(np.isfinite(estimate.x).all() for _, estimate in run_of(mission("4"), 0.5, particles=particles))
