"""The compiled parts of the particle filter do what they say, one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from filterpy.monte_carlo import resampling
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.ranging.kalman_kernels import RaySensors
from mathnavi.estimators.ranging.particle_kernels import mode, propagate, resampled, roughen, weigh
from mathnavi.models.field.curve import BEAN, Curve
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.sim.interfaces.signals import Array
from tests.estimators.ranging.walls import FIELD, angles, seeds, walls

RADIUS, STARTS = 0.4, 16


def around(pose: tuple[float, float, float], count: int, rng: np.random.Generator, deviation: float = 0.05) -> Array:
    """States (count, 4) of a cluster."""
    return np.array([*pose, 0.01]) + deviation * rng.standard_normal((count, 4))


def mode_of(x: Array, w: Array, before: Array, curve: Curve = FIELD) -> tuple[Array, Array]:
    mean, P = mode(x, w, before, RADIUS, STARTS, curve.wall)
    return mean, P


# ---- motion


def test_without_errors_every_particle_moves_as_the_robot_does_with_its_own_scale() -> None:
    rng, u, dt = np.random.default_rng(0), np.array([0.8, -1.3]), 0.1
    x = around((0.5, 0.2, 3.1), 50, rng, 0.1)
    expected = [[*integrate(each[:3], (1.0 - each[3]) * u[0], (1.0 - each[3]) * u[1], dt), each[3]] for each in x]
    propagate(x, u, np.zeros(2), FIELD.wall, dt, rng)
    error = x - expected
    error[:, 2] = np.remainder(error[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    np.testing.assert_allclose(error, 0.0, atol=1e-12)
    assert (np.abs(x[:, 2]) <= math.pi).all()


def test_particles_part_by_what_odometry_errs() -> None:
    rng, dt = np.random.default_rng(0), 0.1
    x = np.zeros((20_000, 4))
    propagate(x, np.zeros(2), np.array([0.5, 0.2]), FIELD.wall, dt, rng)
    np.testing.assert_allclose(x[:, [0, 2]].std(axis=0), [0.05, 0.02], rtol=0.03)
    assert abs(np.corrcoef(x[:, 0], x[:, 2])[0, 1]) < 0.03
    assert np.abs(x[:, :3].mean(axis=0)).max() < 0.002
    assert not x[:, 3].any()


@settings(max_examples=20, deadline=None)
@given(walls, seeds)
def test_no_particle_leaves_the_wall(curve: Curve, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = np.array([[*curve.draw(rng), 0.0] for _ in range(30)])
    for _ in range(3):
        propagate(x, np.array([5.0, 1.0]), np.array([5.0, 5.0]), curve.wall, 0.2, rng)
        assert all(curve.contains(each) for each in x)
        roughen(x, 2.0, curve.wall, rng)
        assert all(curve.contains(each) for each in x)


# ---- weights


@settings(max_examples=30, deadline=None)
@given(walls, angles, seeds)
def test_weights_are_the_likelihoods_of_what_was_read(curve: Curve, alpha: tuple[float, ...], seed: int) -> None:
    """By numpy; a ray that was lost says nothing, one beyond the gate counts as one at the gate."""
    rng, relative, absolute, gate = np.random.default_rng(seed), 0.2, 0.03, 15.0
    x = np.array([[*curve.draw(rng), 0.0] for _ in range(40)])
    h = np.array([curve.ranges(each[:3], np.array(alpha))[0] for each in x])
    z = h[0] * rng.uniform(0.8, 1.2, len(alpha))
    z[rng.random(len(alpha)) < 0.2] = np.nan
    before = rng.dirichlet(np.ones(len(x)))

    r = np.square(relative * h) + absolute**2
    log = -0.5 * np.nansum(np.minimum(np.square(z - h) / r, gate) + np.where(np.isnan(z), 0.0, np.log(r)), axis=1)
    expected = before * np.exp(log - log.max())
    expected /= expected.sum()
    w = before.copy()
    effective = weigh(x, w, z, curve.wall, RaySensors(np.array(alpha), relative, absolute, gate))
    np.testing.assert_allclose(w, expected, rtol=1e-9, atol=1e-15)
    assert effective == pytest.approx(1.0 / np.square(expected).sum(), rel=1e-9)


def test_particles_that_all_are_impossible_are_all_alike() -> None:
    """Their weights sum to one and are finite, however unlikely what was read is."""
    x = around((0.5, 0.2, 0.3), 10, np.random.default_rng(0), 0.1)
    w = np.full(10, 0.1)
    effective = weigh(x, w, np.array([50.0]), FIELD.wall, RaySensors(np.zeros(1), 1e-9, 1e-9, 1e300))
    assert np.isfinite(w).all()
    assert w.sum() == pytest.approx(1.0)
    assert 1.0 <= effective <= 10.0


# ---- resampling


@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(1, 60), st.floats(0.0, 1.0, exclude_max=True))
def test_resampling_is_filterpys_from_the_same_place(seed: int, count: int, start: float) -> None:
    rng = np.random.default_rng(seed)
    w = np.where(rng.random(count) < 0.5, 0.0, rng.random(count) ** 3)
    w[rng.integers(count)] = 1.0
    w /= w.sum()
    chosen = resampled(w, start)
    whole = w.copy()
    whole[-1] += 1e-9  # filterpy reads beyond the last one where round-off leaves less than one
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resampling, "random", lambda: start)
        np.testing.assert_array_equal(chosen, resampling.systematic_resample(whole))


def test_particles_are_drawn_as_often_as_they_weigh() -> None:
    w = np.array([0.5, 0.0, 0.25, 0.25, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(np.bincount(resampled(w, 0.5), minlength=8), [4, 0, 2, 2, 0, 0, 0, 0])


# ---- roughening


def test_roughening_has_the_deviation_that_it_says() -> None:
    """kappa E N^(-1/4) in each of the four coordinates, of mean zero."""
    N, kappa, rng = 10_000, 0.1, np.random.default_rng(0)
    x = np.column_stack([rng.uniform(-width, width, N) for width in (0.5, 0.3, 0.4, 0.02)])
    before, extent = x.copy(), np.ptp(x, axis=0)
    roughen(x, kappa, FIELD.wall, rng)
    added, deviation = x - before, kappa * extent * N**-0.25
    np.testing.assert_allclose(added.std(axis=0), deviation, rtol=0.04)
    assert (np.abs(added.mean(axis=0)) < 4.0 * deviation / math.sqrt(N)).all()


# ---- the place where there are most


def test_of_two_clusters_it_is_the_heavier_with_its_own_mean_and_covariance() -> None:
    rng = np.random.default_rng(0)
    one, other = around((1.0, 0.2, 0.5), 300, rng), around((-1.5, -0.3, 2.0), 200, rng)
    x, w = np.concatenate((one, other)), np.concatenate((rng.uniform(0.8, 1.2, 300), rng.uniform(0.8, 1.2, 200)))
    far = np.array([3.0, 0.0, 0.0, 0.0])
    for heavier, weights in ((one, w), (other, w * np.repeat((1.0, 3.0), (300, 200)))):
        weights = weights / weights.sum()
        own = weights[:300] if heavier is one else weights[300:]
        mean, P = mode_of(x, weights, far)
        np.testing.assert_allclose(mean, np.average(heavier, axis=0, weights=own), atol=1e-9)
        np.testing.assert_allclose(P, np.cov(heavier[:, :3].T, aweights=own, bias=True), atol=1e-12)


@pytest.mark.parametrize(("share", "moves"), [(0.6, False), (0.64, False), (0.69, True), (0.8, True)])
def test_where_it_was_it_stays_until_another_place_has_twice_the_weight(share: float, moves: bool) -> None:
    rng = np.random.default_rng(0)
    one, other = around((1.0, 0.2, 0.5), 200, rng, 0.03), around((-1.5, -0.3, 2.0), 200, rng, 0.03)
    w = np.repeat(((1.0 - share) / 200, share / 200), 200)
    mean, _ = mode_of(np.concatenate((one, other)), w, np.array([1.0, 0.2, 0.5, 0.0]))
    assert bool(mean[0] < 0.0) is moves


def test_headings_on_either_side_of_pi_are_one_place() -> None:
    rng = np.random.default_rng(0)
    x = around((0.5, 0.2, math.pi), 400, rng)
    expected, covariance = x.mean(axis=0), np.cov(x[:, :3].T, bias=True)
    x[:, 2] = np.remainder(x[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    assert np.ptp(x[:, 2]) > 6.0
    mean, P = mode_of(x, np.full(400, 1.0 / 400), np.zeros(4))
    np.testing.assert_allclose(mean[[0, 1, 3]], expected[[0, 1, 3]], atol=1e-9)
    assert math.remainder(mean[2] - expected[2], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(P, covariance, atol=1e-12)


def test_a_mean_that_is_outside_of_a_wall_that_is_not_convex_is_drawn_back_within() -> None:
    """Particles along the bay of the bean, on both sides of what juts out most."""
    depth = 1e-3  # [m] of the particles within the wall
    s = np.linspace(0.0, 2.0 * math.pi, 20_001)
    p, tangent = BEAN.points(s), BEAN.tangent(s)
    p += depth * np.column_stack((-tangent[:, 1], tangent[:, 0])) / np.linalg.norm(tangent, axis=1)[:, None]
    bay = p[(np.abs(p[:, 0]) < 0.19) & (np.abs(p[:, 0]) > 0.17) & (p[:, 1] < 0.0)]
    x = np.column_stack((bay, np.full(len(bay), 0.3), np.zeros(len(bay))))
    w = np.full(len(x), 1.0 / len(x))
    assert all(BEAN.contains(each) for each in x)
    assert not BEAN.contains(x.mean(axis=0))
    mean, P = mode_of(x, w, np.array([0.0, 1.5, 0.3, 0.0]), BEAN)
    assert BEAN.contains(mean)
    assert mean[2] == pytest.approx(0.3)
    np.testing.assert_allclose(P, np.cov(x[:, :3].T, bias=True), atol=1e-12)
