"""Every committed picture is named with the commands that make it, and every scenario has a still and a clip."""

from __future__ import annotations

import shlex
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.command_line import read_command_line
from mathnavi.commands.render import RenderOptions
from mathnavi.commands.run import RunOptions
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.renders import clip, optimum
from mathnavi.renders.gallery import __main__ as program
from mathnavi.renders.gallery.table import (
    HERE,
    MATHNAVI,
    OPTIMUM,
    README,
    Command,
    GalleryPicture,
    chosen,
    entries,
)
from mathnavi.sim.plugin.registry import names

ENTRIES = entries(README.read_text(encoding="utf-8"))
CLIPS = sorted(name for name in ENTRIES if name.endswith(".webp"))
MOST_OF_A_STILL, MOST_OF_CLIPS = 1_300_000, 9_000_000  # [bytes]


def test_what_is_committed_is_named_and_what_is_named_is_there() -> None:
    assert {path.name for path in HERE.iterdir() if path.suffix in (".png", ".webp", ".gif", ".jpg")} == set(ENTRIES)


def test_commands_run_in_the_folder_of_the_repository() -> None:
    assert (program.ROOT / "Makefile").is_file()


def test_every_scenario_has_a_still_and_a_clip() -> None:
    for scenario in names("scenarios"):
        for name in (f"{scenario.replace('-', '_')}.{ending}" for ending in ("png", "webp")):
            assert ENTRIES[name].commands[0][1:3] == ("run", scenario)


def test_pictures_are_small_enough_and_as_large_as_they_should_be() -> None:
    for name in ENTRIES:
        size = (HERE / name).stat().st_size
        assert size <= (clip.MOST_BYTES if name in CLIPS else MOST_OF_A_STILL), name
        with Image.open(HERE / name) as picture:
            if ENTRIES[name].commands[-1][1] == "render":
                assert picture.size == ((clip.WIDTH, clip.HEIGHT) if name in CLIPS else (1280, 720))
            else:
                assert min(picture.size) >= 480, name
    assert sum((HERE / name).stat().st_size for name in CLIPS) <= MOST_OF_CLIPS


@pytest.mark.parametrize("name", CLIPS)
def test_a_clip_shows_something_that_moves_again_and_again(name: str) -> None:
    with Image.open(HERE / name) as moving:
        assert 50 <= moving.n_frames <= 90
        assert moving.info["loop"] == 0
        shown = []
        for k in (0, moving.n_frames // 3):
            moving.seek(k)
            shown.append(np.asarray(moving.convert("RGB")).astype(int))
    assert min(picture.std() for picture in shown) > 10.0
    assert (np.abs(shown[1] - shown[0]).max(axis=-1) > 40).mean() > 0.004


@cache
def folder_of(command: Command) -> str:
    """Where a run is written to, as its command says; BadInputError where that is none."""
    line = read_command_line("run", command[2:], RunOptions)
    assert line.options.out is not None
    return str(line.options.out)


def test_every_command_can_be_given() -> None:
    for entry in ENTRIES.values():
        *before, last = entry.commands
        made = str(entry.made("renders/out/run/top.png"))
        assert Path(made).suffix == Path(entry.name).suffix or "render" in last
        if last[1] == "study":
            assert last[2] in names("studies")
            assert entry.name == f"{last[2].replace('-', '_')}.png"
            assert set(last[3::2]) <= {"--terrain"}
            continue
        if last[:3] == OPTIMUM:
            assert last[3] in PROBLEMS
            assert Path(last[4]).name == entry.name
            continue
        (run,) = before
        assert run[:2] == (MATHNAVI, "run")
        if last[0] != MATHNAVI:
            assert last[-1].startswith(f"{folder_of(run)}/")
            continue
        (options,) = parse(last[2:], "mathnavi render", "", FlagGroup(RenderOptions))
        assert str(options.folder) == folder_of(run)
        assert (options.clip, options.still) == ((True, False) if entry.name in CLIPS else (False, True))


def test_pictures_are_chosen_by_name_or_pattern() -> None:
    assert [entry.name for entry in chosen([], ENTRIES)] == list(ENTRIES)
    assert {entry.name for entry in chosen(["sphere.png", "safe_flight"], ENTRIES)} == {
        "sphere.png", "safe_flight.png", "safe_flight.webp",
    }  # fmt: skip
    assert sorted(entry.name for entry in chosen(["*.webp"], ENTRIES)) == CLIPS
    with pytest.raises(ValueError, match=r"NAME = 'mona_lisa' is no picture of the gallery; allowed: safe_flight"):
        chosen(["mona_lisa"], ENTRIES)


def test_what_makes_no_picture_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a.png: 'by hand' holds no command; allowed"):
        entries("| [a.png](a.png) | a thing | by hand |")
    with pytest.raises(ValueError, match=r"a.png: '.venv/bin/mathnavi list' makes no picture; allowed: render, study"):
        GalleryPicture("a.png", ((MATHNAVI, "list"),)).made("")


def test_a_picture_is_made_by_its_commands_or_the_reason_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    makes = ("sh", "-c", "echo new > made.png", "--screenshot=made.png")
    rows = {
        "a.png": [("sh", "-c", "echo once >> runs.txt"), makes],
        "b.png": [("sh", "-c", "echo once >> runs.txt"), makes],
        "c.png": [("sh", "-c", "exit 2"), makes],
        "d.png": [("no_such_program", "--screenshot=made.png")],
        "e.png": [(*makes[:-1], "no_such_map.npz", makes[-1])],
        "f.png": [("true", "--screenshot=nowhere.png")],
    }
    table = "\n".join(
        f"| [{name}]({name}) | a thing | {', then '.join(f'`{shlex.join(words)}`' for words in commands)} |"
        for name, commands in rows.items()
    )
    (tmp_path / "README.md").write_text(table, encoding="utf-8")
    monkeypatch.setattr(program, "ROOT", tmp_path)
    monkeypatch.setattr(program, "HERE", tmp_path)
    monkeypatch.setattr(program, "README", tmp_path / "README.md")
    assert program.main(["a", "b"]) == 0
    assert (tmp_path / "a.png").read_text() == (tmp_path / "b.png").read_text() == "new\n"
    assert (tmp_path / "runs.txt").read_text() == "once\n"
    assert program.main(["[c-f].png"]) == 1
    messages = capsys.readouterr().err.splitlines()
    for line, why in zip(messages, ("exit code 2", "no_such_program", "no_such_map.npz", "nowhere.png"), strict=True):
        assert why in line
    assert program.main(["g"]) == 2
    assert capsys.readouterr().err.startswith("gallery: NAME = 'g' is no picture")


def test_the_picture_of_an_optimum_is_drawn_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "new" / "energy.svg"
    assert optimum.main(["double integrator, energy", str(path)]) == 0
    assert capsys.readouterr().out == f"{path}\n"
    assert "costate of v" in path.read_text(encoding="utf-8")
    assert optimum.main(["double integrator", str(path)]) == 2
    assert "did you mean double integrator, " in capsys.readouterr().err
    assert optimum.main(["double integrator, energy", str(tmp_path / "energy.gif")]) == 2
    assert "allowed: .png, .svg, .pdf" in capsys.readouterr().err
