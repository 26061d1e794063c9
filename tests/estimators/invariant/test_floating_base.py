"""A floating base is found by its IMU and its feet, and in the air the estimate says how far it has drifted."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest

from mathnavi.estimators.invariant.floating_base import FloatingBaseIekf, FloatingBaseIekfConfig
from mathnavi.estimators.invariant.strapdown import PLACE, SPEED
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.manifold.systems import RigidBody
from mathnavi.models.mechanism.floating_base import IMU, JOINTS, FloatingBase
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import trial

SERVOS = (0.25, -0.25, 0.25, -0.25, 0.1, -0.3, 0.2, -0.2)  # [rad]
FLYING = """<mujoco><option timestep=".001" integrator="implicitfast"/><worldbody><body name="v/hull" pos="0 0 1">
<freejoint name="v/base"/><geom type="box" size=".2 .1 .05" mass="2"/><site name="v/imu" pos=".1 0 .02"/>
<site name="v/thrust"/><body pos="0 0 -.1"><joint name="v/boom" axis="0 1 0" damping=".1"/>
<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02" mass=".3"/>
</body></body></worldbody><actuator><motor name="v/lift" site="v/thrust" gear="0 0 1 0 0 0"/>
<motor name="v/boom" joint="v/boom"/></actuator><sensor><gyro site="v/imu" noise=".002"/>
<accelerometer site="v/imu" noise=".02"/></sensor></mujoco>"""


def quadruped(seconds: float, **fields: object) -> RunData:
    given = {"mechanism": "quadruped", "duration": seconds, "rate": 500.0, "settled": 0.25, **fields}
    given |= {"planner.amplitude": SERVOS, "planner.frequency": 8.0}
    return trial("arm-velocity", 1, controller="input_signal", estimator="floating_base_iekf", fields=given).flown()


@cache
def walked() -> tuple[RunData, list[Estimate], Array]:
    """A run that stands and moves its legs, its estimates and what was true then."""
    run = quadruped(0.8)
    estimates = run.recording.agents["mechanism"].estimates
    truth = run.recording.truths["mechanism"]
    return run, estimates, truth[np.searchsorted(run.recording.t, [each.t - 1e-9 for each in estimates])]


def test_while_its_feet_stand_the_velocity_of_the_base_is_found() -> None:
    run, estimates, truth = walked()
    assert run.summary["velocity_rms"] < 0.15
    late = slice(len(estimates) // 2, None)
    errors = np.array([each.x for each in estimates])[late, 15:18] - truth[late, 15:18]
    assert np.abs(truth[late, 15:18]).max() > 0.1
    assert np.sqrt(np.square(errors).mean(axis=0)).max() < 0.02
    assert np.mean([each.extra["standing"] for each in estimates], axis=0).min() > 0.9
    assert estimates[-1].status is Status.OK


def test_place_and_heading_drift_and_the_estimate_says_so() -> None:
    _, estimates, _ = walked()
    first, last = estimates[1].extra["base_deviation"], estimates[-1].extra["base_deviation"]
    assert (last[PLACE] > first[PLACE]).all()
    assert last[2] > 0.019  # heading [rad], as at the start
    assert (last[:2] < 0.2 * last[2]).all()
    assert (last[SPEED] < first[SPEED]).all()


def test_where_the_ground_pushes_at_its_feet_differences_take_the_place_of_an_observer_with_a_model() -> None:
    given = {"mechanism": "quadruped", "duration": 2.0, "settled": 0.25}
    run = trial("arm-velocity", 1, controller="input_signal", estimator="floating_base_iekf", fields=given).flown()
    estimates, truth = run.recording.agents["mechanism"].estimates, run.recording.truths["mechanism"]
    x = truth[np.searchsorted(run.recording.t, [each.t - 1e-9 for each in estimates])]
    assert np.mean([each.status is Status.OK for each in estimates]) > 0.99
    error = np.array([each.x for each in estimates])[:, -8:] - x[:, -8:]
    deviations = np.array([each.extra["deviation"] for each in estimates])[:, -8:]
    assert (np.abs(error) > 3.0 * deviations).mean() < 0.1


def test_a_base_that_falls_has_no_foot_to_stand_on() -> None:
    start = np.zeros(29)
    start[2], start[3] = 0.9, 1.0
    run = quadruped(0.3, start=tuple(start))
    assert all(not each.extra["standing"].any() for each in run.recording.agents["mechanism"].estimates)


def flown(seconds: float, seed: int, config: FloatingBaseIekfConfig) -> tuple[list[Estimate], Array]:
    """A body with a boom that flies, thrown at a slant, with the truth at each estimate."""
    model, rng = mujoco.MjModel.from_xml_string(FLYING), np.random.default_rng(seed)
    mission = LagrangianMission(MechanismSystem(model), PositionQuality(1e-4), period=0.01)
    estimator = FloatingBaseIekf.build(config, mission)
    start = mission.start_state
    start[8:11] = config.start_velocity * rng.standard_normal(3)
    plant = MujocoPlant(model, {"v": VehicleSetup(start, FloatingBaseIekf.sensors(config, mission))}, rng)
    u, estimates, truths = np.array([2.3 * 9.81, 0.05]), [], []
    for k in range(round(seconds / mission.period)):
        estimates.append(estimator.update(plant.t, plant.sense("v"), u))
        truths.append(plant.state("v"))
        u = np.array([2.3 * 9.81, 0.05 * np.cos(0.2 * k)])
        plant.step({"v": u}, 10)
    return estimates, np.array(truths)


def test_in_the_air_the_velocity_drifts_as_far_as_is_said_and_then_the_estimate_is_lost() -> None:
    config = FloatingBaseIekfConfig(start_attitude=0.01, start_velocity=0.1, deviation_max=0.14)
    squares = []
    for seed in range(4):
        estimates, truth = flown(1.2, seed, config)
        last = estimates[-1]
        squares.append(np.square((last.x[8:11] - truth[-1, 8:11]) / last.extra["base_deviation"][SPEED]).mean())
        status = [each.status for each in estimates[10:]]
        assert status[0] is Status.OK
        assert status[-1] is Status.LOST
        assert last.extra["base_deviation"][SPEED].max() > config.deviation_max
        np.testing.assert_allclose(last.x[11:14], truth[-1, 11:14], atol=0.01)  # the rate is read
        assert abs(last.x[14] - truth[-1, 14]) < 0.05  # the boom's
    assert 0.1 < np.mean(squares) < 3.0


def test_without_its_imu_the_last_reading_is_held_and_the_base_is_lost_and_never_as_good_again() -> None:
    """Position and heading, of which the gap takes away what was known, are not observable."""
    config = FloatingBaseIekfConfig(joints="filtered_differences", timeout=0.1, deviation_max=5.0)
    mission = LagrangianMission(
        MechanismSystem(mujoco.MjModel.from_xml_string(FLYING)), PositionQuality(1e-4), period=0.01
    )
    estimator, rng = FloatingBaseIekf.build(config, mission), np.random.default_rng(5)

    def update(k: int, *names: str) -> Estimate:
        imu = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.81]) + 1e-6 * rng.standard_normal(6)
        values = {IMU: imu, JOINTS: np.zeros(1)}
        return estimator.update(0.01 * k, [Measurement(name, 0.01 * k, values[name]) for name in names], np.zeros(2))

    for k in range(20):
        before = update(k, IMU, JOINTS)
    silent = [update(k, JOINTS) for k in range(20, 60)]
    after = [update(k, IMU, JOINTS) for k in range(60, 100)]
    assert [before.status, silent[5].status, silent[-1].status] == [Status.OK, Status.OK, Status.LOST]
    spread = [each.extra["base_deviation"][SPEED].max() for each in (before, silent[-1])]
    assert spread[1] > 3.0 * spread[0]
    assert {each.status for each in after} == {Status.DEGRADED}
    assert np.abs(after[-1].x[:3] - before.x[:3]).max() < 0.1


def test_other_systems_are_refused_in_one_line() -> None:
    with pytest.raises(FieldError, match="allowed: a mechanism with a floating base"):
        FloatingBaseIekf.build(FloatingBaseIekfConfig(), LagrangianMission(RigidBody(0.05)))


def test_the_state_at_the_start_is_the_mission_s_wherever_the_imu_is_mounted() -> None:
    model = mujoco.MjModel.from_xml_string(FLYING)
    mission = LagrangianMission(MechanismSystem(model))
    assert FloatingBase.from_model(model).offset.any()
    estimate = FloatingBaseIekf.build(FloatingBaseIekfConfig(), mission).update(0.0, (), np.zeros(2))
    np.testing.assert_allclose(estimate.x, mission.start_state, atol=1e-12)
    assert estimate.status is Status.INITIALISING
