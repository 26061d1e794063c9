"""Scenarios through the command line: what a run leaves, the same run again, sweeps, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from tests.commands.test_sweep_cli import records

MISSILE = "missile-guidance --controller tests.missile:Glide --target 300 0 0"
ROBOT = "range-localisation --controller tests.localisation:Pattern --estimator tests.localisation:DeadReckoner"
RUNS = {
    "missile": f"{MISSILE} --noise.position 0.2 --planner.omega 6 --target-change 1 5 0 0 --report",
    "robot": f"{ROBOT} --duration 1 --sensors -90 -45 0 --start-known --noise.dropout 0.1 --field.shape egg "
    "--outage 0.2 0.4",
    "textbook": "textbook-observer --system krener-isidori --start 0.5 0.5 --start-error 0.1 0.2 --noise 0.01 "
    "--estimator output_injection --estimator.poles -4 -5 --planner.constant 0.1 --duration 3",
}
Flown = Callable[[str], Path]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """The folder of a run by its name, flown once."""

    @cache
    def folder(name: str) -> Path:
        out = tmp_path_factory.mktemp(name) / "run"
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("MUJOCO_GL", "disable")
            assert main(["run", *RUNS[name].split(), "--out", str(out)]) in (0, 1)
        return out

    return folder


@pytest.mark.parametrize("name", RUNS)
def test_a_run_leaves_what_every_run_leaves_and_is_run_again_bit_for_bit(
    name: str, flown: Flown, tmp_path: Path
) -> None:
    folder = flown(name)
    names = {"config.json", "summary.json", "events.jsonl", "log.npz", "log.json", "timing.json"}
    assert {path.name for path in folder.iterdir()} - {"report.html"} == names
    assert main(["run", "--trust", "--from", str(folder), "--out", str(tmp_path)]) in (0, 1)
    with np.load(folder / "log.npz") as one, np.load(tmp_path / "log.npz") as other:
        assert set(one) == set(other)
        for array in one:
            np.testing.assert_array_equal(one[array], other[array])


def test_files_of_a_run_say_what_was_asked_for_and_what_is_logged(flown: Flown) -> None:
    missile, robot = flown("missile"), flown("robot")
    assert json.loads((missile / "summary.json").read_text())["hit"] is True
    assert json.loads((missile / "log.json").read_text())["states"]["missile"][2] == "position_theta [rad]"
    assert "The missile hit" in (missile / "report.html").read_text()
    config = json.loads((robot / "config.json").read_text())
    assert config["drawing"] == "mathnavi.renders.ranging.drawing"
    assert config["fields"]["sensors"] == [-90.0, -45.0, 0.0]
    assert config["mission"]["field"] == "egg"
    assert json.loads((robot / "log.json").read_text())["arrays"]["measurement.ranges"]["shape"] == [101, 3]
    config = json.loads((flown("textbook") / "config.json").read_text())
    assert config["fields"]["start"] == [0.5, 0.5]
    assert config["estimator"]["fields"]["poles"] == [-4.0, -5.0]


def test_a_run_again_takes_other_sensors_as_a_whole(flown: Flown, tmp_path: Path) -> None:
    words = ["run", "--trust", "--from", str(flown("robot")), "--sensors", "60", "-60", "--out", str(tmp_path)]
    assert main(words) in (0, 1)
    assert json.loads((tmp_path / "config.json").read_text())["fields"]["sensors"] == [60.0, -60.0]


def test_a_missile_that_misses_exits_with_1(tmp_path: Path) -> None:
    assert main(["run", *MISSILE.split(), "--actuator.normal", "3000", "--out", str(tmp_path)]) == 1
    assert json.loads((tmp_path / "summary.json").read_text())["hit"] is False


def test_the_cameras_and_times_are_those_of_the_run(flown: Flown, capsys: pytest.CaptureFixture[str]) -> None:
    render = ["render", str(flown("missile")), "--still"]
    capsys.readouterr()
    assert main([*render, "--camera", "overview"]) == 2
    assert capsys.readouterr().err == "mathnavi: --camera = 'overview'; allowed: chase, side, target\n"
    assert main([*render, "--time", "60"]) == 2
    assert capsys.readouterr().err.startswith("mathnavi: --time = 60 s; allowed: 0 to")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("missile-guidance --mismatch.mass 0", "--mismatch.mass = 0.0; allowed"),
        ("missile-guidance --start 0 5 10", "--start: its y = 5.0 leads out of the pitch plane; allowed"),
        ("missile-guidance --actuator.delay 0.0005", "--actuator.delay = 0.0005; allowed"),
        ("missile-guidance --case SLOW", "--case = SLOW; allowed: FAST, SM, SM2, SM3"),
        (f"{MISSILE} --planner.reach 100", "no first plan"),
        ("missile-guidance --estimator kalman", "is for a FlightMission"),
        ("range-localisation --start 5 0 0", "--start = (5.0, 0.0, 0.0)"),
        ("range-localisation --start 3.7 0 0", "from the wall"),
        ("range-localisation --sensors", "--sensors = ()"),
        ("range-localisation --sensors 10 370", "-360 to 360"),
        ("range-localisation --sensors 0 90 0", "one direction twice"),
        ("range-localisation --sensors ahead", "--sensors = ahead; allowed: FLOAT..."),
        ("range-localisation --sensors 0 --sensors 90", "--sensors is given 2 times"),
        ("range-localisation --friction 0.5", "--friction = 0.5 with drive = ideal; allowed"),
        ("range-localisation --drive tracks", "--drive = tracks; allowed: differential, ideal"),
        ("range-localisation --noise.outliers 2", "--noise.outliers = 2.0; allowed"),
        ("range-localisation --outage 3 2", "--outage = (3.0, 2.0); allowed"),
        ("range-localisation --estimator range_observer --estimator.z-0 1 2", "--estimator.z-0 = (1.0, 2.0)"),
        ("range-localisation --sensor 3", "did you mean --sensors"),
        ("textbook-observer --start 1", "--start = (1.0,); allowed: 3 finite numbers, of x_1 [-], x_2 [-], x_3 [-]"),
        ("textbook-observer --start-error 1 x 2", "--start-error = 1 x 2; allowed: FLOAT..."),
        ("textbook-observer --system example-2-3", "--system = example-2-3; allowed: camera-and-flags, example-2-1"),
        ("textbook-observer --no-distance-known", "--distance-known = False; allowed: only of camera-and-flags"),
        ("textbook-observer --rate 333", "--rate = 333.0; allowed: 1000 Hz over a whole number"),
        ("textbook-observer --planner.constant 1 2", "--planner.constant = (1.0, 2.0); allowed: one number for each"),
        ("textbook-observer --estimator output_injection", "--system = 'example-2-2'; allowed with this observer: k"),
        ("textbook-observer --estimator kazantzis_kravaris", "--system = 'example-2-2'; allowed: one without inputs"),
        ("sphere-observer --space torus", "torus"),
        ("sphere-observer --start 1 1 0 0 0 0 0", "has a quaternion of length 1.414214; allowed: 1"),
        ("sphere-observer --start 1 0 0", "allowed: 7 numbers"),
        ("sphere-observer --start 1 0 0 0 1e200 0 0", "start = 1e+200"),
        ("sphere-observer --reading.noise nan", "noise = nan"),
        ("sphere-observer --force printed", "force = 'printed' with space = 'body'"),
        ("sphere-observer --speed 80 --speed-max 50", "speed-max = 50.0; allowed: at least 80"),
        ("arm-velocity --start 0 0 200 0", "speed-max = 100.0; allowed: at least"),
        ("sphere-observer --reading.resolution 12", "resolution = 12; allowed"),
        ("sphere-observer --estimator.disturbance --estimator.gains printed", "disturbance = True"),
        ("sphere-observer --controller joint_tracking", "joint_tracking on the attitudes"),
        ("arm-velocity --mechanism nosuch", "mechanism = 'nosuch'; allowed"),
        ("arm-velocity --estimator.curvature matched", "curvature = 'matched'"),
        ("arm-velocity --mechanism dm_control:humanoid", "allowed: on slides and hinges"),
        ("arm-velocity --estimator.tuning innovations --estimator.damping 2", "tuning = 'innovations' with"),
        ("attitude-tracking --planner.k-p 0", "k-p = 0.0"),
        ("attitude-tracking --principal-inertia 1 1 3", "three moments, none greater"),
    ],
)
def test_bad_input_is_one_line_that_names_the_flag(
    words: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", *words.split(), "--out", str(tmp_path / "run")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("mathnavi: ")
    assert expected in line
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("trials_here")
def test_a_sweep_shows_misses_first_and_needs_no_terrain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    store = tmp_path / "misses.db"
    words = "--gust.force-rms 200 --vary mismatch.mass=1,1.1 --trials 2 --workers 1 --report"
    assert main(["sweep", *MISSILE.split(), *words.split(), "--store", str(store)]) == 0
    found = records(store)
    assert [record.success for record in found] == [True] * 4
    assert min(record.summary["cost"] for record in found if record.fields["mismatch.mass"] == 1.1) > 0.0
    assert "miss [m]" in capsys.readouterr().out
    page = store.with_suffix(".html").read_text(encoding="utf-8")
    assert "aspect error" in page
    assert "Over the terrain" not in page


@pytest.mark.usefixtures("trials_here")
def test_sensor_sets_can_be_swept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = tmp_path / "sets.db"
    words = ("--duration", "1", "--vary", "sensors=-90 -45,-60 60 0", "--trials", "1", "--store", str(store))
    assert main(["sweep", *ROBOT.split(), *words]) == 0
    found = records(store)
    assert sorted({tuple(record.fields["sensors"]) for record in found}) == [(-90.0, -45.0), (-60.0, 60.0, 0.0)]
    assert "converged" in capsys.readouterr().out
