"""A plant of ordinary differential equations: time, sensors, commands, escapes."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from mathnavi.interfaces.protocols import Plant, StateView
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.textbook.library import EXAMPLE_2_1, KRENER_ISIDORI
from mathnavi.models.textbook.mission import OutputSensor
from mathnavi.models.textbook.system import System
from mathnavi.sim.engine.ode_plant import OdePlant, OdeVehicle

TICK = 0.01
U = np.array([0.3])


class Notes:
    """A sensor whose reading is the time and the state at which it is read."""

    name, size = "notes", 2

    def __init__(self, rate: float | None) -> None:
        self.rate = rate

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        return motion.x


def plant_of(system: System, *sensors: OutputSensor | Notes, seed: int = 0, start: Array | None = None) -> OdePlant:
    vehicle = OdeVehicle(system, np.array(system.start) if start is None else start, tuple(sensors))
    return OdePlant({"v": vehicle}, TICK, np.random.default_rng(seed))


def test_it_is_a_plant() -> None:
    plant = plant_of(KRENER_ISIDORI, OutputSensor(1, 10.0))
    assert isinstance(plant, Plant)
    assert plant.names == ("v",)
    assert plant.state_names("v") == KRENER_ISIDORI.states
    assert plant.sensor_sizes("v") == {"output": 1}
    assert [sensor.name for sensor in plant.sensors("v")] == ["output"]


def test_it_follows_the_solution_and_time_does_not_drift() -> None:
    plant = plant_of(KRENER_ISIDORI)
    for _ in range(30):
        assert not plant.step({"v": U}, 10)
    assert plant.t == 300 * TICK
    expected = KRENER_ISIDORI.flow(np.array(KRENER_ISIDORI.start), U, 3.0)
    np.testing.assert_allclose(plant.state("v"), expected, atol=1e-8)


def test_how_often_it_is_looked_at_does_not_matter() -> None:
    often, seldom = plant_of(KRENER_ISIDORI), plant_of(KRENER_ISIDORI)
    for _ in range(100):
        often.step({"v": U})
    seldom.step({"v": U}, 100)
    np.testing.assert_allclose(often.state("v"), seldom.state("v"), atol=1e-9)


def readings(plant: OdePlant, samples: int, ticks: int) -> list[Measurement]:
    found: list[Measurement] = []
    for _ in range(samples):
        found += plant.sense("v")
        plant.step({"v": U}, ticks)
    return found


def test_sensors_are_read_when_they_fall_due() -> None:
    plant = plant_of(KRENER_ISIDORI, Notes(25.0))  # every fourth tick
    found = readings(plant, 4, 6)
    assert [reading.t for reading in found] == [k * TICK for k in (0, 4, 8, 12, 16)]
    x = np.array(KRENER_ISIDORI.start)
    for reading in found:
        np.testing.assert_allclose(reading.value, KRENER_ISIDORI.flow(x, U, reading.t), atol=1e-8)


def test_a_sensor_without_a_rate_is_read_at_every_control_step() -> None:
    found = readings(plant_of(KRENER_ISIDORI, Notes(None)), 3, 6)
    assert [reading.t for reading in found] == [0.0, 6 * TICK, 12 * TICK]


def test_an_output_is_that_of_state_and_input_with_its_noise() -> None:
    plant = plant_of(KRENER_ISIDORI, OutputSensor(1, 100.0))
    for reading in readings(plant, 5, 1)[1:]:
        x = KRENER_ISIDORI.flow(np.array(KRENER_ISIDORI.start), U, reading.t)
        assert reading.value[0] == pytest.approx(math.sinh(x[0]), abs=1e-8)
    noisy = readings(plant_of(KRENER_ISIDORI, OutputSensor(1, 100.0, 0.5)), 400, 1)
    clean = readings(plant_of(KRENER_ISIDORI, OutputSensor(1, 100.0)), 400, 1)
    errors = [one.value[0] - other.value[0] for one, other in zip(noisy, clean, strict=True)]
    assert np.std(errors) == pytest.approx(0.5, rel=0.1)


def test_a_component_out_of_sight_is_missing() -> None:
    (reading,) = plant_of(KRENER_ISIDORI, OutputSensor(1, 100.0, largest=1.0)).sense("v")  # sinh 1 = 1.18
    assert np.isnan(reading.value).all()


def test_the_same_seed_gives_the_same_readings() -> None:
    runs = [readings(plant_of(KRENER_ISIDORI, OutputSensor(1, 100.0, 0.1), seed=s), 9, 1) for s in (3, 3, 4)]
    values = [[float(reading.value[0]) for reading in run] for run in runs]
    assert values[0] == values[1] != values[2]


@pytest.mark.parametrize("ticks", [1, 7, 25])
def test_an_escape_is_an_event_and_leaves_the_last_finite_state(ticks: int) -> None:
    plant = plant_of(EXAMPLE_2_1, OutputSensor(1, 100.0))
    events, seen = [], []
    for _ in range(200 // ticks + 8):
        seen += plant.sense("v")
        events += plant.step({"v": np.ones(1)}, ticks)
    (event,) = events
    assert (event.kind, event.agent) == ("escaped", "v")
    assert event.t == plant.escaped("v") == pytest.approx(1.9079584, abs=1e-6)
    expected = EXAMPLE_2_1.flow(np.array(EXAMPLE_2_1.start), np.ones(1), 1.90)
    np.testing.assert_allclose(plant.state("v"), expected, rtol=1e-6)
    assert max(reading.t for reading in seen) <= 1.90 + 1e-9  # what has escaped is not measured
    plant.place("v", np.zeros(2))
    assert plant.escaped("v") is None


def test_a_motion_tells_accelerations_and_knows_no_other_sensor() -> None:
    seen: list[StateView] = []

    class Keeps(Notes):
        def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
            seen.append(motion)
            return None

    plant = plant_of(KRENER_ISIDORI, Keeps(None))
    plant.sense("v")
    np.testing.assert_allclose(seen[0].acceleration, [-1.0])  # x_2' at (1, 0) without an input
    with pytest.raises(ValueError, match="allowed: 'output'"):
        seen[0].sensed("gyroscope")


@pytest.mark.parametrize("command", [np.zeros(2), np.array([math.nan]), np.array([math.inf])])
def test_a_command_that_does_not_fit_is_refused(command: Array) -> None:
    with pytest.raises(ValueError, match="allowed: 1 finite numbers"):
        plant_of(KRENER_ISIDORI).step({"v": command})


def test_without_a_command_the_input_is_nought() -> None:
    plant, twin = plant_of(KRENER_ISIDORI), plant_of(KRENER_ISIDORI)
    commands: Mapping[str, Array] = {"v": np.zeros(1)}
    plant.step({}, 20)
    twin.step(commands, 20)
    np.testing.assert_array_equal(plant.state("v"), twin.state("v"))


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one vehicle"):
        OdePlant({}, TICK, np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"start = \[1.0\]; allowed: 2 finite numbers"):
        plant_of(KRENER_ISIDORI, start=np.ones(1))
    with pytest.raises(ValueError, match="two sensors of one name"):
        plant_of(KRENER_ISIDORI, OutputSensor(1, 100.0), OutputSensor(1, 50.0))
    with pytest.raises(ValueError, match=r"rate = -1\.0 Hz"):
        plant_of(KRENER_ISIDORI, OutputSensor(1, -1.0))
    with pytest.raises(ValueError, match="not a whole number of physics ticks"):
        plant_of(KRENER_ISIDORI, OutputSensor(1, 30.0))
    plant = plant_of(KRENER_ISIDORI)
    with pytest.raises(ValueError, match=r"has no vehicle 'w'; it has \['v'\]"):
        plant.state("w")
    with pytest.raises(ValueError, match="without a body"):
        plant.apply_wrench("v", np.zeros(3))
    with pytest.raises(ValueError, match="without a body"):
        plant.displace("v", np.zeros(3))
