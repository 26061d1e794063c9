"""The digest of a mechanism is that of every file that MuJoCo reads for it."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image

from mathnavi.models.mechanism.entity import build_model, files_of, mechanism_digest, place_of

ARM = """<mujoco>
  <compiler meshdir="parts/meshes" texturedir='parts/pictures'/>
  <include file="parts/options.xml"/>
  <asset>
    <mesh name="bar" file="bar.obj"/>
    <hfield name="ground" file="ground.png" size="1 1 .1 .1"/>
    <texture name="cube" type="cube" fileup="up.png" filedown="up.png" fileleft="up.png" fileright="up.png"
      filefront="up.png" fileback="up.png"/>
    <model name="hand" file="hand/hand.xml"/>
  </asset>
  <worldbody>
    <geom type="hfield" hfield="ground" pos="0 0 -5" contype="0" conaffinity="0"/>
    <body>
      <joint name="shoulder" axis="0 1 0"/>
      <geom type="mesh" mesh="bar" mass="1" contype="0" conaffinity="0"/>
      <attach model="hand" body="palm" prefix="hand-"/>
    </body>
  </worldbody>
  <actuator><motor joint="shoulder"/></actuator>
</mujoco>"""
HAND = """<mujoco>
  <asset><mesh name="palm" file="palm.obj"/></asset>
  <worldbody><body name="palm"><geom type="mesh" mesh="palm" contype="0" conaffinity="0"/></body></worldbody>
</mujoco>"""
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
OTHERS = {
    "parts/options.xml", "parts/inner.xml", "parts/meshes/ground.png", "parts/meshes/bar.obj", "parts/pictures/up.png",
    "hand/hand.xml", "hand/palm.obj",
}  # fmt: skip


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """An arm that consists of files of every kind."""
    folder = tmp_path / "arm"
    for name in ("parts/meshes", "parts/pictures", "hand"):
        (folder / name).mkdir(parents=True)
    (folder / "arm.xml").write_text(ARM)
    (folder / "parts/options.xml").write_text("<mujoco><include file='parts/inner.xml'/></mujoco>")
    (folder / "parts/inner.xml").write_text('<mujoco><option gravity="0 0 -9.81"/></mujoco>')
    (folder / "parts/meshes/bar.obj").write_text(TETRAHEDRON)
    (folder / "hand/hand.xml").write_text(HAND)
    (folder / "hand/palm.obj").write_text(TETRAHEDRON)
    (folder / "unused.obj").write_text(TETRAHEDRON)
    grey = np.arange(64, dtype=np.uint8).reshape(8, 8)
    Image.fromarray(grey).save(folder / "parts/meshes/ground.png")
    Image.fromarray(np.stack([grey] * 3, axis=2)).save(folder / "parts/pictures/up.png")
    return folder / "arm.xml"


@pytest.mark.honoured("MJCF", "include")
@pytest.mark.honoured("MJCF", "compiler meshdir, texturedir, assetdir, strippath")
@pytest.mark.honoured("MJCF", "asset mesh, texture, hfield in files")
@pytest.mark.honoured("MJCF", "model, attach")
def test_it_can_be_built_from_these_files_alone(arm: Path, tmp_path: Path) -> None:
    """So none is forgotten."""
    contents = files_of(arm)
    assert contents.keys() == {"", *OTHERS}
    for name, content in contents.items():
        place = tmp_path / "copy" / (name or "arm.xml")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    copied = build_model(tmp_path / "copy" / "arm.xml")
    assert copied.nmesh == 2
    assert copied.body_mass.tolist() == build_model(arm).body_mass.tolist()


def test_each_of_them_counts(arm: Path, tmp_path: Path) -> None:
    digests = [mechanism_digest(str(arm))]
    for name in ("arm.xml", *sorted(OTHERS)):
        with (arm.parent / name).open("ab") as file:
            file.write(b"\n")
        digests.append(mechanism_digest(str(arm)))
    assert len(set(digests)) == len(OTHERS) + 2
    (arm.parent / "unused.obj").unlink()
    moved = shutil.move(arm.parent, tmp_path / "moved")
    assert mechanism_digest(str(Path(moved) / "arm.xml")) == digests[-1]


def test_files_that_include_each_other_come_to_an_end(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    for name, other in (("a.xml", "sub/b.xml"), ("sub/b.xml", "../a.xml")):
        (tmp_path / name).write_text(f"<mujoco><include file='{other}'/><include file='../sub/b.xml'/></mujoco>")
    assert files_of(tmp_path / "a.xml").keys() == {"", "sub/b.xml"}


def test_mujoco_names_files_in_attributes_of_these_names_only() -> None:
    named = set(re.findall(r"\w*(?:file|dir|path)\w*", mujoco.mj_printSchema(False, False)))
    faces = {f"file{face}" for face in ("back", "down", "front", "left", "right", "up")}
    folders = {"assetdir", "meshdir", "texturedir"}
    assert named == {"file", "strippath", "dir", "directional"} | faces | folders


def test_a_mechanism_by_name_stays_and_a_path_becomes_absolute(arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(arm.parent)
    assert place_of("two-link") == "two-link"
    assert place_of("arm.xml") == str(arm.resolve())
    assert mechanism_digest("dm_control:acrobot") != mechanism_digest("dm_control:cartpole")
