"""Curves as walls: rays end on them, derivatives are exact, symmetries are counted, what is no wall is refused."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import casadi
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN, EGG, Coefficients, Curve, ellipse
from mathnavi.models.field.kernels import curve_point, curve_second_derivative, curve_tangent, range_gradient

STANDARD = ellipse(3.763, math.sqrt(2.0))
CURVES = {"ellipse": STANDARD, "egg": EGG, "bean": BEAN}

curves = pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
angles = st.floats(-math.pi, math.pi)


def harmonics(values: dict[int, complex]) -> Curve:
    """The curve theta_x + i theta_y = sum_k c_k e^{iks}."""
    last = max(abs(k) for k in values)
    rows = []
    for k in range(last + 1):
        plus, minus = values.get(k, 0j), values.get(-k, 0j) if k else 0j
        both, turned = plus + minus, 1j * (plus - minus)
        rows.append((both.real, turned.real, both.imag, turned.imag))
    return Curve(tuple(rows))


@cache
def flower(m: int) -> Curve:
    """A wall that m rotations, and no more, map onto itself."""
    return harmonics({0: 0.3 - 0.2j, 1: 2.0 + 0.0j, 1 - m: 0.15 + 0.1j})


@st.composite
def views(draw: st.DrawFn) -> tuple[Curve, Array, float]:
    """A curve, a pose (3,) within it and the direction of a sensor."""
    curve = CURVES[draw(st.sampled_from(sorted(CURVES)))]
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return curve, curve.draw(rng, draw(st.sampled_from([0.0, 0.05, 0.3]))), draw(angles)


@given(views())
def test_a_ray_ends_on_the_wall(view: tuple[Curve, Array, float]) -> None:
    """(C.4)."""
    curve, pose, alpha = view
    (rho,), (s,) = curve.ranges(pose, np.array([alpha]))
    beta = pose[2] + alpha
    end = pose[:2] + rho * np.array([math.cos(beta), math.sin(beta)])
    assert rho > 0.0
    assert 0.0 <= s < 2.0 * math.pi
    np.testing.assert_allclose(curve.points(np.array(s)), end, rtol=0.0, atol=2e-14 * 4.0)


@given(views(), st.floats(0.02, 0.98))
def test_a_ray_ends_where_it_first_meets_the_wall(view: tuple[Curve, Array, float], share: float) -> None:
    curve, pose, alpha = view
    (rho,), _ = curve.ranges(pose, np.array([alpha]))
    beta = pose[2] + alpha
    on_the_way = pose[:2] + share * rho * np.array([math.cos(beta), math.sin(beta)])
    assume(curve.distance(on_the_way) > 1e-3)  # chords are as near to the wall as that
    assert curve.contains(on_the_way)


@given(views())
def test_the_gradient_of_a_range_is_that_of_differences(view: tuple[Curve, Array, float]) -> None:
    curve, pose, alpha = view
    (rho,), (s,) = curve.ranges(pose, np.array([alpha]))
    beta = pose[2] + alpha
    tangent = curve.tangent(np.array(s))
    steep = abs(tangent[1] * math.cos(beta) - tangent[0] * math.sin(beta)) / np.linalg.norm(tangent)
    assume(steep > 0.3 and curve.distance(pose[:2]) > 0.05)  # a ray that grazes may jump to another part of the wall
    step = 1e-5
    for i, slope in enumerate(range_gradient(curve.table, s, rho, beta)):
        ahead, behind = pose.copy(), pose.copy()
        ahead[i] += step
        behind[i] -= step
        (far,), _ = curve.ranges(ahead, np.array([alpha]))
        (near,), _ = curve.ranges(behind, np.array([alpha]))
        assert (far - near) / (2.0 * step) == pytest.approx(slope, rel=1e-5, abs=1e-5)


def test_a_ray_from_outside_misses_the_wall_or_meets_it_from_there() -> None:
    ahead = np.zeros(1)
    for curve in CURVES.values():
        (rho,), _ = curve.ranges(np.array([9.0, 0.0, 0.0]), ahead)
        assert math.isnan(rho)
        (rho,), _ = curve.ranges(np.array([9.0, 0.0, math.pi]), ahead)
        assert rho == pytest.approx(9.0 - curve.polyline[:, 0][np.abs(curve.polyline[:, 1]) < 0.02].max(), abs=0.05)


@curves
def test_derivatives_are_those_of_casadi(curve: Curve) -> None:
    s = casadi.SX.sym("s")
    theta = curve.symbolic(s)
    tangent = casadi.jacobian(theta, s)
    symbolic = casadi.Function("theta", [s], [theta, tangent, casadi.jacobian(tangent, s)])
    for at in np.linspace(0.0, 2.0 * math.pi, 50):
        expected = [np.array(value).ravel() for value in symbolic(at)]
        for found in (
            [curve.points(at), curve.tangent(at), curve.second_derivative(at)],
            [kernel(curve.table, at) for kernel in (curve_point, curve_tangent, curve_second_derivative)],
        ):
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-14)


def test_the_symmetry_of_a_wall_is_counted() -> None:
    """A flower has as many as petals, and two symmetries together are what they have in common."""
    flowers = [(flower(m), m) for m in (2, 3, 4, 5, 8)]
    two = [(harmonics({1: 2.0 + 0j, -3: 0.1 + 0j, k: 0.05 + 0j}), order) for k, order in ((7, 2), (4, 1))]
    for curve, order in ((STANDARD, 2), (EGG, 1), (BEAN, 1), (ellipse(2.0, 2.0), 0), *flowers, *two):
        assert curve.symmetry == order


@given(m=st.sampled_from([2, 3, 5]), seed=st.integers(0, 2**32), alpha=angles)
def test_images_of_a_pose_have_the_same_ranges(m: int, seed: int, alpha: float) -> None:
    curve = flower(m)
    pose = curve.draw(np.random.default_rng(seed), 0.1)
    images = curve.images(pose)
    assert images.shape == (m, 3)
    np.testing.assert_allclose(images[0], pose, atol=1e-15)
    ranges = [curve.ranges(image, np.array([alpha]))[0][0] for image in images]
    np.testing.assert_allclose(ranges, ranges[0], rtol=0.0, atol=1e-9)


@curves
def test_drawn_poses_keep_the_margin_and_fill_the_field(curve: Curve) -> None:
    rng = np.random.default_rng(0)
    poses = np.array([curve.draw(rng, 0.2) for _ in range(400)])
    assert all(curve.contains(place) and curve.distance(place) >= 0.2 for place in poses[:, :2])
    low, high = curve.polyline.min(axis=0), curve.polyline.max(axis=0)
    assert np.all(poses[:, :2].min(axis=0) < low + 0.25 * (high - low))
    assert np.all(poses[:, :2].max(axis=0) > high - 0.25 * (high - low))
    assert abs(poses[:, 2].mean()) < 0.5
    assert np.ptp(poses[:, 2]) > 6.0


@curves
def test_the_distance_to_the_wall_is_that_to_its_nearest_point(curve: Curve) -> None:
    fine = curve.points(np.linspace(0.0, 2.0 * math.pi, 20_001))
    rng = np.random.default_rng(1)
    for _ in range(20):
        place = curve.draw(rng)[:2]
        assert curve.distance(place) == pytest.approx(np.linalg.norm(fine - place, axis=1).min(), abs=1e-3)


def test_the_area_is_that_of_the_ellipse() -> None:
    assert STANDARD.area == pytest.approx(math.pi * 3.763 * math.sqrt(2.0), rel=1e-4)


def eight() -> Coefficients:
    return ((0.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("coefficients", "named"),
    [
        (eight(), "crosses itself near"),
        (((0.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, -1.0)), "runs clockwise"),
        (((0.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.5)), "stands still or has a cusp"),
        (((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)), "stands still"),
        (((0.0, 0.0, 0.0, 0.0),), "K >= 1"),
        (((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)), "shape"),
        (((0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0)), "finite"),
        (((0.0, 0.0, 0.0, 0.0), (1e9, 0.0, 0.0, 1.0)), "up to 1e"),
    ],
    ids=["eight", "clockwise", "cusp", "point", "centre only", "three columns", "nan", "huge"],
)
def test_what_is_no_wall_is_refused(coefficients: Sequence[Sequence[float]], named: str) -> None:
    with pytest.raises(ValueError, match=rf"{named}.*allowed|allowed.*{named}"):
        Curve(coefficients)  # type: ignore[arg-type]


@pytest.mark.parametrize("half_axes", [(0.0, 1.0), (1.0, -1.0), (math.nan, 1.0), (1.0, math.inf)])
def test_an_ellipse_needs_half_axes(half_axes: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=r"half-axis c_. = .*allowed"):
        ellipse(*half_axes)
