"""A damaged run ends the commands that draw it in one line that names it, and a full disk loses nothing."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.commands.cli import main
from tests.little_room import little_room

Forge = Callable[[dict[str, Any], dict[str, Any], dict[str, Any]], object]  # of arrays, log.json and config.json


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("good") / "run"
    main(["run", "textbook-observer", "--duration", "0.1", "--out", str(folder)])
    return folder


@pytest.fixture
def run(good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it in the working folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "run"
    folder.mkdir()
    for path in good.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    return folder


FORGED: dict[str, tuple[Forge, str]] = {
    "a command as large as none can be": (
        lambda a, index, config: a["command.u"].fill(1e308), "command.u is not finite, or beyond 1e+150",
    ),
    "an estimate after the end": (
        lambda a, index, config: a["estimate.t"].__iadd__(9.0), "estimate.t goes on after the last sample",
    ),
    "the commands of another run": (
        lambda a, index, config: index.update(inputs={key: ["a [N]", "b", "c"] for key in index["states"]}),
        "allowed: 3, as log.json next to it names",
    ),
    "the readings of another run": (
        lambda a, index, config: index.update(readings={key: {"output": ["a"] * 9} for key in index["states"]}),
        "measurement.output has",
    ),
    "states of which some are not described": (
        lambda a, index, config: config["mission"].update(states=["x"]), "are not of 1 states",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_run_is_named_in_one_line(name: str, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    forge, said = FORGED[name]
    with np.load(run / "log.npz") as log:
        arrays = dict(log)
    index, config = (json.loads((run / each).read_text()) for each in ("log.json", "config.json"))
    forge(arrays, index, config)
    np.savez(run / "log.npz", **arrays)
    (run / "log.json").write_text(json.dumps(index))
    (run / "config.json").write_text(json.dumps(config))
    capsys.readouterr()
    assert main(["report", "run", "--out", "new/page.html"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert "run" in line
    assert not Path("new").exists()


def test_a_report_says_nothing_of_a_tolerance_that_is_not_recorded(run: Path) -> None:
    config = json.loads((run / "config.json").read_text())
    del config["mission"]["tolerance"]
    (run / "config.json").write_text(json.dumps(config))
    assert main(["report", "run"]) == 0
    assert "RMS of the last quarter<" in (run / "report.html").read_text()


def test_what_a_library_says_of_the_numbers_of_a_run_comes_with_the_run(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def page(directory: Path) -> str:
        raise ValueError("Axis limits cannot be NaN or Inf")

    monkeypatch.setattr("mathnavi.renders.report.report_page", page)
    assert main(["report", "run"]) == 2
    assert capsys.readouterr().err == "mathnavi: run cannot be drawn: Axis limits cannot be NaN or Inf\n"


@pytest.mark.parametrize("words", ["report run --out page.html", "report run", "new vehicle mine", "new terrain mine"])
def test_a_full_disk_loses_nothing_and_is_named(words: str, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("page.html").write_text("of before")
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    with little_room():
        assert main(words.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(("mathnavi: page.html: ", "mathnavi: run/report.html: ", "mathnavi: mine/"))
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before
    assert not Path("mine").exists()


def test_what_is_made_takes_no_folder_that_came_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    from mathnavi.commands import new

    contents = new.contents

    def late(kind: str, name: str) -> dict[str, str]:
        Path("mine").mkdir()
        Path("mine/letter.txt").write_text("of another")
        return contents(kind, name)

    monkeypatch.setattr(new, "contents", late)
    assert main(["new", "terrain", "mine"]) == 2
    assert capsys.readouterr().err == "mathnavi: mine: Directory not empty\n"
    assert [path.name for path in tmp_path.rglob("*")] == ["mine", "letter.txt"]


def test_a_name_that_no_folder_can_have_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "terrain", "mine", "--out", "x" * 300]) == 2
    assert "--out = xxx" in capsys.readouterr().err
    assert main(["new", "terrain", "mine", "--out=-my folder"]) == 0
    assert "next    cd './-my folder'" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "busy"),
    [
        ("report run --out new/page.html", "mathnavi.renders.report.report_page"),
        ("render run --still --out new/page.png", "mathnavi.renders.video.write_still"),
        ("new terrain mine --out new/mine", "mathnavi.commands.new.contents"),
    ],
)
def test_ctrl_c_leaves_nothing_behind(
    words: str, busy: str, run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(busy, interrupted)
    before = sorted(Path().rglob("*"))
    assert main(words.split()) == 130
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert sorted(Path().rglob("*")) == before
