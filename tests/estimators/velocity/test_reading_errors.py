"""What the errors of readings are is found where it is not declared, and tested where it is."""

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.velocity.reading_errors import EncoderSteps, ReadingErrors
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import load

BITS = 14
SETTLED = 750  # readings


@cache
def swaying(arm: str, steps: int = 1500) -> tuple[mujoco.MjModel, Array, Array, Array]:
    """An arm, and the positions (N, nq), velocities (N, nv) and controls (N, nu) of its own model, swaying."""
    model = build_model(arm)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    middle = data.ctrl.copy()
    amplitude = 0.4 if (model.actuator_biastype != 0).any() else 2.0
    rows = [(data.qpos.copy(), data.qvel.copy(), middle)]
    for k in range(steps):
        t = k * model.opt.timestep
        data.ctrl[:] = middle + amplitude * np.sin(2.0 * np.pi * (0.4 + 0.1 * np.arange(model.nu)) * t)
        mujoco.mj_step(model, data)
        rows.append((data.qpos.copy(), data.qvel.copy(), data.ctrl.copy()))
    q, v, u = (np.array(each) for each in zip(*rows, strict=True))
    return model, q, v, u


def observed(arm: str, method: str, y: Array, speed_max: float = 100.0, **quality: Any) -> list[Estimate]:
    """What an observer makes of the readings y (N, nq), with the declared quality."""
    model, _, _, u = swaying(arm)
    mission = LagrangianMission(
        MechanismSystem(model), PositionQuality(**quality), float(model.opt.timestep), speed_max
    )
    plugin: Any = load("estimators", method)
    estimator = plugin.build(plugin.Config(), mission)
    times = mission.period * np.arange(len(y))
    return [
        estimator.update(t, [Measurement("position", t, a)], b) for t, a, b in zip(times, y, u[: len(y)], strict=True)
    ]


def errors(arm: str, found: list[Estimate]) -> Array:
    """Errors (N, nv) of the velocities."""
    model, _, v, _ = swaying(arm)
    return np.array([each.x[model.nq :] for each in found]) - v


def rms(e: Array) -> float:
    return float(np.sqrt(np.mean(np.square(e[SETTLED:]))))


def encoded(arm: str) -> Array:
    model, q, _, _ = swaying(arm)
    manifold = MechanismSystem(model).manifold
    return np.array([manifold.rounded(each, BITS) for each in q])


@pytest.mark.parametrize("method", ["riemannian_observer", "high_gain", "momentum_observer", "lagrangian_ekf"])
@pytest.mark.parametrize("arm", ["servo-six", "seven-joint"])
def test_an_encoder_that_is_not_declared_is_as_good_as_one_that_is(arm: str, method: str) -> None:
    y = encoded(arm)
    found, told = observed(arm, method, y), observed(arm, method, y, resolution=BITS)
    assert rms(errors(arm, found)) <= 1.2 * rms(errors(arm, told))
    sure = np.array([each.status is Status.OK for each in found])
    assert sure[SETTLED:].all()
    assert np.abs(errors(arm, found)[sure]).max() < 0.03  # [rad/s] never sure and wrong


def test_an_observer_that_is_stepped_knows_its_encoder_too() -> None:
    model, _, v, u = swaying("servo-six")
    observer = mn.VelocityObserver(model)
    found = [observer.step(0.001, a, b) for a, b in zip(encoded("servo-six"), u, strict=True)]
    assert np.abs(np.array([each.velocity for each in found]) - v)[SETTLED:].max() < 2e-3
    assert found[-1].status is Status.OK


@pytest.mark.parametrize("method", ["riemannian_observer", "lagrangian_ekf", "moving_horizon"])
def test_noise_that_is_not_declared_is_found(method: str) -> None:
    sigma = 5e-3
    _, q, _, _ = swaying("servo-six")
    y = q + sigma * np.random.default_rng(3).standard_normal(q.shape)
    found, told = observed("servo-six", method, y), observed("servo-six", method, y, noise=sigma)
    assert rms(errors("servo-six", found)) <= 1.2 * rms(errors("servo-six", told))
    assert all(each.status is not Status.OK for each in found[:50])


@pytest.mark.parametrize("method", ["riemannian_observer", "high_gain", "lagrangian_ekf", "filtered_differences"])
def test_an_estimate_is_degraded_while_its_readings_are_noisier_than_declared(method: str) -> None:
    _, q, _, _ = swaying("servo-six")
    noise = np.random.default_rng(4).standard_normal(q.shape)
    honest = observed("servo-six", method, q + 1e-3 * noise, noise=1e-3)
    wrong = observed("servo-six", method, q + 1e-3 * noise, noise=2e-4)
    assert all(each.status is Status.OK for each in honest[SETTLED:])
    assert all(each.status is not Status.OK for each in wrong[SETTLED:])


def test_a_moving_horizon_tests_the_declared_noise_too() -> None:
    _, q, _, _ = swaying("two-link")
    y = q[:200] + 1e-3 * np.random.default_rng(4).standard_normal(q[:200].shape)
    honest, wrong = (observed("two-link", "moving_horizon", y, noise=noise)[-1] for noise in (1e-3, 2e-4))
    assert honest.status is Status.OK
    assert wrong.status is Status.DEGRADED
    assert "noisier" in wrong.message


def test_outliers_that_are_declared_are_no_alarm() -> None:
    _, q, _, _ = swaying("servo-six")
    rng = np.random.default_rng(9)
    y = q + 1e-3 * rng.standard_normal(q.shape) + 1.0 * (rng.random((len(q), 1)) < 0.05)
    found = observed("servo-six", "high_gain", y, noise=1e-3, jump=0.05, jump_size=1.0)
    assert all(each.status is Status.OK for each in found[SETTLED:])


@pytest.mark.parametrize("declared", [BITS, BITS - 2])
def test_an_encoder_that_is_as_declared_or_better_is_no_alarm(declared: int) -> None:
    found = observed("servo-six", "high_gain", encoded("servo-six"), resolution=declared)
    assert all(each.status is Status.OK for each in found[SETTLED:])


def test_a_coarser_encoder_than_declared_is_an_alarm() -> None:
    found = observed("servo-six", "high_gain", encoded("servo-six"), resolution=BITS + 3)
    assert all(each.status is not Status.OK for each in found[SETTLED:])


def test_a_joint_at_rest_has_no_noise_that_is_not_known() -> None:
    model, q, _, _ = swaying("two-link")
    mission = LagrangianMission(MechanismSystem(model), PositionQuality())
    found = ReadingErrors(mission)
    for k in range(100):
        found.read(0.001 * k, q[0], None)
    assert found.known
    np.testing.assert_array_equal(found.variance, 0.0)
    for k in range(100, 105):  # it begins to move, and nobody knows by how much
        found.read(0.001 * k, q[0] + 1e-3 * (k - 99) ** 2, None)
    assert not found.known


@pytest.mark.parametrize("rate", [0.05, 0.7, 11.0], ids=lambda rate: f"{rate:g} rad/s")
def test_the_step_of_an_encoder_is_found_at_any_speed(rate: float) -> None:
    step, found = 2.0 * np.pi / 2**BITS, EncoderSteps(1)
    t = 0.001 * np.arange(2000)
    read = step * np.round((rate * t + 0.2 * rate * np.sin(3.0 * t)) / step)
    for change in np.diff(read):
        found.read(np.array([change]))
    assert found.known.all()
    assert found.steps[0] == pytest.approx(step, rel=1e-6)


def test_a_constant_rate_is_no_step() -> None:
    found = EncoderSteps(1)
    for _ in range(100):
        found.read(np.array([2e-3]))
    assert found.known.all()
    np.testing.assert_array_equal(found.steps, 0.0)


def test_readings_without_a_step_have_none() -> None:
    found, rng = EncoderSteps(2), np.random.default_rng(6)
    for _ in range(100):
        found.read(1e-3 * rng.standard_normal(2))
    assert found.known.all()
    np.testing.assert_array_equal(found.steps, 0.0)


@pytest.mark.parametrize("jitter", [0.0, 0.3], ids=["even", "uneven"])
def test_the_variance_of_noise_is_found_whatever_the_times(jitter: float) -> None:
    model, _, _, _ = swaying("two-link")
    mission = LagrangianMission(MechanismSystem(model), PositionQuality())
    found, rng, sigma = ReadingErrors(mission), np.random.default_rng(8), np.array([1e-3, 3e-3])
    for k in range(2000):
        t = 0.002 * (k + jitter * rng.uniform(-1.0, 1.0))
        found.read(t, np.sin([2.0 * t, 3.0 * t]) + sigma * rng.standard_normal(2), None)
    np.testing.assert_allclose(np.sqrt(found.variance), sigma, rtol=0.25)
