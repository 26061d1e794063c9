"""The geometry of mass matrices: against finite differences of M, known spaces and the orders of error it states."""

from __future__ import annotations

import copy
import pickle
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.manifold import is_beyond
from mathnavi.models.mechanism import kernels
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.geometry import MechanismManifold
from tests.mechanisms import chain, somewhere

CHAINS = ("hh", "shh", "hhhhhhh", "b", "hb", "bsb", "fhb")


def bracket(manifold: MechanismManifold, u: Array, w: Array) -> Array:
    """u x w of each ball joint, and of the attitude of each free joint, by numpy."""
    turned = np.zeros(manifold.dimension)
    for k in manifold._at.balls:
        turned[k : k + 3] = np.cross(u[k : k + 3], w[k : k + 3])
    return turned


def koszul(manifold: MechanismManifold, p: Array) -> Array:
    """Gamma (n, n, n) by differences of M: first the component, then the direction."""
    n, h, e = manifold.dimension, 1e-5, np.eye(manifold.dimension)
    M = manifold.mass(p)
    d = [(manifold.mass(manifold.point(p, h * s)) - manifold.mass(manifold.point(p, -h * s))) / (2.0 * h) for s in e]
    lowered = np.zeros((n, n, n))
    for i, j, k in np.ndindex(n, n, n):
        slopes = d[i][j, k] + d[j][i, k] - d[k][i, j]
        frames = bracket(manifold, e[i], e[j]) @ M[k] - bracket(manifold, e[j], e[k]) @ M[i]
        lowered[k, i, j] = 0.5 * (slopes + frames + bracket(manifold, e[k], e[i]) @ M[j])
    gamma: Array = np.einsum("lk,kij->lij", np.linalg.inv(M), lowered)
    return gamma


def drawn(joints: str, seed: int) -> tuple[MechanismManifold, Array, np.random.Generator]:
    """A mechanism, a place of it and what draws more."""
    model, rng = chain(joints), np.random.default_rng(seed)
    manifold = MechanismManifold(model)
    return manifold, somewhere(manifold, model, rng), rng


@pytest.mark.parametrize("joints", CHAINS)
def test_the_connection_is_that_of_the_mass_matrix(joints: str) -> None:
    manifold, p, _ = drawn(joints, 1)
    e = np.eye(manifold.dimension)
    gamma = koszul(manifold, p)
    for i, j in np.ndindex(len(e), len(e)):
        np.testing.assert_allclose(manifold.christoffel(p, e[i], e[j]), gamma[:, i, j], atol=1e-8)


@pytest.mark.parametrize("joints", CHAINS)
def test_the_mass_matrix_is_that_of_mujoco_with_its_armature(joints: str) -> None:
    model, rng = chain(joints, option='gravity="0 0 -3"'), np.random.default_rng(2)
    manifold, data, M = MechanismManifold(model), mujoco.MjData(model), np.zeros((model.nv, model.nv))
    p, w = somewhere(manifold, model, rng), rng.normal(size=model.nv)
    data.qpos[:] = p
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, M)
    np.testing.assert_array_equal(manifold.mass(p), M)
    assert manifold.norm(p, w) == pytest.approx(np.sqrt(w @ M @ w), rel=1e-12)


def along(manifold: MechanismManifold, p: Array, w: Array, steps: int = 200) -> tuple[Array, Array]:
    """The geodesic from p with the velocity w, by many short ones; its velocity at the end."""
    for _ in range(steps):
        q = manifold.exp(p, w / steps)
        p, w = q, manifold.transport(p, q, w)
    return p, w


@pytest.mark.parametrize("joints", CHAINS)
def test_exp_and_log_err_by_the_fourth_order_and_transport_by_the_third(joints: str) -> None:
    manifold, p, rng = drawn(joints, 3)
    w, errors = rng.normal(size=manifold.dimension), []
    w /= np.linalg.norm(w)
    for share in (0.2, 0.1):
        q, v = along(manifold, p, share * w)
        carried_error = (manifold.transport(p, q, share * w) - v) / share
        differences = manifold.coordinates(q, manifold.exp(p, share * w)), manifold.log(p, q) - share * w, carried_error
        errors.append([np.abs(each).max() for each in differences])
    (exp, log, transport), (exp_half, log_half, transport_half) = errors
    assert max(exp_half / exp, log_half / log) < 2.0**-3.3
    assert transport_half < max(2.0**-2.3 * transport, 1e-6)  # better than that in the plane
    assert np.array(errors).max() < 0.02


@pytest.mark.parametrize("joints", CHAINS)
def test_energy_is_conserved_along_a_geodesic(joints: str) -> None:
    manifold, p, rng = drawn(joints, 4)
    w = rng.normal(size=manifold.dimension)
    q, v = along(manifold, p, w, 1000)
    assert manifold.norm(q, v) == pytest.approx(manifold.norm(p, w), rel=1e-11)
    assert np.abs(manifold.coordinates(p, q)).max() > 0.1
    assert manifold.norm(q, manifold.log(q, manifold.exp(q, 0.01 * v))) == pytest.approx(
        0.01 * manifold.norm(p, w), rel=1e-3
    )


@pytest.mark.parametrize("joints", CHAINS)
def test_transport_is_orthogonal_and_undone_by_the_way_back(joints: str) -> None:
    manifold, p, rng = drawn(joints, 5)
    u, w = rng.normal(size=(2, manifold.dimension))
    q = manifold.exp(p, 1e-3 * u)
    there = manifold.transport(p, q, w)
    assert manifold.norm(q, there) == pytest.approx(manifold.norm(p, w), rel=1e-12)
    np.testing.assert_allclose(manifold.transport(q, p, there), w, atol=1e-7)
    np.testing.assert_allclose(manifold.transport(p, p, w), w, rtol=1e-14)


@pytest.mark.parametrize("joints", CHAINS)
def test_far_points_are_held_near_the_straight_line(joints: str) -> None:
    manifold, p, rng = drawn(joints, 11)
    w = 20.0 * rng.normal(size=manifold.dimension)
    q = manifold.point(p, w)
    d = manifold.coordinates(p, q)
    third = manifold.point(p, d / 3.0)
    assert manifold.norm(third, manifold.log(p, q) - d) <= 0.5 * manifold.norm(third, d) * (1.0 + 1e-9)
    assert np.isfinite(manifold.exp(p, w)).all()
    assert manifold.norm(q, manifold.transport(p, q, w)) == pytest.approx(manifold.norm(p, w))


def test_the_cart_pendulum_is_flat() -> None:
    model, rng = build_model("cart-pendulum"), np.random.default_rng(6)
    manifold = MechanismManifold(model)
    for _ in range(20):
        p, X, Y = rng.normal(size=(3, 2))
        np.testing.assert_allclose(manifold.curvature(p, X, Y), 0.0, atol=1e-9)
        assert np.abs(manifold.christoffel(p, X, Y)).max() > 1e-3


def test_the_rigid_body_is_the_manifold_of_attitudes() -> None:
    model, rng, space = build_model("rigid-body"), np.random.default_rng(7), Attitude()
    manifold = MechanismManifold(model)
    assert manifold.injectivity_radius == pytest.approx(2.0 * np.sqrt(0.05) * space.injectivity_radius)
    for _ in range(20):
        p, X, Y = somewhere(manifold, model, rng), *rng.normal(size=(2, 3))
        q = manifold.exp(p, Y)
        np.testing.assert_allclose(manifold.curvature(p, X, Y), space.curvature(p, X, Y), atol=1e-9)
        np.testing.assert_allclose(np.outer(q, q), np.outer(space.exp(p, Y), space.exp(p, Y)), atol=1e-12)
        np.testing.assert_allclose(manifold.log(p, q), space.log(p, q), atol=1e-12)
        np.testing.assert_allclose(manifold.coordinates(p, q), space.coordinates(p, q), atol=1e-12)
        near = manifold.exp(p, 0.01 * Y)
        np.testing.assert_allclose(manifold.transport(p, near, X), space.transport(p, near, X), atol=1e-5)


@pytest.mark.parametrize("joints", ["hh", "hhhhhhh", "hb", "bsb"])
def test_the_curvature_has_the_symmetries_of_a_curvature(joints: str) -> None:
    manifold, p, rng = drawn(joints, 8)
    X, Y, Z = rng.normal(size=(3, manifold.dimension))
    M, R = manifold.mass(p), manifold.curvature(p, X, Y)
    size = float(np.sqrt(R @ M @ R))
    assert size > 1e-2
    assert abs(X @ M @ R) < 1e-7 * size
    assert pytest.approx(Y @ M @ manifold.curvature(p, X, Z), abs=1e-7 * size) == Z @ M @ R
    np.testing.assert_allclose(manifold.curvature(p, 3.0 * X, -2.0 * Y), -18.0 * R, atol=1e-6 * size)
    np.testing.assert_allclose(manifold.curvature(p, X, X), 0.0, atol=1e-7 * size)
    np.testing.assert_array_equal(manifold.curvature(p, 0.0 * X, Y), 0.0 * X)


@pytest.mark.parametrize("joints", ["hh", "hb"])
def test_a_vector_carried_around_a_loop_is_turned_by_the_curvature(joints: str) -> None:
    """R(X, Y) X, with X carried around the geodesic triangle of h X and h Y: half of the parallelogram."""
    manifold, p, rng = drawn(joints, 9)
    X, Y, h = *rng.normal(size=(2, manifold.dimension)), 2e-2

    def around(sign: float) -> Array:
        corners = [p, manifold.exp(p, sign * h * Y), manifold.exp(p, sign * h * X), p]
        w = X
        for a, b in pairwise(corners):
            w = carried(manifold, a, b, w)
        change: Array = w - X
        return change

    turned = 0.5 * (around(1.0) + around(-1.0)) / (0.5 * h * h)
    R = manifold.curvature(p, X, Y)
    np.testing.assert_allclose(turned, R, atol=0.02 * np.abs(R).max())


def carried(manifold: MechanismManifold, a: Array, b: Array, w: Array, steps: int = 200) -> Array:
    """w, carried along the geodesic from a to b in many steps."""
    direction = manifold.log(a, b)
    for _ in range(3):  # until it leads there
        direction = direction + manifold.coordinates(along(manifold, a, direction)[0], b)
    for _ in range(steps):
        after = manifold.exp(a, direction / steps)
        w, direction, a = manifold.transport(a, after, w), manifold.transport(a, after, direction), after
    return w


def test_encoders_round_turns_and_metres() -> None:
    manifold = MechanismManifold(chain("sh"))
    p = np.array([0.123456, -7.654321])
    step = np.array([1.0, 2.0 * np.pi]) / 2.0**14
    rounded = manifold.rounded(p, 14)
    assert (np.abs(rounded - p) <= 0.5 * step).all()
    np.testing.assert_allclose(rounded / step, np.round(rounded / step), atol=1e-9)
    np.testing.assert_array_equal(manifold.rounded(p, 0), p)


def test_a_full_pose_is_rounded_as_encoders_are() -> None:
    manifold, p, _ = drawn("fb", 12)
    rounded = manifold.rounded(p, 14)
    error = np.abs(manifold.coordinates(p, rounded))
    assert (error[:3] <= 0.5 / 2.0**14).all()
    assert (error[3:] <= 2.0 * np.pi / 2.0**14).all()
    assert error.all()
    np.testing.assert_array_equal(manifold.check(rounded), rounded)


def test_a_chart_is_undone_by_its_inverse() -> None:
    manifold, p, rng = drawn("hbs", 10)
    c = rng.uniform(-1.0, 1.0, 5)
    np.testing.assert_allclose(manifold.coordinates(p, manifold.point(p, c)), c, atol=1e-12)
    np.testing.assert_array_equal(manifold.vector(p, manifold.components(p, c)), c)
    strided = np.repeat(c, 2)[::2]
    np.testing.assert_array_equal(manifold.point(p, strided), manifold.point(p, c))


def test_half_a_turn_of_a_ball_is_beyond_what_has_one_geodesic_and_still_finite() -> None:
    manifold = MechanismManifold(build_model("rigid-body"))
    p, q = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0, 0.0])
    assert np.isfinite(manifold.log(p, q)).all()
    assert is_beyond(manifold, p, q, 0.99)
    assert MechanismManifold(chain("hh")).injectivity_radius == np.inf


@pytest.mark.parametrize("wrong", [[0.0], [0.0, np.nan, 0, 0, 0], [0.0, 1.0, 0.2, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0]])
def test_what_is_no_point_is_refused(wrong: list[float]) -> None:
    with pytest.raises(ValueError, match=r"point = .*allowed"):
        MechanismManifold(chain("hb")).check(np.array(wrong))


@pytest.mark.parametrize("off", [3e-7, 4e-6, 5e-4, 6e-3])
def test_a_quaternion_off_by_rounding_to_some_decimals_is_projected(off: float) -> None:
    for manifold, before in ((MechanismManifold(chain("hb")), [0.5]), (Attitude(), [])):
        p = manifold.check(np.array([*before, 0.6 + off, 0.0, 0.8, 0.0]))
        assert np.linalg.norm(p[-4:]) == pytest.approx(1.0, abs=1e-15)
        assert p[:-4].tolist() == before


def test_a_vector_of_another_size_is_refused() -> None:
    manifold, p = MechanismManifold(chain("hh")), np.zeros(2)
    for call in (manifold.exp, manifold.log, manifold.norm, manifold.point, manifold.coordinates):
        for wrong in (np.zeros(1), np.zeros(3)):
            with pytest.raises(ValueError, match=r"size|shape"):
                call(p, wrong)


TENDON = '<tendon><fixed name="t" armature="1"><joint joint="joint_0" coef="1"/></fixed></tendon>'
MOTOR = '<actuator><motor joint="joint_2" gear="1 0 0" armature="1"/></actuator>'
TWICE = "<body><joint axis='1 0 0'/><joint axis='1 0 0'/><geom size='.1'/></body>"
REFUSED = {
    "no joints": mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='.1'/></worldbody></mujoco>"),
    ".*not positive definite": mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{TWICE}</worldbody></mujoco>"),
    "armature of tendons": chain("hhb", TENDON),
    "armature of actuators": chain("hhb", MOTOR),
}


@pytest.mark.refused("MJCF", "armature of tendons, and of actuators that turn no slide or hinge")
@pytest.mark.refused("MJCF", "a joint that moves no mass")
@pytest.mark.parametrize(("reason", "model"), REFUSED.items(), ids=REFUSED)
def test_what_is_no_mechanism_is_refused(reason: str, model: mujoco.MjModel) -> None:
    with pytest.raises(ValueError, match=f"model = one with {reason}.*; allowed: joints, each of which moves mass"):
        MechanismManifold(model)


def test_the_armature_of_an_actuator_at_a_hinge_counts() -> None:
    extra = '<actuator><motor joint="joint_0" gear="3" armature="2"/></actuator>'
    more = MechanismManifold(chain("hh", extra)).mass(np.zeros(2)) - MechanismManifold(chain("hh")).mass(np.zeros(2))
    np.testing.assert_allclose(more, [[18.0, 0.0], [0.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda m: pickle.loads(pickle.dumps(m))])
def test_a_copy_has_memory_of_its_own(duplicate: type) -> None:
    manifold, p, w = MechanismManifold(chain("hb")), np.array([0.1, 1.0, 0.0, 0.0, 0.0]), np.ones(4)
    other = duplicate(manifold)
    expected = manifold.exp(p, w)
    del manifold
    np.testing.assert_array_equal(other.exp(p, w), expected)


def test_one_mechanism_does_not_disturb_another() -> None:
    one, two, p, w = MechanismManifold(chain("hh")), MechanismManifold(chain("hh")), np.array([0.3, 0.4]), np.ones(2)
    kernels.locate(one._at, p)
    expected = one.christoffel(p, w, w)
    two.exp(p + 1.0, w)
    np.testing.assert_array_equal(one.christoffel(p, w, w), expected)
