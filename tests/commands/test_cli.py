"""The commands with valid arguments."""

from __future__ import annotations

import json
import math
import os
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from mathnavi.commands.cli import main
from mathnavi.commands.summary import summary_table
from mathnavi.commands.terrain import steepest
from mathnavi.commands.unforeseen import DEVELOPERS
from mathnavi.models import opengl
from mathnavi.models.terrain.library import load_terrain, terrain_names
from mathnavi.sim.plugin.registry import names
from mathnavi.sim.scenarios.closed_loop import RunData

Words = tuple[str, ...]


def arrays(folder: Path) -> dict[str, np.ndarray]:
    with np.load(folder / "log.npz", allow_pickle=False) as log:
        return dict(log)


def same_log(one: Path, other: Path) -> bool:
    a, b = arrays(one), arrays(other)
    return a.keys() == b.keys() and all(a[name].tobytes() == b[name].tobytes() for name in a)


def config(folder: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads((folder / "config.json").read_text())
    return loaded


@pytest.fixture(scope="module")
def flown(mission: Words, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with everything that draws from the seed."""
    folder = tmp_path_factory.mktemp("runs") / "first"
    extra = "--seed 5 --planner.nodes 11 --noise.position 0.1 --faults.solver-failure-rate 0.3 --radar 5000 6000 900 2"
    assert main(["run", *mission, *extra.split(), "--out", str(folder), "--report"]) == 0
    return folder


def test_a_run_writes_its_whole_folder(flown: Path) -> None:
    assert {path.name for path in flown.iterdir()} == {
        "config.json",
        "summary.json",
        "events.jsonl",
        "log.npz",
        "log.json",
        "timing.json",
        "report.html",
    }
    summary = json.loads((flown / "summary.json").read_text())
    assert summary["arrived"]
    assert summary["seed"] == 5
    assert summary["version"] == config(flown)["versions"]["mathnavi"]
    assert config(flown)["versions"].keys() >= {"mathnavi", "mujoco", "numpy", "casadi", "python"}
    for line in (flown / "events.jsonl").read_text().splitlines():
        assert json.loads(line).keys() == {"t", "agent", "kind", "message"}


def test_fields_reach_the_configuration(flown: Path) -> None:
    saved = config(flown)
    assert saved["controller"]["fields"]["nodes"] == 11
    assert saved["fields"]["faults"]["solver_failure_rate"] == 0.3
    assert saved["fields"]["radar"] == [[5000.0, 6000.0, 900.0, 2.0]]


def test_from_flies_the_same_run_bit_for_bit_from_any_folder(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "--from", str(flown), "--out", "again"]) == 0
    assert same_log(flown, tmp_path / "again")
    assert config(flown) == config(tmp_path / "again")


def test_the_same_flags_give_the_same_log_bit_for_bit(mission: Words, tmp_path: Path) -> None:
    for name in ("one", "two"):
        assert main(["run", *mission, "--seed", "3", "--faults.gust-rms", "0.2", "--out", str(tmp_path / name)]) == 0
    assert same_log(tmp_path / "one", tmp_path / "two")


class FlightAskedForError(Exception):
    """Instead of a flight."""


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Any]]:
    """The closed loop that a command would fly, without flying it."""
    import mathnavi.commands.run

    def without_flight(closed_loop: Any, *others: Any, **named: Any) -> RunData:
        raise FlightAskedForError(closed_loop.config)

    monkeypatch.setattr(mathnavi.commands.run, "fly", without_flight)
    monkeypatch.setenv(DEVELOPERS, "1")  # the exception is to pass

    def ask(*argv: str) -> dict[str, Any]:
        with pytest.raises(FlightAskedForError) as info:
            main(["run", *argv])
        answer: dict[str, Any] = json.loads(json.dumps(info.value.args[0]))
        return answer

    return ask


def test_flags_beside_from_take_precedence(asked: Callable[..., Any], flown: Path, tmp_path: Path) -> None:
    changed = asked("safe-flight", "--from", str(flown), "--seed", "6", "--planner.beta", "90", "--out", str(tmp_path))
    before = config(flown)
    assert changed["seed"] == 6
    assert changed["controller"]["fields"] == {**before["controller"]["fields"], "beta": 90.0}
    assert changed["fields"] == before["fields"]


def test_lists_beside_from_replace_the_saved_ones(asked: Callable[..., Any], flown: Path, tmp_path: Path) -> None:
    changed = asked("--from", str(flown), *["--radar", "2000", "9000", "500", "1", "--out"], str(tmp_path))
    assert changed["fields"]["radar"] == [[2000.0, 9000.0, 500.0, 1.0]]


def test_another_estimator_beside_from_has_its_own_fields(
    asked: Callable[..., Any], flown: Path, tmp_path: Path
) -> None:
    other = ("--estimator", "kalman", "--estimator.timeout", "2.5", "--noise.position", "0")
    changed = asked("--from", str(flown), *other, "--out", str(tmp_path))
    assert changed["estimator"]["name"] == "mathnavi.estimators.kalman:Kalman"
    assert changed["estimator"]["fields"]["timeout"] == 2.5


def test_the_radar_list_appends(asked: Callable[..., Any], mission: Words, tmp_path: Path) -> None:
    radars = ["--radar", "5000", "6000", "900", "2", "--radar", "5000", "9000", "800", "1.5"]
    assert asked(*mission, *radars, "--out", str(tmp_path))["fields"]["radar"] == [
        [5000.0, 6000.0, 900.0, 2.0],
        [5000.0, 9000.0, 800.0, 1.5],
    ]


def test_a_plugin_is_found_by_its_place_too(asked: Callable[..., Any], mission: Words, tmp_path: Path) -> None:
    place = "mathnavi.estimators.full_state:FullState"
    answer = asked(*mission, "--estimator", place, "--estimator.timeout", "0.25", "--out", str(tmp_path))
    assert answer["estimator"] == {**answer["estimator"], "name": place}
    assert answer["estimator"]["fields"]["timeout"] == 0.25


def test_a_flight_that_is_cut_short_leaves_no_folder(
    mission: Words, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import mathnavi.commands.run

    def interrupted(closed_loop: Any, *others: Any, **named: Any) -> RunData:
        raise KeyboardInterrupt

    monkeypatch.setattr(mathnavi.commands.run, "fly", interrupted)
    words = ["run", *mission, "--out", str(tmp_path / "deep/a run")]
    assert main(words) == 130
    assert not list(tmp_path.iterdir())
    again = shlex.join(["mathnavi", *words])
    assert capsys.readouterr().err == f"mathnavi: interrupted, nothing was written; to begin again: {again}\n"


def test_a_mission_that_fails_exits_with_1_and_is_written(mission: Words, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert main(["run", *mission, "--faults.position-jump", "500", "--out", str(folder)]) == 1
    assert not json.loads((folder / "summary.json").read_text())["arrived"]
    assert len(arrays(folder)["t"]) > 1


def test_a_new_run_takes_the_old_pictures_with_it(mission: Words, tmp_path: Path) -> None:
    drawn = {"video.mp4", "video.gif", "report.html", "top.png", "top.webp", "top.webm"}
    for name in (*drawn, "notes.txt", "config.json"):
        (tmp_path / name).write_text("of an earlier run")
    assert main(["run", *mission, "--out", str(tmp_path)]) == 0
    assert not drawn & {path.name for path in tmp_path.iterdir()}
    assert (tmp_path / "notes.txt").read_text() == "of an earlier run"


CANNOT_DRAW = {
    "nothing installed": ({"MUJOCO_GL": ""}, r"found no OpenGL .*missing; .*apt-get install libegl1 .*libosmesa6"),
    "no driver": ({"MUJOCO_GL": "egl", "__EGL_VENDOR_LIBRARY_DIRS": os.devnull}, r"MUJOCO_GL = egl: .*; allowed: .*"),
    "switched off": ({"MUJOCO_GL": "off"}, r"MUJOCO_GL = off switches drawing off; allowed: MUJOCO_GL unset, to draw"),
    "no display": (
        {"MUJOCO_GL": "glfw", "DISPLAY": "", "WAYLAND_DISPLAY": ""},
        r"MUJOCO_GL = glfw: there is no display",
    ),
}


@pytest.mark.parametrize(("variables", "said"), CANNOT_DRAW.values(), ids=CANNOT_DRAW)
def test_where_nothing_can_be_drawn_a_run_succeeds_and_says_why_in_one_line(
    variables: dict[str, str],
    said: str,
    flown: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    if not variables["MUJOCO_GL"]:
        monkeypatch.setattr(opengl, "_fault", lambda name: f"{name} is missing")
    assert main(["run", "--from", str(flown), "--out", str(tmp_path), "--video"]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(f"no video: {said}", line)
    assert not (tmp_path / "video.mp4").exists()
    assert main(["render", str(tmp_path)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(f"nothing drawn: {said}", line)


@pytest.mark.skipif(os.environ.get("MUJOCO_GL") == "disable", reason="there is nothing to draw with")
def test_render_draws_a_still(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", str(flown), "--camera", "top", "--still"]) == 0
    path = Path(capsys.readouterr().out.strip())
    assert path == flown / "top.png"
    with Image.open(path) as image:
        assert image.size == (1280, 720)
        assert len(image.getcolors(1 << 20) or ()) > 1000
    path.unlink()


def test_a_report_is_written_at_any_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The page of a run without one is that of `run --report`, wherever it is written to."""
    monkeypatch.chdir(tmp_path)
    assert main(["run", "textbook-observer", "--duration", "1", "--out", "run", "--report"]) in (0, 1)
    at_once = Path("run/report.html").read_bytes()
    Path("run/report.html").unlink()
    capsys.readouterr()
    for words, path in (([], "run/report.html"), (["--out", "pages/page.htm"], "pages/page.htm")):
        assert main(["report", "run", *words]) == 0
        assert capsys.readouterr().out == f"{path}\n"
        assert Path(path).read_bytes() == at_once


def test_a_camera_that_a_run_is_not_drawn_by_is_refused(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for still in ([], ["--still"]):
        assert main(["render", str(flown), "--camera", "front", *still]) == 2
        assert capsys.readouterr().err == "mathnavi: --camera = 'front'; allowed: chase, overview, top\n"


def test_list_shows_what_is_installed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["list"]) == 0
    shown = capsys.readouterr().out
    for kind in ("controllers", "estimators", "scenarios", "terrains"):
        for name in names(kind):
            assert name in shown
    assert {"flight", "kalman", "safe-flight", "tian_shan"} <= set(shown.split())
    assert "cannot be imported" not in shown
    assert main(["list", "estimators", "--verbose"]) == 0
    shown = capsys.readouterr().out
    assert "noise-floor" in shown
    assert "tian_shan" not in shown


@pytest.mark.parametrize(
    "command", ["", "list", "run", "run safe-flight", "render", "report", "terrain", "terrain import"]
)
def test_help_explains_every_command(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command.split(), "--help"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("usage: mathnavi")
    assert not err


def test_without_a_command_the_usage_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    out, err = capsys.readouterr()
    assert not out
    assert "terrain" in err


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"mathnavi {version('mathnavi')}\n"


def test_what_there_is_no_number_for_is_a_dash(capsys: pytest.CaptureFixture[str]) -> None:
    Console(width=100).print(summary_table({"solve_ms_mean": math.nan, "arrival_time_s": None}, []))
    shown = capsys.readouterr().out
    assert shown.split().count("-") == 2
    assert "nan" not in shown


def test_a_run_that_replaces_another_says_so(
    mission: Words, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", *mission]) == 0
    assert not capsys.readouterr().err
    folder = Path("renders/out/safe-flight-seed0")
    (folder / "video.mp4").write_bytes(b"of the first run")
    assert main(["run", *mission]) == 0
    assert capsys.readouterr().err == f"replaced the run in {folder}, and removed its video.mp4\n"
    for named in ((), ("--out", str(folder))):
        assert main(["run", *mission, *named]) == 0
        assert capsys.readouterr().err == f"replaced the run in {folder}\n"


def test_help_of_run_has_the_fields_of_the_plugins_that_are_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "safe-flight", "--estimator", "kalman", "--help"]) == 0
    shown = capsys.readouterr().out
    assert "--estimator.noise-floor" in shown
    assert "--planner.nodes" in shown
    assert "number N of nodes of the horizon" in shown
    assert "Fields of estimator kalman." in shown
    assert "None}" not in shown


def test_a_planner_that_never_answers_has_an_exit_status_of_its_own(
    mission: Words, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    assert main(["run", *mission, "--faults.solver-failure-rate", "1", "--out", str(folder)]) == 3
    shown = capsys.readouterr().out
    assert "succeeded; BUT THE PLANNER answered the first request only" in " ".join(shown.split())
    assert json.loads((folder / "summary.json").read_text())["planner_status"] == "answered the first request only"


def test_terrain_import_crops_and_resamples(hills: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "part.npz"
    words = f"terrain import {hills} --out {out} --resample 200 --crop 2000 1000 5800 4800"
    assert main(words.split()) == 0
    part, whole = load_terrain(out), load_terrain(hills)
    assert part.z.shape == (20, 20)
    assert part.spacing == 200.0
    np.testing.assert_allclose(part.z, whole.z[10:50:2, 20:60:2], atol=1e-3)
    assert "20 x 20" in capsys.readouterr().out


def test_terrain_show_prints_and_draws(hills: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "hills.png"
    assert main(["terrain", "show", str(hills), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "121 x 121, 100 m apart" in printed
    assert printed.splitlines()[-1] == f"fly       mathnavi run safe-flight --terrain {hills}"
    with Image.open(out) as image:
        assert image.size[0] > 800


@pytest.mark.parametrize("name", terrain_names())
def test_the_steepest_triangle_is_at_least_as_steep_as_any_point(name: str) -> None:
    terrain = load_terrain(name)
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.0, terrain.width, 20000), rng.uniform(0.0, terrain.depth, 20000)
    slope = np.degrees(np.arctan(np.linalg.norm(terrain.gradient(x, y), axis=-1))).max()
    assert 0.7 * steepest(terrain) <= slope <= steepest(terrain) + 1e-9


def test_a_truth_value_can_be_given_either_way(mission: tuple[str, ...], tmp_path: Path) -> None:
    radar = ("--radar", "5000", "3000", "800", "10")
    for flag, known in (("--radar-known", True), ("--no-radar-known", False)):
        out = tmp_path / flag
        assert main(["run", *mission, *radar, flag, "--out", str(out)]) == 0
        assert json.loads((out / "config.json").read_text(encoding="utf-8"))["fields"]["radar_known"] is known


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    with subprocess.Popen(
        [
            sys.executable,
            "-c",
            "from mathnavi.commands.cli import main; raise SystemExit(main())",
            "run",
            "range-localisation",
            "--help",
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as command:
        assert command.stdout is not None
        assert command.stderr is not None
        command.stdout.close()
        assert command.stderr.read() == b""
    assert command.returncode == 141


def test_a_reader_that_leaves_a_table_unread_is_no_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w", encoding="utf-8") as nobody:
        monkeypatch.setattr(sys, "stdout", nobody)
        assert main(["list", "terrains"]) == 141
    assert not capsys.readouterr().err


def test_help_names_no_default_that_is_none(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (("terrain", "import"), ("run", "safe-flight"), ("view",)):
        assert main([*words, "--help"]) == 0
        shown = " ".join(capsys.readouterr().out.split())
        assert "default: None" not in shown
        assert "default: False" in shown


def test_the_package_run_as_a_module_is_the_command_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def printed(*words: str) -> str:
        monkeypatch.setattr(sys, "argv", ["mathnavi", *words])
        monkeypatch.setattr(sys, "path", list(sys.path))  # which it changes
        with pytest.raises(SystemExit, match=r"^0$"):
            runpy.run_module("mathnavi", run_name="__main__", alter_sys=True)
        return capsys.readouterr().out

    assert printed("--help").startswith("usage: mathnavi COMMAND ...")
    command = [sys.executable, "-m", "mathnavi", "run", "safe-flight", "--help"]
    apart = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert apart.startswith("usage: mathnavi run safe-flight ")
    assert printed("completion", "words", "run", "safe-flight", "--planner.gr").split() == [
        "--planner.grid-nodes", "--planner.grid-layers",
    ]  # fmt: skip
