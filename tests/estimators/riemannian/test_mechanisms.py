"""The sampled observer on mechanisms, the metric of which is MuJoCo's mass matrix."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

from mathnavi.estimators.riemannian.gains import IntrinsicGains
from mathnavi.estimators.riemannian.plugin import RiemannianObserver
from mathnavi.estimators.riemannian.sampled import SampledIntrinsicObserver
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.manifold.mission import POSITION, LagrangianMission
from mathnavi.models.mechanism.entity import MechanismName, build_model
from mathnavi.models.mechanism.system import MechanismSystem, heavier

PERIOD, OMEGA = 1e-3, 30.0


@dataclass(frozen=True)
class Run:
    """The truth of a mechanism, once a millisecond."""

    model: mujoco.MjModel
    x: Array  # (n + 1, nq)
    v: Array  # (n + 1, nv)
    u: Array  # (n, nu)


def run(name: MechanismName, amplitude: list[float], duration: float = 2.0) -> Run:
    """Under u = amplitude sin 2 t, from 0.5 and a rate of 1 in every joint."""
    model = build_model(name)
    data, n = mujoco.MjData(model), round(duration / PERIOD)
    mujoco.mj_integratePos(model, data.qpos, np.full(model.nv, 0.5), 1.0)
    data.qvel[:] = 1.0
    u = np.array(amplitude) * np.sin(2.0 * PERIOD * np.arange(n))[:, None]
    x, v = [data.qpos.copy()], [data.qvel.copy()]
    for held in u:
        data.ctrl[:] = held
        mujoco.mj_step(model, data)
        x.append(data.qpos.copy())
        v.append(data.qvel.copy())
    return Run(model, np.array(x), np.array(v), u)


def errors(truth: Run, model: mujoco.MjModel, bits: int = 0, *, disturbed: bool = False) -> Array:
    """(n,) |eta - v| of an observer that believes in ``model``."""
    system = MechanismSystem(model)
    y = [system.manifold.rounded(x, bits) for x in truth.x]
    observer = SampledIntrinsicObserver(system, IntrinsicGains(bandwidth=OMEGA), y[0], disturbed=disturbed)
    found = []
    for u, reading, v in zip(truth.u, y[1:], truth.v[1:], strict=True):
        observer.predict(PERIOD, u, reading)
        observer.correct(reading, PERIOD)
        found.append(np.abs(observer.eta - v).max())
    return np.array(found)


@pytest.fixture(scope="module")
def two_link() -> Run:
    return run("two-link", [4.0, 1.0])


@pytest.mark.parametrize(
    ("name", "amplitude"),
    [
        ("rigid-body", [0.3, 0.2, -0.3]),
        ("cart-pendulum", [2.0, 0.2]),
        ("two-link", [4.0, 1.0]),
        ("seven-joint", [3.0, 12.0, 1.0, 6.0, 0.5, 1.0, 0.1]),
    ],
)
def test_it_converges_to_the_velocity_where_readings_are_exact(name: MechanismName, amplitude: list[float]) -> None:
    truth = run(name, amplitude)
    error = errors(truth, truth.model)
    assert error[0] > 0.9  # eta = 0 at the start
    assert error[1000:].max() < 1e-4


def test_with_encoders_it_is_a_hundred_times_better_than_differences(two_link: Run) -> None:
    error = errors(two_link, two_link.model, 14)[500:]
    step = 2.0 * np.pi / 2.0**14
    differences = np.diff(step * np.round(two_link.x / step), axis=0) / PERIOD - two_link.v[1:]
    assert np.sqrt((error**2).mean()) < 1e-3
    assert np.sqrt((differences**2).mean()) > 100.0 * np.sqrt((error**2).mean())


def test_readings_that_jump_are_refused(two_link: Run) -> None:
    """Joints have no injectivity radius that would show it."""
    mission = LagrangianMission(MechanismSystem(two_link.model), speed_max=10.0)
    held, found = [np.zeros(two_link.u.shape[1]), *two_link.u], []
    for jump, refused in ((0.0, 0.0), (0.5, 8.0), (3.0, 8.0)):
        readings, error = two_link.x.copy(), 0.0
        readings[200:1000:100] += jump
        observer = RiemannianObserver.build(RiemannianObserver.Config(bandwidth=OMEGA), mission)
        for k, (y, u) in enumerate(zip(readings, held, strict=True)):
            estimate = observer.update(k * PERIOD, (Measurement(POSITION, k * PERIOD, y),), u)
            error += (k >= 500) * float(np.abs(estimate.x[2:] - two_link.v[k]).max()) ** 2
        assert estimate.extra["refused"] == [refused]
        found.append(np.sqrt(error / (len(held) - 500)))
    assert max(found) < 1.5 * found[0] + 1e-6


def test_a_transported_disturbance_makes_up_for_a_load(two_link: Run) -> None:
    believed = heavier(two_link.model, 1.3)
    plain, disturbed = (errors(two_link, believed, 14, disturbed=d)[500:] for d in (False, True))
    assert np.sqrt((disturbed**2).mean()) < 0.5 * np.sqrt((plain**2).mean())
