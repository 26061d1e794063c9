"""``mathnavi run``: how long answers took is told and kept, and ``--latency measured`` makes it part of the flight."""

from __future__ import annotations

import html
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from mathnavi import run as run_in_python
from mathnavi.commands.cli import main
from mathnavi.interfaces.errors import FieldError
from mathnavi.renders.report import timing_section
from mathnavi.renders.web.scene import read_scene
from mathnavi.scripting.loading import load
from mathnavi.sim.engine import agent_runner
from tests.commands.test_cli import config, same_log

ROBOT = ("range-localisation", "--duration", "1", "--sensors", "0", "90")
SAME = ("log.npz", "config.json", "events.jsonl", "delays.json", "log.json")


@pytest.fixture
def slower(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """A clock on the wall by which the n-th answer takes n times the given seconds."""

    def begin(step: float) -> None:
        calls, now = 0, 0.0

        def clock() -> float:
            nonlocal calls, now
            calls += 1
            now += step * (calls // 2)
            return now

        monkeypatch.setattr(agent_runner, "perf_counter", clock)

    return begin


@pytest.fixture
def measured(slower: Callable[[float], None], tmp_path: Path) -> Path:
    """A run whose first plans were in time, and whose last were not."""
    slower(2e-3)
    assert main(["run", *ROBOT, "--latency", "measured", "--out", str(tmp_path / "measured")]) in (0, 1, 3)
    return tmp_path / "measured"


def late(folder: Path) -> int:
    return sum(json.loads(line)["kind"] == "late" for line in (folder / "events.jsonl").read_text().splitlines())


@pytest.mark.honoured("plug-in", "answers slower than their period")
def test_a_planner_slower_than_real_time_is_told_of(
    slower: Callable[[float], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slower(2e-3)
    main(["run", *ROBOT, "--out", str(tmp_path / "run")])
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("planner: ")]
    assert line.startswith("planner: 3 of 6 answers took longer than the period of 200 ms, worst ")
    assert line.endswith("; with --latency measured they are flown as late")
    planner = json.loads((tmp_path / "run/timing.json").read_text())["vehicles"]["robot"]["planner"]
    assert (planner["answers"], planner["longer"], planner["period_s"]) == (6, 3, 0.2)
    assert line in html.unescape(str(timing_section(tmp_path / "run")[0])), "in the report"
    assert tuple(line.split(": ")) in read_scene(tmp_path / "run").facts, "in the browser"
    assert late(tmp_path / "run") == 0
    assert not (tmp_path / "run/delays.json").exists()


def test_measured_times_are_flown_and_flown_again_bit_for_bit(
    measured: Path, slower: Callable[[float], None], tmp_path: Path
) -> None:
    assert late(measured) > 0
    assert config(measured)["latency"] == "measured"
    slower(1e-6)
    again, instantly = tmp_path / "again", tmp_path / "instantly"
    main(["run", "--from", str(measured), "--out", str(again)])
    assert [name for name in SAME if (measured / name).read_bytes() != (again / name).read_bytes()] == []
    shutil.copytree(again, instantly)
    main(["run", "--from", str(measured), "--latency", "none", "--out", str(instantly)])
    assert not same_log(measured, instantly)
    assert "latency" not in config(instantly)
    assert not (instantly / "delays.json").exists(), "those of the run that was there before are gone"
    main(["run", "--from", str(measured), "--latency", "measured", "--out", str(again)])
    assert late(again) == 0, "measured anew"


def test_wall_clock_times_are_not_in_what_is_compared(slower: Callable[[float], None], tmp_path: Path) -> None:
    for name, step in (("one", 1e-3), ("two", 2e-6)):
        slower(step)
        main(["run", *ROBOT, "--out", str(tmp_path / name)])
    for name in ("log.npz", "config.json", "events.jsonl", "log.json"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def broken(folder: Path) -> None:
    (folder / "delays.json").write_text('{"delays_s": {"robot": [0.1, -1.0]}}')


def fewer(folder: Path) -> None:
    (folder / "delays.json").write_text('{"delays_s": {"robot": [0.1, 0.1]}}')


@pytest.mark.parametrize(
    ("change", "more", "told"),
    [
        (lambda folder: (folder / "delays.json").unlink(), (), "delays.json is missing"),
        (broken, (), "-1.0; allowed: "),
        (fewer, (), "robot requests plan 3 at 0.4 s, and the recorded run has the delays of 2; allowed: "),
        (lambda folder: None, ("--web",), "--latency = measured: with --web"),
    ],
)
def test_delays_that_cannot_be_repeated_are_refused_in_one_line(
    measured: Path,
    capsys: pytest.CaptureFixture[str],
    change: Callable[[Path], None],
    more: tuple[str, ...],
    told: str,
) -> None:
    change(measured)
    capsys.readouterr()
    assert main(["run", "--from", str(measured), *more, "--out", str(measured.with_name("again"))]) == 2
    out, err = capsys.readouterr()
    (line,) = err.splitlines()
    assert told in line
    assert not out
    assert not measured.with_name("again").exists()


@pytest.mark.parametrize("command", ["sweep", "search"])
def test_trials_are_the_same_on_any_machine(command: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    store = str(tmp_path / "x.db")
    assert main([command, "range-localisation", "--latency", "measured", "--store", store]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--latency is not a field of" in line
    assert "allowed: only with `mathnavi run`" in line


def test_of_a_played_back_run_the_estimator_alone_is_timed(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["estimate", "range_ekf", str(measured), "--out", str(tmp_path / "ekf")])
    assert list(json.loads((tmp_path / "ekf/timing.json").read_text())["vehicles"]["robot"]) == ["estimator"]
    assert "wall time of" in capsys.readouterr().out
    assert not (tmp_path / "ekf/delays.json").exists()


def test_a_script_measures_saves_and_loads_the_same(slower: Callable[[float], None], tmp_path: Path) -> None:
    slower(2e-3)
    flown = run_in_python("range-localisation", duration=1.0, sensors=(0.0, 90.0), latency="measured")
    assert flown.timing is not None
    assert flown.timing.vehicles["robot"]["planner"].answers == 6
    assert "; planner: 3 of 6 answers took longer than the period of 200 ms" in repr(flown), "and all together"
    folder = flown.save(tmp_path / "saved")
    copied = load(folder).save(tmp_path / "copied")
    assert (folder / "delays.json").read_bytes() == (copied / "delays.json").read_bytes()
    assert load(copied).timing == flown.timing
    main(["run", "--from", str(copied), "--out", str(tmp_path / "again")])
    assert same_log(folder, tmp_path / "again")
    with pytest.raises(FieldError, match="latency = 'late'; allowed: none, measured"):
        run_in_python("range-localisation", latency="late")  # type: ignore[arg-type]
