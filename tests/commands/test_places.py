"""Names that are read are checked before they are part of a path, and no link leads what is written elsewhere."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.commands.cli import main
from mathnavi.interfaces.checks import plain_name
from mathnavi.interfaces.errors import FieldError, TerrainError
from mathnavi.models.terrain.dem import read_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.drawing import Drawing
from mathnavi.sim.records.files import inside
from mathnavi.sim.records.run_folder import RUN_FILES

HOSTILE = [  # one of each kind
    "../../../../precious", "..", "/etc/passwd", "a\\b", "", " a", "-x", ".hidden", "a\0b", "\x1b[2J", "\u202egnp.exe",
    "\u2028", "\ud800", "x" * 101, "é" * 51,
]  # fmt: skip


def write_map(path: Path, **meta: object) -> Path:
    np.savez(path, z=np.zeros((3, 3), np.float32), meta=np.array(json.dumps({"spacing_m": 10.0, **meta})))
    return path


@pytest.mark.parametrize("name", [*HOSTILE, 3, ["a"], {"a": 1}, True])
def test_no_map_has_a_name_that_leads_elsewhere(name: object, tmp_path: Path) -> None:
    with pytest.raises(TerrainError, match=r"name = |half a character"):
        read_npz(write_map(tmp_path / "map.npz", name=name))


@pytest.mark.parametrize("label", ["source", "licence"])
@pytest.mark.parametrize("text", ["a\nb", "\x1b]0;title\a", "\u202e", "x" * 1001, 3, None, ["a"]])
def test_what_is_printed_of_a_map_is_one_line(label: str, text: object, tmp_path: Path) -> None:
    with pytest.raises(TerrainError, match=f"{label} = "):
        read_npz(write_map(tmp_path / "map.npz", **{label: text}))


def test_names_that_are_in_use_stay() -> None:
    for name in ("hills", "Jengish Čokusu", "N42E080", "map (1)", "a.b", "天山", "x" * 100):
        assert HeightField(np.zeros((2, 2)), 1.0, name).inflated(1.0, 1.0).name == name


@settings(max_examples=60)
@given(st.text(max_size=120))
def test_a_name_that_is_accepted_is_that_of_a_file_in_its_folder(name: str) -> None:
    try:
        accepted = plain_name(name, "name")
    except FieldError:
        return
    path = Path("/folder") / f"{accepted}.png"
    assert path.parent == Path("/folder")
    assert path.name == f"{accepted}.png"
    assert len(f".{path.name}.partial".encode()) <= 255


def untouched(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("command", ["terrain", "study"])
def test_a_map_overwrites_nothing_outside(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    here = tmp_path / "a" / "b" / "c"
    here.mkdir(parents=True)
    (tmp_path / "precious.png").write_bytes(b"a picture")
    monkeypatch.chdir(here)
    other = write_map(here / "other.npz", name="other")
    file = write_map(here / "map.npz", name="../../../../precious")
    before = untouched(tmp_path)
    study = ["study", "horizon", "--quick", "--out", "out", "--terrain", str(file), "--terrain", str(other)]
    assert main(["terrain", "show", str(file)] if command == "terrain" else study) == 2
    assert "name = '../../../../precious'" in capsys.readouterr().err
    assert untouched(tmp_path) == before


def test_a_link_beside_a_picture_is_replaced_and_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    precious, out = tmp_path / "precious", tmp_path / "out"
    precious.write_text("mine")
    out.mkdir()
    file = write_map(tmp_path / "map.npz", name="hills")
    (out / "hills.png").symlink_to(precious)
    assert main(["terrain", "show", str(file), "--out", "out/hills.png"]) == 0
    assert precious.read_text() == "mine"
    assert not (out / "hills.png").is_symlink()
    assert [path.name for path in out.iterdir()] == ["hills.png"]


def test_a_run_writes_through_no_link(tmp_path: Path) -> None:
    precious, out = tmp_path / "precious", tmp_path / "out"
    precious.write_text("mine")
    out.mkdir()
    for name in (*RUN_FILES, "report.html"):
        (out / name).symlink_to(precious)
    assert main(["run", "range-localisation", "--duration", "0.5", "--out", str(out)]) in (0, 1)
    assert precious.read_text() == "mine"
    assert not any(path.is_symlink() for path in out.iterdir())


def test_a_study_writes_through_no_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    elsewhere, out = tmp_path / "elsewhere", tmp_path / "out"
    elsewhere.mkdir()
    out.mkdir()
    (out / "trials.db").symlink_to(elsewhere / "theirs.db")
    assert main(["study", "consensus", "--quick", "--out", str(out)]) == 2
    assert "leads out of" in capsys.readouterr().err
    assert not list(elsewhere.iterdir())


def test_the_folder_itself_may_be_a_link(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk")
    out = tmp_path / "out"
    assert inside(out, out / "worst-1") == out / "worst-1"
    (out / "worst-2").symlink_to(tmp_path)
    with pytest.raises(PermissionError, match="leads out of"):
        inside(out, out / "worst-2")


@pytest.mark.parametrize("camera", ["../../precious", "", "a/b", "-x"])
def test_the_camera_of_a_drawing_is_the_name_of_a_file(camera: str) -> None:
    functions = [lambda *_: None] * 5
    with pytest.raises(FieldError, match="camera = "):
        Drawing((camera,), camera, *functions, "nowhere:report")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "words",
    [
        ["run", "textbook-observer", "--duration", "0.1", "--out", "loop"],
        ["render", "loop"],
        ["report", "loop"],
        ["sweep", "textbook-observer", "--trials", "1", "--store", "loop"],
        ["terrain", "show", "plain", "--out", "loop/map.png"],
    ],
)
def test_a_link_that_leads_back_to_itself_is_refused(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop").symlink_to("loop")
    assert main(words) == 2
    assert f"= {words[-1]}, a link that leads back to itself; allowed: another path" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["loop"]


def test_a_line_on_standard_error_has_no_control_characters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def failing(*args: object, **named: object) -> None:
        raise OSError("no\x1b[31m space")

    monkeypatch.setattr("mathnavi.commands.sweep.run_trials", failing)
    assert main(["sweep", "textbook-observer", "--trials", "1", "--store", "new\x1b[31m.db"]) == 1
    error = capsys.readouterr().err
    assert "no\\x1b[31m space" in error
    assert "new\\x1b[31m.db" in error
    assert "\x1b" not in error
