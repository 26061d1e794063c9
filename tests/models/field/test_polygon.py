"""Polygons with holes: rays, the inside, distances, symmetry, and the refusal of rings that are none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve, ellipse
from mathnavi.models.field.kernels import is_inside, range_gradient
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.field.wall import Ring
from mathnavi.models.unicycle.mission import RangingMission

from .walls import FURNISHED, pillars

L_SHAPE = ((0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0), (2.0, 3.0), (0.0, 3.0))
HOLE = ((0.5, 0.5), (1.0, 0.5), (1.0, 1.0), (0.5, 1.0))


def nearest_crossing(wall: Polygon, p: Array, beta: float) -> float:
    """Range along a ray by all segments, without a grid."""
    e = np.array([math.cos(beta), math.sin(beta)])
    a, b = wall.segments[:, :2] - p, wall.segments[:, 2:] - p
    at_a, at_b = e[0] * a[:, 1] - e[1] * a[:, 0], e[0] * b[:, 1] - e[1] * b[:, 0]
    hit = (at_a < 0.0) != (at_b < 0.0)
    a, b, share = a[hit], b[hit], (at_a[hit] / (at_a[hit] - at_b[hit]))[:, None]
    along = (a + share * (b - a)) @ e
    return float(along[along > 0.0].min())


@pytest.mark.parametrize("wall", [FURNISHED, pillars(np.random.default_rng(1))], ids=["furnished", "pillars"])
def test_rays_end_where_the_nearest_segment_is_crossed(wall: Polygon) -> None:
    rng = np.random.default_rng(3)
    angles = np.linspace(-3.0, 3.0, 12)
    for _ in range(150):
        pose = wall.draw(rng)
        rho, s = wall.ranges(pose, angles)
        exact = [nearest_crossing(wall, pose[:2], pose[2] + angle) for angle in angles]
        np.testing.assert_allclose(rho, exact, rtol=0.0, atol=1e-13)
        k = s.astype(int)
        a, b = wall.segments[k, :2], wall.segments[k, 2:]
        ends = a + (s - k)[:, None] * (b - a)
        beta = pose[2] + angles
        np.testing.assert_allclose(
            ends, pose[:2] + rho[:, None] * np.column_stack([np.cos(beta), np.sin(beta)]), atol=1e-7
        )


def test_rays_into_a_corner_and_along_a_wall_do_not_escape() -> None:
    wall = Polygon((L_SHAPE, HOLE))
    for corner in (*L_SHAPE, *HOLE):
        for p in ((1.5, 0.7), (1.4, 1.3)):
            beta = math.atan2(corner[1] - p[1], corner[0] - p[0])
            rho = wall.ranges(np.array([*p, beta]), np.zeros(1))[0][0]
            assert rho == pytest.approx(nearest_crossing(wall, np.array(p), beta), abs=1e-12)
    assert wall.ranges(np.array([0.25, 1.0, 0.0]), np.zeros(1))[0][0] in (pytest.approx(0.25), pytest.approx(3.75))


def test_inside_and_distance_are_those_of_all_segments() -> None:
    from matplotlib.path import Path

    wall = pillars(np.random.default_rng(2))
    points = np.random.default_rng(5).uniform(-1.0, 13.0, (2000, 2))
    crossed = np.sum([Path(ring).contains_points(points) for ring in wall.outlines], axis=0)
    assert [is_inside(*wall.wall, *p) for p in points] == (crossed % 2 == 1).tolist()
    a, d = wall.segments[:, :2], wall.segments[:, 2:] - wall.segments[:, :2]
    for p in points[:200]:
        along = np.clip(((p - a) * d).sum(axis=1) / (d * d).sum(axis=1), 0.0, 1.0)
        assert wall.distance(p) == pytest.approx(np.linalg.norm(a + along[:, None] * d - p, axis=1).min(), abs=1e-13)


def test_gradient_of_a_range_is_that_of_its_differences() -> None:
    rng, h = np.random.default_rng(7), 1e-6
    for _ in range(50):
        pose = FURNISHED.draw(rng, 0.1)
        rho, s = FURNISHED.ranges(pose, np.zeros(1))
        ends = [
            [FURNISHED.ranges(pose + sign * h * np.eye(3)[j], np.zeros(1)) for sign in (1.0, -1.0)] for j in range(3)
        ]
        if any(int(end[1][0]) != int(s[0]) for pair in ends for end in pair):
            continue  # across a corner
        slope = [(after[0][0] - before[0][0]) / (2.0 * h) for after, before in ends]
        np.testing.assert_allclose(range_gradient(FURNISHED.table, s[0], rho[0], pose[2]), slope, rtol=1e-4, atol=1e-6)


def test_area_centre_and_diameter() -> None:
    wall = Polygon((L_SHAPE, HOLE))
    assert wall.area == pytest.approx(10.0 - 0.25)
    np.testing.assert_allclose(wall.centre, (np.array([18.0, 13.0]) - 0.25 * 0.75) / 9.75, rtol=1e-12)
    assert wall.longest == pytest.approx(5.0)


def test_rings_may_run_either_way_and_repeat_their_first_corner() -> None:
    wall, other = Polygon((L_SHAPE, HOLE)), Polygon(((*L_SHAPE[::-1], L_SHAPE[-1]), HOLE[::-1]))
    assert wall.area == other.area
    pose = np.array([1.5, 1.2, 0.4])
    angles = np.linspace(0.0, 6.0, 20)
    np.testing.assert_allclose(wall.ranges(pose, angles)[0], other.ranges(pose, angles)[0], atol=1e-14)


@pytest.mark.parametrize(
    ("rings", "symmetry"),
    [
        ((((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)),), 4),
        ((((0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)),), 2),
        ((((0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)), ((0.2, 0.2), (0.4, 0.2), (0.3, 0.5))), 1),
        ((L_SHAPE,), 1),
    ],
)
def test_rotations_that_map_a_wall_onto_itself(rings: tuple[Ring, ...], symmetry: int) -> None:
    wall = Polygon(rings)
    assert wall.symmetry == symmetry
    pose, angles = np.array([0.7, 1.1, 0.3]), np.array([0.0, 1.0, 2.5])
    for image in wall.images(pose):
        np.testing.assert_allclose(wall.ranges(image, angles)[0], wall.ranges(pose, angles)[0], atol=1e-12)


@pytest.mark.parametrize(
    ("rings", "said"),
    [
        ((), "no rings"),
        ((((0.0, 0.0), (1.0, 0.0)),), "ring 0: 2 corners"),
        ((L_SHAPE, ((1.0, 1.0), (math.nan, 0.5), (0.5, 0.5))), r"ring 1: corner 1 = \(nan, 0.5\)"),
        ((((0.0, 0.0), (4.0, 0.0), (4.0, 0.0), (0.0, 2.0)),), r"ring 0: corner 1 = \(4, 0\) twice"),
        ((((0.0, 0.0), (4.0, 3.0), (4.0, 0.0), (0.0, 3.0)),), r"ring 0 crosses or touches itself near \(2, 1.5\)"),
        ((((0.0, 0.0), (4.0, 0.0), (2.0, 0.0), (2.0, 2.0)),), "ring 0 crosses or touches itself near"),
        ((L_SHAPE, ((3.5, 0.5), (4.5, 0.5), (3.7, 1.0))), r"rings 0 and 1 cross or touch near \(4, "),
        ((L_SHAPE, ((0.0, 0.5), (1.0, 0.5), (1.0, 1.0))), r"rings 0 and 1 cross or touch near \(0, 0.5\)"),
        ((L_SHAPE, ((3.0, 2.5), (3.5, 2.5), (3.3, 2.8))), r"ring 1 at \(3, 2.5\) is outside ring 0"),
        ((L_SHAPE, HOLE, ((0.6, 0.6), (0.8, 0.6), (0.7, 0.8))), "within another hole, or holds one"),
    ],
)
def test_what_is_no_wall_is_refused_by_ring_and_place(rings: tuple[Ring, ...], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        Polygon(rings, "hall")


def test_walls_and_directions_may_be_lists_and_arrays() -> None:
    """They are keys of what is computed once for a wall."""
    rings = [[list(corner) for corner in L_SHAPE], np.array(HOLE)]
    wall, curve = Polygon(rings, "hall"), ellipse(2.0, 1.0)  # type: ignore[arg-type]
    same = Curve(np.array(curve.coefficients), curve.name)  # type: ignore[arg-type]
    assert (wall, hash(wall)) == (Polygon((L_SHAPE, HOLE), "hall"), hash(Polygon((L_SHAPE, HOLE), "hall")))
    assert (same, hash(same)) == (curve, hash(curve))
    mission = RangingMission(wall, np.array([0.0, 1.0]))  # type: ignore[arg-type]
    assert hash(mission) == hash(RangingMission(wall, (0.0, 1.0)))


def test_a_hole_with_a_corner_beside_the_middle_of_its_longest_side_is_a_hole() -> None:
    """Traced holes have their corners on a grid, where a point that is looked for within may be one of them."""
    hole = ((-33.3, 11.45), (-33.9, 11.65), (-33.55, 11.7), (-33.5, 12.1), (-33.5, 11.65), (-33.15, 11.55))
    wall = Polygon((((-40.0, 5.0), (-30.0, 5.0), (-30.0, 15.0), (-40.0, 15.0)), hole))
    assert wall.area == pytest.approx(100.0 - 0.08625)
