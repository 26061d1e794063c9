"""Contacts, tendons, constraints, actuators and sensors of an MJCF file are those of MuJoCo's own model."""

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
            f'{GROUND}<body name="p" pos="1 0 .1"><freejoint/>'
            '<geom name="pg" size=".1" contype="0" conaffinity="0"/></body>',
            '<contact><pair geom1="pg" geom2="ground" friction=".5 .5 .1 .1 .1" condim="4"/>'
            '<exclude body1="upper" body2="p"/></contact>',
            marks=pytest.mark.honoured("MJCF", "contact pair, exclude"),
        ),
        pytest.param(
            "",
            '<site name="anchor" pos=".5 0 1.2"/>'
            '<geom name="post" type="cylinder" size=".05 .2" pos=".3 0 1" euler="90 0 0" contype="0" '
            'conaffinity="0"/>',
            "<tendon>"
            '<spatial stiffness="50" damping="1" springlength=".3" frictionloss=".1" limited="true" range="0 '
            '.9">'
            '<site site="anchor"/><geom geom="post"/><site site="tip"/></spatial></tendon>',
            marks=pytest.mark.honoured("MJCF", "tendon spatial"),
        ),
        pytest.param(
            "",
            '<site name="anchor" pos=".5 0 1.2"/><site name="other" pos=".5 .3 1.2"/>',
            '<tendon><spatial stiffness="50" springlength=".3"><site site="anchor"/><site site="tip"/>'
            '<pulley divisor="2"/><site site="tip"/><site site="other"/></spatial></tendon>',
            marks=pytest.mark.honoured("MJCF", "tendon spatial pulley"),
        ),
        pytest.param(
            "",
            "",
            '<tendon><fixed stiffness="5" damping=".2"><joint joint="a" coef="1"/>'
            '<joint joint="b" coef="-2"/></fixed></tendon>',
            marks=pytest.mark.honoured("MJCF", "tendon fixed"),
        ),
        pytest.param(
            "",
            "",
            '<equality><connect body1="lower" anchor="0 0 -.2"/></equality>',
            marks=pytest.mark.honoured("MJCF", "equality connect"),
        ),
        pytest.param(
            "",
            '<body name="w" pos="0 0 .2"><freejoint/><geom size=".05"/></body>',
            '<equality><weld body1="w" body2="lower" torquescale=".5"/></equality>',
            marks=pytest.mark.honoured("MJCF", "equality weld"),
        ),
        pytest.param(
            "",
            "",
            '<equality><joint joint1="a" joint2="b" polycoef=".1 -.5 .1 0 0"/></equality>',
            marks=pytest.mark.honoured("MJCF", "equality joint"),
        ),
        pytest.param(
            "",
            "",
            '<tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="-2"/></fixed></tendon>'
            '<equality><tendon tendon1="t" polycoef=".1 0 0 0 0"/></equality>',
            marks=pytest.mark.honoured("MJCF", "equality tendon"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><motor joint="a" gear="3" ctrlrange="-1 1" ctrllimited="true"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator motor"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><position joint="a" kp="30" kv="2" forcerange="-3 3"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator position"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><position joint="a" kp="30" dampratio="1" inheritrange="0"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator position dampratio"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><velocity joint="a" kv="3"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator velocity"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><damper joint="a" kv="3" ctrlrange="0 1"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator damper"),
        ),
        pytest.param(
            "",
            "",
            "<actuator>"
            '<general joint="a" gaintype="affine" gainprm="1 2 3" biastype="affine" biasprm="1 -2 -3"/>'
            "</actuator>",
            marks=pytest.mark.honoured("MJCF", "actuator general"),
        ),
        pytest.param(
            "",
            f'{GROUND}<body name="p" pos="1 0 .1"><freejoint/><geom size=".1"/></body>',
            '<actuator><adhesion body="p" ctrlrange="0 1" gain="5"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator adhesion"),
        ),
        pytest.param(
            "",
            "",
            '<tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="-2"/></fixed></tendon>'
            '<actuator><motor tendon="t" gear="2"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator at a tendon"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><general site="tip" gear="1 0 0 0 2 0"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator at a site"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".2 0 0"/>'
            '<site name="crank" pos=".1 0 .1"/></body><site name="slider" pos="1 0 1.5"/>',
            '<actuator><motor cranksite="crank" slidersite="slider" cranklength=".6"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator at a slider and crank"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint name="ball" type="ball"/><geom size=".1" pos=".2 0 0"/></body>',
            '<actuator><motor jointinparent="ball" gear="1 2 3"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator jointinparent"),
        ),
        pytest.param(
            "",
            GROUND,
            '<sensor><accelerometer site="tip"/><gyro site="tip"/><velocimeter site="tip"/>'
            '<force site="tip"/><torque site="tip"/><touch site="tip"/><rangefinder site="tip"/></sensor>',
            marks=pytest.mark.honoured("MJCF", "sensor of a site: IMU, force, torque, touch, range"),
        ),
        pytest.param(
            "",
            "",
            '<tendon><fixed name="t"><joint joint="a" coef="1"/></fixed></tendon><actuator>'
            '<motor name="m" joint="a"/></actuator><sensor><jointpos joint="a" noise=".1" cutoff="2"/>'
            '<jointvel joint="a"/><jointactuatorfrc joint="a"/><tendonpos tendon="t"/><tendonvel tendon="t"/>'
            '<actuatorpos actuator="m"/><actuatorfrc actuator="m"/></sensor>',
            marks=pytest.mark.honoured("MJCF", "sensor of a joint, a tendon or an actuator"),
        ),
        pytest.param(
            "",
            "",
            '<sensor><framepos objtype="site" objname="tip"/>'
            '<framequat objtype="body" objname="lower" reftype="body" refname="upper"/>'
            '<framelinvel objtype="site" objname="tip"/><frameangacc objtype="body" objname="lower"/>'
            "</sensor>",
            marks=pytest.mark.honoured("MJCF", "sensor of a frame"),
        ),
        pytest.param(
            "",
            "",
            '<sensor><subtreecom body="upper"/><subtreeangmom body="upper"/><e_potential/><e_kinetic/>'
            "<clock/></sensor>",
            marks=pytest.mark.honoured("MJCF", "sensor of a subtree, of energy, of the clock"),
        ),
        pytest.param(
            "",
            "",
            '<sensor><user name="u" dim="3"/></sensor>',
            marks=pytest.mark.honoured("MJCF", "sensor user"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><motor joint="a" delay=".01" nsample="6"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator delay, nsample"),
        ),
        pytest.param(
            "",
            "",
            '<sensor><jointpos joint="a" delay=".01" nsample="6"/></sensor>',
            marks=pytest.mark.honoured("MJCF", "sensor delay, nsample"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><motor joint="a" armature=".1" damping=".3"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator armature, damping"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><dcmotor joint="a" motorconst=".5" resistance="1"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator dcmotor"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><pid joint="a" kp="30" kv="2"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator pid"),
        ),
        pytest.param(
            "",
            '<body pos="1 0 1"><joint name="ball" type="ball"/><geom size=".1" pos=".2 0 0"/></body>',
            '<actuator><orientation joint="ball" kp="3"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator orientation"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><muscle joint="a" lengthrange="0 1"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator muscle"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><cylinder joint="a" timeconst=".1"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator cylinder"),
        ),
        pytest.param(
            "",
            "",
            '<actuator><intvelocity joint="a" kp="3" actrange="-1 1"/></actuator>',
            marks=pytest.mark.honoured("MJCF", "actuator intvelocity"),
        ),
        pytest.param(
            "",
            '<geom name="far" size=".1" pos="3 0 0"/>',
            '<sensor><distance body1="upper" geom2="far"/>'
            '<insidesite site="tip" objtype="body" objname="upper"/><contact body1="upper"/></sensor>',
            marks=pytest.mark.honoured("MJCF", "sensor of distances and contacts"),
        ),
        pytest.param(
            "",
            f'{GROUND}<body name="p" pos="1 0 .1"><freejoint/><geom name="pg" size=".1"/></body>',
            '<contact><pair geom1="pg" geom2="ground" solref=".02 1" margin=".01" gap=".005"/></contact>',
            marks=pytest.mark.honoured("MJCF", "contact pair solref, margin, gap"),
        ),
    ],
)
def test_what_acts_and_what_is_measured_is_mujocos(tmp_path: Path, before: str, beside: str, after: str) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(before, beside, after))
    assert differences(tmp_path / "arm.xml") == []
    assert_moves_alike(tmp_path / "arm.xml")
