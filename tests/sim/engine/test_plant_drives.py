"""The plant of a vehicle with a drive: inputs that are not those of actuators, MuJoCo's own sensors, a floor."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.protocols import ActuatorModel, StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.entity import RADIUS, build_model, build_spec
from mathnavi.models.unicycle.kernels import rays_at
from mathnavi.models.unicycle.mission import IdealDrive, RangingMission
from mathnavi.sim.engine.mujoco_sensors import MujocoSensor
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from tests.unicycle import STANDARD, plant_of

ANGLES = (-0.5, 0.0, 2.0)


@dataclass(frozen=True)
class Sensing:
    """A sensor that reads one of MuJoCo's own, as it is."""

    sensor: str
    rate: float | None = None
    name: str = "at_control_step"
    size: int = 1

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        return motion.sensed(self.sensor)


def test_a_drive_has_inputs_of_its_own_and_their_bounds() -> None:
    drive: ActuatorModel = IdealDrive()
    model = build_model(STANDARD, rays_at((0.0,)))
    setup = VehicleSetup(np.zeros(10), input_max=np.array([0.5, 1.0]), drive=drive)
    plant = MujocoPlant(model, {"robot": setup}, np.random.default_rng(0))
    events = plant.step({"robot": np.array([2.0, 0.0])}, 10)
    assert [event.kind for event in events] == ["input-clipped"]
    assert plant.state("robot")[0] == pytest.approx(0.05, abs=1e-12)
    with pytest.raises(ValueError, match=r"shape \(3,\); allowed: \(2,\)"):
        plant.step({"robot": np.zeros(3)})


def test_what_is_sensed_is_of_the_present_instant() -> None:
    sensors = tuple(Sensing(f"range_{i}", name=f"ray_{i}") for i in range(3))
    plant = plant_of((0.5, 0.2, 0.7), angles=ANGLES, sensors=sensors)
    for k in range(40):
        pose = plant.state("robot")[:3]
        readings = [float(m.value[0]) for m in plant.sense("robot")]
        expected, _ = STANDARD.ranges(pose, np.array(ANGLES))
        np.testing.assert_allclose(readings, expected, rtol=0.0, atol=1e-13)
        plant.step({"robot": np.array([0.5, math.sin(0.3 * k)])}, 1 + k % 3)


@pytest.mark.parametrize("move", ["displace", "place"])
def test_what_is_sensed_follows_a_vehicle_that_is_moved_at_once(move: str) -> None:
    plant = plant_of((0.5, 0.2, 0.0), sensors=(Sensing("range_0"),))
    before = plant.sense("robot")[0].value
    if move == "displace":
        plant.displace("robot", np.array([0.3, 0.0, 0.0]))
    else:
        plant.place("robot", plant.state("robot") + 0.3 * np.eye(10)[0])
    np.testing.assert_allclose(plant.sense("robot")[0].value, before - 0.3, atol=1e-13)


@pytest.mark.parametrize("drive", ["ideal", "differential"])
def test_looking_does_not_change_what_happens(drive: str) -> None:
    """Bit for bit, whether the sensors are read at every tick, now and then, or never."""
    carried = ((), (Sensing("range_0"),), (Sensing("wheel_left", rate=100.0), Sensing("range_0", name="ray")))
    paths = []
    for sensors in carried:
        plant = plant_of((0.5, 0.2, 0.7), drive, 0.3, sensors=sensors)  # type: ignore[arg-type]
        path = []
        for k in range(60):
            plant.sense("robot")
            plant.step({"robot": np.array([0.6, 2.0 * math.sin(0.2 * k)])}, 10)
            path.append(plant.state("robot"))
        paths.append(path)
    for path in paths[1:]:
        np.testing.assert_array_equal(path, paths[0])


def test_a_reading_is_the_sensors_own() -> None:
    plant = plant_of(sensors=(Sensing("range_0"),))
    plant.sense("robot")[0].value[:] = np.nan
    assert np.isfinite(plant.sense("robot")[0].value).all()


def test_a_sensor_that_is_not_there_is_named_with_those_that_are() -> None:
    setup = VehicleSetup(np.zeros(10), (Sensing("range_O"),), drive=IdealDrive())
    plant = MujocoPlant(build_spec(STANDARD, rays_at((0.0,))).compile(), {"robot": setup}, np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"no sensor 'robot/range_O'; did you mean range_0.*allowed: .*wheel_left"):
        plant.sense("robot")


SLED = """
<mujoco><option timestep="0.002" integrator="implicitfast"><flag {flag}/></option><worldbody>
  <geom name="ice" type="plane" size="9 9 1" friction="0.1"/>
  <geom name="wall" type="box" pos="0.62 0 0.2" size=".1 1 1"/>
  <body name="sled/body" pos="0 0 0.099"><freejoint name="sled/free"/>
    <geom name="sled/hull" type="box" size="0.2 0.1 0.1" mass="2"/>
    <site name="sled/imu" pos="0.05 0 0.02"/><site name="sled/bow" pos="0.2 0 0" size="0.05 0.2 0.2" type="box"/>
    <body name="sled/arm" pos="0 0 0.1"><joint name="sled/hinge" axis="0 1 0" damping="0.1"/>
      <geom name="sled/rod" type="capsule" fromto="0 0 0.05 0 0 0.2" size="0.02" contype="0" conaffinity="0"
        mass="0.1"/>
      <site name="sled/root"/></body></body>
</worldbody><actuator><motor name="sled/push" site="sled/imu" gear="1 0 0 0 0 0"/></actuator><sensor>
  <gyro name="sled/gyro" site="sled/imu" noise="0.1"/><accelerometer name="sled/accelerometer" site="sled/imu"/>
  <velocimeter name="sled/velocimeter" site="sled/imu"/><magnetometer name="sled/magnetometer" site="sled/imu"/>
  <touch name="sled/bumper" site="sled/bow"/><force name="sled/load" site="sled/root"/>
  <jointvel name="sled/rate" joint="sled/hinge"/></sensor></mujoco>
"""
AT_REST = np.array([0.0, 0.0, 0.099, 1.0, *[0.0] * 11])
KINDS = ("gyro", "accelerometer", "velocimeter", "magnetometer", "bumper", "load", "rate")


def sled(*kinds: str, flag: str = 'sensor="enable"') -> MujocoPlant:
    model = mujoco.MjModel.from_xml_string(SLED.format(flag=flag))
    sensors = tuple(replace(MujocoSensor.of(model, "sled", each), noise=0.0) for each in kinds)
    return MujocoPlant(model, {"sled": VehicleSetup(AT_REST, sensors)}, np.random.default_rng(0))


@pytest.mark.parametrize("flag", ['sensor="enable"', 'sensor="disable"'])
def test_each_of_mujocos_sensors_says_what_the_next_step_begins_with(flag: str) -> None:
    """Of positions, velocities and forces, to the last digit, also where the model switches its sensors off."""
    plant = sled(*KINDS, flag=flag)
    reference = mujoco.MjModel.from_xml_string(SLED.format(flag=""))
    data, push = mujoco.MjData(reference), np.array([15.0])
    data.qpos[:] = AT_REST[:8]
    touched = 0.0
    for _ in range(120):
        plant.step({"sled": push}, 2)
        read = {each.name: each.value for each in plant.sense("sled")}
        data.ctrl[:] = push
        mujoco.mj_step(reference, data, 2)
        ahead = copy.copy(data)
        mujoco.mj_step(reference, ahead)
        for name in KINDS:
            np.testing.assert_array_equal(read[name], ahead.sensor(f"sled/{name}").data, err_msg=name)
        touched = max(touched, float(read["bumper"][0]))
    assert touched > 10.0  # it has reached the wall


def test_reading_velocities_and_forces_does_not_change_what_happens() -> None:
    paths = []
    for plant in (sled(), sled(*KINDS)):
        path = []
        for k in range(150):
            plant.sense("sled")
            plant.apply_wrench("sled", np.array([0.0, 3.0 * math.sin(0.1 * k), 0.0]))
            plant.step({"sled": np.array([15.0])}, 3)
            path.append(plant.state("sled"))
        paths.append(path)
    np.testing.assert_array_equal(*paths)


def test_an_accelerometer_feels_the_disturbance_of_the_past_step_and_not_that_of_the_next() -> None:
    plant = sled("accelerometer")
    plant.place("sled", AT_REST + 5.0 * np.eye(15)[2])  # falling freely, it reads nothing but what pushes
    felt = []
    for force in (0.0, 6.0, 0.0):
        plant.apply_wrench("sled", np.array([0.0, force, 0.0]))
        plant.step({})
        plant.apply_wrench("sled", np.array([0.0, -50.0, 0.0]))
        felt.append(float(plant.sense("sled")[-1].value[1]))
        plant.apply_wrench("sled", np.array([0.0, 50.0, 0.0]))
    assert felt[0] == pytest.approx(0.0, abs=1e-9)
    assert felt[1] > 2.5  # [m/s^2] 6 N on some 2 kg
    assert felt[2] == pytest.approx(0.0, abs=1e-3)


def test_a_sensor_of_the_model_has_its_size_and_its_noise() -> None:
    model = mujoco.MjModel.from_xml_string(SLED.format(flag=""))
    sensor = MujocoSensor.of(model, "sled", "gyro", rate=50.0)
    assert (sensor.size, sensor.noise, sensor.rate) == (3, 0.1, 50.0)
    plant = MujocoPlant(model, {"sled": VehicleSetup(AT_REST, (sensor,))}, np.random.default_rng(1))
    readings = []
    for _ in range(200):
        plant.step({}, 10)
        readings += [each.value for each in plant.sense("sled")]
    assert len(readings) == 200
    assert 0.08 < np.std(readings) < 0.12
    with pytest.raises(ValueError, match=r"no sensor 'sled/giro'; did you mean gyro\?"):
        MujocoSensor.of(model, "sled", "giro")


def test_standing_on_the_floor_is_no_event_and_bumping_into_the_wall_is() -> None:
    for drive in ("ideal", "differential"):
        plant = plant_of((3.0, 0.0, 0.0), drive)  # type: ignore[arg-type]
        events = []
        while not events:
            events = list(plant.step({"robot": np.array([0.5, 0.0])}, 1))
            assert plant.t < 4.0
        assert {event.kind for event in events} == {"contact"}
        assert "wall_" in events[0].message
        assert plant.contacts("robot") >= 1
        assert STANDARD.distance(plant.state("robot")[:2]) == pytest.approx(RADIUS, abs=0.015)


def test_a_floor_that_is_not_expected_is_an_event() -> None:
    model = build_model(STANDARD, rays_at((0.0,)), "differential")
    plant = MujocoPlant(model, {"robot": VehicleSetup(np.zeros(16))}, np.random.default_rng(0))
    assert "ground-contact" in [event.kind for event in plant.step({"robot": np.zeros(2)}, 100)]


def test_what_it_is_said_to_stand_on_must_be_there() -> None:
    model = build_model(STANDARD, rays_at((0.0,)), "differential")
    setup = VehicleSetup(np.zeros(16), ignored_contacts=("ice",))
    with pytest.raises(ValueError, match=r"'robot': ignored_contacts: no geom 'ice'; allowed: .*\bfloor\b"):
        MujocoPlant(model, {"robot": setup}, np.random.default_rng(0))


def test_a_missions_own_sensors_agree_with_the_motion_in_mujoco() -> None:
    """On the ideal drive, to round-off: ranges of the curve, odometry of the input that was held."""
    mission = RangingMission(STANDARD, ANGLES)
    plant = plant_of((0.5, 0.2, 0.7), angles=ANGLES, sensors=mission.sensors_carried())
    held = None
    for k in range(100):
        readings = {m.name: m.value for m in plant.sense("robot")}
        rho, _ = STANDARD.ranges(plant.state("robot")[:3], mission.alpha)
        np.testing.assert_allclose(readings["ranges"], rho, rtol=0.0, atol=1e-13)
        if held is None:
            assert "odometry" not in readings
        else:
            np.testing.assert_allclose(readings["odometry"], held, rtol=0.0, atol=1e-11)
        held = np.array([0.5, 2.0 * math.sin(0.1 * k)])
        plant.step({"robot": held})
