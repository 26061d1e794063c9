"""The charts are those of the thesis' spaces: the map of Hopf, and Poincare's disc."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.attitude import Attitude, product
from mathnavi.models.manifold.constant_curvature import hyperbolic_space, sphere
from mathnavi.renders.lagrangian.charts import Disc, Globe, nose

PLANE = hyperbolic_space(2)
seeds = st.integers(0, 2**31)


def attitude(seed: int) -> Array:
    return sphere(3).draw(np.random.default_rng(seed))


@given(seeds, st.floats(-3.0, 3.0))
def test_turning_about_its_nose_moves_no_nose(seed: int, angle: float) -> None:
    q = attitude(seed)
    turned = Attitude().exp(q, np.array([angle, 0.0, 0.0]))
    np.testing.assert_allclose(nose(turned[None]), nose(q[None]), atol=1e-12)


@given(seeds)
def test_a_nose_points_where_the_attitude_turns_the_first_axis(seed: int) -> None:
    q = attitude(seed)
    turned = product(product(q, np.array([0.0, 1.0, 0.0, 0.0])), q * (1.0, -1.0, -1.0, -1.0))
    np.testing.assert_allclose(nose(q[None])[0], turned[1:], atol=1e-12)
    np.testing.assert_allclose(nose(-q[None]), nose(q[None]), atol=1e-12)


def test_a_globe_shows_what_points_at_the_eye_in_its_middle() -> None:
    globe = Globe(azimuth=90.0, elevation=0.0)  # the viewpoint is south of the globe
    to_the_eye, opposite, left, up = (
        np.array([math.cos(0.5 * angle), *(math.sin(0.5 * angle) * np.array(axis))])
        for angle, axis in (
            (-0.5 * math.pi, (0.0, 0.0, 1.0)),
            (0.5 * math.pi, (0.0, 0.0, 1.0)),
            (math.pi, (0.0, 0.0, 1.0)),
            (-0.5 * math.pi, (0.0, 1.0, 0.0)),
        )
    )
    places, near = globe.project(np.array([to_the_eye, opposite, left, up]))
    np.testing.assert_allclose(places, [[0.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [0.0, 1.0]], atol=1e-12)
    assert near[0]
    assert not near[1]


@given(seeds, st.floats(0.0, 6.0))
def test_the_disc_keeps_the_distance_from_its_middle(seed: int, distance: float) -> None:
    direction = np.random.default_rng(seed).standard_normal(2)
    w = np.concatenate([[0.0], distance * direction / np.linalg.norm(direction)])
    p = PLANE.exp(PLANE.origin, w)
    place, _ = Disc(p[None]).project(p[None])
    assert float(np.linalg.norm(place)) < 1.0
    assert 2.0 * math.atanh(float(np.linalg.norm(place))) == pytest.approx(distance, abs=1e-6)


@given(seeds)
def test_geodesics_of_the_disc_are_arcs_of_circles_that_meet_its_edge_at_right_angles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p = PLANE.draw(rng)
    w = PLANE.draw_vector(rng, p)
    place, _ = Disc(p[None]).project(np.array([PLANE.exp(p, s * w) for s in (-1.0, 0.0, 1.3)]))
    # A circle |z - m|^2 = |m|^2 - 1, which is one at right angles to the unit circle, is 2 <m, z> = 1 + |z|^2.
    m, *_ = np.linalg.lstsq(2.0 * place, 1.0 + np.square(place).sum(axis=1), rcond=None)
    scale = 1.0 + float(np.linalg.norm(m))
    np.testing.assert_allclose(2.0 * place @ m / scale, (1.0 + np.square(place).sum(axis=1)) / scale, atol=1e-6)
