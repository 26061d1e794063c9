"""Point systems and the rigid body: energy is kept, forces are gradients, what no system could be is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, flat_space, hyperbolic_space, sphere
from mathnavi.models.manifold.mission import LagrangianMission, ManifoldPositionSensor, PositionQuality
from mathnavi.models.manifold.systems import PointSystem, RigidBody, chart, linear, printed

SPACES = [sphere(3), hyperbolic_space(2), flat_space(2)]
spaces = pytest.mark.parametrize("space", SPACES, ids=lambda space: space.name)


@spaces
def test_energy_is_kept_and_the_point_stays_on_the_space(space: ConstantCurvature) -> None:
    system, rng = PointSystem(space, linear(3.0, 0)), np.random.default_rng(0)
    p = space.draw(rng)
    x = system.state(p, 2.0 * space.draw_vector(rng, p))
    n = space.size

    def energy(state: Array) -> float:
        return 0.5 * space.norm(state[:n], state[n:]) ** 2 + 3.0 * float(state[0])

    after, reached = system.reach(x, np.zeros(n), 3.0)
    assert reached == 3.0
    assert energy(after) == pytest.approx(energy(x), abs=1e-7)
    space.check(after[:n])
    if space.kappa:
        assert space.inner(after[:n], after[:n], after[n:]) == pytest.approx(0.0, abs=1e-9)


@spaces
def test_the_force_is_minus_the_gradient(space: ConstantCurvature) -> None:
    system, rng, h = PointSystem(space, linear(3.0, 1)), np.random.default_rng(1), 1e-4
    p = space.draw(rng)
    w = space.draw_vector(rng, p)
    F = system.force(p, w, np.zeros(space.size))
    slope = 3.0 * (space.exp(p, h * w)[1] - space.exp(p, -h * w)[1]) / (2.0 * h)
    assert space.inner(p, F, w) == pytest.approx(-slope, abs=1e-6)


@spaces
def test_a_step_of_the_model_is_of_the_second_order(space: ConstantCurvature) -> None:
    system, rng = PointSystem(space, linear(3.0, 0)), np.random.default_rng(2)
    p = space.draw(rng)
    x, u = system.state(p, 2.0 * space.draw_vector(rng, p)), np.full(space.size, 0.3)
    errors = []
    for h in (0.02, 0.01):
        at = x
        for _ in range(round(1.0 / h)):
            at = system.flow(at, u, h)
        errors.append(float(np.abs(at - system.reach(x, u, 1.0)[0]).max()))
    assert errors[0] < 1e-2
    assert space.kappa == 0.0 or 3.0 < errors[0] / errors[1] < 5.0  # in R^n it is exact


def test_the_force_of_d_5_is_that_of_its_angles() -> None:
    """F = -grad W with W = sin x_1 cos x_2 cos x_3, g = diag(1, sin^2 x_1, sin^2 x_1 sin^2 x_2)."""
    x = np.array([1.0, 0.7, 2.0])
    point, slope = chart(x)
    metric = slope.T @ slope
    (s_1, s_2, s_3), (c_1, c_2, c_3) = np.sin(x), np.cos(x)
    assert metric == pytest.approx(np.diag([1.0, s_1**2, (s_1 * s_2) ** 2]), abs=1e-12)
    gradient = np.array([c_1 * c_2 * c_3, -s_1 * s_2 * c_3, -s_1 * c_2 * s_3])
    expected = -slope @ np.linalg.solve(metric, gradient)
    assert PointSystem(sphere(3), printed).force(point, point, np.zeros(4)) == pytest.approx(expected, abs=1e-12)


def test_a_torque_turns_a_body_as_euler_has_it() -> None:
    body, x = RigidBody(0.05), np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for _ in range(1000):
        x = body.flow(x, np.array([0.0, 0.0, 0.05]), 1e-3)
    assert x[4:] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert x[:4] == pytest.approx([math.cos(0.25), 0.0, 0.0, math.sin(0.25)], abs=1e-9)


# ---- sensors


class Still:
    """A motion that stands still."""

    def __init__(self, x: Array) -> None:
        self.x, self.acceleration = x, x[:0]

    def sensed(self, name: str) -> Array:
        raise ValueError(name)


@spaces
def test_noise_is_that_of_the_coordinates(space: ConstantCurvature) -> None:
    rng, p = np.random.default_rng(3), space.draw(np.random.default_rng(0))
    sensor = ManifoldPositionSensor(space, PositionQuality(noise=0.02), 1000.0)
    motion = Still(np.concatenate([p, np.zeros(space.size)]))
    drawn = [sensor.read(motion, rng) for _ in range(2000)]
    errors = np.array([space.coordinates(p, y) for y in drawn if y is not None])
    assert errors.std(axis=0) == pytest.approx(np.full(space.dimension, 0.02), rel=0.08)
    assert errors.mean(axis=0) == pytest.approx(np.zeros(space.dimension), abs=0.002)


def test_what_is_drawn_does_not_depend_on_how_large_errors_are() -> None:
    space, p = sphere(2), sphere(2).origin
    motion = Still(np.concatenate([p, np.zeros(3)]))

    def first(**quality: float) -> Array | None:
        rng = np.random.default_rng(5)
        sensor = ManifoldPositionSensor(space, PositionQuality(**quality), None)  # type: ignore[arg-type]
        sensor.read(motion, rng)
        return sensor.read(motion, rng)

    small, large = first(noise=0.01), first(noise=0.02, dropout=1e-9)
    assert small is not None
    assert large is not None
    assert 2.0 * space.log(p, small) == pytest.approx(space.log(p, large), abs=1e-12)
    assert first(dropout=1.0) is None
    jumped = first(jump=1.0, jump_size=0.3)
    assert jumped is not None
    assert space.coordinates(p, jumped) == pytest.approx([0.3, 0.3])


def test_where_there_are_no_encoders_none_can_round() -> None:
    sensor = ManifoldPositionSensor(sphere(2), PositionQuality(resolution=12), None)
    with pytest.raises(ValueError, match="resolution = 12; allowed on S\\^2, which has no encoders: 0"):
        sensor.read(Still(np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])), np.random.default_rng(0))


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"noise": -0.1}, "noise = -0.1"),
        ({"noise": math.nan}, "noise = nan"),
        ({"dropout": 1.5}, "dropout = 1.5"),
        ({"resolution": 40}, "resolution = 40"),
    ],
)
def test_qualities_that_are_none_are_refused(fields: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=f"{named}; allowed"):
        PositionQuality(**fields)  # type: ignore[arg-type]


@pytest.mark.parametrize("period", [0.0, -1e-3, math.nan, math.inf])
def test_periods_that_no_sensor_has_are_refused(period: float) -> None:
    with pytest.raises(ValueError, match=r"period = .*; allowed"):
        LagrangianMission(RigidBody(0.05), period=period)
