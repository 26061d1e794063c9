"""The compiled parts of the particle filter do what they say, one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from filterpy.monte_carlo import resampling
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.ranging.kalman_kernels import RaySensors
from mathnavi.estimators.ranging.particle_clusters import Cells, clusters_of, fold, kld_bound
from mathnavi.estimators.ranging.particle_kernels import propagate, resample, resampled, weigh
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.kernels import integrate, rays_at
from tests.estimators.ranging.walls import FIELD, angles, seeds, walls

CELLS = Cells(0.1, 63)


def around(pose: tuple[float, float, float], count: int, rng: np.random.Generator, deviation: float = 0.02) -> Array:
    """States (count, 4) of a cluster."""
    return np.array([*pose, 0.01]) + deviation * rng.standard_normal((count, 4))


def equal(x: Array) -> Array:
    """Weights (n,) of states x (n, 4)."""
    return np.full(len(x), 1.0 / len(x))


# ---- motion


def test_without_errors_every_particle_moves_as_the_robot_does_with_its_own_scale() -> None:
    rng, u, dt = np.random.default_rng(0), np.array([0.8, -1.3]), 0.1
    x = around((0.5, 0.2, 3.1), 50, rng, 0.1)
    memory = math.exp(-dt / 3.0)  # of b, which has no noise here
    expected = [
        [*integrate(each[:3], (1.0 - each[3]) * u[0], (1.0 - each[3]) * u[1], dt), memory * each[3]] for each in x
    ]
    propagate(x, u, np.zeros(2), 0.0, FIELD.wall, dt, rng)
    error = x - expected
    error[:, 2] = np.remainder(error[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    np.testing.assert_allclose(error, 0.0, atol=1e-12)
    assert (np.abs(x[:, 2]) <= math.pi).all()


def test_particles_part_by_what_odometry_errs() -> None:
    rng, dt = np.random.default_rng(0), 0.1
    x = np.zeros((20_000, 4))
    propagate(x, np.zeros(2), np.array([0.5, 0.2]), 0.0, FIELD.wall, dt, rng)
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
        propagate(x, np.array([5.0, 1.0]), np.array([5.0, 5.0]), 0.02, curve.wall, 0.2, rng)
        assert all(curve.contains(each) for each in x)
        clusters = clusters_of(x, equal(x), CELLS)
        x = resample(x, equal(x), clusters, 0.2, (30, 30), (0.05, 2.33), CELLS, 0.02, curve.wall, rng)
        assert all(curve.contains(each) for each in x)


# ---- weights


@settings(max_examples=30, deadline=None)
@given(walls, angles, seeds)
def test_weights_are_the_likelihoods_of_the_readings(curve: Curve, alpha: tuple[float, ...], seed: int) -> None:
    """By numpy, of particles near the pose; a ray that was lost says nothing, any range may be an outlier."""
    rng, relative, absolute, epsilon, longest = np.random.default_rng(seed), 0.2, 0.03, 0.1, 7.0
    x = np.array([[*curve.draw(rng), 0.0]] * 40)
    x[:, 2] += 0.01 * rng.standard_normal(40)
    h = np.array([curve.ranges(each[:3], np.array(alpha))[0] for each in x])
    z = h[0] * rng.uniform(0.8, 1.2, len(alpha))
    z[rng.random(len(alpha)) < 0.2] = np.nan
    before = rng.dirichlet(np.full(len(x), 20.0))

    r = np.square(relative * h) + absolute**2
    p = (1.0 - epsilon) * np.exp(-0.5 * np.square(z - h) / r) / np.sqrt(2.0 * np.pi * r) + epsilon / longest
    likely = np.where(np.isnan(z), 1.0, p).prod(axis=1)
    w, read, tested = before.copy(), np.isfinite(z).sum(), np.zeros((2, len(z)))
    effective, mean = weigh(
        x, w, z, curve.wall, RaySensors(rays_at(alpha), relative, absolute, math.inf, epsilon, longest), tested
    )
    middle = before @ h
    S = before @ (np.square(h - middle) + r)
    np.testing.assert_allclose(tested[0], z - middle, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(tested[1], np.where(np.isnan(z), np.nan, np.sqrt(S)), rtol=1e-7)
    expected = before * likely / (before * likely).sum()
    assert 1.0 / np.square(expected).sum() > 4.0
    np.testing.assert_allclose(w, expected, rtol=1e-9, atol=1e-15)
    assert effective == pytest.approx(1.0 / np.square(expected).sum(), rel=1e-9)
    if read:
        peaks = (1.0 - epsilon) / np.sqrt(2.0 * np.pi * (before @ r)) + epsilon / longest
        relative_to = np.where(np.isnan(z), 1.0, peaks).prod()
        assert mean == pytest.approx(((before * likely).sum() / relative_to) ** (1.0 / read), rel=1e-9)
    else:
        assert math.isnan(mean)


def test_an_exact_reading_leaves_a_tenth_of_the_particles() -> None:
    """Where the likelihood alone would leave one."""
    x = around((0.5, 0.2, 0.3), 400, np.random.default_rng(0), 0.1)
    w = equal(x)
    z = FIELD.ranges(x[7, :3], np.zeros(1))[0]
    sensors = RaySensors(rays_at([0.0]), 1e-4, 1e-4, math.inf, 1e-9, 7.0)
    effective, _ = weigh(x, w, z, FIELD.wall, sensors, np.zeros((2, 1)))
    assert 40.0 <= effective <= 200.0
    assert w.argmax() == 7


# ---- resampling


@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(1, 60), st.floats(0.0, 1.0, exclude_max=True))
def test_resampling_is_filterpys_from_the_same_place(seed: int, count: int, start: float) -> None:
    rng = np.random.default_rng(seed)
    w = np.where(rng.random(count) < 0.5, 0.0, rng.random(count) ** 3)
    w[rng.integers(count)] = 1.0
    w /= w.sum()
    chosen = resampled(w, start, count)
    whole = w.copy()
    whole[-1] += 1e-9  # filterpy reads beyond the last one where round-off leaves less than one
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resampling, "random", lambda: start)
        np.testing.assert_array_equal(chosen, resampling.systematic_resample(whole))


@pytest.mark.parametrize("seed", range(3))
def test_resampling_keeps_mean_and_covariance_of_a_cluster(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = around((0.5, 0.2, 0.3), 4000, rng)
    x[:, 1] += 0.5 * (x[:, 0] - 0.5)
    w = np.exp(-0.5 * np.square((x[:, 0] - 0.51) / 0.02))
    w /= w.sum()
    mean, C = np.average(x, axis=0, weights=w), np.cov(x.T, aweights=w, bias=True)
    after = resample(x, w, clusters_of(x, w, CELLS), 0.0, (4000, 4000), (0.05, 2.33), CELLS, 0.02, FIELD.wall, rng)
    np.testing.assert_allclose(after.mean(axis=0), mean, atol=1.5e-3)
    np.testing.assert_allclose(np.cov(after.T, bias=True), C, atol=0.1 * C.max())
    assert len(np.unique(after, axis=0)) == len(after)


def test_there_are_as_many_particles_as_the_cells_need() -> None:
    """KLD sampling: few for a pose that is known, many for one that may be anywhere; a share is drawn anew."""
    rng = np.random.default_rng(0)
    kld = (0.05, 2.326)
    near = around((0.5, 0.2, 0.3), 2000, rng, 0.01)
    far = np.column_stack((rng.uniform(-1.0, 1.0, (2000, 2)), rng.uniform(-3.0, 3.0, 2000), np.zeros(2000)))
    counts = []
    for x, share in ((near, 0.0), (far, 0.0), (near, 0.3)):
        clusters = clusters_of(x, equal(x), CELLS)
        after = resample(x, equal(x), clusters, share, (50, 3000), kld, CELLS, 0.02, FIELD.wall, rng)
        counts.append(len(after))
        assert np.mean(np.abs(after[:, :2] - [0.5, 0.2]).max(axis=1) > 0.2) == pytest.approx(share, abs=0.1) or x is far
    assert 50 <= counts[0] < 400
    assert counts[1] == 3000
    assert counts[2] > 2 * counts[0]


@pytest.mark.parametrize(("k", "bound"), [(1, 1.0), (2, 66.3), (10, 216.7), (100, 1347.0)])
def test_the_bound_is_a_chi_square_quantile(k: int, bound: float) -> None:
    """chi2(k - 1) at .99 over 2 epsilon, which the bound approximates (Wilson and Hilferty)."""
    assert kld_bound(k, 0.05, 2.3263) == pytest.approx(bound, rel=0.02)


# ---- clusters


def test_clusters_have_their_own_weight_mean_and_covariance() -> None:
    rng = np.random.default_rng(0)
    one, other = around((1.0, 0.2, 0.5), 300, rng), around((-1.5, -0.3, 2.0), 200, rng)
    x, w = np.concatenate((one, other)), rng.uniform(0.8, 1.2, 500)
    w /= w.sum()
    found = clusters_of(x, w, CELLS)
    assert found.weight.sum() == pytest.approx(1.0)
    assert found.members.sum() == 500
    for part, own in ((one, w[:300]), (other, w[300:])):
        k = int(np.argmin(np.abs(found.weight - own.sum())))
        assert found.weight[k] == pytest.approx(own.sum(), rel=0.02)
        np.testing.assert_allclose(
            x[found.origin[k]] + found.offset[k], np.average(part, axis=0, weights=own), atol=2e-3
        )
        np.testing.assert_allclose(found.covariance[k], np.cov(part.T, aweights=own, bias=True), atol=1e-4)


def test_headings_on_either_side_of_pi_are_one_cluster() -> None:
    x = around((0.5, 0.2, math.pi), 400, np.random.default_rng(0))
    expected, C = x.mean(axis=0), np.cov(x.T, bias=True)
    x[:, 2] = np.remainder(x[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    found = clusters_of(x, equal(x), CELLS)
    k = int(found.weight.argmax())
    assert found.weight[k] > 0.97
    mean = x[found.origin[k]] + found.offset[k]
    np.testing.assert_allclose(np.remainder(mean[2], 2.0 * math.pi), expected[2], atol=3e-3)
    np.testing.assert_allclose(found.covariance[k], C, atol=1e-4)


def test_images_of_a_pose_become_one_cluster() -> None:
    """Of an ellipse, which half a turn maps onto itself: the readings do not change."""
    rng = np.random.default_rng(0)
    x = around((0.8, 0.2, 0.5), 100, rng)
    x[50:, :2] *= -1.0
    x[50:, 2] -= math.pi
    before = np.array([FIELD.ranges(each[:3], np.zeros(1))[0][0] for each in x])
    fold(x, 0.4, 2, 0.0, 0.0)
    np.testing.assert_allclose(x[:, :3].mean(axis=0), [0.8, 0.2, 0.5], atol=0.01)
    after = np.array([FIELD.ranges(each[:3], np.zeros(1))[0][0] for each in x])
    np.testing.assert_allclose(after, before, atol=1e-6)
