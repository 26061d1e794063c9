"""A mechanism read from a file is MuJoCo's own model of that file, value by value, with a floor and a sky about it."""

from __future__ import annotations

from pathlib import Path

import dm_control
import gymnasium
import mujoco
import numpy as np
import pytest

from mathnavi.models.mechanism.entity import build_model

SUITE = sorted((Path(dm_control.__file__).parent / "suite").glob("*.xml"))
GYMNASIUM = sorted((Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets").glob("*.xml"))
WITHOUT_JOINTS = {"lqr.xml"}  # its scene is made in Python
SIZES = (
    "nq", "nv", "nu", "nactuator", "na", "nbody", "njnt", "neq", "ntendon", "nsensor", "nmocap", "nkey", "npair",
    "nexclude", "nmesh", "nhfield",
)  # fmt: skip
DRAWN = ("cam_", "light_", "mat_", "tex_", "bvh_", "oct_", "vis")


def differences(path: Path, rounding: float = 0.0) -> list[str]:
    """Numbers of the model that is built that are not those of MuJoCo's own, in which the file's elements come last."""
    own, built = mujoco.MjModel.from_xml_path(str(path)), build_model(path)
    found = [size for size in SIZES if getattr(own, size) != getattr(built, size)]
    for name in dir(own):
        values = getattr(own, name)
        if not isinstance(values, np.ndarray) or values.dtype.kind != "f" or name.startswith(DRAWN):
            continue
        others = getattr(built, name)
        others = others[len(others) - len(values) :]
        first = 1 if name.startswith("body_") else 0  # the world, which has the floor
        if values.shape != others.shape or not np.allclose(values[first:], others[first:], rounding, 0.0, True):
            found.append(name)
    for name in dir(own.opt):
        value = getattr(own.opt, name)
        if not (name.startswith("_") or callable(value) or np.array_equal(value, getattr(built.opt, name))):
            found.append(f"opt.{name}")
    return found


@pytest.mark.honoured("MJCF", "files of dm_control and of Gymnasium")
@pytest.mark.parametrize("folder", [SUITE, GYMNASIUM], ids=["dm_control", "gymnasium"])
def test_files_of_others_are_the_models_that_mujoco_makes_of_them(folder: list[Path]) -> None:
    assert len(folder) > 10
    found = {path.name: differences(path) for path in folder if path.name not in WITHOUT_JOINTS}
    assert {name: each for name, each in found.items() if each} == {}


ARM = """<mujoco>{}<worldbody>{}
  <body pos="0 0 1"><joint name="a" axis="0 1 0"/><geom type="capsule" size=".04" fromto="0 0 0 .1 0 -.5" mass="1"/>
    <body pos="0 0 -.5"><joint axis="0 1 0"/><geom type="box" size=".03 .1 .2" mass=".6"/></body></body>
</worldbody>{}</mujoco>"""
FREE = '<body name="ball" pos="1 0 2"><freejoint/><geom size="0.1"/></body>'


MOCAP = '<body name="target" mocap="true" pos=".5 0 .5"><geom size=".02" contype="0" conaffinity="0"/></body>'
TO_THE_WORLD = """<equality><connect body1="ball" anchor="0 0 1"/><weld body1="world" body2="ball" active="false"/>
<joint joint1="a"/></equality><contact><exclude body1="world" body2="ball"/></contact>
<sensor><framepos name="world" objtype="body" objname="world"/><framepos objtype="body" objname="ball" reftype="body"
refname="world" noise=".3"/></sensor>"""
EVERY_OPTION = """<option timestep="0.003" impratio="3" tolerance="1e-7" ls_tolerance="0.02" noslip_tolerance="1e-5"
ccd_tolerance="1e-5" gravity="1 2 -3" wind="1 0 0" magnetic="0 1 0" density="1.2" viscosity="0.1" o_margin="0.01"
o_solref="0.1 1" o_solimp="0.8 0.9 0.01 0.5 2" integrator="implicit" cone="elliptic" jacobian="dense" solver="CG"
iterations="33" ls_iterations="22" noslip_iterations="2" ccd_iterations="44" actuatorgroupdisable="3">
<flag contact="disable" energy="enable" override="enable" multiccd="disable" island="disable" warmstart="disable"/>
</option>"""
LIGHT = '<light mode="targetbody" target="world"/>'
OF_THE_WHOLE_MODEL = {
    "every option and flag": (EVERY_OPTION, FREE, ""),
    "statistic meaninertia, meanmass": ('<statistic meaninertia="1e-4" meanmass="3"/>', "", ""),
    "elements that refer to the world": ("", FREE + LIGHT, TO_THE_WORLD),
    "compiler fusestatic": ('<compiler fusestatic="true"/>', '<body pos="1 0 0"><geom size=".1"/></body>', ""),
    "compiler lengthrange": (
        '<compiler><lengthrange uselimit="true"/></compiler>',
        '<body pos="3 0 1"><joint name="l" range="-60 50" limited="true"/><geom size=".1" pos=".3 0 0"/></body>',
        '<actuator><muscle joint="l"/></actuator>',
    ),
    "compiler boundmass, boundinertia": ('<compiler boundmass="2" boundinertia="0.5"/>', "", ""),
    "mocap bodies": ("", MOCAP, ""),
    "size": ('<size nkey="3" nuser_geom="2"/>', FREE, ""),
    "keyframes without names": ("", FREE, '<keyframe><key qpos="0 0 1 1 0 0 0 0.1 0.2"/><key time="2"/></keyframe>'),
}


@pytest.mark.parametrize(
    ("before", "beside", "after"),
    [
        pytest.param(*parts, id=feature, marks=pytest.mark.honoured("MJCF", feature))
        for feature, parts in OF_THE_WHOLE_MODEL.items()
    ],
)
def test_what_a_file_may_say_of_the_whole_model_is_kept(tmp_path: Path, before: str, beside: str, after: str) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(before, beside, after))
    assert differences(tmp_path / "arm.xml") == []


@pytest.mark.honoured("MJCF", "compiler settotalmass")
@pytest.mark.parametrize(
    ("compiler", "beside"),
    [
        ('settotalmass="8"', ""),
        ('settotalmass="8"', '<geom type="box" size="1 1 1" pos="0 0 -3"/>'),  # which has no mass there
        ('settotalmass="3" angle="radian" balanceinertia="true"', FREE),
    ],
)
def test_the_total_mass_that_a_file_sets_is_kept_up_to_rounding(tmp_path: Path, compiler: str, beside: str) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(f"<compiler {compiler}/>", beside, ""))
    assert differences(tmp_path / "arm.xml", rounding=1e-9) == []
