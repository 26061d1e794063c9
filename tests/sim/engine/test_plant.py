"""The MuJoCo plant: exact motion, bounded inputs, honest sensors, contacts on the triangles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.protocols import Plant, Sensor, StateView
from mathnavi.interfaces.signals import Array, Event
from mathnavi.models.aerial.dynamics import TICK, flow
from mathnavi.models.aerial.entity import build_model
from mathnavi.models.aerial.mission import AccelerationSensor, FullStateSensor, PositionSensor
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.mechanism.entity import build_model as build_mechanism
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL, Coordinates
from mathnavi.models.missile.entity import build_model as build_missile
from mathnavi.models.sensor_faults import Dropout
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup

HIGH = np.array([2000.0, 2000.0, 3000.0, 20.0, -10.0, 5.0])
RADIUS = 0.5  # [m] of the vehicle's sphere


@pytest.fixture(scope="module")
def terrain() -> HeightField:
    """A cone of 1500 m in the middle of a plain."""
    x, y = np.meshgrid(np.arange(41) * 100.0, np.arange(41) * 100.0)
    return HeightField(np.maximum(0.0, 1500.0 - 1.2 * np.hypot(x - 2000.0, y - 2000.0)), 100.0)


def plant_of(terrain: HeightField, seed: int = 0, **vehicles: VehicleSetup) -> MujocoPlant:
    return MujocoPlant(build_model(terrain, list(vehicles), 40.0), vehicles, np.random.default_rng(seed))


def test_conforms_to_the_protocol(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH))
    assert isinstance(plant, Plant)
    assert plant.names == ("uav",)
    assert plant.state_names("uav")[0] == "position_x [m]"
    assert plant.state_names("uav")[5] == "velocity_z [m/s]"


def test_flies_the_exact_flow_with_input_and_disturbance(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH))
    rng, x = np.random.default_rng(0), HIGH
    for _ in range(600):
        u, force = rng.uniform(-20.0, 20.0, 3), rng.normal(size=3)
        plant.apply_wrench("uav", force)
        plant.step({"uav": u})
        x = flow(x, u + force, TICK)
    np.testing.assert_allclose(plant.state("uav"), x, rtol=0.0, atol=1e-9)


def test_a_disturbance_lasts_one_tick_and_several_add_up(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH))
    plant.apply_wrench("uav", np.array([1.0, 0.0, 0.0]))
    plant.apply_wrench("uav", np.array([2.0, 1.0, 0.0]))
    plant.step({"uav": np.zeros(3)})
    plant.step({"uav": np.zeros(3)})
    np.testing.assert_allclose(plant.state("uav")[3:] - HIGH[3:], np.array([3.0, 1.0, 0.0]) * TICK, atol=1e-12)


def test_time_does_not_drift(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH))
    for _ in range(3000):
        plant.step({"uav": np.zeros(3)})
    assert plant.t == 3000 * TICK == plant.data.time


def test_an_input_too_long_is_shortened_and_reported_once_an_episode(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH, input_max=40.0))
    long, short = np.array([30.0, 30.0, 30.0]), np.array([1.0, 0.0, 0.0])
    kinds = [event.kind for u in (long, long, short, long) for event in plant.step({"uav": u})]
    assert kinds == ["input-clipped", "input-clipped"]
    u = long * 40.0 / np.linalg.norm(long)
    expected = flow(flow(flow(HIGH, u, 2 * TICK), short, TICK), u, TICK)
    np.testing.assert_allclose(plant.state("uav"), expected, rtol=0.0, atol=1e-9)


def test_round_off_on_the_bound_is_no_event(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH, input_max=40.0))
    assert plant.step({"uav": np.array([40.0 * (1.0 + 1e-14), 0.0, 0.0])}) == []


def test_a_vehicle_without_a_command_coasts(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH))
    plant.step({"uav": np.ones(3)})
    x = plant.state("uav")
    plant.step({})
    np.testing.assert_allclose(plant.state("uav"), flow(x, np.zeros(3), TICK), rtol=0.0, atol=1e-12)


def test_the_acceleration_sensor_feels_input_and_gust(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH, (AccelerationSensor(),)))
    plant.apply_wrench("uav", np.array([0.5, 0.0, -0.5]))
    plant.step({"uav": np.array([1.0, 2.0, 3.0])})
    (reading,) = plant.sense("uav")
    np.testing.assert_allclose(reading.value, [1.5, 2.0, 2.5], atol=1e-12)


def test_sensors_read_at_their_rates_and_stamp_the_time(terrain: HeightField) -> None:
    sensors: tuple[Sensor, ...] = (FullStateSensor(), PositionSensor(rate=10.0))
    plant = plant_of(terrain, uav=VehicleSetup(HIGH, sensors))
    assert plant.sensor_sizes("uav") == {"full_state": 6, "position": 3}
    times: dict[str, list[float]] = {"full_state": [], "position": []}
    for _ in range(91):
        for reading in plant.sense("uav"):
            assert reading.t == plant.t
            np.testing.assert_array_equal(reading.value, plant.state("uav")[: len(reading.value)])
            times[reading.name].append(reading.t)
        plant.step({"uav": np.ones(3)})
    assert times["position"] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert len(times["full_state"]) == 91


def test_lost_readings_are_no_measurements(terrain: HeightField) -> None:
    sensor = Dropout(FullStateSensor(), 1.0, np.random.default_rng(0))
    plant = plant_of(terrain, uav=VehicleSetup(HIGH, (sensor,)))
    assert list(plant.sense("uav")) == []


def test_noise_depends_on_the_seed_and_not_on_the_other_sensors(terrain: HeightField) -> None:
    def fixes(seed: int, *more: Sensor) -> Array:
        plant = plant_of(terrain, seed, uav=VehicleSetup(HIGH, (PositionSensor(5.0, rate=None), *more)))
        values = []
        for _ in range(10):
            values.append(plant.sense("uav")[0].value)
            plant.step({})
        return np.array(values)

    np.testing.assert_array_equal(fixes(1), fixes(1))
    np.testing.assert_array_equal(fixes(1), fixes(1, FullStateSensor(3.0)))
    assert not np.array_equal(fixes(1), fixes(2))


@pytest.mark.parametrize("rate", [7.0, 301.0, 0.0, -1.0, np.inf])
def test_a_rate_that_is_not_whole_ticks_is_refused(terrain: HeightField, rate: float) -> None:
    with pytest.raises(ValueError, match="'position'"):
        plant_of(terrain, uav=VehicleSetup(HIGH, (PositionSensor(rate=rate),)))


@dataclass(frozen=True)
class ByHand:
    """A sensor that is not ours: a plant takes what has the shape."""

    name: str = "altitude"
    size: int = 1
    rate: float | None = None

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        return motion.x[2:3]


def test_a_strangers_sensor_is_read_too(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH, (ByHand(),)))
    assert plant.sense("uav")[0].value == HIGH[2]


def test_a_vehicle_flown_into_a_mountain_touches_it_where_it_stands(terrain: HeightField) -> None:
    start = np.array([100.0, 2000.0, 600.0, 150.0, 0.0, 0.0])
    plant = plant_of(terrain, uav=VehicleSetup(start))
    events: list[Event] = []
    while not events:
        events = list(plant.step({"uav": np.zeros(3)}))
        assert plant.t < 20.0
    (event,) = events
    assert event.kind == "ground-contact"
    assert "terrain" in event.message
    x = plant.state("uav")
    slope = 1.2
    expected = 2000.0 - (1500.0 - 600.0) / slope - RADIUS * np.hypot(1.0, slope) / slope
    assert x[0] == pytest.approx(expected, abs=2.0 * 150.0 * TICK)
    assert plant.contacts("uav") == 1


def test_an_exact_graze_is_no_contact_and_half_a_metre_lower_is(terrain: HeightField) -> None:
    for lower, touches in ((-0.1, False), (0.1, True)):
        plant = plant_of(terrain, uav=VehicleSetup(np.array([200.0, 200.0, RADIUS - lower, 10.0, 0.0, 0.0])))
        plant.step({"uav": np.zeros(3)})
        assert (plant.contacts("uav") == 1) == touches


def test_a_contact_that_lasts_is_one_and_a_second_one_is_two(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(np.array([300.0, 300.0, RADIUS - 1e-3, 0.0, 0.0, 0.0])))

    def push(force: float, ticks: int) -> list[str]:
        return [event.kind for _ in range(ticks) for event in plant.step({"uav": np.array([0.0, 0.0, force])})]

    assert push(-5.0, 300) == ["ground-contact"]
    assert push(5.0, 300) == []
    assert push(-10.0, 600)[:1] == ["ground-contact"]
    assert plant.contacts("uav") >= 2


def test_a_fast_vehicle_cannot_pass_through_the_ground_unseen(terrain: HeightField) -> None:
    for speed in (50.0, 300.0):
        plant = plant_of(terrain, uav=VehicleSetup(np.array([250.0, 250.0, 30.0, 0.0, 0.0, -speed])))
        for _ in range(300):
            plant.step({"uav": np.zeros(3)})
        assert plant.contacts("uav") >= 1


def test_a_jump_moves_the_vehicle_at_once_and_keeps_its_velocity(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH))
    plant.displace("uav", np.array([10.0, -20.0, 30.0]))
    np.testing.assert_array_equal(plant.state("uav"), HIGH + np.array([10.0, -20.0, 30.0, 0.0, 0.0, 0.0]))


def test_vehicles_of_a_fleet_do_not_disturb_each_other(terrain: HeightField) -> None:
    above = HIGH + np.array([0.0, 0.0, 100.0, 0.0, 0.0, 0.0])
    fleet = plant_of(terrain, a=VehicleSetup(HIGH, (PositionSensor(5.0),)), b=VehicleSetup(above))
    x = HIGH
    for _ in range(100):
        fleet.apply_wrench("b", np.ones(3))
        fleet.step({"a": np.array([1.0, 0.0, 0.0]), "b": np.array([0.0, 5.0, 0.0])})
        x = flow(x, np.array([1.0, 0.0, 0.0]), TICK)
    np.testing.assert_allclose(fleet.state("a"), x, rtol=0.0, atol=1e-9)


def test_two_vehicles_that_meet_are_distinguished_from_the_ground(terrain: HeightField) -> None:
    towards = np.array([20.0, 0.0, 0.0])
    fleet = plant_of(
        terrain,
        a=VehicleSetup(np.array([1000.0, 1000.0, 2500.0, *towards])),
        b=VehicleSetup(np.array([1010.0, 1000.0, 2500.0, *-towards])),
    )
    events = [event for _ in range(150) for event in fleet.step({})]
    assert {(event.agent, event.kind) for event in events} == {("a", "vehicle-contact"), ("b", "vehicle-contact")}


def test_the_truth_handed_out_is_a_copy(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH))
    plant.state("uav")[:] = np.nan
    np.testing.assert_array_equal(plant.state("uav"), HIGH)


def test_errors_name_the_culprit(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH))
    with pytest.raises(ValueError, match=r"no vehicle 'ghost'.*uav"):
        plant.state("ghost")
    with pytest.raises(ValueError, match=r"shape \(2,\)"):
        plant.step({"uav": np.zeros(2)})
    with pytest.raises(ValueError, match="not finite"):
        plant.step({"uav": np.array([np.nan, 0.0, 0.0])})
    with pytest.raises(ValueError, match="start"):
        plant_of(terrain, uav=VehicleSetup(HIGH[:3]))
    with pytest.raises(ValueError, match="two sensors of one name"):
        plant_of(terrain, uav=VehicleSetup(HIGH, (PositionSensor(), PositionSensor(1.0))))
    with pytest.raises(ValueError, match=r"no vehicle 'ghost'.*uav"):
        MujocoPlant(build_model(terrain, ["uav"], 40.0), {"ghost": VehicleSetup(HIGH)}, np.random.default_rng(0))


def test_a_step_of_many_ticks_is_that_many_steps(terrain: HeightField) -> None:
    sensors = (FullStateSensor(2.0, rate=100.0), PositionSensor(1.0, rate=60.0), AccelerationSensor())
    single, whole = (plant_of(terrain, uav=VehicleSetup(HIGH, sensors)) for _ in range(2))
    u, force = np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.0, 0.1])
    read: dict[str, list[tuple[float, list[float]]]] = {"single": [], "whole": []}
    for plant, name, ticks in ((single, "single", 1), (whole, "whole", 5)):
        for tick in range(0, 31, ticks):
            sampled = tick % 5 == 0
            readings = plant.sense("uav")
            read[name] += [(r.t, r.value.tolist()) for r in readings if sampled or r.name != "acceleration"]
            plant.apply_wrench("uav", force)
            plant.step({"uav": u}, ticks)
    assert [reading for reading in read["whole"] if reading[0] <= 30 * TICK] == read["single"]


def test_a_contact_within_a_step_of_many_ticks_is_reported(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(np.array([200.0, 200.0, 3.0, 0.0, 0.0, -40.0])))
    events = list(plant.step({"uav": np.zeros(3)}, 60))
    assert [event.kind for event in events][:1] == ["ground-contact"]
    assert 0.0 < events[0].t < 60 * TICK


def test_a_bounce_between_two_samples_is_found_at_its_tick(terrain: HeightField) -> None:
    """A step is one call of MuJoCo where nothing touches; the ball is in the air at the end of most."""
    start = VehicleSetup(np.array([200.0, 200.0, 3.0, 0.0, 0.0, -40.0]), (FullStateSensor(),))
    single, whole = (plant_of(terrain, uav=start) for _ in range(2))
    ends, found = 0, {}
    for plant, ticks in ((single, 1), (whole, 5)):
        events, states = [], []
        for tick in range(0, 120, ticks):
            if tick % 5 == 0:
                states.append(plant.state("uav").tolist())
                ends += plant is whole and plant.data.ncon > 0
                plant.sense("uav")
            events += plant.step({"uav": np.array([0.0, 0.0, -9.0])}, ticks)
        found[ticks] = states, events
    assert found[5] == found[1]
    assert found[1][1]
    assert ends < 12


def test_a_step_that_begins_between_two_control_steps_loses_no_reading(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH, (PositionSensor(rate=60.0),)))
    plant.sense("uav")
    plant.step({}, 2)
    times = []
    for _ in range(20):
        times += [reading.t for reading in plant.sense("uav")]
        plant.step({}, 5)
    assert times == pytest.approx([5 * k * TICK for k in range(1, 20)])


def missile(coordinates: Coordinates = PLANAR, **setup: Any) -> tuple[MujocoPlant, Array]:
    """A missile in level flight 500 m high, and its state."""
    x = np.zeros(coordinates.state_size)
    x[coordinates.index("u")], x[coordinates.index("z_e")] = 120.0, -500.0
    start = VehicleSetup(coordinates.to_joints(x), **setup)
    model = build_missile(coordinates, [1e6] * coordinates.input_size)
    return MujocoPlant(model, {"missile": start}, np.random.default_rng(0)), x


def test_a_wrench_pushes_and_turns_a_body_along_the_axes_of_the_world() -> None:
    plant, _ = missile(SPATIAL)
    force, torque = np.array([400.0, -200.0, 100.0]), np.array([0.0, -20.0, -10.0])
    before = plant.state("missile")
    plant.apply_wrench("missile", force)
    plant.apply_wrench("missile", np.zeros(3), torque)
    plant.step({"missile": np.zeros(5)})
    pushed = plant.state("missile")[5:] - before[5:]
    expected = [*(force / 204.02 - [0.0, 0.0, 9.8]), 20.0 / 247.437, 10.0 / 247.437]
    np.testing.assert_allclose(pushed / plant.dt, expected, rtol=1e-4, atol=1e-6)
    plant.step({"missile": np.zeros(5)})
    after = plant.state("missile")[5:] - before[5:] - pushed
    np.testing.assert_allclose(after / plant.dt, [0.0, 0.0, -9.8, 0.0, 0.0], atol=1e-3)


def test_each_input_has_a_limit_of_its_own_and_its_excess_is_reported_once_an_episode() -> None:
    limits = np.array([1000.0, 4000.0, 50.0])
    plant, x = missile(input_max=limits)
    large, small = np.array([1500.0, -5000.0, 20.0]), np.array([1000.0, -4000.0, 50.0])
    events = [event for u in (large, large, small, large) for event in plant.step({"missile": u}, 10)]
    assert [event.kind for event in events] == ["input-clipped", "input-clipped"]
    assert "-5000 " in events[0].message
    for u, ticks in ((np.array([1000.0, -4000.0, 20.0]), 20), (small, 10), (np.array([1000.0, -4000.0, 20.0]), 10)):
        x = PLANAR.flow(x, u, ticks * plant.dt)
    np.testing.assert_allclose(PLANAR.from_joints(plant.state("missile")), x, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("wrong", [np.array([1.0, 2.0]), np.array([1.0, 0.0, 1.0]), np.array([1.0, np.nan, 1.0]), -1.0])
def test_a_limit_that_fits_no_input_is_refused(wrong: Any) -> None:
    with pytest.raises(ValueError, match=r"input_max = .*allowed"):
        missile(input_max=wrong)


@pytest.mark.parametrize("ticks", [1, 4, 10])
def test_late_actuators_carry_out_the_command_of_so_many_ticks_ago(ticks: int) -> None:
    plant, x = missile(delay=0.006)
    rng = np.random.default_rng(1)
    inputs = np.vstack([np.zeros((6, 3)), np.repeat(rng.uniform(-3e3, 3e3, (40 // ticks, 3)), ticks, axis=0)])
    for k in range(40 // ticks):
        plant.step({"missile": inputs[6 + ticks * k]}, ticks)
    for u in inputs[:40]:
        x = PLANAR.flow(x, u, plant.dt)
    np.testing.assert_allclose(PLANAR.from_joints(plant.state("missile")), x, rtol=1e-9, atol=1e-9)


def test_late_actuators_do_not_see_what_becomes_of_a_command_later() -> None:
    (plant, _), (twin, _) = missile(delay=0.003), missile(delay=0.003)
    command = np.array([0.0, -2000.0, 10.0])
    plant.step({"missile": command})
    twin.step({"missile": command.copy()})
    command[:] = 1e5
    for late in (plant, twin):
        late.step({}, 5)
    np.testing.assert_array_equal(plant.state("missile"), twin.state("missile"))


@pytest.mark.parametrize("delay", [-0.001, 0.0005, np.inf])
def test_a_delay_that_is_not_whole_ticks_is_refused(delay: float) -> None:
    with pytest.raises(ValueError, match="delay"):
        missile(delay=delay)


def test_a_vehicle_goes_on_from_where_it_is_put(terrain: HeightField) -> None:
    plant = plant_of(terrain, uav=VehicleSetup(HIGH, (FullStateSensor(),)))
    plant.step({"uav": np.ones(3)})
    elsewhere = np.array([1000.0, 1500.0, 3500.0, -5.0, 3.0, 1.0])
    plant.place("uav", elsewhere)
    np.testing.assert_array_equal(plant.state("uav"), elsewhere)
    np.testing.assert_array_equal(plant.sense("uav")[-1].value, elsewhere)
    plant.step({"uav": np.ones(3)})
    np.testing.assert_allclose(plant.state("uav"), flow(elsewhere, np.ones(3), TICK), rtol=0.0, atol=1e-12)
    for state in (elsewhere[:5], elsewhere * np.nan):
        with pytest.raises(ValueError, match=r"vehicle 'uav': state = .*; allowed: 6 finite numbers"):
            plant.place("uav", state)


BALLS = """<mujoco><option timestep=".001" integrator="RK4" gravity="0 0 0"/><worldbody>
  <body name="v/cart"><joint name="v/x" type="slide" axis="1 0 0"/><geom size=".1" mass="1"/>
    <body name="v/top"><joint name="v/ball" type="ball"/><inertial pos="0 0 0" mass="1" diaginertia=".05 .05 .05"/>
      <body name="v/arm" pos="0 0 1"><joint name="v/y" type="slide" axis="0 1 0"/>
        <inertial pos="0 0 0" mass=".001" diaginertia="1e-6 1e-6 1e-6"/></body></body></body></worldbody>
  <actuator><motor name="v/push" joint="v/x"/><motor name="v/turn" joint="v/ball" gear="0 0 1"/></actuator></mujoco>"""


def with_balls(state: Any) -> MujocoPlant:
    model = mujoco.MjModel.from_xml_string(BALLS)
    return MujocoPlant(model, {"v": VehicleSetup(np.array(state), (FullStateSensor(),))}, np.random.default_rng(0))


TURNED = [0.1, 0.5, 0.5, -0.5, 0.5, 0.2, 1.0, 2.0, -3.0, 4.0, 0.3]


def test_a_ball_joint_has_four_positions_and_three_velocities() -> None:
    plant = with_balls(TURNED)
    assert plant.state_names("v") == (
        "position_x [m]", *(f"position_ball_{axis} [-]" for axis in "wxyz"), "position_y [m]",
        "velocity_x [m/s]", *(f"velocity_ball_{axis} [rad/s]" for axis in "xyz"), "velocity_y [m/s]",
    )  # fmt: skip
    np.testing.assert_array_equal(plant.state("v"), TURNED)
    np.testing.assert_array_equal(plant.sense("v")[0].value, TURNED)
    plant.displace("v", np.array([1.0, 2.0, 0.0]))
    np.testing.assert_allclose(plant.state("v")[[0, 5]], [1.1, 2.2])
    np.testing.assert_array_equal(plant.state("v")[1:5], TURNED[1:5])


def test_a_quaternion_stays_one() -> None:
    plant = with_balls(TURNED)
    for _ in range(500):
        plant.step({"v": np.array([1.0, 0.1])})
        assert abs(np.linalg.norm(plant.state("v")[1:5]) - 1.0) < 1e-15 * 4.0
    rounded = np.array(TURNED) + 3e-7 * np.eye(11)[2]
    plant.place("v", rounded)
    assert abs(np.linalg.norm(plant.state("v")[1:5]) - 1.0) < 1e-15


@pytest.mark.parametrize("quaternion", [[0.0] * 4, [2.0, 0.0, 0.0, 0.0], [1.0, 0.2, 0.0, 0.0]])
def test_what_is_no_quaternion_is_refused(quaternion: list[float]) -> None:
    plant, state = with_balls(TURNED), [0.1, *quaternion, *TURNED[5:]]
    with pytest.raises(ValueError, match=r"vehicle 'v': state = .* quaternion of length .*; allowed: 1"):
        plant.place("v", np.array(state))
    np.testing.assert_array_equal(plant.state("v"), TURNED)
    with pytest.raises(ValueError, match="vehicle 'v': start = "):
        with_balls(state)
    with pytest.raises(ValueError, match="allowed: 11 finite numbers"):
        plant.place("v", np.zeros(10))


FREE = """<mujoco><option timestep=".001" integrator="RK4"/><worldbody><body name="v/b"><freejoint name="v/f"/>
  <inertial pos="0 0 0" mass="2" diaginertia=".1 .2 .25"/><geom size=".1"/></body></worldbody></mujoco>"""


def test_a_free_joint_is_a_position_before_a_quaternion() -> None:
    state = np.array([1.0, 2.0, 3.0, 0.5, 0.5, -0.5, 0.5, 4.0, 5.0, 6.0, 0.7, 0.8, 0.9])
    plant = MujocoPlant(mujoco.MjModel.from_xml_string(FREE), {"v": VehicleSetup(state)}, np.random.default_rng(0))
    assert plant.state_names("v") == (
        *(f"position_{axis} [m]" for axis in "xyz"), *(f"attitude_{axis} [-]" for axis in "wxyz"),
        *(f"velocity_{axis} [m/s]" for axis in "xyz"), *(f"rate_{axis} [rad/s]" for axis in "xyz"),
    )  # fmt: skip
    np.testing.assert_array_equal(plant.state("v"), state)
    plant.displace("v", np.array([1.0, -1.0, 0.5]))
    np.testing.assert_array_equal(plant.state("v")[:3], [2.0, 1.0, 3.5])
    plant.apply_wrench("v", np.array([2.0, 0.0, 0.0]))  # in the world frame, whatever the attitude
    plant.step({"v": np.empty(0)}, 10)
    np.testing.assert_allclose(plant.state("v")[7:10] - state[7:10], [0.01, 0.0, -0.0981], atol=1e-12)
    assert abs(np.linalg.norm(plant.state("v")[3:7]) - 1.0) < 1e-15 * 4.0
    with pytest.raises(ValueError, match=r"vehicle 'v': state = .* quaternion of length .*; allowed: 1"):
        plant.place("v", 2.0 * state)


@pytest.mark.parametrize("omega", [[10.0, 0.0, 0.0], [3.0, -6.0, 7.0], [0.1, 0.2, 0.0]])
def test_the_rigid_body_moves_along_a_geodesic_of_s3(omega: list[float]) -> None:
    space, x = Attitude(), np.array([0.5, 0.5, -0.5, 0.5])
    plant = MujocoPlant(
        build_mechanism("rigid-body", name="body"), {"body": VehicleSetup(np.concatenate([x, omega]))},
        np.random.default_rng(0),
    )  # fmt: skip
    plant.step({}, 5000)
    after = plant.state("body")
    expected = space.exp(x, 5.0 * np.array(omega))
    assert space.distance(after[:4], expected) < 5e-10  # half the angle [rad]
    np.testing.assert_allclose(after[4:], omega, atol=1e-9)
