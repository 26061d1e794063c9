"""Each body, joint and geom of an MJCF file is in the model that is simulated as it is in MuJoCo's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.models.mechanism.mjcf_arm import ARM, GROUND, assert_moves_alike
from tests.models.mechanism.test_same_model import differences


@pytest.mark.parametrize(
    ("before", "beside", "after"),
    [
        pytest.param(
            "",
            '<body pos="1 0 1" axisangle="0 1 1 40"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0" />'
            '<body xyaxes="0 1 0 -1 0 0" pos=".3 0 0"><joint axis="1 0 0"/>'
            '<geom type="box" size=".1 .2 .3" zaxis="1 1 0" pos="0 .2 0"/></body></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "frames by quat, axisangle, euler, xyaxes, zaxis"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1" gravcomp=".7"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "body gravcomp"),
        ),
        pytest.param(
            "",
            '<body name="target" mocap="true" pos=".5 0 .5"><geom size=".02" contype="0" conaffinity="0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "body mocap"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><inertial pos="0 0 -.1" mass="1" fullinertia="1 2 2.5 .1 .1 .1"/>'
            '<joint axis="0 1 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "body inertial"),
        ),
        pytest.param(
            "",
            '<frame pos="1 0 1" euler="0 30 0"><body><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/>'
            "</body></frame>",
            "",
            marks=pytest.mark.honoured("MJCF", "frame"),
        ),
        pytest.param(
            "",
            '<replicate count="3" offset=".5 0 0"><body pos="1 0 1"><joint axis="0 1 0"/>'
            '<geom size=".1" pos=".2 0 0"/></body></replicate>',
            "",
            marks=pytest.mark.honoured("MJCF", "replicate"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint type="slide" axis="0 1 0"/><joint axis="0 1 0"/>'
            '<geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "joint slide, hinge"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint type="ball"/><geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "joint ball"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><freejoint/><geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "joint free"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0" range="-10 20" margin=".1" solreflimit=".05 1"/>'
            '<geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "joint limited, range, margin, solreflimit"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0" stiffness="20" springref="30" damping=".5"/>'
            '<geom size=".1" pos=".2 0 0"/><body pos=".4 0 0"><joint axis="0 1 0" springdamper=".1 .5"/>'
            '<geom size=".1" pos=".2 0 0"/></body></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "joint stiffness, springref, springdamper, damping"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0" frictionloss=".4" solreffriction=".05 1"/>'
            '<geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "joint frictionloss"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0" armature=".4"/><geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "joint armature"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0" ref="25"/><geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "joint ref"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1" gravcomp="1">'
            '<joint name="j" axis="0 1 0" actuatorfrcrange="-.1 .1" actuatorgravcomp="true"/>'
            '<geom size=".1" pos=".2 0 0"/></body>',
            '<actuator><motor joint="j"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "joint actuatorfrcrange, actuatorgravcomp"),
        ),
        pytest.param(
            "",
            f'{GROUND}<body pos="1 0 .15"><freejoint/><geom size=".1"/>'
            '<geom type="ellipsoid" size=".1 .2 .1" pos="1 0 0"/>'
            '<geom type="cylinder" size=".1 .1" pos="2 0 0"/><geom type="box" size=".1 .1 .1" pos="3 0 0"/>'
            '<geom type="capsule" size=".05 .2" pos="1 1 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "geom plane, sphere, capsule, ellipsoid, cylinder, box"),
        ),
        pytest.param(
            '<asset><hfield name="h" nrow="3" ncol="3" size="2 2 .3 .1" elevation="0 1 0 1 0 1 0 1 0"/></asset>',
            '<geom type="hfield" hfield="h"/><body pos="0 .5 .5"><freejoint/><geom size=".1"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "geom hfield"),
        ),
        pytest.param(
            '<asset><mesh name="m" vertex="0 0 0 .3 0 0 0 .2 0 0 0 .1"/></asset>',
            f'{GROUND}<body pos="1 0 .1"><freejoint/><geom type="mesh" mesh="m"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "geom mesh"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom type="cylinder" size=".1" fromto="0 0 0 .3 .1 .2"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "geom fromto"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0" mass="3"/>'
            '<geom size=".1" density="200" pos=".4 0 0"/>'
            '<geom type="box" size=".1 .1 .1" shellinertia="true"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "geom mass, density, shellinertia"),
        ),
        pytest.param(
            "",
            f'{GROUND}<body pos="1 0 .1"><freejoint/>'
            '<geom size=".1" condim="6" friction=".3 .1 .1" priority="2" solref=".01 1" solimp=".8 .9 .01 .5 '
            '2" solmix="2" margin=".01" gap=".005"/>'
            "</body>",
            "",
            marks=pytest.mark.honoured("MJCF", "geom friction, condim, priority, solref, margin, gap"),
        ),
        pytest.param(
            "",
            f'{GROUND}<body pos="1 0 .1"><freejoint/><geom size=".1" contype="2" conaffinity="4"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "geom contype, conaffinity"),
        ),
        pytest.param(
            '<option density="1000" viscosity=".01"/>',
            '<body pos="1 0 1"><joint axis="0 1 0"/>'
            '<geom type="ellipsoid" size=".1 .2 .3" pos=".2 0 0" fluidshape="ellipsoid" fluidcoef=".4 .2 1 1 '
            '1"/>'
            "</body>",
            "",
            marks=pytest.mark.honoured("MJCF", "geom fluidshape, fluidcoef"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/>'
            '<site name="s" pos=".1 0 0"/><camera name="c" fovy="50"/><light name="l"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "site, camera, light"),
        ),
        pytest.param(
            "",
            '<composite type="cable" curve="s" count="5 1 1" size="1" offset="0 0 3" initial="ball">'
            '<joint kind="main" damping=".1"/><geom type="capsule" size=".02"/></composite>',
            "",
            marks=pytest.mark.honoured("MJCF", "composite"),
        ),
        pytest.param(
            "",
            '<flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" pos="2 0 2" '
            'radius=".01" mass="1">'
            '<edge equality="true"/><pin id="0"/></flexcomp>',
            "",
            marks=pytest.mark.honoured("MJCF", "flexcomp"),
        ),
        pytest.param(
            "",
            '<geom name="ground" type="plane" surfacevel="1 0 0" size="5 5 1"/><body pos="1 0 .1">'
            '<freejoint/><geom size=".1"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "geom surfacevel"),
        ),
        pytest.param(
            "",
            f'{GROUND}<body pos="1 0 .1"><freejoint/><geom size=".1" adhesion="3"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "geom adhesion"),
        ),
        pytest.param(
            "",
            '<flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" pos="2 0 2" '
            'radius=".01" mass="1">'
            '<elasticity young="1e3"/><pin id="0"/></flexcomp>',
            "",
            marks=pytest.mark.honoured("MJCF", "flexcomp elasticity, pin"),
        ),
        pytest.param(
            '<option><flag sleep="enable"/></option>',
            f'{GROUND}<body pos="1 0 .1" sleep="allowed"><freejoint/><geom size=".1"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "body sleep"),
        ),
        pytest.param(
            '<extension><plugin plugin="mujoco.elasticity.cable"/></extension>',
            '<composite type="cable" curve="s" count="5 1 1" size="1" offset="0 0 3" initial="ball">'
            '<plugin plugin="mujoco.elasticity.cable"><config key="twist" value="1e6"/></plugin>'
            '<joint kind="main" damping=".1"/><geom type="capsule" size=".02"/></composite>',
            "",
            marks=pytest.mark.honoured("MJCF", "extension plugin"),
        ),
        pytest.param(
            '<asset><texture name="t" type="2d" builtin="checker" width="8" height="8"/>'
            '<material name="m" texture="t" rgba="1 0 0 1"/></asset>',
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0" material="m"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "asset texture, material"),
        ),
        pytest.param(
            "",
            '<body name="bb" pos="1 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/></body>',
            '<deformable><skin name="s" vertex="0 0 0 1 0 0 0 1 0" face="0 1 2">'
            '<bone body="bb" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2" vertweight="1 1 1"/></skin>'
            "</deformable>",
            marks=pytest.mark.honoured("MJCF", "deformable skin"),
        ),
        pytest.param(
            "",
            '<body name="v0" pos="0 0 3"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
            '<joint type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass=".1" diaginertia=".1 .1 .1"/>'
            '</body><body name="v1" pos="1 0 3"><joint type="slide" axis="1 0 0"/>'
            '<joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>'
            '<inertial pos="0 0 0" mass=".1" diaginertia=".1 .1 .1"/></body><body name="v2" pos="0 1 3">'
            '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
            '<joint type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass=".1" diaginertia=".1 .1 .1"/>'
            "</body>",
            '<deformable><flex name="f" dim="2" radius=".01" body="v0 v1 v2" element="0 1 2">'
            '<edge damping="1"/></flex></deformable><equality><flex flex="f"/></equality>',
            marks=pytest.mark.honoured("MJCF", "deformable flex, equality flex"),
        ),
    ],
)
def test_an_element_means_here_what_it_means_in_mujoco(tmp_path: Path, before: str, beside: str, after: str) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(before, beside, after))
    assert differences(tmp_path / "arm.xml") == []
    assert_moves_alike(tmp_path / "arm.xml")
