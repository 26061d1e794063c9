"""Where a ray may end on one of several walls, the filter weighs them; it is not sure of the one that its mean sees."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from mathnavi.estimators.ranging.kalman_kernels import Innovations, RaySensors, condition, no_innovations
from mathnavi.estimators.ranging.wall_choice_kernels import condition_among_walls, doubt, mismatched
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.unicycle.kernels import rays_at

ROOM = Polygon((((0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0)),))
CORNER = Polygon((((0.0, 0.0), (8.0, 0.0), (8.0, 4.0), (14.0, 4.0), (14.0, 10.0), (0.0, 10.0)),))
"""past its corner at (8, 4) m a ray goes on for six metres"""
BELOW = np.array([3.0, 3.95, 0.0, 0.0])  # from where a ray ahead ends 5 cm below the corner
ABSOLUTE, LONGEST = 0.05, 20.0
Update = Callable[..., tuple[float, float, int]]


def sensors(*angles: float, outliers: float = 0.05) -> RaySensors:
    return RaySensors(rays_at(angles), 0.0, ABSOLUTE, 1e300, outliers, LONGEST)


def updated(
    update: Update, wall: Polygon, x: Array, P: Array, z: Array, rays: RaySensors
) -> tuple[Array, Array, Innovations, tuple[float, float, int]]:
    """x (4,), P (4, 4) after an update, its innovations, and what it returns."""
    x, P, innovations = x.copy(), P.copy(), no_innovations(len(z))
    returned = update(x, P, z, wall.wall, rays, innovations)
    return x, P, innovations, returned


def test_where_each_ray_ends_on_one_wall_the_update_is_that_of_the_extended_kalman_filter() -> None:
    x, P, angles = np.array([3.0, 2.5, 0.3, 0.0]), 1e-6 * np.eye(4), (0.0, 1.5, -2.0)
    z = ROOM.ranges(x[:3], np.array(angles))[0] + [0.03, -0.02, 0.01]
    ours = updated(condition_among_walls, ROOM, x, P, z, sensors(*angles))
    theirs = updated(condition, ROOM, x, P, z, sensors(*angles))
    np.testing.assert_allclose((ours[0] - x)[:3], (theirs[0] - x)[:3], rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(ours[1], theirs[1], atol=1e-9)
    assert ours[3] == pytest.approx(theirs[3], rel=1e-3)


def test_a_ray_that_passes_a_corner_within_the_errors_is_no_outlier() -> None:
    """The mean sees the near wall; the reading is that of the far one."""
    P, z = np.diag([0.01, 0.01, 1e-4, 1e-6]), np.array([11.0])
    assert updated(condition, CORNER, BELOW, P, z, sensors(0.0))[2].outliers[0] == 1
    x, _, innovations, (_, nis, read) = updated(condition_among_walls, CORNER, BELOW, P, z, sensors(0.0))
    assert (innovations.outliers[0], read) == (0, 1)
    assert nis < 1.0
    assert abs(x[0] - BELOW[0]) < 0.05
    far = updated(condition_among_walls, CORNER, BELOW, P, np.array([8.0]), sensors(0.0))
    assert far[2].outliers[0] == 1  # no wall is there
    np.testing.assert_allclose(far[0], BELOW, atol=0.02)


@pytest.mark.parametrize("deviation", [0.02, 0.1, 0.3])
def test_the_likelihood_of_a_reading_at_a_corner_is_a_density(deviation: float) -> None:
    """Over all readings it sums to one, the outliers among them."""
    P = np.diag([deviation**2, deviation**2, 1e-4, 1e-6])
    grid = np.linspace(0.002, LONGEST, 5000)
    likelihood = [
        updated(condition_among_walls, CORNER, BELOW, P, np.array([z]), sensors(0.0))[3][0] for z in grid.tolist()
    ]
    assert np.exp(likelihood).sum() * (grid[1] - grid[0]) == pytest.approx(1.0, abs=0.05)


def test_at_a_corner_an_update_is_right_about_its_errors() -> None:
    """Normalised errors of poses about one from which some rays pass the corner and some do not."""
    rng, angles = np.random.default_rng(1), (0.0, 0.02, 1.6, 3.1, -1.5)
    P = np.diag([0.15**2, 0.15**2, 0.03**2, 1e-6])
    squares = {condition: 0.0, condition_among_walls: 0.0}
    trials = 400
    for _ in range(trials):
        truth = BELOW + np.sqrt(P.diagonal()) * rng.standard_normal(4)
        z = CORNER.ranges(truth[:3], np.array(angles))[0] + ABSOLUTE * rng.standard_normal(len(angles))
        for update in squares:
            x, covariance, _, _ = updated(update, CORNER, BELOW, P, z, sensors(*angles))
            error = (x - truth)[:3]
            squares[update] += float(error @ np.linalg.solve(covariance[:3, :3], error)) / (3.0 * trials)
    assert squares[condition_among_walls] < 1.5


def test_whatever_is_read_the_pose_stays_within_the_walls_and_its_covariance_positive() -> None:
    rng, angles = np.random.default_rng(2), (-2.0, -1.0, 0.0, 0.5, 2.5)
    for _ in range(200):
        root = rng.uniform(0.05, 1.0) * rng.standard_normal((4, 4))
        x, P = np.array([*CORNER.draw(rng), 0.0]), root @ root.T + 1e-6 * np.eye(4)
        x, P, _, (likelihood, _, _) = updated(
            condition_among_walls, CORNER, x, P, rng.uniform(0.01, 20.0, len(angles)), sensors(*angles)
        )
        assert CORNER.contains(x[:2])
        assert math.isfinite(likelihood)
        assert np.linalg.eigvalsh(0.5 * (P + P.T))[0] > -1e-9
        np.testing.assert_allclose(P, P.T, atol=1e-12)


@pytest.mark.parametrize(("unexplained", "of_prior"), [(0, 0.0), (2, 0.02), (4, 0.2), (6, 0.9)])
def test_an_update_that_leaves_rays_unexplained_is_doubted(unexplained: int, of_prior: float) -> None:
    """Of eight rays some end in front of any wall: the more, the more of the prediction's variance stays."""
    x, P, angles = np.array([3.0, 2.5, 0.3, 0.0]), 0.04 * np.eye(4), tuple(np.linspace(-3.0, 2.5, 8))
    z = ROOM.ranges(x[:3], np.array(angles))[0]
    z[:unexplained] *= 0.4
    _, covariance, innovations, _ = updated(condition_among_walls, ROOM, x, P, z, sensors(*angles, outliers=0.15))
    assert innovations.misfits[0] == unexplained
    kept = np.trace(covariance[:2, :2]) / np.trace(P[:2, :2])
    assert of_prior <= kept < of_prior + 0.3


def test_where_most_rays_are_outliers_an_update_is_not_doubted_for_that() -> None:
    assert mismatched(4, 8, 0.5) == pytest.approx(mismatched(1, 8, 0.5)) == pytest.approx(0.02)
    assert mismatched(4, 8, 0.15) > 0.2
    assert mismatched(0, 0, 0.1) == mismatched(0, 8, 0.1) == 0.0


@pytest.mark.parametrize("probability", [0.3, 0.7])
def test_the_mixture_of_two_places_is_within_the_walls_and_its_covariance_is_about_it(probability: float) -> None:
    """About a corner, between the legs of an L."""
    x, P, before, prior = np.array([13.0, 4.5, 0.2, 0.0]), 0.01 * np.eye(4), np.array([7.5, 0.5, 0.0, 0.0]), np.eye(4)
    places = (x[:2].copy(), 1.0 - probability), (before[:2].copy(), probability)
    assert not CORNER.contains(sum(share * place for place, share in places))
    doubt(x, P, before, prior, probability, CORNER.wall)
    assert CORNER.contains(x[:2])
    spread = sum(share * np.outer(place - x[:2], place - x[:2]) for place, share in places)
    np.testing.assert_allclose(P[:2, :2], spread + ((1.0 - probability) * 0.01 + probability) * np.eye(2))
