"""``missile-guidance`` through the command line: run, run again, render, sweep."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.sim.records.store import Record, Store
from tests.commands.test_sweep_cli import records

NEAR = ("missile-guidance", "--controller", "tests.missile:Glide", "--target", "300", "0", "0")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short dive with its report."""
    folder = tmp_path_factory.mktemp("dive") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MUJOCO_GL", "disable")
        words = ("--noise.position", "0.2", "--planner.omega", "6", "--target-change", "1", "5", "0", "0", "--report")
        assert main(["run", *NEAR, *words, "--out", str(folder)]) == 0
    return folder


def refused(argv: Sequence[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(list(argv)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_a_run_leaves_what_every_run_leaves(flown: Path) -> None:
    names = {"config.json", "summary.json", "events.jsonl", "log.npz", "log.json", "report.html"}
    assert {path.name for path in flown.iterdir()} == names
    summary = json.loads((flown / "summary.json").read_text())
    assert summary["hit"] is True
    assert json.loads((flown / "log.json").read_text())["states"]["missile"][2] == "position_theta [rad]"
    assert "The missile hit" in (flown / "report.html").read_text()


def test_a_run_can_be_run_again_bit_for_bit(flown: Path, tmp_path: Path) -> None:
    assert main(["run", "--trust", "--from", str(flown), "--out", str(tmp_path)]) == 0
    with np.load(flown / "log.npz") as one, np.load(tmp_path / "log.npz") as other:
        assert set(one) == set(other)
        for name in one:
            np.testing.assert_array_equal(one[name], other[name])


def test_a_mission_that_fails_exits_with_1(tmp_path: Path) -> None:
    assert main(["run", *NEAR, "--actuator.normal", "3000", "--out", str(tmp_path)]) == 1
    assert json.loads((tmp_path / "summary.json").read_text())["hit"] is False


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--mismatch.mass", "0"), ("--mismatch.mass = 0.0", "allowed")),
        (("--start", "0", "5", "10"), ("--start: its y = 5.0", "dimension = spatial")),
        (("--actuator.delay", "0.0005"), ("--actuator.delay = 0.0005", "0.001 s")),
        (("--case", "SLOW"), ("SLOW", "SM, SM2, SM3")),
        (("--planner.reach", "100"), ("--target = ", "no first plan", "300 m is too far")),
        (("--estimator", "kalman"), ("kalman", "is for a FlightMission")),
    ],
)
def test_bad_input_is_one_line_that_names_the_flag(
    words: Sequence[str], expected: Sequence[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(["run", *NEAR, *words, "--out", str(tmp_path / "run")], capsys)
    for word in expected:
        assert word in line
    assert not list(tmp_path.iterdir())


def test_the_cameras_are_those_of_a_missile(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(["render", str(flown), "--camera", "overview", "--still"], capsys)
    assert line == "mathnavi: --camera = 'overview'; allowed: chase, side, target"
    line = refused(["render", str(flown), "--still", "--time", "60"], capsys)
    assert line.startswith("mathnavi: --time = 60 s; allowed: 0 to")


@pytest.mark.usefixtures("trials_here")
def test_a_sweep_shows_misses_first_and_needs_no_terrain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    store = tmp_path / "misses.db"
    words = ("--gust.force-rms", "200", "--vary", "mismatch.mass=1,1.1", "--trials", "2", "--workers", "1")
    assert main(["sweep", *NEAR, *words, "--store", str(store), "--report"]) == 0
    found: list[Record] = records(store)
    assert [record.success for record in found] == [True] * 4
    heavy = [record.summary["cost"] for record in found if record.fields["mismatch.mass"] == 1.1]
    assert min(heavy) > 0.0
    shown = capsys.readouterr().out
    assert "miss [m]" in shown
    page = store.with_suffix(".html").read_text(encoding="utf-8")
    assert "aspect error" in page
    assert "Over the terrain" not in page
    with Store.existing(store) as kept:
        assert len(kept.records()) == 4
