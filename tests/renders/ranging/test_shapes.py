"""Shapes around a pose have the size and the direction that they stand for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.models.field.curve import BEAN, EGG, Curve, ellipse
from mathnavi.models.unicycle.entity import RADIUS
from mathnavi.renders.ranging import shapes
from mathnavi.renders.ranging.floor import INSIDE, OUTSIDE, extent, floor_picture, pale

coordinates, headings = st.floats(-5.0, 5.0), st.floats(-10.0, 10.0)
sizes = st.floats(0.01, 2.0)


@given(coordinates, coordinates, headings)
def test_the_outline_points_where_the_robot_is_headed(x: float, y: float, phi: float) -> None:
    corners = shapes.outline(np.array([x, y, phi])) - [x, y]
    lengths = np.linalg.norm(corners, axis=1)
    assert lengths.min() == pytest.approx(RADIUS)
    tip = corners[np.argmax(lengths)] / lengths.max()
    np.testing.assert_allclose(tip, [math.cos(phi), math.sin(phi)], atol=1e-9)


@given(sizes, sizes, headings, st.sampled_from([1.0, 3.0]))
def test_the_ellipse_is_where_the_squared_distance_is_that_of_its_deviations(
    a: float, b: float, turn: float, deviations: float
) -> None:
    c, s = math.cos(turn), math.sin(turn)
    R = np.array([[c, -s], [s, c]])
    P = np.eye(3)
    P[:2, :2] = R @ np.diag([a * a, b * b]) @ R.T
    points = shapes.ellipse(np.array([1.0, 2.0]), *shapes.half_axes(P, deviations)) - [1.0, 2.0]
    squares = (points * np.linalg.solve(P[:2, :2], points.T).T).sum(axis=1)
    np.testing.assert_allclose(squares, deviations**2, rtol=1e-6)
    np.testing.assert_allclose(points[0], points[-1], atol=1e-9)


@given(headings, st.floats(0.0, 3.1))
def test_the_fan_spans_the_headings_that_are_likely(phi: float, half_angle: float) -> None:
    arc = shapes.fan(np.array([0.0, 0.0, phi]), half_angle, 0.5)[1:-1]
    along = arc @ np.array([math.cos(phi), math.sin(phi)]) / 0.5
    assert along.min() == pytest.approx(math.cos(half_angle), abs=1e-9)
    np.testing.assert_allclose(np.linalg.norm(arc, axis=1), 0.5)
    whole = shapes.fan(np.array([0.0, 0.0, phi]), 4.0, 0.5)
    np.testing.assert_allclose(np.linalg.norm(whole, axis=1), 0.5)


@pytest.mark.parametrize("curve", [ellipse(3.763, math.sqrt(2.0)), EGG, BEAN], ids=lambda curve: curve.name)
def test_the_floor_is_light_within_the_wall_and_only_there(curve: Curve) -> None:
    picture = floor_picture(curve)
    centre, half = extent(curve)
    rows, columns = picture.shape[:2]
    rng = np.random.default_rng(0)
    for p in centre + half * rng.uniform(-1.0, 1.0, (300, 2)):
        if curve.distance(p) > 0.05:
            column = int((p[0] - centre[0] + half[0]) / (2.0 * half[0]) * columns)
            row = int((centre[1] + half[1] - p[1]) / (2.0 * half[1]) * rows)
            light = picture[row, column].min() > 0.5 * (min(INSIDE) + min(OUTSIDE)) - 30.0
            assert (picture[row, column].tolist() != list(OUTSIDE)) == curve.contains(p), (p, light)


def test_a_pale_colour_lies_between_the_floor_and_itself() -> None:
    colour = (0.1, 0.2, 0.9)
    assert pale(colour, 1.0) == pytest.approx(colour)
    assert pale(colour, 0.0) == pytest.approx([channel / 255.0 for channel in INSIDE])
