"""What an MJCF file says of the whole model is kept: compiler, options, sizes, defaults."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.models.mechanism.mjcf_arm import ARM, GROUND, assert_moves_alike
from tests.models.mechanism.test_same_model import differences


@pytest.mark.parametrize(
    ("before", "beside", "after"),
    [
        pytest.param(
            '<compiler angle="radian"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "compiler angle"),
        ),
        pytest.param(
            '<compiler eulerseq="zyx"/>',
            '<body pos="1 0 1" euler="10 20 30"><joint axis="0 1 0"/><geom type="box" size=".1 .2 .3"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler eulerseq"),
        ),
        pytest.param(
            '<compiler autolimits="false"/>',
            '<body pos="1 0 1"><joint range="-1 1" limited="true" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler autolimits"),
        ),
        pytest.param(
            '<compiler boundmass="2" boundinertia="0.5"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "compiler boundmass, boundinertia"),
        ),
        pytest.param(
            '<compiler balanceinertia="true"/>',
            '<body pos="1 0 1"><inertial pos="0 0 -.1" mass="1" diaginertia="1 1 9"/><joint axis="0 1 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler balanceinertia"),
        ),
        pytest.param(
            '<compiler settotalmass="8"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "compiler settotalmass"),
        ),
        pytest.param(
            '<compiler inertiafromgeom="true"/>',
            '<body pos="1 0 1"><inertial pos="0 0 -.1" mass="1" diaginertia="1 1 1"/><joint axis="0 1 0"/>'
            '<geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler inertiafromgeom"),
        ),
        pytest.param(
            '<compiler inertiagrouprange="0 1"/>',
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/><geom size=".3" group="4"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler inertiagrouprange"),
        ),
        pytest.param(
            '<compiler fitaabb="true"/><asset><mesh name="m" vertex="0 0 0 .3 0 0 0 .2 0 0 0 .1"/></asset>',
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom type="box" mesh="m"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler fitaabb"),
        ),
        pytest.param(
            '<compiler alignfree="true"/>',
            '<body pos="1 0 1"><freejoint/><geom size=".1" pos=".2 0 0"/><geom size=".2"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler alignfree"),
        ),
        pytest.param(
            '<compiler usethread="false" saveinertial="true"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "compiler usethread, saveinertial"),
        ),
        pytest.param(
            '<option gravity="1 0 -3"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "option gravity"),
        ),
        pytest.param(
            '<option wind="3 0 1" density="1000" viscosity=".01"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "option wind, density, viscosity"),
        ),
        pytest.param(
            '<option magnetic="1 2 3"/>',
            "",
            '<sensor><magnetometer site="tip"/></sensor>',
            marks=pytest.mark.honoured("MJCF", "option magnetic"),
        ),
        pytest.param(
            '<option integrator="implicitfast"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "option integrator"),
        ),
        pytest.param(
            '<option solver="CG" iterations="3" tolerance="1e-4" ls_iterations="4" ls_tolerance=".1"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "option solver, iterations, tolerance"),
        ),
        pytest.param(
            '<option cone="elliptic" jacobian="sparse" impratio="4"/>',
            GROUND,
            "",
            marks=pytest.mark.honoured("MJCF", "option cone, jacobian, impratio"),
        ),
        pytest.param(
            '<option o_margin=".01" o_solref=".01 1" o_solimp=".8 .9 .01 .5 2" o_friction="1 1 .1 .1 .1">'
            '<flag override="enable"/></option>',
            GROUND,
            "",
            marks=pytest.mark.honoured("MJCF", "option o_margin, o_solref, o_solimp, o_friction"),
        ),
        pytest.param(
            '<option noslip_iterations="3" noslip_tolerance="1e-3"/>',
            GROUND,
            "",
            marks=pytest.mark.honoured("MJCF", "option noslip_iterations"),
        ),
        pytest.param(
            '<option ccd_iterations="9" ccd_tolerance="1e-3" sdf_iterations="4" sdf_initpoints="9"/>',
            GROUND,
            "",
            marks=pytest.mark.honoured("MJCF", "option ccd_iterations, sdf_iterations"),
        ),
        pytest.param(
            '<option actuatorgroupdisable="1"/>',
            "",
            '<actuator><motor joint="a" group="1"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "option actuatorgroupdisable"),
        ),
        pytest.param(
            '<option><flag gravity="disable" contact="disable" limit="disable" eulerdamp="disable"/></option>',
            GROUND,
            "",
            marks=pytest.mark.honoured("MJCF", "option flags of what is disabled"),
        ),
        pytest.param(
            '<option><flag energy="enable" invdiscrete="enable" multiccd="enable"/></option>',
            GROUND,
            "",
            marks=pytest.mark.honoured("MJCF", "option flags of what is enabled"),
        ),
        pytest.param(
            '<size memory="1M" nuserdata="4" nuser_jnt="2"/>',
            '<body pos="1 0 1"><joint axis="0 1 0" user="1 2"/><geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "size memory, njmax, nuserdata, nuser"),
        ),
        pytest.param(
            '<statistic extent="3" meansize=".2" center="1 2 3"/>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "statistic"),
        ),
        pytest.param(
            '<default><joint damping=".3"/><default class="heavy"><geom density="4000"/></default></default>',
            '<body pos="1 0 1" childclass="heavy"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "default, class, childclass"),
        ),
        pytest.param(
            '<custom><numeric name="n" data="1 2"/><text name="t" data="hello"/><tuple name="p">'
            '<element objtype="body" objname="upper"/></tuple></custom>',
            "",
            "",
            marks=pytest.mark.honoured("MJCF", "custom numeric, text, tuple"),
        ),
        pytest.param(
            "",
            "",
            '<keyframe><key qpos=".1 .2" qvel="1 2"/></keyframe>',
            marks=pytest.mark.honoured("MJCF", "keyframe qpos, qvel"),
        ),
        pytest.param(
            "<compiler>"
            '<lengthrange mode="all" timestep="0.02" interval="1" inttotal="3" useexisting="false" '
            'uselimit="false"/>'
            "</compiler>",
            '<body pos="1 0 1"><joint name="x" axis="0 1 0" range="-20 30" limited="true"/>'
            '<geom size=".1" pos=".2 0 0"/></body>',
            '<actuator><motor joint="x"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "compiler lengthrange"),
        ),
    ],
)
def test_what_is_said_of_the_whole_model_is_kept(tmp_path: Path, before: str, beside: str, after: str) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(before, beside, after))
    assert differences(tmp_path / "arm.xml") == []
    assert_moves_alike(tmp_path / "arm.xml")


@pytest.mark.parametrize(
    ("before", "beside", "after"),
    [
        pytest.param(
            '<compiler fusestatic="true"/>',
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/><body pos=".4 0 0">'
            '<geom size=".1"/></body></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler fusestatic"),
        ),
        pytest.param(
            '<compiler discardvisual="true"/>',
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/>'
            '<geom size=".2" contype="0" conaffinity="0" mass="0"/></body>',
            "",
            marks=pytest.mark.honoured("MJCF", "compiler discardvisual"),
        ),
    ],
)
def test_what_a_file_leaves_out_of_its_model_moves_nothing(
    tmp_path: Path, before: str, beside: str, after: str
) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(before, beside, after))
    assert_moves_alike(tmp_path / "arm.xml")
