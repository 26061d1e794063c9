"""The composed model: quadrotors over the triangles of a height field, and what a camera sees of one."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.quadrotor.dynamics import NOMINAL, ROTORS, at_rest
from mathnavi.models.quadrotor.entity import REACH, RotorDrive, build_model, build_spec, tilt
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from tests.models.quadrotor.rotors import rotor_thrusts
from tests.quadrotor import HIGH, built, hills, plain


def test_the_file_states_the_nominal_vehicle() -> None:
    """Every constant that entity.py sets is the one written there."""
    from mathnavi.models.quadrotor import entity

    written = mujoco.MjModel.from_xml_path(str(entity._XML))
    model = build_model(plain(), ("quad",))
    for name in ROTORS:
        ours, theirs = model.actuator(f"quad/{name}"), written.actuator(name)
        for field in ("gear", "dynprm", "biasprm", "gainprm"):
            np.testing.assert_allclose(getattr(ours, field), getattr(theirs, field), atol=1e-4)
        np.testing.assert_allclose(model.body(f"quad/{name}").pos, written.body(name).pos, atol=1e-4)
    for axis in "xyz":
        np.testing.assert_array_equal(
            model.actuator(f"quad/drag_{axis}").biasprm, written.actuator(f"drag_{axis}").biasprm
        )
    for field in ("mass", "inertia"):
        np.testing.assert_array_equal(getattr(model.body("quad/body"), field), getattr(written.body("body"), field))
    np.testing.assert_array_equal(written.opt.gravity, model.opt.gravity)


def test_nothing_that_touches_reaches_farther_than_is_said() -> None:
    model = built(plain(), NOMINAL)
    corners = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T
    farthest = []
    for name in ("outline", "under"):
        geom = model.geom(f"quad/{name}")
        assert geom.contype[0]
        if name == "outline":  # a cylinder: radius, half its height
            farthest.append(float(np.hypot(geom.size[0], abs(geom.pos[2]) + geom.size[1])))
        else:
            farthest.append(float(np.linalg.norm(geom.pos + corners * geom.size, axis=1).max()))
    touching = [k for k in range(model.ngeom) if model.geom_contype[k] and model.geom_bodyid[k]]
    assert len(touching) == len(farthest)
    assert 0.99 * REACH < max(farthest) <= REACH


def test_the_drawn_parts_weigh_nothing() -> None:
    model = built(plain(), NOMINAL)
    assert model.body("quad/body").subtreemass[0] == NOMINAL.mass
    drawn = [g for g in range(model.ngeom) if model.geom_group[g] == 2]
    assert len(drawn) > 20
    assert not model.geom_contype[drawn].any()


def test_the_physics_is_that_of_the_flight_tick() -> None:
    model = built(plain(), NOMINAL)
    assert model.opt.timestep == TICK
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    np.testing.assert_array_equal(model.opt.gravity, [0.0, 0.0, -9.81])


def test_a_model_that_has_just_been_made_hovers() -> None:
    model = build_model(plain(), ("one", "two"), {"one": NOMINAL, "two": dataclasses.replace(NOMINAL, mass=2.0)})
    starts = {"one": at_rest(HIGH), "two": at_rest(HIGH + 5.0)}
    plant = MujocoPlant(model, {name: VehicleSetup(x) for name, x in starts.items()}, np.random.default_rng(0))
    plant.step({}, 300)
    for name, x in starts.items():
        np.testing.assert_allclose(plant.state(name), x, atol=1e-9)


def test_a_drive_turns_thrusts_asked_for_into_thrusts_that_lag() -> None:
    plant = MujocoPlant(
        built(plain(), NOMINAL), {"quad": VehicleSetup(at_rest(HIGH), drive=RotorDrive())}, np.random.default_rng(0)
    )
    before, asked = NOMINAL.hover_thrust, np.array([0.0, 4.0, 99.0, -3.0])
    plant.step({"quad": asked}, 9)
    end = np.clip(asked, 0.0, NOMINAL.thrust_max)
    expected = end + (before - end) * np.exp(-9 * TICK / NOMINAL.motor_lag)
    np.testing.assert_allclose(rotor_thrusts(plant.model, plant.data, "quad"), expected, atol=1e-5)


def test_it_touches_the_ground_with_its_skids_and_says_so() -> None:
    terrain = hills()
    ground = float(terrain.height(200.0, 200.0))
    start = at_rest(np.array([200.0, 200.0, ground + 1.0]))
    plant = MujocoPlant(
        built(terrain, NOMINAL), {"quad": VehicleSetup(start, drive=RotorDrive())}, np.random.default_rng(0)
    )
    events = []
    while not events and plant.t < 2.0:
        events = list(plant.step({"quad": np.zeros(4)}, 1))
    assert [event.kind for event in events] == ["ground-contact"]
    assert 0.02 < plant.state("quad")[2] - ground < 0.4


@pytest.mark.parametrize("names", [[], ["uav", "uav"], [""], ["a/b"]])
def test_names_that_cannot_be_are_refused(names: list[str]) -> None:
    with pytest.raises(ValueError, match="name"):
        build_model(plain(), names)


def test_one_model_has_one_gravity() -> None:
    moon = dataclasses.replace(NOMINAL, gravity=1.6)
    with pytest.raises(ValueError, match=r"gravity = \[1\.6, 9\.81\]; allowed: the same"):
        build_model(plain(), ("one", "two"), {"one": NOMINAL, "two": moon})


def test_tilt_is_the_angle_of_the_thrust() -> None:
    assert tilt(np.array([1.0, 0.0, 0.0, 0.0])) == 0.0
    assert tilt(np.array([0.0, 1.0, 0.0, 0.0])) == pytest.approx(np.pi)
    assert tilt(np.array([np.cos(0.3), 0.0, np.sin(0.3), 0.0])) == pytest.approx(0.6)


def test_a_camera_beside_it_sees_it() -> None:
    """By the classes of the pixels: hull and rotors in the middle, ground around them."""
    terrain = HeightField(np.zeros((5, 5)), 20.0)
    spec = build_spec(terrain, ("quad",))
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:7] = [40.0, 40.0, 10.0, 1.0, 0.0, 0.0, 0.0]
    mujoco.mj_forward(model, data)
    try:
        renderer = mujoco.Renderer(model, 180, 320)
    except Exception as error:  # no OpenGL on this machine
        pytest.skip(f"nothing to draw with: {error}")
    with renderer:
        renderer.update_scene(data, "quad/beside")
        picture = renderer.render()
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, "quad/beside")
        shown = renderer.render()[..., 0]
    assert picture.std() > 10.0
    own = {g for g in range(model.ngeom) if model.body(int(model.geom_bodyid[g])).name.startswith("quad/")}
    seen = np.isin(shown, list(own))
    rows, columns = np.nonzero(seen)
    assert 0.02 < seen.mean() < 0.5
    assert abs(rows.mean() - 90.0) < 30.0
    assert abs(columns.mean() - 160.0) < 30.0
    assert model.geom("quad/nose").id in shown
    assert model.geom("terrain").id in shown
