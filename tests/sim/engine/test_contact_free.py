"""Steps without collision detection: taken where nothing can touch, and never seen in what they lead to."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.entity import build_model
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.contact_free import ContactFree
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup

TICKS, DURATION = 5, 5.0 / 300.0  # of a step


@pytest.fixture(scope="module")
def terrain() -> HeightField:
    """Hills of 300 m, 900 m apart."""
    x, y = np.meshgrid(np.arange(41) * 50.0, np.arange(41) * 50.0)
    return HeightField(300.0 * np.sin(x / 143.0) * np.cos(y / 143.0) + 300.0, 50.0)


@pytest.fixture(scope="module")
def model(terrain: HeightField) -> mujoco.MjModel:
    return build_model(terrain, ["uav"], 400.0)


def plant_at(model: mujoco.MjModel, start: Array) -> MujocoPlant:
    return MujocoPlant(model, {"uav": VehicleSetup(start)}, np.random.default_rng(0))


@pytest.mark.parametrize("seed", range(2))
def test_a_flight_among_hills_is_the_same_bit_for_bit_with_every_contact(
    terrain: HeightField, model: mujoco.MjModel, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(500.0, 1500.0, 2)
    start = np.array([x, y, float(terrain.height(x, y)) + 60.0, *rng.normal(0.0, 40.0, 3)])
    sparing, plain = plant_at(model, start), plant_at(model, start)
    vars(plain)["_contact_free"] = None
    free = sparing._contact_free
    assert free is not None
    spared, contacts = 0, 0
    for step in range(300):
        u = rng.normal(0.0, 100.0, 3) - [0.0, 0.0, 60.0]
        for plant in (sparing, plain):
            if step == 150:
                plant.displace("uav", np.array([0.0, 0.0, 50.0]))
            if step == 220:
                plant.place("uav", start)
        spared += free.ahead(DURATION)
        events = sparing.step({"uav": u}, TICKS)
        assert events == plain.step({"uav": u}, TICKS)
        assert sparing.state("uav").tobytes() == plain.state("uav").tobytes()
        contacts += len(events)
    assert spared > 20
    assert contacts > 0


@pytest.mark.parametrize(
    ("options", "body", "joint", "motor"),
    [
        ("", "", "damping='.3'", ""),
        ("", "", "damping='0 .01'", ""),
        ("", "", "", "damping='.3'"),
        ("", "", "", "damping='0 .01'"),
        ("density='1.2' viscosity='.001'", "", "", ""),
        ("gravity='-9 0 0'", "gravcomp='.5'", "", ""),
    ],
)
def test_what_resists_the_motion_acts_far_from_everything_too(options: str, body: str, joint: str, motor: str) -> None:
    model, unresisted = (
        mujoco.MjModel.from_xml_string(
            f"<mujoco><option {options}/><worldbody><body {body}><joint name='x' type='slide' axis='1 0 0' {joint}/>"
            f"<geom size='1'/></body></worldbody><actuator><motor joint='x' {motor}/></actuator></mujoco>"
        )
        for options, body, joint, motor in ((options, body, joint, motor), ("", "", "", ""))
    )
    assert ContactFree.applies(model, slides=1)
    reached = []
    for each in (model, ContactFree(model, mujoco.MjData(model)).model, unresisted):
        data = mujoco.MjData(each)
        data.qvel[:], data.ctrl[:] = 30.0, 2.0
        mujoco.mj_step(each, data, 200)
        reached.append((data.qpos.tolist(), data.qvel.tolist()))
    assert reached[0] == reached[1]
    assert reached[0] != reached[2]


def test_passive_forces_that_do_not_act_are_not_computed(model: mujoco.MjModel) -> None:
    flags = ContactFree(model, mujoco.MjData(model)).model.opt.disableflags
    assert flags & mujoco.mjtDisableBit.mjDSBL_DAMPER
    assert flags & mujoco.mjtDisableBit.mjDSBL_SPRING


@pytest.mark.parametrize("name", ["passive", "control", "act_gain", "act_bias", "contactfilter"])
def test_a_model_with_a_callback_is_not_surveyed(model: mujoco.MjModel, name: str) -> None:
    change = getattr(mujoco, f"set_mjcb_{name}")
    assert ContactFree.applies(model, slides=3)
    change(lambda *_: 0)
    try:
        assert not ContactFree.applies(model, slides=3)
    finally:
        change(None)


def test_nothing_touches_within_a_surveyed_margin(terrain: HeightField, model: mujoco.MjModel) -> None:
    rng, data, other = np.random.default_rng(1), mujoco.MjData(model), mujoco.MjData(model)
    surveys = 0
    for _ in range(300):
        x, y = rng.uniform(0.0, 2000.0, 2)
        data.qpos[:] = x, y, float(terrain.height(x, y)) + rng.uniform(-5.0, 300.0)
        free = ContactFree(model, data)
        if not free.ahead(DURATION):
            continue
        surveys += 1
        for _ in range(5):
            away = rng.normal(size=3)
            other.qpos[:] = data.qpos + free._free / np.sqrt(3.0) * away / np.linalg.norm(away)
            mujoco.mj_forward(model, other)
            assert other.ncon == 0
    assert surveys > 100


def test_a_vehicle_on_the_ground_is_not_free(terrain: HeightField, model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    data.qpos[:] = 700.0, 700.0, float(terrain.height(700.0, 700.0)) + 0.4
    assert not any(ContactFree(model, data).ahead(DURATION) for _ in range(20))


def test_a_vehicle_that_was_put_elsewhere_is_surveyed_anew(terrain: HeightField, model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    data.qpos[:] = 700.0, 700.0, 2000.0
    free = ContactFree(model, data)
    assert free.ahead(DURATION)
    data.qpos[2] = float(terrain.height(700.0, 700.0)) + 0.4
    assert not free.within(DURATION)
    assert not free.ahead(DURATION)


def test_the_model_of_others_keeps_its_collision_detection(model: mujoco.MjModel) -> None:
    before = model.opt.disableflags, model.opt.enableflags, model.opt.o_margin
    plant = plant_at(model, np.array([1000.0, 1000.0, 900.0, 0.0, 0.0, 0.0]))
    plant.step({"uav": np.zeros(3)}, TICKS)
    assert plant._contact_free is not None
    assert (model.opt.disableflags, model.opt.enableflags, model.opt.o_margin) == before


def test_only_a_single_vehicle_on_slides_is_surveyed(terrain: HeightField, model: mujoco.MjModel) -> None:
    assert ContactFree.applies(model, slides=3)
    assert not ContactFree.applies(build_model(terrain, ["one", "two"], 40.0), slides=3)
    turning = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint type='slide'/><joint type='hinge'/><geom size='1'/></body></worldbody>"
        "</mujoco>"
    )
    assert not ContactFree.applies(turning, slides=1)


@pytest.mark.parametrize(
    "joint", ["", "range='-1 1' limited='true'", "frictionloss='1'", "stiffness='1'", "stiffness='0 1'"]
)
def test_a_slide_that_is_held_by_more_than_contacts_is_not_surveyed(joint: str) -> None:
    xml = f"<mujoco><worldbody><body><joint type='slide' {joint}/><geom size='1'/></body></worldbody></mujoco>"
    assert ContactFree.applies(mujoco.MjModel.from_xml_string(xml), slides=1) == (not joint)


@pytest.mark.parametrize(
    ("actuator", "held"),
    [
        ("motor joint='x'", True),
        ("position joint='x'", False),
        ("velocity joint='x'", False),
        ("general joint='x' gaintype='affine' gainprm='1 1 0'", False),
        ("motor joint='x' delay='.01' nsample='4'", False),
        ("motor site='s'", False),
    ],
)
def test_a_slide_with_a_servo_whose_force_changes_within_a_step_is_not_surveyed(actuator: str, held: bool) -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint name='x' type='slide'/><geom size='1'/><site name='s'/></body></worldbody>"
        f"<actuator><{actuator}/></actuator></mujoco>"
    )
    assert ContactFree.applies(model, slides=1) == held


def test_a_mocap_body_that_collides_may_come_near_at_any_time() -> None:
    xml = (
        "<mujoco><worldbody><body><joint type='slide'/><geom size='1'/></body>"
        "<body mocap='true' pos='9 0 0'><geom size='1' contype='{}' conaffinity='{}'/></body></worldbody></mujoco>"
    )
    assert ContactFree.applies(mujoco.MjModel.from_xml_string(xml.format(0, 0)), slides=1)
    assert not ContactFree.applies(mujoco.MjModel.from_xml_string(xml.format(1, 1)), slides=1)


@pytest.mark.parametrize(
    ("ball", "pair", "flag"),
    [
        ("margin='40'", "", ""),
        ("margin='40' gap='30'", "", ""),
        ("contype='0' conaffinity='0'", "<pair geom1='ball' geom2='ground' margin='40'/>", ""),
        ("", "", "<option o_margin='40'><flag override='enable'/></option>"),
    ],
)
def test_a_contact_that_begins_at_a_distance_is_met_at_that_distance(ball: str, pair: str, flag: str) -> None:
    """Margins of geoms and pairs, with a gap that leaves a contact without force, and one margin of all."""
    xml = (
        f"<mujoco><option timestep='0.01'/>{flag}<worldbody><geom name='ground' type='plane' size='1 1 1'/>"
        f"<body name='uav' pos='0 0 200'><joint name='z' type='slide' axis='0 0 1'/><geom name='ball' size='1' {ball}/>"
        f"</body></worldbody><contact>{pair}</contact>"
        "<actuator><motor name='m' joint='z'/></actuator></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(xml)
    data, plain = mujoco.MjData(model), mujoco.MjData(model)
    free = ContactFree(model, data)
    for _ in range(1000):
        mujoco.mj_step(free.model if free.ahead(0.01) else model, data)
        mujoco.mj_step(model, plain)
        assert data.qpos.tobytes() == plain.qpos.tobytes()
        assert data.qvel.tobytes() == plain.qvel.tobytes()
    assert plain.ncon > 0
