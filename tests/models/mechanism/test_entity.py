"""Mechanisms of our own and of any file, in their arena."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import mujoco
import numpy as np
import pytest

from mathnavi.models.mechanism.entity import MechanismName, build_model
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup

STRANGER = """<mujoco model="stranger"><compiler angle="degree"/><option timestep=".004" gravity="0 0 -2"/>
<visual><map znear=".5"/></visual><asset><material name="m" rgba="1 0 0 1"/></asset><worldbody>{floor}
<body pos="0 0 -3"><joint name="knee" axis="0 1 0" range="-90 90" limited="true"/><geom size=".1 .3" type="capsule"
material="m"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("name", get_args(MechanismName))
def test_each_mechanism_has_a_motor_for_each_velocity_and_touches_nothing(name: MechanismName) -> None:
    model = build_model(name, name="arm")
    assert model.nu == model.nv
    assert all(model.joint(j).name.startswith("arm/") for j in range(model.njnt))
    assert all(model.actuator(i).name.startswith("arm/") for i in range(model.nu))
    assert not model.geom_contype.any()
    assert (model.opt.timestep, model.opt.integrator) == (1e-3, int(mujoco.mjtIntegrator.mjINT_RK4))
    assert model.opt.gravity[2] == -9.81
    data = mujoco.MjData(model)
    for i in range(model.nu):  # each motor moves its own joint, ball joints about the axes of the body
        data.ctrl[:] = np.eye(model.nu)[i]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.qfrc_actuator, np.eye(model.nv)[i], atol=1e-12)


def test_the_rigid_body_has_one_inertia_about_every_axis_and_no_weight_about_its_pivot() -> None:
    model = build_model("rigid-body")
    data, M = mujoco.MjData(model), np.zeros((3, 3))
    data.qpos[:] = np.array([0.1, 0.7, 0.5, -0.5])
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, M)
    np.testing.assert_allclose(M, 0.05 * np.eye(3), atol=1e-15)
    np.testing.assert_allclose(data.qfrc_bias, 0.0, atol=1e-12)


def test_the_arms_hang_where_their_angles_are_nought() -> None:
    for name in ("two-link", "seven-joint"):
        model = build_model(name)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert np.abs(data.qfrc_bias).max() < 1.5  # [N m] the bodies' centres are not quite in line
        assert data.subtree_com[int(model.jnt_bodyid[0])][2] < data.xanchor[0][2]


@pytest.mark.parametrize("floor", ["", '<geom type="plane" size="1 1 1"/>'])
def test_a_file_of_anybody_keeps_its_options_and_its_floor(tmp_path: Path, floor: str) -> None:
    file = tmp_path / "stranger.xml"
    file.write_text(STRANGER.format(floor=floor))
    model = build_model(file, name="it")
    assert model.joint(0).name == "it/knee"
    np.testing.assert_allclose(model.jnt_range[0], [-np.pi / 2, np.pi / 2])
    assert (model.opt.timestep, model.opt.gravity[2]) == (0.004, -2.0)
    planes = [g for g in range(model.ngeom) if model.geom_type[g] == int(mujoco.mjtGeom.mjGEOM_PLANE)]
    assert len(planes) == 1
    if not floor:
        assert model.geom_pos[planes[0], 2] < -3.4
        assert model.geom_contype[planes[0]] == model.geom_conaffinity[planes[0]] == 0


@pytest.mark.honoured("MJCF", "elements without a name")
def test_what_has_no_name_in_a_file_gets_one(tmp_path: Path) -> None:
    file = tmp_path / "nameless.xml"
    file.write_text(
        """<mujoco><worldbody><body><joint axis="0 1 0"/><geom size=".1"/>
        <body pos="1 0 0"><joint name="joint_0" axis="0 1 0"/><geom size=".1"/></body></body></worldbody>
        <actuator><motor joint="joint_0"/></actuator></mujoco>"""
    )
    model = build_model(file, name="it")
    assert [model.joint(j).name for j in range(2)] == ["it/joint_0_", "it/joint_0"]
    assert model.actuator(0).name == "it/actuator_0"
    assert {model.body(int(b)).name for b in model.jnt_bodyid} == {"it/body_1", "it/body_2"}
    plant = MujocoPlant(model, {"it": VehicleSetup(np.zeros(4))}, np.random.default_rng(0))
    assert plant.state_names("it")[0] == "position_joint_0_ [rad]"


@pytest.mark.honoured("MJCF", "joint free")
def test_a_floating_base_stays_on_top_of_the_world_and_falls(tmp_path: Path) -> None:
    free = tmp_path / "free.xml"
    free.write_text(
        "<mujoco><worldbody><body name='base'><freejoint/><geom size='.1'/><body><joint axis='0 1 0'/>"
        "<geom size='.1' pos='.2 0 0'/></body></body></worldbody></mujoco>"
    )
    model = build_model(free, name="it")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert (model.nq, model.nv, model.joint(0).name) == (8, 7, "it/joint_0")
    assert data.qacc[2] == pytest.approx(-9.81)


@pytest.mark.refused("MJCF", "no joints")
def test_what_is_no_mechanism_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"mechanism = 'octopus'; allowed: rigid-body, .*path *of an MJCF file"):
        build_model("octopus")
    broken = tmp_path / "broken.xml"
    broken.write_text("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>")
    with pytest.raises(ValueError, match=r"mechanism = .*broken\.xml.*; allowed: an MJCF file that MuJoCo can read"):
        build_model(broken)
    broken.write_text("not a model")
    with pytest.raises(ValueError, match=r"mechanism = .*broken\.xml.*; allowed: an MJCF file that MuJoCo can read"):
        build_model(broken)
    static = tmp_path / "static.xml"
    static.write_text("<mujoco><worldbody><geom size='.1'/></worldbody></mujoco>")
    with pytest.raises(ValueError, match="no joints; allowed"):
        build_model(static)
    with pytest.raises(ValueError, match="vehicle name"):
        build_model("two-link", name="a/b")
