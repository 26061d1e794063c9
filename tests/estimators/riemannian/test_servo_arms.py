"""The observer on arms with stiff servos, limits, friction and loads: better than filters, or lost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from mathnavi.estimators.riemannian.plugin import RiemannianObserver
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.manifold.mission import POSITION, LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.geometry import MechanismManifold
from mathnavi.models.mechanism.system import MechanismSystem
from tests.mechanisms import chain

H, BEGIN = 1e-3, 600
ARMS = ("servo-six", "servo-seven", "servo-gripper")


@dataclass(frozen=True)
class ServoRun:
    """A motion under servo commands, once a millisecond."""

    model: mujoco.MjModel  # as it is believed
    y: Array  # (n, nq) of encoders of 14 bits
    u: Array  # (n, nu) held before
    v: Array  # (n, nv)


@cache
def moved(name: str, load: float = 1.0, limit: float | None = None) -> ServoRun:
    """Servos to and fro, all links ``load`` times as heavy as believed, joints limited to +-``limit``."""
    model = build_model(name)
    if limit is not None:
        model.jnt_range[model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)] = (-limit, limit)
    real = build_model(name)
    real.jnt_range[:] = model.jnt_range
    real.body_mass[:] *= load
    real.body_inertia[:] *= load
    mujoco.mj_setConst(real, mujoco.MjData(real))
    data, manifold = mujoco.MjData(real), MechanismManifold(model)
    half = 0.5 * np.diff(model.actuator_ctrlrange, axis=1)[:, 0]
    w = 3.0 + np.linspace(0.0, 1.0, model.nu)
    y, u, v = [manifold.rounded(data.qpos, 14)], [np.zeros(model.nu)], [data.qvel.copy()]
    for k in range(1200):
        data.ctrl[:] = model.actuator_ctrlrange.mean(axis=1) + 0.4 * half * np.sin(w * k * H)
        u.append(data.ctrl.copy())
        mujoco.mj_step(real, data)
        y.append(manifold.rounded(data.qpos, 14))
        v.append(data.qvel.copy())
    return ServoRun(model, np.array(y), np.array(u), np.array(v))


Observed = tuple[list[Estimate], list[tuple[str, str]]]


def observed(run: ServoRun, system: MechanismSystem | None = None) -> Observed:
    """Estimates of the observer as it comes, and its events."""
    mission = LagrangianMission(system or MechanismSystem(run.model), PositionQuality(resolution=14), H)
    observer = RiemannianObserver.build(RiemannianObserver.Config(), mission)
    estimates, events = [], []
    for k, (y, u) in enumerate(zip(run.y, run.u, strict=True)):
        estimates.append(observer.update(k * H, (Measurement(POSITION, k * H, y),), u))
        events += observer.events()
    return estimates, events


@cache
def tracked(name: str, load: float = 1.0) -> Observed:
    """What the observer makes of the motion of an arm."""
    return observed(moved(name, load))


def velocity_rms(run: ServoRun, estimates: list[Estimate]) -> float:
    v = np.array([estimate.x[run.model.nq :] for estimate in estimates])
    return rms(v - run.v)


def rms(error: Array) -> float:
    return float(np.sqrt(np.square(error[BEGIN:]).sum(axis=1).mean()))


def best_butterworth(run: ServoRun) -> float:
    """With the cutoff that is best on this very run."""
    w = np.diff(run.y, axis=0, prepend=run.y[:1]) / H
    return min(rms(sosfilt(butter(2, f, output="sos", fs=1.0 / H), w, axis=0) - run.v) for f in (30.0, 80.0, 180.0))


@pytest.mark.parametrize("name", ARMS)
def test_with_an_exact_model_it_is_fifty_times_better_than_the_best_filter(name: str) -> None:
    run, (estimates, events) = moved(name), tracked(name)
    assert velocity_rms(run, estimates) < 0.02 * best_butterworth(run)
    assert {estimate.status for estimate in estimates[100:]} == {Status.OK}
    assert not events


@pytest.mark.parametrize(("name", "load"), [("servo-six", 1.5), ("servo-seven", 0.5)])
def test_with_a_wrong_load_it_is_better_than_the_best_filter(name: str, load: float) -> None:
    run, (estimates, _) = moved(name, load), tracked(name, load)
    assert velocity_rms(run, estimates) < 0.5 * best_butterworth(run)
    assert {estimate.status for estimate in estimates[100:]} == {Status.OK}


def test_limits_that_are_hit_are_forces_of_the_model() -> None:
    run = moved("servo-seven", limit=0.4)
    assert (run.y[:, :7].max(axis=0) > 0.4 - 1e-3).all()
    estimates, _ = observed(run)
    assert velocity_rms(run, estimates) < 0.5 * best_butterworth(run)


def test_noise_beyond_the_declared_resolution_is_allowed_for_and_said() -> None:
    run = moved("servo-six")
    noisy = replace(run, y=run.y + 2e-3 * np.random.default_rng(0).standard_normal(run.y.shape))
    estimates, _ = observed(noisy)
    assert velocity_rms(noisy, estimates) < 0.5 * best_butterworth(noisy)
    assert {estimate.status for estimate in estimates[100:]} == {Status.DEGRADED}
    assert estimates[-1].message == "has readings that are noisier than declared"


class Wrong(MechanismSystem):
    """A system whose steps go astray for a time, as of a model that is no model of what is read."""

    calls = 0

    def step(self, x: Array, v: Array, u: Array, h: float, delta: Array | None = None) -> tuple[Array, Array]:
        self.calls += 1
        x, v = super().step(x, v, u, h, delta)
        return (x, 1e77 * np.ones_like(v)) if 600 <= self.calls < 700 else (x, v)


def test_an_estimate_that_runs_away_is_lost_at_once_and_differences_answer_until_it_is_back() -> None:
    run = moved("servo-six")
    estimates, events = observed(run, Wrong(run.model))
    assert [kind for kind, _ in events] == ["estimate-diverged", "estimate-recovered"]
    astray = {estimate.status for estimate in estimates[602:700]}
    assert astray == {Status.LOST}
    assert {estimate.status for estimate in estimates[900:]} == {Status.OK}
    error = np.array([estimate.x[6:] for estimate in estimates]) - run.v
    assert np.abs(error[100:]).max() < 0.5 * np.abs(run.v).max()


def test_bandwidths_fall_where_the_model_is_right_and_rise_where_it_is_not() -> None:
    right, wrong = (tracked("servo-six", load)[0][-1].extra["bandwidth"] for load in (1.0, 1.5))
    assert (right < 30.0).all()
    assert wrong[1] > 50.0  # the shoulder, which carries the load


def test_without_servos_damping_or_limits_nothing_is_tuned() -> None:
    mission = LagrangianMission(MechanismSystem(chain("hh")))
    assert not RiemannianObserver.Config().tuned(mission)
    assert RiemannianObserver.Config(tuning="innovations").tuned(mission)
