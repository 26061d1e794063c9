"""A URDF file is MuJoCo's own model of it; what MuJoCo cannot read is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.errors import FieldError
from mathnavi.models.mechanism.entity import build_model
from tests.models.mechanism.mjcf_arm import assert_moves_alike
from tests.models.mechanism.test_same_model import differences

ARM = """<robot name="arm">
<link name="base"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="one">{link}<inertial><origin xyz="0 0 -.2" rpy="0 .1 0"/><mass value="1"/>
  <inertia ixx=".1" iyy=".2" izz=".15" ixy=".01" ixz="0" iyz="0"/></inertial></link>
<link name="two"><inertial><mass value="1"/>
  <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 1" rpy=".1 0 .2"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="10" velocity="3"/></joint>
<joint name="j2" type="{kind}"><parent link="one"/><child link="two"/><origin xyz="0 0 -.4"/><axis xyz="0 1 0"/>{joint}
</joint>{more}</robot>"""
SPHERE = '<sphere radius=".1"/>'
LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'


def arm(folder: Path, kind: str = "continuous", link: str = "", joint: str = "", more: str = "") -> Path:
    path = folder / "arm.urdf"
    path.write_text(ARM.format(kind=kind, link=link, joint=joint, more=more))
    return path


@pytest.mark.honoured("URDF", "link inertial: origin, mass, inertia")
@pytest.mark.honoured("URDF", "joint origin, axis, parent, child")
@pytest.mark.parametrize(
    ("kind", "joint"),
    [
        pytest.param("revolute", LIMIT, marks=pytest.mark.honoured("URDF", "joint revolute")),
        pytest.param("continuous", "", marks=pytest.mark.honoured("URDF", "joint continuous")),
        pytest.param("prismatic", LIMIT, marks=pytest.mark.honoured("URDF", "joint prismatic")),
        pytest.param("planar", "", marks=pytest.mark.honoured("URDF", "joint planar")),
        pytest.param(
            "continuous",
            '<dynamics damping=".3" friction=".1"/>',
            marks=pytest.mark.honoured("URDF", "dynamics damping, friction"),
        ),
        pytest.param(
            "continuous",
            '<mimic joint="j1" multiplier="2" offset=".1"/>',
            marks=pytest.mark.honoured("URDF", "mimic"),
        ),
    ],
)
def test_a_joint_means_here_what_it_means_in_mujoco(tmp_path: Path, kind: str, joint: str) -> None:
    path = arm(tmp_path, kind, joint=joint)
    assert differences(path) == []
    assert_moves_alike(path)


@pytest.mark.honoured("URDF", "limit lower, upper, effort")
@pytest.mark.honoured("URDF", "left aside as by MuJoCo: limit velocity, safety_controller, calibration")
@pytest.mark.honoured("URDF", "left aside as by MuJoCo: transmission, gazebo, sensor")
def test_limits_of_angle_and_effort_count_and_what_is_for_controllers_does_not(tmp_path: Path) -> None:
    plain = build_model(arm(tmp_path, "revolute", joint=LIMIT))
    np.testing.assert_array_equal(plain.jnt_range, [[-1.0, 2.0], [-1.0, 1.0]])
    np.testing.assert_array_equal(plain.jnt_actfrcrange, [[-10.0, 10.0], [-5.0, 5.0]])
    more = '<transmission name="t"/><gazebo reference="one"/><sensor name="s"/>'
    joint = f'{LIMIT}<safety_controller k_velocity="1"/><calibration rising="0"/>'
    path = arm(tmp_path, "revolute", joint=joint, more=more)
    assert differences(path) == []
    assert build_model(path).nsensor == 0


@pytest.mark.honoured("URDF", "joint fixed")
def test_a_fixed_link_moves_with_its_parent(tmp_path: Path) -> None:
    path = arm(tmp_path, "fixed")
    assert build_model(path).nv == 1
    assert_moves_alike(path)


@pytest.mark.honoured("URDF", "joint floating below the world")
@pytest.mark.refused("URDF", "joint floating below a link")
def test_a_floating_joint_is_below_the_world_only(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="free joint can only be used on top level"):
        build_model(arm(tmp_path, "floating"))
    path = tmp_path / "ball.urdf"
    path.write_text(
        '<robot name="ball"><link name="world"/><link name="one"><inertial><mass value="2"/><inertia ixx="1" iyy="1" '
        'izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="floating"><parent link="world"/>'
        '<child link="one"/></joint></robot>'
    )
    assert build_model(path).nq == 7
    assert differences(path) == []


@pytest.mark.honoured("URDF", "collision: box, cylinder, capsule, sphere")
@pytest.mark.honoured("URDF", "visual, material")
def test_shapes_are_those_of_collisions(tmp_path: Path) -> None:
    shapes = '<box size=".1 .2 .3"/>', '<cylinder radius=".1" length=".3"/>', '<capsule radius=".1" length=".3"/>'
    collisions = "".join(f"<collision><geometry>{each}</geometry></collision>" for each in (*shapes, SPHERE))
    visual = f'<visual><geometry>{SPHERE}</geometry><material name="m"><color rgba="1 0 0 1"/></material></visual>'
    path = arm(tmp_path, link=visual + collisions)
    assert differences(path) == []
    assert build_model(path).ngeom == 5  # and the floor


@pytest.mark.honoured("URDF", "mesh in a file")
@pytest.mark.refused("URDF", "mesh that is not there, package://")
def test_a_mesh_is_found_beside_the_file_or_named(tmp_path: Path) -> None:
    mesh = "<collision><geometry><mesh filename='{}' scale='2 1 1'/></geometry></collision>"
    with pytest.raises(FieldError, match=r"Error opening file .*y\.stl"):
        build_model(arm(tmp_path, link=mesh.format("package://x/y.stl")))
    (tmp_path / "a.obj").write_text("v 0 0 0\nv .3 0 0\nv 0 .2 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    path = arm(tmp_path, link=mesh.format("a.obj"))
    assert differences(path) == []
    assert build_model(path).nmesh == 1


@pytest.mark.honoured("URDF", "mujoco: compiler, option, size")
def test_the_extension_of_mujoco_counts(tmp_path: Path) -> None:
    more = '<mujoco><compiler balanceinertia="true" fusestatic="false"/><option gravity="0 0 -3"/></mujoco>'
    path = arm(tmp_path, more=more)
    assert differences(path) == []
    assert build_model(path).opt.gravity[2] == -3.0


@pytest.mark.refused("URDF", "joint of an unknown type")
@pytest.mark.refused("URDF", "xacro")
@pytest.mark.parametrize(
    ("kind", "more", "words"),
    [
        ("wobbly", "", "invalid joint type in URDF"),
        ("continuous", '<xacro:include filename="more.xacro"/>', r"<xacro:include; allowed: what xacro has expanded"),
    ],
)
def test_what_mujoco_does_not_read_is_refused(tmp_path: Path, kind: str, more: str, words: str) -> None:
    with pytest.raises(FieldError, match=words):
        build_model(arm(tmp_path, kind, more=more))
