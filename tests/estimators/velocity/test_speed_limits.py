"""A limit of speeds is one of the coordinates' rates, and no estimate beyond it, or without a covariance, is OK."""

from __future__ import annotations

import dataclasses
from typing import Any

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.moving_horizon import MovingHorizonEstimator
from mathnavi.estimators.velocity.possible import impossible
from mathnavi.estimators.velocity.readings import SpeedGate
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.manifold.manifold import greatest_rate
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import load

METHODS = (
    "riemannian_observer", "lagrangian_ekf", "lagrangian_ukf", "high_gain", "momentum_observer",
    "filtered_differences", "moving_horizon",
)  # fmt: skip
BALL = """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody><body>
  <joint type="ball"/><geom type="box" size="0.1 0.2 0.3" mass="2"/></body></worldbody></mujoco>"""
BOX = """<mujoco><option timestep="0.002"/><worldbody><body pos="0 0 1">
  <freejoint/><geom type="box" size="0.1 0.2 0.3" mass="2"/></body></worldbody></mujoco>"""
HEAVY = """<mujoco><option timestep="0.002"/><worldbody><body name="trunk" pos="0 0 20"><freejoint/>
  <geom type="box" size="0.3 0.2 0.1" mass="30" contype="0"/>
  <body pos="0.3 0 0"><joint name="hip" axis="0 1 0" damping="0.5"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1" contype="0"/></body></body></worldbody></mujoco>"""


def run_of(source: str, steps: int = 800) -> tuple[mujoco.MjModel, Array, Array]:
    """A model, and positions (N, nq) and velocities (N, nv) of its free motion."""
    model = mujoco.MjModel.from_xml_string(source)
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0 + 0.3 * np.arange(model.nv)
    q, v = [], []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        q.append(data.qpos.copy())
        v.append(data.qvel.copy())
    return model, np.array(q), np.array(v)


@pytest.mark.parametrize("source", [BALL, BOX], ids=["ball joint", "free box"])
@pytest.mark.parametrize("speed_max", [None, 10.0, 1e6])
@pytest.mark.parametrize("method", ["lagrangian_ekf", "lagrangian_ukf"])
def test_no_limit_of_speeds_destroys_a_filter(method: str, speed_max: float | None, source: str) -> None:
    model, q, v = run_of(source, 400)
    declared = {} if speed_max is None else {"speed_max": speed_max}
    observer = mn.VelocityObserver(model, method, **declared)
    found = [observer.step(model.opt.timestep, each) for each in q]
    late = np.abs(np.array([each.velocity for each in found]) - v)[200:]
    assert late.max() < 0.02  # [rad/s, m/s] that MuJoCo's step of 2 ms errs by
    assert found[-1].status is Status.OK


@pytest.mark.parametrize("method", METHODS)
def test_a_body_that_falls_at_less_than_the_limit_is_followed(method: str) -> None:
    """Whatever it weighs: the limit is one of metres and radians in a second, not of the energy."""
    model, q, v = run_of(HEAVY)
    mission = LagrangianMission(MechanismSystem(model), PositionQuality(1e-4), model.opt.timestep, speed_max=16.0)
    plugin: Any = load("estimators", method)
    estimator = plugin.build(plugin.Config(), mission)
    rng, refused = np.random.default_rng(5), 0.0
    for k, each in enumerate(q):
        t = k * mission.period
        y = mission.system.manifold.point(each, 1e-4 * rng.standard_normal(model.nv))
        estimate = estimator.update(t, [Measurement("position", t, y)], np.zeros(0))
        refused = float(estimate.extra.get("refused", np.zeros(1))[0])
    assert np.abs(v[-1]).max() > 10.0
    assert refused == 0.0
    slow = method == "momentum_observer"  # it finds the rate of the damped, light leg within 0.7 s, and says so
    assert estimate.status is (Status.DEGRADED if slow else Status.OK)
    assert np.abs(estimate.x[model.nq : model.nq + 3] - v[-1, :3]).max() < 0.5


@pytest.mark.parametrize(("rates", "passes"), [((19.0, 19.0), True), ((21.0, 0.0), False), ((0.0, 21.0), False)])
@pytest.mark.parametrize("mass", [1e-3, 1.0, 1e3])
def test_the_gate_asks_for_the_rate_of_each_coordinate(mass: float, rates: tuple[float, float], passes: bool) -> None:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body><joint type="slide"/><geom size="0.1" mass="{mass}"/>
        <body><joint type="hinge" axis="0 1 0"/><geom size="0.1" mass="{mass}" pos="0 0 1"/></body></body></worldbody>
        </mujoco>"""
    )
    mission = LagrangianMission(MechanismSystem(model), PositionQuality(), speed_max=10.0)
    gate = SpeedGate(mission, np.zeros(2))
    assert gate.passes(np.array(rates) * 1e-3, 1e-3) is passes


def test_the_rate_of_a_rotation_is_its_length() -> None:
    manifold = MechanismSystem(mujoco.MjModel.from_xml_string(HEAVY)).manifold
    assert greatest_rate(manifold, np.array([3.0, 0.0, 4.0, 1.0, 2.0, 2.0, 4.5])) == pytest.approx(5.0)
    assert greatest_rate(manifold, np.array([0.0, 0.0, 4.0, 4.0, 4.0, 2.0, 4.5])) == pytest.approx(6.0)
    assert greatest_rate(manifold, np.array([0.0, 0.0, 4.0, 4.0, 4.0, 2.0, -7.0])) == pytest.approx(7.0)
    assert np.isnan(greatest_rate(manifold, np.array([0.0, 0.0, 4.0, np.nan, 4.0, 2.0, -7.0])))


def test_what_cannot_be_is_named() -> None:
    mission = LagrangianMission(mn.RigidBody(0.05), speed_max=10.0)
    x, P = np.array([1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 2.0]), np.eye(7)
    assert impossible(mission, x, P) == ""
    assert impossible(mission, x, None) == ""
    assert impossible(mission, x, np.diag([0.0, *np.ones(6)])) == ""  # an error without a direction
    assert "not finite" in impossible(mission, x * np.nan, P)
    assert "speed_max = 10" in impossible(mission, x * np.array([1, 1, 1, 1, 8, 8, 8]), P)
    assert "covariance" in impossible(mission, x, np.diag([-1e-3, *np.ones(6)]))
    assert "covariance" in impossible(mission, x, np.full((7, 7), np.inf))


@pytest.mark.parametrize("method", METHODS)
def test_an_estimate_that_cannot_be_is_never_ok_and_found_again(method: str) -> None:
    """Readings that run ten times as fast as anything moves, for a second: no estimate that follows them is OK."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody><body><joint axis="0 1 0"/>
        <geom size="0.1" mass="1" pos="0 0 0.3"/></body></worldbody></mujoco>"""
    )
    speed_max = 2.0
    mission = LagrangianMission(MechanismSystem(model), PositionQuality(1e-4), 0.002, speed_max)
    plugin: Any = load("estimators", method)
    estimator = plugin.build(plugin.Config(), mission)
    angle, rng, found = 0.0, np.random.default_rng(7), list[Estimate]()
    for k in range(2000):
        rate = 10.0 * speed_max if 500 <= k < 1000 else 1.0
        angle += rate * mission.period
        y = np.array([angle + 1e-4 * rng.standard_normal()])
        t = k * mission.period
        found.append(estimator.update(t, [Measurement("position", t, y)], np.zeros(0)))
    for each in found:
        if each.status is Status.OK:
            assert impossible(mission, each.x, each.covariance) == ""
    assert found[490].status is Status.OK
    assert not any(each.status is Status.OK for each in found[520:1000])
    assert found[-1].status is Status.OK
    assert abs(found[-1].x[1] - 1.0) < 0.2


@dataclasses.dataclass
class _Broken:
    """A law that says what it is told."""

    said: Array
    state_covariance: Array | None
    deviation: Array = dataclasses.field(default_factory=lambda: np.ones(2))
    settling, residual, doubt = 0.0, None, ""
    extra = {}  # noqa: RUF012

    @property
    def state(self) -> Array:
        return self.said

    def start(self, y: Array) -> None: ...
    def learn(self, variance: Array, steps: Array) -> None: ...
    def predict(self, h: float, u: Array, y: Array | None) -> None: ...
    def correct(self, y: Array, h: float) -> bool:
        return True


@pytest.mark.parametrize(
    ("velocity", "covariance"),
    [(5.0, np.diag([1.0, -1.0])), (5.0, np.diag([1.0, np.inf])), (1e3, np.eye(2)), (np.nan, np.eye(2))],
)
def test_no_law_makes_an_impossible_estimate_ok(velocity: float, covariance: Array) -> None:
    from mathnavi.estimators.velocity.position_observer import PositionObserver

    mission = LagrangianMission(mn.MechanismSystem(_pendulum()), speed_max=10.0)
    observer = PositionObserver(_Broken(np.array([0.0, velocity]), covariance), mission, 0.5)
    statuses = [
        observer.update(t, [Measurement("position", t, np.zeros(1))], np.zeros(0)).status for t in 1e-3 * np.arange(50)
    ]
    assert Status.OK not in statuses


def _pendulum() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint/><geom size="0.1" mass="1" pos="0 0 1"/></body></worldbody></mujoco>'
    )


def test_a_horizon_without_a_possible_estimate_is_not_ok(monkeypatch: pytest.MonkeyPatch) -> None:
    mission = LagrangianMission(MechanismSystem(_pendulum()), PositionQuality(1e-4), speed_max=10.0)
    estimator = MovingHorizonEstimator.build(MovingHorizonEstimator.Config(), mission)
    monkeypatch.setattr(
        type(estimator._model), "reported", lambda self, x, P: (x, None if np.isnan(P).any() else -np.eye(2))
    )
    statuses = [
        estimator.update(t, [Measurement("position", t, np.zeros(1))], np.zeros(0)).status for t in 1e-3 * np.arange(50)
    ]
    assert Status.OK not in statuses
