"""An observer of velocities is not OK while its model is wrong, declares how good it is, and raises no false alarm."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.velocity.gain_covariance import GainCovariance, Residual
from mathnavi.estimators.velocity.innovation_tests import InnovationTests
from mathnavi.estimators.velocity.poles import pole_weights, triple_pole_weights
from mathnavi.interfaces.signals import Estimate, Measurement, Status
from mathnavi.models.manifold.system import LagrangianSystem
from tests.estimators.velocity.faulty_arms import observed
from tests.estimators.velocity.runs import PLUGINS, mission_of, moving

METHODS = ("riemannian_observer", "high_gain", "momentum_observer", "lagrangian_ekf")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("arm", "fault"),
    [("two-link", {"friction": 1.0}), ("servo-six", {"gain": 0.8})],
    ids=["friction left out", "gain of servos"],
)
def test_no_observer_is_sure_of_a_wrong_velocity(arm: str, fault: dict[str, float], method: str) -> None:
    watched = observed(arm, method, **fault)
    assert not watched.sure_and_wrong
    late = slice(round(1.2 / watched.period), None)
    far = np.linalg.norm(watched.error[late], axis=1) > 0.3
    assert not (far & watched.ok[late]).any()


@pytest.mark.parametrize("bandwidth", [1.0, 2.0, 5.0])
def test_an_observer_that_is_slow_is_not_sure_of_a_wrong_velocity_from_its_start_on(bandwidth: float) -> None:
    watched = observed("two-link", "momentum_observer", fields={"bandwidth": bandwidth}, friction=1.0)
    assert not watched.sure_and_wrong
    sound = observed("two-link", "momentum_observer", 2.5, fields={"bandwidth": bandwidth})
    assert not sound.sure_and_wrong
    assert sound.ok[-1]


@pytest.mark.parametrize("noise", [0.0, 1e-3], ids=["encoder", "noise"])
@pytest.mark.parametrize("method", [*METHODS, "filtered_differences"])
def test_as_declared_no_observer_is_sure_and_wrong_from_its_start_on(method: str, noise: float) -> None:
    watched = observed("two-link", method, noise=noise)
    assert watched.ok[: round(1.0 / watched.period)].any()
    assert not watched.sure_and_wrong


def test_a_filter_that_hardly_follows_its_readings_is_tested_too() -> None:
    """What counts as no error of the velocity moves its position for long, and yet not by 50 mrad."""
    system, _ = moving("flat", 0.0)
    step = 2.0 * math.pi / 2.0**14
    tests = InnovationTests(mission_of(system, 0.002, noise=1e-4), 0.0)
    tests.begin(0.0)
    P, gain = np.full(2, 1e-10), np.full(2, 1e-4)
    for k in range(500):
        residual = Residual(np.array([0.05, 0.0]), P, gain)
        tests.note(0.002 * k, 0.002, residual, (np.full(2, step**2 / 12.0), np.full(2, step)), np.full(2, 3.0))
    assert tests.status(0.998) is Status.DEGRADED


@pytest.mark.parametrize("noise", [0.0, 1e-3], ids=["encoder", "noise"])
@pytest.mark.parametrize("method", [*METHODS, "filtered_differences"])
@pytest.mark.parametrize("arm", ["two-link"])
def test_what_is_as_declared_is_no_alarm_and_as_good_as_declared(arm: str, method: str, noise: float) -> None:
    watched = observed(arm, method, noise=noise)
    settled = slice(round(1.0 / watched.period), None)
    assert watched.ok[settled].all()
    assert not watched.sure_and_wrong
    assert float(np.sqrt(np.mean(np.square(watched.error[settled] / watched.deviation[settled])))) < 1.5


def at_rest(system: LagrangianSystem, y: np.ndarray, method: str, u: np.ndarray) -> list[Estimate]:
    """Estimates of an observer that reads y exactly, for 2 s."""
    estimator = PLUGINS[method].build(PLUGINS[method].Config(), mission_of(system))
    times = 0.01 * np.arange(200)
    return [estimator.update(t, (Measurement("position", t, y),), u) for t in times]


@pytest.mark.parametrize("method", ["high_gain", "lagrangian_ekf", "riemannian_observer"])
def test_a_system_at_rest_is_no_alarm_and_an_unexplained_force_no_reason_to_be_sure(method: str) -> None:
    """Rounding is all that exact readings differ by, and there is no motion to compare an error with."""
    system, start = moving("hyperbolic", 0.0)
    y, nothing = start[:3], np.zeros(3)
    held = at_rest(system, y, method, -system.force(y, nothing, nothing))
    assert all(each.status is Status.OK for each in held[100:])
    moved = at_rest(system, y, method, nothing)  # the model says that the system falls
    assert all(not each.status.usable or each.status is Status.DEGRADED for each in moved[150:])
    error = [np.abs(system.manifold.components(y, each.x[3:])) for each in moved[150:]]
    assert all((e < 3.0 * each.extra["deviation"][2:] + 1e-6).all() for e, each in zip(error, moved[150:], strict=True))
    slightly = max(float(np.linalg.norm(each)) for each in error) < 0.05  # as the Kalman filter is
    assert moved[-1].status is (Status.DEGRADED if slightly else Status.LOST)


def test_the_declared_deviation_is_that_of_the_gains() -> None:
    """sigma omega^1.5 sqrt(h) / 2, of a double pole without damping, and what a thousand runs of a triple pole show."""
    sigma, omega, h = 1e-3, 10.0, 1e-3
    errors = GainCovariance(1)
    errors.start(np.array([sigma**2]), np.zeros(1), 10.0)
    for _ in range(3000):
        errors.predict(h)
        alpha, beta = pole_weights(omega, 1.0, h)
        errors.correct(np.zeros(1), (np.array([alpha]), np.array([beta]), np.zeros(1)), np.zeros(1), h)
    assert errors.deviation[1] == pytest.approx(0.5 * sigma * omega**1.5 * math.sqrt(h), rel=0.02)

    rng, count, n = np.random.default_rng(0), 120, 1000
    alpha, beta, gamma = (np.full(1, float(each)) for each in triple_pole_weights(100.0, h))
    errors = GainCovariance(1)
    errors.start(np.array([sigma**2]), np.zeros(1), 0.0)
    x, v, a = sigma * rng.standard_normal(n), np.zeros(n), np.zeros(n)
    for _ in range(count):
        errors.predict(h)
        x, v = x + h * v + 0.5 * h * h * a, v + h * a
        L = sigma * rng.standard_normal(n) - x
        x, v, a = x + alpha * L, v + beta * L, a + gamma * L
        errors.correct(np.full(1, 10.0), (alpha, beta, gamma), np.zeros(1), h)
    assert errors.deviation == pytest.approx([np.std(x), np.std(v)], rel=0.1)


def test_a_bias_of_a_velocity_is_shown_by_what_moves_the_position() -> None:
    """v - v^ is the mean of alpha L / h, and is LOST where it is most of the motion."""
    system, _ = moving("flat", 0.0)
    tests, rng, h, sigma = (
        InnovationTests(mission_of(system, 0.001, noise=1e-3), 0.0),
        np.random.default_rng(1),
        1e-3,
        1e-3,
    )
    tests.begin(0.0)
    R, P, gain = np.full(2, sigma**2), np.full(2, 0.1 * sigma**2), np.full(2, 0.05)
    statuses = []
    for k in range(2000):
        bias = np.array([0.0, 0.5 * h / 0.05]) if k > 1000 else np.zeros(2)
        L = bias + 1.05 * sigma * rng.standard_normal(2)
        tests.note(k * h, h, Residual(L, P, gain), (R, np.zeros(2)), np.array([1.0, 0.0]))
        statuses.append(tests.status(k * h))
    assert set(statuses[:1001]) == {Status.OK}
    assert statuses[-1] is Status.DEGRADED
    assert tests.shown[0] < 0.05
    assert tests.shown[1] == pytest.approx(0.5, rel=0.2)
    assert "mean" in tests.message or "spread" in tests.message
    for k in range(2000, 4000):
        L = np.array([0.0, 0.5 * h / 0.05]) + 1.05 * sigma * rng.standard_normal(2)
        tests.note(k * h, h, Residual(L, P, gain), (R, np.zeros(2)), np.zeros(2))
    assert tests.status(3.999) is Status.LOST
