"""Forces on a mechanism, against MuJoCo's own accelerations without constraints."""

from __future__ import annotations

import copy
import pickle

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.systems import RigidBody
from mathnavi.models.mechanism.entity import MechanismName, build_model
from mathnavi.models.mechanism.system import MechanismSystem, heavier
from tests.mechanisms import chain, somewhere

OWN: tuple[MechanismName, ...] = ("rigid-body", "cart-pendulum", "two-link", "seven-joint")
RICH = """
<tendon><spatial name="t" stiffness="20" damping="2"><site site="a"/><site site="b"/></spatial></tendon>
<actuator>
  <motor name="one" joint="j" gear="7" ctrlrange="-.1 .1" ctrllimited="true"/>
  <position name="two" joint="k" kp="4" kv=".3"/>
  <motor name="three" tendon="t"/>
  <general name="four" joint="b" gear="0 .5 0" gainprm="2" forcerange="-.3 .3" forcelimited="true"/>
</actuator>"""


def rich() -> mujoco.MjModel:
    """Springs, dampers, a tendon, gravity compensation, a medium and actuators with ranges; limits that are reached."""
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="1 0 -9.81" density="500" viscosity=".2" wind="1 0 0"/><worldbody>
        <site name="a" pos="1 0 0"/>
        <body><joint name="j" type="slide" axis="1 0 0" stiffness="3" damping=".4" range="-.1 .1" limited="true"/>
          <geom size=".1"/>
          <body pos="0 0 .3" gravcomp=".5"><joint name="k" axis="0 1 0" stiffness="2" springref=".3" frictionloss="1"/>
            <geom type="capsule" fromto="0 0 0 .1 0 .4" size=".04"/>
            <body pos=".1 0 .4"><joint name="b" type="ball" damping=".1" stiffness="1"/>
              <geom type="box" size=".1 .05 .02" pos=".1 0 0"/><site name="b" pos=".1 .1 .1"/>
        </body></body></body></worldbody>{RICH}</mujoco>"""
    )


def accelerations(model: mujoco.MjModel, x: Array, v: Array, u: Array) -> Array:
    """MuJoCo's qacc without constraints."""
    free = copy.copy(model)
    free.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(free)
    data.qpos[:], data.qvel[:], data.ctrl[:] = x, v, u
    mujoco.mj_forward(free, data)
    return np.array(data.qacc)


@pytest.mark.parametrize("model", [rich(), *map(build_model, OWN)], ids=["rich", *OWN])
def test_the_force_is_mujocos_without_constraints(model: mujoco.MjModel) -> None:
    system, rng = MechanismSystem(model), np.random.default_rng(0)
    for _ in range(5):
        x = somewhere(system.manifold, model, rng)
        v, u = rng.normal(size=model.nv), rng.normal(size=model.nu)
        expected = accelerations(model, x, v, u)
        found = system.force(x, v, u) - system.manifold.christoffel(x, v, v)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())
        assert system.velocity_dependent or np.array_equal(system.force(x, v, u), system.force(x, 0.0 * v, u))


def test_states_and_inputs_have_names_and_units() -> None:
    system = MechanismSystem(rich(), amplitude=(1.0, 2.0, 3.0, 4.0))
    assert system.states[:4] == ("position_j [m]", "position_k [rad]", "position_b_w [-]", "position_b_x [-]")
    assert system.states[6:8] == ("velocity_j [m/s]", "velocity_k [rad/s]")
    assert len(system.states) == system.manifold.size + system.manifold.vector_size
    assert system.inputs == ("one [-]", "two [rad]", "three [-]", "four [N m]")
    assert (system.constant, system.amplitude) == ((0.0,) * 4, (1.0, 2.0, 3.0, 4.0))
    cart = MechanismSystem(build_model("cart-pendulum"))
    assert (cart.states[0], cart.inputs) == ("position_cart [m]", ("cart [N]", "pole [N m]"))


@pytest.mark.parametrize(
    ("extra", "option"),
    [
        ("", 'viscosity=".1"'),
        ('<actuator><velocity joint="joint_0" kv="2"/></actuator>', ""),
        ('<actuator><damper joint="joint_0" kv="2" ctrlrange="0 1"/></actuator>', ""),
        ('<tendon><fixed damping="1"><joint joint="joint_0" coef="1"/></fixed></tendon>', ""),
    ],
)
def test_what_depends_on_the_velocity_is_said_to(extra: str, option: str) -> None:
    system, v = MechanismSystem(chain("hh", extra, option)), np.array([1.0, -2.0])
    assert system.velocity_dependent
    u = np.ones(len(system.inputs))
    assert not np.allclose(system.force(np.zeros(2), v, u), system.force(np.zeros(2), 0.0 * v, u))
    position = '<actuator><position joint="joint_0" kp="2"/></actuator>'
    assert not MechanismSystem(chain("hh", position)).velocity_dependent


def test_the_rigid_body_moves_as_the_one_of_s3() -> None:
    system, body, rng = MechanismSystem(build_model("rigid-body")), RigidBody(0.05), np.random.default_rng(1)
    x = np.array([1.0, 0.0, 0.0, 0.0])
    state = expected = np.concatenate([x, rng.normal(size=3)])
    for _ in range(100):
        u = rng.normal(size=3)
        state, expected = system.flow(state, u, 1e-3), body.flow(expected, u, 1e-3)
    np.testing.assert_allclose(state, expected, atol=1e-7)


@pytest.mark.parametrize("name", OWN)
def test_the_flow_follows_mujoco(name: MechanismName) -> None:
    model, rng = build_model(name), np.random.default_rng(2)
    system, data = MechanismSystem(model), mujoco.MjData(model)
    data.qpos[:] = somewhere(system.manifold, model, rng)
    data.qvel[:] = rng.normal(size=model.nv)
    state, u = np.concatenate([data.qpos, data.qvel]), 0.2 * rng.normal(size=model.nu)
    data.ctrl[:] = u
    for _ in range(200):
        mujoco.mj_step(model, data)
        state = system.flow(state, u, 1e-3)
    np.testing.assert_allclose(state, np.concatenate([data.qpos, data.qvel]), atol=3e-4)


def test_a_heavier_last_link_has_its_mass_and_inertia_times_the_factor() -> None:
    model = build_model("two-link")
    other, link = heavier(model, 1.3), int(model.jnt_bodyid[-1])
    np.testing.assert_allclose(other.body_mass[link], 1.3 * model.body_mass[link])
    np.testing.assert_allclose(other.body_inertia[link], 1.3 * model.body_inertia[link])
    np.testing.assert_array_equal(other.body_mass[:link], model.body_mass[:link])
    one, two = (MechanismSystem(each).manifold.mass(np.zeros(2)) for each in (model, other))
    assert two[1, 1] == pytest.approx(1.3 * one[1, 1])
    for factor in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match=r"factor = .*; allowed"):
            heavier(model, factor)


STATEFUL = '<actuator><general joint="joint_0" dyntype="integrator"/><motor joint="joint_1"/></actuator>'
LATE = '<actuator><motor name="late" joint="joint_0" delay=".01" nsample="20"/></actuator>'


@pytest.mark.parametrize(("extra", "names"), [(STATEFUL, "0"), (LATE, "late")])
def test_actuators_with_a_memory_are_named_and_have_no_force(extra: str, names: str) -> None:
    system = MechanismSystem(chain("hh", extra))
    assert system.unmodelled == f"states or delays of the actuators {names}"
    with pytest.raises(FieldError, match=f"actuators {names}, which it does not model; allowed: filtered_differences"):
        system.flow(np.zeros(4), np.zeros(len(system.inputs)), 0.01)


@pytest.mark.honoured("MJCF", "keyframe ctrl")
def test_the_control_of_the_first_keyframe_is_the_default_input() -> None:
    key = '<keyframe><key ctrl="0.2"/><key ctrl="0.7"/></keyframe>'
    model = chain("h", f'<actuator><motor joint="joint_0"/></actuator>{key}')
    assert MechanismSystem(model).constant == (0.2,)
    assert MechanismSystem(model, (0.5,)).constant == (0.5,)


@pytest.mark.refused("MJCF", "option timestep of zero")
def test_a_timestep_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match=r"timestep of the model = -1 s; allowed: at least 1e-06 s"):
        MechanismSystem(chain("h", option='timestep="-1"'))


@pytest.mark.parametrize("amplitude", [(1.0,), (1.0, np.nan), (1.0, 2.0, 3.0)])
def test_an_input_of_another_size_is_refused(amplitude: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"amplitude = .*; allowed: 2 finite numbers, of shoulder \[N m\], elbow"):
        MechanismSystem(build_model("two-link"), amplitude=amplitude)


def test_a_copy_is_the_same_system_with_memory_of_its_own() -> None:
    system, x = MechanismSystem(build_model("two-link"), (0.1, 0.2), (1.0, 2.0)), np.array([0.3, 0.4])
    other = pickle.loads(pickle.dumps(system))
    expected = system.force(x, x, x)
    del system
    np.testing.assert_array_equal(other.force(x, x, x), expected)
    assert (other.constant, other.amplitude) == ((0.1, 0.2), (1.0, 2.0))
