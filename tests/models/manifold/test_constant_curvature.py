"""Spaces of constant curvature: exponential, logarithm and transport are what they should be, near and far."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mathnavi.models.manifold.attitude import Attitude, ambient, body_rate, product
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, flat_space, hyperbolic_space, sphere
from mathnavi.models.manifold.manifold import CutLocusError, is_beyond
from mathnavi.models.runge_kutta import Flow

SPACES = [build(n) for n in (2, 3, 5) for build in (sphere, hyperbolic_space, flat_space)]
spaces = pytest.mark.parametrize("space", SPACES, ids=lambda space: space.name)
seeds = st.integers(0, 2**32 - 1)
lengths = st.floats(1e-9, 0.999 * math.pi)


@spaces
@given(seeds, lengths)
def test_the_logarithm_undoes_the_exponential(space: ConstantCurvature, seed: int, length: float) -> None:
    rng = np.random.default_rng(seed)
    p = space.draw(rng)
    w = length * space.draw_vector(rng, p)
    q = space.exp(p, w)
    scale = 1e-12 * max(1.0, np.abs(q).max()) ** 2
    assert space.log(p, q) == pytest.approx(w, abs=scale / max(1e-2, math.pi - length) if space.kappa > 0.0 else scale)
    assert space.distance(p, q) == pytest.approx(length, rel=1e-6, abs=scale)
    assert space.distance(p, q) == space.distance(q, p)
    space.check(q)


@spaces
@given(seeds, lengths)
def test_transport_keeps_lengths_and_angles_and_comes_back(space: ConstantCurvature, seed: int, length: float) -> None:
    rng = np.random.default_rng(seed)
    p = space.draw(rng)
    along = length * space.draw_vector(rng, p)
    u, w, q = space.draw_vector(rng, p), space.draw_vector(rng, p), space.exp(p, along)
    there_u, there_w = space.transport(p, q, u), space.transport(p, q, w)
    near = 1e-9 * max(1.0, np.abs(q).max() ** 3)
    assert space.inner(q, there_u, there_w) == pytest.approx(space.inner(p, u, w), abs=near)
    assert space.transport(q, p, there_u) == pytest.approx(u, abs=near)
    # The velocity of a geodesic stays that: what leads there leads back.
    assert space.transport(p, q, along) == pytest.approx(-space.log(q, p), abs=10.0 * near)
    if space.kappa:
        assert space.tangent(q, there_u) == pytest.approx(there_u, abs=near)


@spaces
def test_the_exponential_is_a_geodesic(space: ConstantCurvature) -> None:
    """p'' = -k <p', p'> p."""
    import casadi

    rng, n, k = np.random.default_rng(3), space.size, space.kappa
    signs = casadi.DM([-1.0 if k < 0.0 else 1.0] + [1.0] * (n - 1))

    def rate(x: casadi.SX, u: casadi.SX) -> casadi.SX:
        p, v = x[:n], x[n:]
        return casadi.vertcat(v, -k * casadi.dot(v * signs, v) * p)

    p = space.draw(rng)
    w = 1.7 * space.draw_vector(rng, p)
    after = Flow(rate, 2 * n, 1)(np.concatenate([p, w]), np.zeros(1), 1.0)
    q = space.exp(p, w)
    assert q == pytest.approx(after[:n], abs=1e-8)
    assert space.transport(p, q, w) == pytest.approx(after[n:], abs=1e-8)


@spaces
def test_nothing_is_lost_between_points_that_are_nearly_the_same(space: ConstantCurvature) -> None:
    rng = np.random.default_rng(1)
    p = space.draw(rng)
    for length in (1e-15, 1e-12, 1e-7):
        w = length * space.draw_vector(rng, p)
        assert space.log(p, p + w) == pytest.approx(w, rel=1e-6, abs=1e-15)
    assert np.array_equal(space.log(p, p), np.zeros(space.size))
    assert space.distance(p, p) == 0.0
    assert space.exp(p, np.zeros(space.size)) == pytest.approx(p, abs=1e-15)


@given(seeds)
def test_opposite_points_of_the_sphere_are_refused(seed: int) -> None:
    space = sphere(3)
    p = space.draw(np.random.default_rng(seed))
    for function in (space.log, lambda a, b: space.transport(a, b, np.ones(4))):
        with pytest.raises(CutLocusError, match=r"opposite points of S\^3"):
            function(p, -p)
    assert space.distance(p, -p) == pytest.approx(math.pi)
    assert is_beyond(space, p, -p)
    assert not is_beyond(space, p, space.exp(p, 3.0 * space.draw_vector(np.random.default_rng(seed), p)))


@given(seeds)
def test_geodesics_of_hyperbolic_space_are_all_shortest(seed: int) -> None:
    space, rng = hyperbolic_space(2), np.random.default_rng(seed)
    p = space.draw(rng, radius=5.0)
    assert not is_beyond(space, p, space.exp(p, 9.0 * space.draw_vector(rng, p)))


@pytest.mark.parametrize("kappa", [1.0, -1.0])
def test_the_curvature_term_turns_the_velocity_only(kappa: float) -> None:
    """<R(eta, G) eta, eta> = 0, and <R(eta, G) eta, G> = -kappa times the square of their area."""
    space, rng = ConstantCurvature(3, kappa), np.random.default_rng(5)
    p = space.draw(rng)
    eta, G = 2.0 * space.draw_vector(rng, p), 0.7 * space.draw_vector(rng, p)
    R = space.curvature(p, eta, G)
    area = space.inner(p, eta, eta) * space.inner(p, G, G) - space.inner(p, eta, G) ** 2
    assert space.inner(p, R, eta) == pytest.approx(0.0, abs=1e-12)
    assert space.inner(p, R, G) == pytest.approx(-kappa * area, rel=1e-9)


@spaces
def test_frames_are_orthonormal(space: ConstantCurvature) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        p = space.draw(rng)
        frame = space.frame(p)
        gram = [[space.inner(p, a, b) for b in frame.T] for a in frame.T]
        assert np.array(gram) == pytest.approx(np.eye(space.dimension), abs=1e-9)


@pytest.mark.parametrize(
    ("space", "point", "expected"),
    [
        (sphere(2), [1.0, 0.1, 0.0], r"off S\^2: <p, p> = 1.01; allowed: 1"),
        (sphere(2), [1.0, 0.0], "allowed on S\\^2: 3 finite numbers"),
        (sphere(2), [math.nan, 0.0, 0.0], "allowed on S\\^2: 3 finite numbers"),
        (hyperbolic_space(2), [-1.0, 0.0, 0.0], r"allowed: -1, p_0 > 0"),
        (hyperbolic_space(2), [0.0, 1.0, 0.0], r"off H\^2"),
        (flat_space(2), [math.inf, 0.0], "2 finite numbers"),
    ],
)
def test_points_off_the_space_are_refused(space: ConstantCurvature, point: list[float], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        space.check(np.array(point))


@pytest.mark.parametrize(("n", "kappa"), [(0, 0.0), (1, 1.0), (1, -1.0), (2, 0.5), (2, math.nan)])
def test_spaces_that_are_none_are_refused(n: int, kappa: float) -> None:
    with pytest.raises(ValueError, match=r"(kappa|dimension) = .*; allowed"):
        ConstantCurvature(n, kappa)


# ---- attitudes


def drawn(rng: np.random.Generator) -> np.ndarray:
    return sphere(3).draw(rng)


def rotation(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


@given(seeds)
def test_attitudes_agree_with_rotations(seed: int) -> None:
    rng, attitude = np.random.default_rng(seed), Attitude()
    p, q, omega = drawn(rng), drawn(rng), rng.uniform(-1.0, 1.0, 3)
    assert rotation(product(p, q)).as_matrix() == pytest.approx(rotation(p).as_matrix() @ rotation(q).as_matrix())
    turned = rotation(p) * Rotation.from_rotvec(omega)
    assert rotation(attitude.exp(p, omega)).as_matrix() == pytest.approx(turned.as_matrix(), abs=1e-12)
    difference = (rotation(p).inv() * rotation(q)).as_rotvec()
    assert attitude.log(p, q) == pytest.approx(difference, abs=1e-7)
    assert 2.0 * attitude.distance(p, q) == pytest.approx(float(np.linalg.norm(difference)), abs=1e-7)
    assert attitude.log(p, -q) == pytest.approx(attitude.log(p, q), abs=1e-12)
    assert body_rate(p, ambient(p, omega)) == pytest.approx(omega, abs=1e-14)


@given(seeds)
def test_the_rate_of_a_free_body_is_transported_along_its_way(seed: int) -> None:
    rng, attitude = np.random.default_rng(seed), Attitude()
    p, omega = drawn(rng), rng.uniform(-1.0, 1.0, 3)
    q = attitude.exp(p, omega)
    for end in (q, -q):
        assert attitude.transport(p, end, omega) == pytest.approx(omega, abs=1e-12)
    other = rng.uniform(-1.0, 1.0, 3)
    assert attitude.norm(q, attitude.transport(p, q, other)) == pytest.approx(attitude.norm(p, other))


def test_attitudes_half_a_turn_apart_are_refused() -> None:
    p, q = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0, 0.0])
    for function in (Attitude().log, lambda a, b: Attitude().transport(a, b, np.ones(3))):
        with pytest.raises(CutLocusError, match="half a turn apart"):
            function(p, q)


@pytest.mark.parametrize("distance", [1e2, 1e4, 1e6])
def test_far_out_a_point_is_put_back_above_where_it_is(distance: float) -> None:
    """<p, p> is the small difference of large numbers there, and has no sign that could be trusted."""
    space = hyperbolic_space(2)
    point = space.check(
        np.array([distance, distance, 0.0]) if distance > 1e2 else np.array([math.hypot(1.0, distance), distance, 0.0])
    )
    assert point == pytest.approx([math.hypot(1.0, distance), distance, 0.0], rel=1e-15)
    with pytest.raises(ValueError, match="is off H"):
        space.check(np.array([1e200, 1e200, 0.0]))
