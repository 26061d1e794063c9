"""Robots of MuJoCo Menagerie by their names, from a folder that is laid out as the package's cache."""

from __future__ import annotations

from pathlib import Path

import mujoco
import mujoco_menagerie
import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.models.mechanism.entity import build_model, mechanism_digest
from mathnavi.models.mechanism.geometry import MechanismManifold

ROBOT = "universal_robots_ur5e"
MJCF = """<mujoco model="arm"><compiler angle="radian" meshdir="assets" autolimits="true"/>
<option integrator="implicitfast"/>
<default><default class="arm"><joint axis="0 1 0" range="-3 3" armature=".1"/>
<general gaintype="fixed" biastype="affine" gainprm="2000" biasprm="0 -2000 -300" ctrlrange="-3 3" forcerange="-99 99"/>
</default></default>
<asset><mesh name="link" file="link.obj"/></asset>
<worldbody><body name="upper" childclass="arm"><joint name="shoulder"/><geom type="mesh" mesh="link"/>
<include file="lower.xml"/></body></worldbody>
<actuator><general class="arm" name="shoulder" joint="shoulder"/><general class="arm" name="elbow" joint="elbow"/>
</actuator><keyframe><key name="home" qpos="0.5 -1" ctrl="0.5 -1"/></keyframe></mujoco>"""
LOWER = """<mujocoinclude><body name="lower" pos="0 0 .4"><joint name="elbow"/><geom type="mesh" mesh="link"/></body>
</mujocoinclude>"""
LINK = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .4\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


LEGGED = "unitree_go2"
WALKER = """<mujoco model="walker"><worldbody><body name="trunk" pos="0 0 .3"><freejoint/><geom size=".1"/></body>
</worldbody></mujoco>"""
SCENE = """<mujoco model="scene"><include file="go2.xml"/><worldbody><geom type="plane" size="0 0 .1"/></worldbody>
</mujoco>"""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache in which two robots are, others than Menagerie's."""
    monkeypatch.setenv("MENAGERIE_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setenv("MENAGERIE_BASE_URL", (tmp_path / "nowhere").as_uri())
    robot = mujoco_menagerie.get(ROBOT)
    folder = mujoco_menagerie.Cache().model_path(robot)
    (folder / "assets").mkdir(parents=True)
    (folder / robot.entry(robot.default_model).file).write_text(MJCF)
    (folder / "lower.xml").write_text(LOWER)
    (folder / "assets" / "link.obj").write_text(LINK)
    (folder / ".complete").write_text("{}")
    legged = mujoco_menagerie.get(LEGGED)
    there = mujoco_menagerie.Cache().model_path(legged)
    there.mkdir(parents=True)
    for entry, content in ((legged.default_model, WALKER), (legged.default_scene, SCENE)):
        (there / legged.entry(entry).file).write_text(content)
    (there / ".complete").write_text("{}")
    return folder


@pytest.mark.honoured("MJCF", "robots of MuJoCo Menagerie")
def test_a_robot_in_the_cache_is_loaded_as_it_is(cache: Path) -> None:
    """With its mesh, what it includes, its defaults and its keyframe."""
    name = f"menagerie:{ROBOT}"
    model = build_model(name, name="arm")
    assert [model.joint(j).name for j in range(model.njnt)] == ["arm/shoulder", "arm/elbow"]
    assert model.nmesh == 1
    np.testing.assert_allclose(model.actuator_biasprm[:, 2], -300.0)
    np.testing.assert_allclose(MechanismManifold(model).origin, [0.5, -1.0])
    before = mechanism_digest(name)
    (cache / "assets" / "link.obj").write_text(LINK.replace(".4", ".5"))
    assert mechanism_digest(name) != before


@pytest.mark.parametrize(("entry", "stands"), [("", True), ("/scene", True), ("/go2", False)])
def test_a_robot_with_a_free_base_has_the_floor_of_its_scene(cache: Path, entry: str, stands: bool) -> None:
    model = build_model(f"menagerie:{LEGGED}{entry}")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)
    assert (0.05 < data.qpos[2] < 0.15) == stands


def test_its_joints_are_tracked(cache: Path, tmp_path: Path) -> None:
    words = ["--mechanism", f"menagerie:{ROBOT}", "--duration", "0.5", "--settled", "0.3"]
    assert main(["run", "arm-velocity", *words, "--out", str(tmp_path / "run")]) == 0


@pytest.mark.parametrize(
    ("name", "reason"),
    [("nosuch", "Unknown robot"), (f"{ROBOT}/nosuch", "no entry point"), ("franka_emika_panda", "not found")],
)
def test_a_robot_that_is_not_there_is_one_clear_error(
    name: str, reason: str, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "arm-velocity", "--mechanism", f"menagerie:{name}", "--out", str(cache / "run")]) == 2
    error = capsys.readouterr().err.strip()
    assert f"'menagerie:{name}'; allowed: menagerie:NAME" in error
    assert reason in error
    assert "\n" not in error


def test_without_the_package_its_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mujoco_menagerie", None)
    with pytest.raises(ValueError, match=r"pip install 'mathnavi\[robots\]'"):
        build_model(f"menagerie:{ROBOT}")
