"""The signals of a vehicle have the names and units of its model, or those that are declared in their place."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signal_names import SignalNames, difference, name_and_unit
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.mujoco_sensors import MujocoSensor
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup

ROVER = """
<mujoco>
  <worldbody>
    <body name="rover/chassis" pos="0 0 1">
      <freejoint name="rover/chassis"/>
      <geom name="rover/hull" type="box" size="0.2 0.1 0.05" mass="1"/>
      <site name="rover/imu"/>
      <body name="rover/wheel" pos="0 0.2 0">
        <joint name="rover/wheel" axis="0 1 0"/>
        <geom name="rover/tyre" type="sphere" size="0.05" mass="0.1"/>
      </body>
      <body name="rover/mast" pos="0 0 0.2">
        <joint name="rover/mast" type="slide" axis="0 0 1"/>
        <geom name="rover/pole" type="sphere" size="0.05" mass="0.1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <velocity name="rover/wheel" joint="rover/wheel" kv="3"/>
    <position name="rover/mast" joint="rover/mast" kp="7" kv="1"/>
    <motor name="rover/brake" joint="rover/wheel"/>
    <motor name="rover/lift" joint="rover/mast" gear="2"/>
  </actuator>
  <sensor>
    <gyro name="rover/gyro" site="rover/imu"/>
    <jointpos name="rover/height" joint="rover/mast"/>
    <framequat name="rover/attitude" objtype="site" objname="rover/imu"/>
  </sensor>
</mujoco>
"""
START = np.array([0.0, 0.0, 1.0, 1.0, *np.zeros(13)])


def plant(signals: SignalNames | None = None) -> MujocoPlant:
    model = mujoco.MjModel.from_xml_string(ROVER)
    sensors = tuple(MujocoSensor.of(model, "rover", name) for name in ("gyro", "height", "attitude"))
    setup = VehicleSetup(START, sensors)
    setup = setup if signals is None else replace(setup, signals=signals)
    return MujocoPlant(model, {"rover": setup}, np.random.default_rng(0))


def test_a_model_names_all_signals_with_their_units() -> None:
    names = plant().signal_names("rover")
    assert names.states[:3] == ("position_x [m]", "position_y [m]", "position_z [m]")
    assert names.states[7:9] == ("position_wheel [rad]", "position_mast [m]")
    assert names.inputs == ("wheel [rad/s]", "mast [m]", "brake [N m]", "lift [-]")
    assert names.readings == {
        "gyro": ("x [rad/s]", "y [rad/s]", "z [rad/s]"), "height": ("height [m]",), "attitude": ("w", "x", "y", "z"),
    }  # fmt: skip
    grouped = {name for group in names.groups.values() for name in group}
    assert grouped == {name.partition(" [")[0] for name in names.states} - {
        "position_wheel", "position_mast", "velocity_wheel", "velocity_mast",
    }  # fmt: skip


def test_declared_names_stand_in_the_place_of_the_models_everywhere() -> None:
    own = SignalNames(
        inputs=("left [1/s]", "mast [m]", "brake [N m]", "lift [N]"),
        readings={"height": ("height of the mast [m]",)},
        groups={"place": ("position_x", "position_y")},
    )
    names = Disturbed(plant(own), ()).signal_names("rover")
    assert names.inputs == own.inputs
    assert names.readings["height"] == ("height of the mast [m]",)
    assert len(names.readings["gyro"]) == 3  # the model's, beside it
    assert names.groups["place"] == ("position_x", "position_y")
    assert "position" not in names.groups  # its numbers are in one chart, not in two
    assert Recording.begin(plant(own), {"rover": 4}, 2).signals["rover"] == names


@pytest.mark.parametrize(
    ("own", "said"),
    [
        (SignalNames(states=("x [m]",)), r"signals\.states = \['x \[m\]'\]; allowed: 17 names, or none"),
        (SignalNames(inputs=("a", "b")), "allowed: 4 names, or none"),
        (SignalNames(readings={"giro": ("x", "y", "z")}), "signals.readings names 'giro'; .*gyro"),
        (SignalNames(readings={"gyro": ("x",)}), "allowed: 3 names"),
    ],
)
def test_names_that_do_not_fit_are_refused_by_name(own: SignalNames, said: str) -> None:
    with pytest.raises(ArgumentError, match=f"vehicle 'rover': .*{said}"):
        plant(own)


def test_an_input_beyond_its_bound_is_named() -> None:
    setup = VehicleSetup(START, input_max=np.array([1.0, 1.0, 2.0, 1.0]))
    bounded = MujocoPlant(mujoco.MjModel.from_xml_string(ROVER), {"rover": setup}, np.random.default_rng(0))
    (event,) = bounded.step({"rover": np.array([1.5, 0.0, 3.0, 0.0])})
    assert event.message == "wheel = 1.5 rad/s is beyond 1, brake = 3 N m is beyond 2"


def test_an_angle_differs_by_less_than_half_a_turn_and_a_length_by_what_it_is() -> None:
    value, reference = np.array([6.0, 0.1]), np.array([-0.2, 0.0])
    np.testing.assert_allclose(difference("heading [rad]", value, reference), [6.2 - 2.0 * np.pi, 0.1])
    np.testing.assert_allclose(difference("east [m]", value, reference), [6.2, 0.1])
    assert name_and_unit("position_x [m]") == ("position x", "m")
    assert name_and_unit("share [-]") == ("share", "")
