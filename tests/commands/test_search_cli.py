"""``mathnavi search``."""

from __future__ import annotations

import json
import shlex
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mathnavi.commands.cli import main
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.search import evaluation
from mathnavi.sim.sweep.execution import run_trials
from mathnavi.sim.sweep.trial import Trial
from tests.commands.signalled import signalled

BOWL = "tests.sim.search.scenarios:Bowl"
OVER = ("--over", "x=-4..4", "--over", "y=-4..4")


def search(path: Path, *argv: str, scenario: str = BOWL) -> int:
    return main(["search", scenario, "--store", str(path), "--workers", "1", *argv])


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "store.db"


def printed(capsys: pytest.CaptureFixture[str]) -> str:
    return " ".join(capsys.readouterr().out.split())


@pytest.mark.usefixtures("trials_here")
def test_the_worst_missions_are_named_drawn_and_flown_again(
    mission: tuple[str, ...],
    path: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")  # pictures in the reports
    scenario, *given = mission
    fields = (*given, "--planner.grid-nodes", "17", "--planner.nodes", "7", "--faults.gust-rms", "0.5")
    objective = ("--minimise", "clearance_margin_m", "--over", "planner.margin=0..25", "--over", "start[2]=700..900")
    options = ("--missions", "3", "--batch", "3", "--out", str(tmp_path / "out"), "--worst", "1", "--report")
    assert search(path, *fields, *objective, *options, scenario=scenario) == 0
    shown = printed(capsys)
    assert "safe-flight, 3 missions: 3 flown" in shown
    worst = json.loads((tmp_path / "out/worst-1/summary.json").read_text())
    with Store.existing(path) as store:
        records = store.records()
    least = min(records, key=lambda record: record.summary["clearance_margin_m"])
    assert {name: worst[name] for name in least.summary} == least.summary
    again = ["run", "--from", str(tmp_path / "out/worst-1"), "--out", str(tmp_path / "again")]
    assert main(again) == (0 if least.success else 1)
    words = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("run"))
    assert words.endswith("again")
    logs = [np.load(tmp_path / folder / "log.npz") for folder in ("out/worst-1", "again")]
    assert np.array_equal(logs[0]["truth.x"], logs[1]["truth.x"])
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    assert "mathnavi run safe-flight --seed 0" in page
    assert '<a href="out/worst-1/report.html">' in page  # and from there to the search
    report = (tmp_path / "out/worst-1/report.html").read_text(encoding="utf-8")
    assert f'A run of <a href="../../{path.stem}.html">the search {path.stem} (safe-flight, mission ' in report
    with Image.open(path.with_suffix(".png")) as picture:
        assert np.asarray(picture.convert("L")).std() > 10.0


@pytest.mark.usefixtures("trials_here")
def test_the_command_beside_a_mission_flies_it(path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fields = ("--terrain", "canyon:3", "--drawn-separation", "0.25", "0.4", "--planner.grid-nodes", "17")
    over = ("--over", "planner.margin=0..10", "--over", "seed=3..5", "--over", "radar_known=true,false")
    assert search(path, *fields, *over, "--minimise", "flight_time_s", "--missions", "2", scenario="safe-flight") == 0
    command = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("again"))
    main([*shlex.split(command.removeprefix("again"))[1:], "--out", str(tmp_path / "run")])
    with Store.existing(path) as store:
        least = min(record.summary["flight_time_s"] for record in store.records())
    assert json.loads((tmp_path / "run/summary.json").read_text())["flight_time_s"] == least


@pytest.mark.usefixtures("trials_here")
def test_a_search_that_was_killed_goes_on_to_the_same_end(path: Path, tmp_path: Path) -> None:
    words = ("--minimise", "height_m", *OVER, "--missions", "20", "--batch", "4")
    argv = ("search", BOWL, "--store", str(path), "--workers", "1", *words)
    assert signalled(signal.SIGKILL, "after", 8, *argv).returncode == -signal.SIGKILL
    assert _stored(path) == 8
    other = tmp_path / "other.db"
    assert search(path, *words) == search(other, *words) == 0
    with Store.existing(path) as one, Store.existing(other) as two:
        assert one.keys() == two.keys()
        assert len(one.keys()) == 20


@pytest.mark.usefixtures("trials_here")
def test_a_search_that_is_interrupted_says_what_is_kept_and_goes_on(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    batches = []

    def interrupted(trials: Sequence[Trial], store: Store, **options: Any) -> list[Record]:
        batches.append(trials)
        if len(batches) < 2:
            return run_trials(trials, store, **options)
        run_trials(trials[:3], store, **options)
        raise KeyboardInterrupt

    words = ("--minimise", "height_m", *OVER, "--missions", "8", "--batch", "4")
    with monkeypatch.context() as patched:
        patched.setattr(evaluation, "run_trials", interrupted)
        assert search(path, *words) == 130
    command = shlex.join(["mathnavi", "search", BOWL, "--store", str(path), "--workers", "1", *words])
    kept = "4 of 8 missions evaluated, and 3 more stored"
    assert capsys.readouterr().err == f"mathnavi: interrupted, {kept}; to go on: {command}\n"
    assert _stored(path) == 7
    assert search(path, *words) == 0
    assert _stored(path) == 8


def _stored(path: Path) -> int:
    with Store.existing(path) as store:
        return len(store.keys())


def test_what_is_refused_and_what_fails_is_reported(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--minimise", "height_m", *OVER, "--rim", "2", "--fire", "2", "--missions", "6", "--report")
    assert search(path, *words) == 0
    shown = printed(capsys)
    assert "Bowl, 6 missions: " in shown
    assert "failed mission" in shown
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    assert "beyond the rim; allowed: &lt; 2.0" in page
    assert "crashed: the process ended itself with exit code 7" in page
    assert "Refused and failed" in page


@pytest.mark.usefixtures("trials_here")
def test_a_search_ends_at_what_it_looks_for(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert search(path, "--maximise", "height_m", *OVER, "--missions", "60", "--until", "30", "--batch", "4") == 0
    assert "largest height" in (shown := printed(capsys))
    assert "30 m was reached by mission" in shown
    with Store.existing(path) as store:
        assert len(store.keys()) < 60


@pytest.mark.usefixtures("trials_here")
def test_a_rare_event_has_a_probability_with_its_interval(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rare = ("--rare", "--maximise", "noise", "--until", "1", "--particles", "8", "--repetitions", "2")
    assert search(path, *rare, "--missions", "200", "--report") == 0
    assert "P(noise >= 1) = 0." in printed(capsys)
    assert "how probable it is to reach a level" in path.with_suffix(".html").read_text(encoding="utf-8")
    assert search(path.with_name("deep.db"), *rare[:4], "40", *rare[5:], "--missions", "40") == 0
    assert "not reached: the nearest level that every repetition came to is P(noise >= " in printed(capsys)


@pytest.mark.usefixtures("trials_here")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--over", "x=0..1"), "--minimise = not given; allowed: one of --minimise and --maximise"),
        (("--minimise", "a", "--maximise", "b"), "--minimise = 'a' together with --maximise b"),
        (("--minimise", "height_m"), "--over = nothing; allowed: at least one field"),
        (("--minimise", "depth_m", "--over", "x=0..1"), "--minimise = depth_m is not a figure of"),
        (("--maximise", "solve_ms_mean", "--over", "x=0..1"), "--maximise = solve_ms_mean is a wall-clock time"),
        (("--minimise", "height_m", "--over", "z=0..1"), "--over z=0..1: this is not one of the fields"),
        (("--minimise", "height_m", "--over", "x"), "--over = 'x'; allowed: FIELD=LOW..HIGH"),
        (("--minimise", "height_m", "--over", "x=1..0"), "--over x=1..0: 1.0 > 0.0; allowed: LOW <= HIGH"),
        (("--minimise", "height_m", "--over", "x=0..1,log"), "--over x=0..1: 0.0..1.0; allowed on a logarithmic scale"),
        (("--minimise", "height_m", "--over", "x=0..1", "--over", "x=2..3"), "this field is searched over twice"),
        (("--minimise", "height_m", "--over", "x=0..1", "--x", "1"), "--x is given as well; allowed: one of both"),
        (("--minimise", "height_m", "--over", "place[2]=0..1"), "has no such place"),
        (("--minimise", "height_m", "--over", "place[0]=a..b"), "not two numbers"),
        (("--minimise", "height_m", *OVER, "--sampler", "tpe"), "--sampler = tpe; allowed: cmaes, random, sobol-cmaes"),
        (
            ("--minimise", "height_m", *OVER, "--missions", "0"),
            "--missions = 0; allowed: a whole number from 1 to 100000",
        ),
        (("--minimise", "noise", "--rare"), "--until = not given; allowed with --rare"),
        (("--minimise", "noise", "--rare", "--until", "0", "--missions", "10"), "--missions = 10; allowed with --rare"),
        (("--minimise", "noise", "--rare", "--until", "0", "--rim", "-1"), "beyond the rim"),
        (("--minimise", "height_m", *OVER, "--cluster", "tcp://nowhere"), "--cluster = 'tcp://nowhere' together with"),
    ],
)
def test_bad_input_is_one_line(
    words: tuple[str, ...], message: str, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert search(path, *words) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert "\n" not in error
    assert error.startswith("mathnavi: ")


def test_a_scenario_whose_chance_is_its_own_has_no_rare_events(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--minimise", "x_m", "--rare", "--until", "0")
    assert search(path, *words, scenario="tests.sim.sweep.scenarios:Coin") == 2
    assert "cannot draw part of its chance again; allowed: scenarios with --redraw" in capsys.readouterr().err
