"""The missile's Kalman filter: its Jacobian, its consistency, and what it finds out about a gust that lasts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.missile_kalman import MissileKalman, MissileKalmanConfig, disturbing_input, transition
from mathnavi.estimators.moving_horizon import MovingHorizonEstimator
from mathnavi.interfaces.reading_counts import Unused, unused_in
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.missile.coordinates import COORDINATES, PLANAR, SPATIAL, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL
from mathnavi.models.missile.mission import CASES, GustStrength, MissileMission, StateNoise, Target

PERIOD = 0.004  # [s]
NOISE = StateNoise(position=1.0, velocity=0.5, angle=0.01, rate=0.01)

both = pytest.mark.parametrize("coordinates", COORDINATES.values(), ids=COORDINATES)


def mission(coordinates: Coordinates) -> MissileMission:
    start = np.zeros(coordinates.state_size)
    start[coordinates.index("u")], start[coordinates.index("z_e")] = 120.0, -400.0
    return MissileMission(tuple(start), Target((700.0, 0.0, 0.0)), CASES["SM"], coordinates, noise=NOISE)


def flown(
    coordinates: Coordinates, force: Array, moment: float, duration: float, seed: int
) -> tuple[list[Estimate], Array]:
    """Estimates and truths (n, nx) of level flight under a constant force (3,) [N], Earth frame, and moment [N m]."""
    task, rng = mission(coordinates), np.random.default_rng(seed)
    filter_, x = MissileKalman(MissileKalmanConfig(), task), task.start_state
    u = np.zeros(coordinates.input_size)
    u[coordinates.index("F_z")] = -NOMINAL.mass * NOMINAL.gravity
    estimates, truths = [], []
    for k in range(round(duration / PERIOD)):
        reading = x + NOISE.deviations(coordinates) * rng.standard_normal(len(x))
        readings = [Measurement("full_state", k * PERIOD, reading)] if k % 5 == 0 else []
        estimates.append(filter_.update(k * PERIOD, readings, u if k else np.zeros_like(u)))
        truths.append(x)
        s = coordinates.in_space(x)
        c, sin = math.cos(s[5]), math.sin(s[5])
        along, down = c * force[0] - sin * force[2], sin * force[0] + c * force[2]  # psi stays near 0
        pushed = {"F_x": along, "F_y": force[1], "F_z": down, "M": moment, "N": 0.0}
        x = coordinates.flow(x, u + [pushed[name] for name in coordinates.inputs], PERIOD)
    return estimates, np.array(truths)


@both
def test_the_transition_is_the_declared_flow_and_its_jacobian_is_that_of_differences(coordinates: Coordinates) -> None:
    rng = np.random.default_rng(0)
    size = coordinates.state_size + coordinates.input_size
    z = rng.normal(size=size) * np.r_[np.full(coordinates.state_size, 0.3), np.full(coordinates.input_size, 300.0)]
    z[coordinates.index("u")] = 100.0
    u, h = rng.normal(size=coordinates.input_size) * 1e3, 0.004
    step = transition(coordinates, NOMINAL, 5.0)
    after, jacobian = (np.array(part) for part in step(z, u, h))
    undisturbed = z.copy()
    undisturbed[coordinates.state_size :] = 0.0
    moved = np.array(step(undisturbed, u, h)[0]).ravel()[: coordinates.state_size]
    np.testing.assert_allclose(moved, coordinates.flow(z[: coordinates.state_size], u, h), rtol=1e-12, atol=1e-12)
    for k in range(size):
        e = 1e-5 * max(abs(z[k]), 1.0) * np.eye(size)[k]
        column = (np.array(step(z + e, u, h)[0]) - np.array(step(z - e, u, h)[0])).ravel() / (2.0 * e[k])
        np.testing.assert_allclose(jacobian[:, k], column, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(after[coordinates.state_size :, 0], z[coordinates.state_size :] * math.exp(-h / 5.0))


def test_a_force_of_the_earth_frame_is_turned_into_the_body() -> None:
    dive = np.zeros(9)
    dive[3] = -0.5 * math.pi  # theta: the nose points down, the back ahead
    dive[6:] = 400.0, 100.0, 20.0
    np.testing.assert_allclose(np.array(disturbing_input(PLANAR)(dive)).ravel(), [100.0, -400.0, 20.0], atol=1e-9)


@both
def test_it_finds_a_gust_that_lasts(coordinates: Coordinates) -> None:
    sideways = 150.0 if coordinates is SPATIAL else 0.0
    estimates, _ = flown(coordinates, np.array([400.0, sideways, -250.0]), 20.0, 3.0, seed=1)
    found = np.mean([estimate.extra["disturbance"] for estimate in estimates[-250:]], axis=0)
    true = {"F_x": 400.0, "F_y": sideways, "F_z": -250.0, "M": 20.0, "N": 0.0}
    for name, value in zip(coordinates.inputs, found, strict=True):
        if name in ("F_x", "F_y", "F_z"):
            continue  # the body turns under the moment; their norm is checked below
        assert value == pytest.approx(true[name], abs=8.0)
    forces = [value for name, value in zip(coordinates.inputs, found, strict=True) if name.startswith("F")]
    assert float(np.linalg.norm(forces)) == pytest.approx(float(np.linalg.norm([400.0, sideways, -250.0])), rel=0.25)


@both
def test_its_errors_are_as_large_as_it_says(coordinates: Coordinates) -> None:
    """The normalised error squared, averaged over flights, is chi-squared with nx degrees of freedom."""
    squares = []
    for seed in range(12):
        estimates, truths = flown(coordinates, np.zeros(3), 0.0, 0.8, seed)
        error = estimates[-1].x - truths[-1]
        assert estimates[-1].covariance is not None
        squares.append(float(error @ np.linalg.solve(estimates[-1].covariance, error)))
    n = coordinates.state_size
    assert 0.4 * n < np.mean(squares) < 1.9 * n


def test_it_is_better_than_its_readings() -> None:
    estimates, truths = flown(PLANAR, np.zeros(3), 0.0, 2.0, seed=3)
    error = np.array([estimate.x for estimate in estimates[250:]]) - truths[250:]
    assert (error.std(axis=0) < 0.6 * NOISE.deviations(PLANAR)).all()


def test_an_angle_that_has_gone_round_is_the_same_angle() -> None:
    one, other = (MissileKalman(MissileKalmanConfig(), mission(PLANAR)) for _ in range(2))
    reading = mission(PLANAR).start_state
    turned = reading.copy()
    turned[PLANAR.index("theta")] += 2.0 * math.pi
    command = np.zeros(3)
    x = one.update(0.0, [Measurement("full_state", 0.0, reading)], command).x
    np.testing.assert_allclose(other.update(0.0, [Measurement("full_state", 0.0, turned)], command).x, x, atol=1e-9)


def test_commands_beyond_the_limits_count_as_the_limits() -> None:
    bounded = replace(mission(PLANAR), input_max=(1e3, 3e3, 100.0))
    answers = []
    for command in (np.array([5e3, -9e3, 400.0]), np.array([1e3, -3e3, 100.0])):
        filter_ = MissileKalman(MissileKalmanConfig(), bounded)
        filter_.update(0.0, [Measurement("full_state", 0.0, bounded.start_state)], command)
        answers.append(filter_.update(0.1, [], command).x)
    np.testing.assert_array_equal(answers[0], answers[1])


def test_declared_gusts_make_it_listen_more() -> None:
    calm, windy = mission(PLANAR), replace(mission(PLANAR), gust=GustStrength(force=3000.0, moment=300.0))
    grown = []
    for task in (calm, windy):
        filter_ = MissileKalman(MissileKalmanConfig(), task)
        filter_.update(0.0, [Measurement("full_state", 0.0, task.start_state)], np.zeros(3))
        covariance = filter_.update(0.4, [], np.zeros(3)).covariance
        assert covariance is not None
        grown.append(np.diag(covariance))
    assert (grown[1] > grown[0])[[0, 1, 2]].all()


def test_a_reading_from_the_past_is_counted_and_one_of_another_shape_refused() -> None:
    filter_ = MissileKalman(MissileKalmanConfig(), mission(PLANAR))
    filter_.update(1.0, [], np.zeros(3))
    estimate = filter_.update(1.1, [Measurement("full_state", 0.5, np.zeros(6))], np.zeros(3))
    assert estimate.status is Status.INITIALISING
    assert unused_in(estimate.extra) == {Unused.LATE.value: 1}
    with pytest.raises(ValueError, match=r"\(6,\)"):
        filter_.update(1.1, [Measurement("full_state", 1.1, np.zeros((6, 1)))], np.zeros(3))


def test_without_readings_it_ends_up_lost_and_still_finite() -> None:
    filter_ = MissileKalman(MissileKalmanConfig(), mission(SPATIAL))
    assert filter_.update(0.0, [], np.zeros(5)).status is Status.INITIALISING
    filter_.update(0.1, [Measurement("full_state", 0.1, mission(SPATIAL).start_state)], np.zeros(5))
    last = filter_.update(3.0, [], np.zeros(5))
    assert last.status is Status.LOST
    assert np.isfinite(last.x).all()


SPOILT: dict[str, Callable[[Array, Array, Array], Array]] = {
    "off": lambda y, last, noise: y + 5.0 * NOISE.deviations(PLANAR),
    "noisy": lambda y, last, noise: y + 2.8 * noise,
    "stuck": lambda y, last, noise: last,
    "scaled": lambda y, last, noise: 1.1 * y,
}


@pytest.mark.parametrize("plugin", [MissileKalman, MovingHorizonEstimator])
@pytest.mark.parametrize("fault", [None, *SPOILT])
def test_readings_of_something_else_are_found_within_a_third_of_a_second(plugin: Any, fault: str | None) -> None:
    """Spoilt from 0.6 s on."""
    task, rng = mission(PLANAR), np.random.default_rng(0)
    estimator, x = plugin.build(plugin.Config(), task), task.start_state
    u, last, status = np.zeros(3), x, []
    u[PLANAR.index("F_z")] = -NOMINAL.mass * NOMINAL.gravity
    for k in range(300):
        t, (noise, more) = k * PERIOD, NOISE.deviations(PLANAR) * rng.standard_normal((2, len(x)))
        readings = []
        if k % 5 == 0:
            spoilt = SPOILT[fault] if fault and t >= 0.6 else None
            last = x + noise if spoilt is None else spoilt(x + noise, last, more)
            readings = [Measurement("full_state", t, last)]
        status.append((t, estimator.update(t, readings, u if k else np.zeros(3)).status))
        x = PLANAR.flow(x, u, PERIOD)
    assert all(each is Status.OK for t, each in status if 0.0 < t < 0.6)
    assert all((each is Status.OK) == (fault is None) for t, each in status if t > 0.9)
