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
NAMES = {
    "body": ("nbody", "BODY"), "jnt": ("njnt", "JOINT"), "actuator": ("nu", "ACTUATOR"), "key": ("nkey", "KEY"),
    "tendon": ("ntendon", "TENDON"), "eq": ("neq", "EQUALITY"), "sensor": ("nsensor", "SENSOR"),
    "geom": ("ngeom", "GEOM"), "site": ("nsite", "SITE"), "pair": ("npair", "PAIR"), "exclude": ("nexclude", "EXCLUDE"),
}  # fmt: skip
SIZES = ("nq", "nv", "nu", "na", "neq", "ntendon", "nsensor", "nmocap", "nkey", "npair", "nexclude", "njnt")
ADDED = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # a state that diverges has to be visible


def places(own: mujoco.MjModel, built: mujoco.MjModel, count: str, kind: str) -> list[int]:
    """Where the elements of the file are in the model that is built; what has no name keeps its order, from the end."""
    object_type = getattr(mujoco.mjtObj, f"mjOBJ_{kind}")
    found = []
    for i in range(getattr(own, count)):
        name = mujoco.mj_id2name(own, object_type, i)
        unnamed = i + getattr(built, count) - getattr(own, count)
        found.append(mujoco.mj_name2id(built, object_type, f"mechanism/{name}") if name else unnamed)
    return found


def differences(path: Path) -> list[str]:
    own, built = mujoco.MjModel.from_xml_path(str(path)), build_model(path)
    found = [size for size in SIZES if getattr(own, size) != getattr(built, size)]
    for prefix, (count, kind) in NAMES.items():
        at = places(own, built, count, kind)
        first = 1 if prefix == "body" else 0  # the world
        for name in dir(own):
            values, others = getattr(own, name), getattr(built, name)
            if not (name.startswith(f"{prefix}_") and isinstance(values, np.ndarray) and values.dtype.kind == "f"):
                continue
            if len(values) == len(at) and not np.allclose(values[first:], others[at][first:], 1e-9, 1e-12, True):
                found.append(name)
    for name in (*(each for each in dir(own) if each.startswith("dof_")), "qpos0", "qpos_spring"):
        if getattr(own, name).dtype.kind == "f" and not np.allclose(
            getattr(own, name), getattr(built, name), 1e-9, 1e-12
        ):
            found.append(name)
    own.opt.disableflags |= ADDED
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


@pytest.mark.parametrize(
    ("before", "beside", "after"),
    [
        ('<compiler settotalmass="8"/>', "", ""),
        ('<compiler settotalmass="8"/>', '<geom type="box" size="1 1 1" pos="0 0 -3"/>', ""),  # which has no mass there
        ('<compiler settotalmass="3" angle="radian" balanceinertia="true"/>', FREE, ""),
        ('<compiler boundmass="2" boundinertia="0.5"/>', "", ""),
        (
            "",
            '<body name="target" mocap="true" pos=".5 0 .5"><geom size=".02" contype="0" conaffinity="0"/></body>',
            "",
        ),
        ('<size nkey="3" nuser_geom="2"/>', FREE, ""),
        ("", FREE, '<keyframe><key qpos="0 0 1 1 0 0 0 0.1 0.2"/></keyframe>'),
    ],
)
def test_what_a_file_may_say_of_the_whole_model_is_kept(tmp_path: Path, before: str, beside: str, after: str) -> None:
    (tmp_path / "arm.xml").write_text(ARM.format(before, beside, after))
    assert differences(tmp_path / "arm.xml") == []
