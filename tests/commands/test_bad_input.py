"""Bad input: exit code 2, one line on standard error, nothing written, nothing lost."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mathnavi.commands.cli import main
from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.estimators.full_state import FullStateConfig
from mathnavi.models.aerial.dynamics import HULL_RADIUS
from mathnavi.models.aerial.mission import EstimateQuality
from mathnavi.models.terrain.library import load_terrain
from mathnavi.models.terrain.raster_file import TILES
from mathnavi.sim.plugin.registry import (
    PluginSpec,
    checked_controller,
    checked_estimator,
    checked_quality,
    checked_sensors,
    load,
)
from tests.flight import mission as flight_mission

Words = tuple[str, ...]
Refusal = Callable[..., str]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Refusal:
    """The one line with which a command is refused, when nothing in the working directory was touched."""
    monkeypatch.chdir(tmp_path)
    former = tmp_path / "former"
    former.mkdir()
    for name in ("config.json", "summary.json", "events.jsonl", "log.npz", "log.json", "video.mp4"):
        (former / name).write_text(f"{name} of an earlier run")
    (tmp_path / "map.npz").write_text("an earlier map")

    def refuse(*argv: str) -> str:
        before, folders = contents(tmp_path), sorted(tmp_path.rglob("*"))
        capsys.readouterr()
        assert main(argv) == 2
        out, err = capsys.readouterr()
        assert contents(tmp_path) == before
        assert sorted(tmp_path.rglob("*")) == folders
        assert not out
        assert err.endswith("\n")
        assert len(err.splitlines()) == 1, err
        assert err.startswith("mathnavi: ")
        assert "Traceback" not in err
        return err

    return refuse


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ("--start 3000 3000 400", ["--start", "400.0", "under ground", "z >="]),
        ("--start 3000 3000 500", ["--start", "500.0", "below the least clearance", "z >="]),
        ("--start -1 3000 800", ["--start", "-1.0", "off the map", "0 to 12000"]),
        ("--target 3000 3000 800", ["--target", "3000.0", "50 m"]),
        ("--planner.nodes 1", ["--planner.nodes", "1", "2 to"]),
        ("--planner.nodes 2.5", ["--planner.nodes", "2.5", "INT"]),
        ("--planner.horizon 0", ["--planner.horizon", "0.0", "> 0"]),
        ("--planner.incorporation soft", ["--planner.incorporation", "soft", "schedule", "constraint", "penalty"]),
        ("--radar 5000 6000 0 2", ["--radar", "radius", "0.0", "> 0"]),
        ("--radar 5000 6000 900", ["--radar", "5000 6000 900", "4 values"]),
        ("--faults.dropout_rate 7", ["--faults.dropout-rate", "7.0", ">= 0 and <= 1"]),
        ("--estimator.rate 7", ["7.0 Hz", "whole number of physics ticks"]),
        ("--beacons.places 1 2", ["--beacons.places", "1 2", "3 values: place X Y Z"]),
        ("--beacons.places 1 2 3", ["--beacons.places", "full_state", "allowed", "kalman"]),
        ("--beacons.range-noise -1", ["--beacons.range-noise", "-1.0", ">= 0"]),
        ("--beacons.read bearing", ["--beacons.read = bearing", "allowed: ranges,bearings,range-differences\n"]),
        ("--faults.beacons 0", ["--faults.beacons", "0 beacons", "allowed: none"]),
        ("--seed -1", ["--seed", "-1", "from 0 to 9223372036854775807"]),
        ("--terrain atlantis", ["terrain", "atlantis", "jacksboro", "tian_shan", ".npz"]),
        ("--terrain atlantis.npz", ["--terrain", "atlantis.npz", "no such file"]),
        ("--controller autopilot", ["--controller", "autopilot", "flight", "as_printed", "package.module:Class"]),
        ("--controller nowhere:Planner", ["--controller", "nowhere:Planner", "cannot be imported"]),
        ("--controller mathnavi.controllers.flight.planner:RecedingHorizon", ["--controller", "no frozen dataclass"]),
        (
            "--estimator mathnavi.controllers.flight.plugin:FlightController",
            ["--estimator", "has no sensors; allowed: build, sensors"],
        ),
        ("--planner.nods 3", ["--planner.nods", "did you mean --planner.nodes"]),
        ("--nodes 3", ["--nodes", "did you mean --planner.nodes"]),
        ("--estimator.noise-floor 3", ["--estimator.noise-floor", "--estimator.rate"]),
        ("--seed 3 --seed 4", ["--seed", "2 times", "once"]),
        ("--noise.position-rate 11 --noise.position_rate 12", ["--noise.position-rate", "2 times", "once"]),
        ("--seed", ["--seed: its value is missing", "1 value"]),
        ("--controller=", ["--controller", "''", "flight", "as_printed"]),
        ("--start 1 2", ["--start", "1 2", "3 values: start x, y, z [m]"]),
    ],
)
def test_run_refuses_what_no_mission_can_be(refused: Refusal, mission: Words, flags: str, expected: list[str]) -> None:
    replaced = [word for word in flags.split() if word.startswith("--")]
    words = list(mission)
    for flag in ("--start", "--target", "--terrain"):
        if flag in replaced:
            k = words.index(flag)
            del words[k : k + (2 if flag == "--terrain" else 4)]
    line = refused("run", *words, *flags.split(), "--out", "former" if "nodes" in flags else "new/run")
    for word in expected:
        assert word in line


@pytest.mark.parametrize(
    ("flag", "value"),
    [
        *((flag, "nan") for flag in ("--speed-max", "--noise.position", "--planner.beta", "--estimator.timeout")),
        *(("--clearance-min", value) for value in ("inf", "-inf")),
    ],
)
def test_numbers_must_be_finite(refused: Refusal, mission: Words, flag: str, value: str) -> None:
    assert f"{flag} = {value}; allowed:" in refused("run", *mission, flag, value, "--out", "former")


@pytest.mark.parametrize("value", ["0", "nan", "5"])
def test_a_stretch_leaves_no_arc_a_thousand_times_as_long_as_another(
    refused: Refusal, mission: Words, value: str
) -> None:
    line = refused("run", *mission, "--planner.nodes", "13", "--planner.stretch", value)
    assert "--planner.stretch = " in line
    assert "allowed at nodes = 13" in line


@pytest.mark.parametrize(("period", "named"), [("0.03", "a whole number of control periods"), ("21", "the horizon")])
def test_a_replan_period_fits_the_loop_and_the_horizon(
    refused: Refusal, mission: Words, period: str, named: str
) -> None:
    line = refused("run", *mission, "--planner.nodes", "13", "--planner.period", period)
    assert "period = " in line
    assert named in line


@pytest.mark.parametrize("flags", ["--start 3000 nan 800", "--target inf 3000 800", "--radar 5000 6000 nan 1"])
def test_points_must_be_finite(refused: Refusal, hills: Path, flags: str) -> None:
    line = refused("run", "safe-flight", "--terrain", str(hills), *flags.split())
    assert flags.split()[0] in line
    assert "finite" in line


def test_a_start_without_a_certificate_is_refused(refused: Refusal, hills: Path) -> None:
    """Just above h_min, but nearer than the tracker's bound."""
    z = float(load_terrain(hills).inflated(HULL_RADIUS, 0.0).height(3000.0, 3000.0)) + 50.0 + 1e-4
    words = f"run safe-flight --terrain {hills} --start 3000 3000 {z} --target 7000 3000 800"
    line = refused(*words.split())
    for word in ("--start", str(z), "no initial certificate", "allowed"):
        assert word in line


@pytest.mark.parametrize(
    ("argv", "expected"),
    [
        (
            "fly",
            [
                "COMMAND",
                "fly",
                "list, run, sweep, search, store, study, estimate, render, report, view, export, compare",
            ],
        ),
        ("run", ["SCENARIO", "safe-flight"]),
        ("run hover", ["SCENARIO", "hover", "safe-flight"]),
        ("list planets", ["planets", "controllers", "terrains"]),
        ("render", ["DIR", "missing"]),
        ("render former", ["former", "config.json", "not JSON"]),
        ("render former --stil", ["--stil", "--still"]),
        ("report", ["DIR", "missing"]),
        ("report former", ["former", "config.json", "not JSON"]),
        ("report nowhere", ["nowhere", "does not exist"]),
        ("report former --out page.pdf", ["--out = page.pdf", ".html"]),
        ("terrain", ["import, show"]),
        ("terrain show atlantis", ["atlantis", "tian_shan"]),
        ("terrain show map.npz", ["map.npz", "not a readable .npz"]),
        ("terrain show tian_shan --out tian_shan.txt", ["--out", "tian_shan.txt", ".png"]),
        ("terrain import map.npz", ["--out", "missing"]),
        ("terrain import map.npz --out new.npz", ["map.npz", "not a readable .npz"]),
        ("run --from former", ["former/config.json", "not JSON"]),
    ],
)
def test_commands_refuse_what_is_not_there(refused: Refusal, argv: str, expected: list[str]) -> None:
    line = refused(*argv.split())
    for word in expected:
        assert word in line


def test_a_backend_that_does_not_exist_is_refused(
    refused: Refusal, mission: Words, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "quantum")
    line = refused("run", *mission)
    for word in ("MUJOCO_GL", "quantum", "osmesa"):
        assert word in line


PLUGIN = """
from dataclasses import dataclass
from types import SimpleNamespace as Made

@dataclass(frozen=True)
class Settings:
    gain: float = 1.0

class Mine:
    Config = Settings

    @staticmethod
    def build(config, mission):
        {body}
"""
PLANNER, TRACKER = "Made(period=1.0, plan=print)", "Made(period=1.0, command=print, bound={})"


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("return mission.colour", ["build() failed", "AttributeError", "colour", ".py:14)"]),
        ("return None", ["None", "a pair (planner, tracker)"]),
        (f"return {PLANNER}", ["a SimpleNamespace", "a pair (planner, tracker)"]),
        (f"return None, {TRACKER}", ["the planner None without period [s] and plan()"]),
        (f"return Made(plan=print), {TRACKER}", ["the planner a SimpleNamespace without period [s];"]),
        (f"return {PLANNER}, Made(period=1.0, bound=1)", ["the tracker a SimpleNamespace without command();"]),
        (f"return {PLANNER}, Made(period=1.0, command=print)", ["the tracker", "no bound", "TrackingBound"]),
        (f"return {PLANNER}, {TRACKER.format(None)}", ["the tracker", "None", "TrackingBound"]),
    ],
)
def test_a_controller_that_builds_the_wrong_thing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, expected: list[str]
) -> None:
    name = tmp_path.name  # another one for every test
    (tmp_path / f"{name}.py").write_text(PLUGIN.format(body=body))
    monkeypatch.syspath_prepend(tmp_path)
    part = PluginSpec.with_fields(load("controllers", f"{name}:Mine"))
    with pytest.raises(ValueError, match=f"controllers: '{name}:Mine': build") as info:
        checked_controller(part, flight_mission(), TrackingBound)
    for word in expected:
        assert word in str(info.value)


@pytest.mark.parametrize(
    ("scenario", "flag", "name", "fitting"),
    [
        ("safe-flight", "--controller", "missile", "as_printed, barrier, faster, flight, gatekeeper"),
        ("missile-guidance", "--controller", "flight", "missile"),
        ("missile-guidance", "--estimator", "kalman", "full_state, missile_kalman, moving_horizon"),
        ("safe-flight", "--estimator", "missile_kalman", "full_state, kalman, moving_horizon"),
    ],
)
def test_a_plug_in_of_another_kind_of_mission_is_named_with_those_that_fit(
    scenario: str, flag: str, name: str, fitting: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", scenario, flag, name]) == 2
    assert f"allowed: {fitting}, or" in capsys.readouterr().err


def test_a_run_is_not_written_among_other_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    assert main(["run", "safe-flight", "--out", str(tmp_path)]) == 2
    assert "holds other files than a run's" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_an_estimator_that_builds_the_wrong_thing_is_named() -> None:
    class Wrong:
        Config = FullStateConfig
        build = sensors = quality = staticmethod(lambda config, mission: None)

    part = PluginSpec.with_fields(Wrong)
    for check, expected in (
        (checked_estimator, "the estimator None without period [s] and update()"),
        (checked_sensors, "None; allowed: a tuple of sensors"),
        (partial(checked_quality, quality=EstimateQuality), "None; allowed: EstimateQuality"),
    ):
        with pytest.raises(ValueError, match=re.escape(expected)):
            check(part, flight_mission())


@pytest.mark.parametrize("folder", ["map.npz", "map.npz/run", "/proc/run"])
def test_an_output_folder_that_cannot_be_made_is_noticed_before_the_flight(
    refused: Refusal, mission: Words, folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    import mathnavi.commands.run

    monkeypatch.setattr(mathnavi.commands.run, "fly", None)
    line = refused("run", *mission, "--out", folder)
    for word in ("--out", folder, "allowed"):
        assert word in line


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_the_line_is_the_same_on_every_terminal(encoding: str) -> None:
    command = [sys.executable, "-c", "import sys; from mathnavi.commands.cli import main; sys.exit(main())"]
    refusal = subprocess.run(
        [*command, "render", "somewhere", "--time", "soon"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": encoding},
    )
    assert refusal.returncode == 2
    assert refusal.stderr == "mathnavi: --time = soon; allowed: FLOAT\n"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_an_output_folder_without_permission_is_refused(refused: Refusal, mission: Words, tmp_path: Path) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    assert "locked" in refused("run", *mission, "--out", "locked")


def png(path: Path, z: Any) -> None:
    Image.fromarray(z).save(path)


def void_tile(path: Path) -> None:
    z = np.full(TILES[0], 500, dtype=">i2")
    z[7, 9] = -32768
    path.write_bytes(z.tobytes())


def map_with(z: Any, meta: Any = None) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        np.savez(path, z=np.array(z), meta=json.dumps({"spacing_m": 100.0} if meta is None else meta))

    return write


def truncated(path: Path) -> None:
    map_with(np.zeros((50, 50)))(path)
    path.write_bytes(path.read_bytes()[:-400])


FLAT = np.zeros((40, 40))
HOLE = np.where(np.arange(1600).reshape(40, 40) == 777, np.nan, 0.0)


@pytest.mark.parametrize(
    ("name", "write", "flags", "expected"),
    [
        ("N42E080.hgt", void_tile, "", ["void", "row"]),
        ("N42E080.hgt", lambda path: path.write_bytes(b"\0" * 999), "", ["999 bytes", "1201"]),
        ("mountain.hgt", void_tile, "", ["mountain", "N42E080.hgt"]),
        ("hole.npz", map_with(HOLE), "", ["not finite", "row 19, column 17"]),
        ("line.npz", map_with(np.zeros(40)), "", ["shape (40,)", "(rows, cols)"]),
        ("dot.npz", map_with(np.zeros((1, 1))), "", ["shape (1, 1)", "at least 2"]),
        ("free.npz", map_with(FLAT, {}), "", ["spacing_m"]),
        ("negative.npz", map_with(FLAT, {"spacing_m": -5}), "", ["spacing_m", "-5", "> 0"]),
        ("cut.npz", truncated, "", ["not a readable .npz"]),
        ("grey.png", lambda path: png(path, np.zeros((9, 9), np.uint8)), "--spacing 9 --scale 1", ["16-bit"]),
        ("deep.png", lambda path: png(path, np.zeros((9, 9), np.uint16)), "", ["spacing", "scale"]),
        ("deep.png", lambda path: png(path, np.zeros((9, 9), np.uint16)), "--spacing 0 --scale 1", ["--spacing", "0"]),
        ("flat.npz", map_with(FLAT), "--crop 0 0 1 1e9", ["--crop", "1000000000", "allowed: within 0 0"]),
        ("flat.npz", map_with(FLAT), "--resample nan", ["--resample", "nan"]),
        ("flat.npz", map_with(FLAT), "--spacing 5", ["--spacing", "--resample"]),
        ("flat.xyz", lambda path: path.write_text("1 2 3"), "", [".asc", ".hgt", ".png", ".tif"]),
    ],
)  # fmt: skip
def test_a_broken_elevation_model_is_refused(
    refused: Refusal, tmp_path: Path, name: str, write: Callable[[Path], None], flags: str, expected: list[str]
) -> None:
    write(tmp_path / name)
    line = refused("terrain", "import", name, "--out", "map.npz", *flags.split())
    for word in ("" if flags.startswith(("--spacing", "--resample")) else Path(name).stem, *expected):
        assert word in line
    if name.endswith(".npz") and not flags:
        flown = refused("run", "safe-flight", "--terrain", name)
        assert name in flown
        assert expected[0] in flown


@pytest.fixture
def saved(hills: Path, tmp_path: Path) -> Callable[..., str]:
    """Folders with a config.json of a run, with some entries changed."""
    terrain = load_terrain(hills)

    def write(**changes: Any) -> str:
        config: dict[str, Any] = {
            "scenario": "safe-flight",
            "seed": 1,
            "fields": {"terrain": str(hills), "start": [3000.0, 3000.0, 800.0], "target": [7000.0, 3000.0, 800.0]},
            "controller": {"name": "flight", "fields": {"nodes": 13}},
            "estimator": {"name": "full_state", "fields": {}},
            "terrain": {"name": "hills", "path": str(hills), "digest": terrain.digest},
        }
        for name, change in changes.items():
            config[name] = {**config[name], **change} if isinstance(change, dict) else change
        folder = tmp_path / "saved"
        folder.mkdir()
        (folder / "config.json").write_text(json.dumps({k: v for k, v in config.items() if v is not None}))
        return "saved"

    return write


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"terrain": {"digest": "0123"}}, ["digest", "0123"]),
        ({"scenario": None}, ["scenario", "missing"]),
        ({"seed": True}, ["seed", "True", "int"]),
        ({"scenario": "hover"}, ["hover", "safe-flight"]),
        ({"fields": {"colour": "red"}}, ["fields.colour", "terrain"]),
        ({"fields": {"start": [1.0, 2.0]}}, ["fields.start", "3 values"]),
        ({"fields": {"speed_max": "fast"}}, ["fields.speed_max", "fast", "float"]),
        ({"fields": {"speed_max": -1.0}}, ["speed_max", "-1.0", "> 0"]),
        ({"fields": {"noise": {"position": None}}}, ["fields.noise.position", "None"]),
        ({"controller": {"fields": {"incorporation": "x"}}}, ["controller.fields.incorporation", "'x'", "schedule"]),
        ({"controller": {"name": "autopilot"}}, ["autopilot", "flight"]),
    ],
)
def test_a_broken_configuration_is_refused(
    refused: Refusal, saved: Callable[..., str], changes: dict[str, Any], expected: list[str]
) -> None:
    line = refused("run", "--from", saved(**changes))
    for word in expected:
        assert word in line


def test_another_scenario_than_the_saved_one_is_refused(refused: Refusal, saved: Callable[..., str]) -> None:
    line = refused("run", "hover", "--from", saved())
    assert "hover" in line
    assert "allowed: safe-flight" in line
