"""Runs from a script: the same as from the command line, kept and read back whole, and wrong arguments named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.renders.run_figure import signals_figure
from mathnavi.sim.records.store import Store
from tests.renders.drawn import needs_opengl

FLIGHT = {"terrain": "jacksboro", "start": (3000, 4000, 900), "target": (6000, 7000, 1000)}
BRIEF = {"duration": 0.6, "settled": 0.3}
SHORT: dict[str, dict[str, Any]] = {
    "arm-velocity": BRIEF,
    "attitude-tracking": BRIEF,
    "missile-guidance": {},
    "quadrotor-canyon": {
        "start": (300.0, 275.0, 1232.0), "target": (246.0, 288.0, 1246.0), "planner": {"flight": {"nodes": 5}},
    },
    "range-localisation": {"duration": 1.0},
    "safe-flight": FLIGHT,
    "simultaneous-arrival": {"terrain": "jacksboro", "vehicles": 2},
    "sphere-observer": BRIEF,
    "textbook-observer": {"duration": 1.0},
}  # fmt: skip


@pytest.fixture(scope="module")
def flight() -> mn.RunResult:
    return mn.run("safe-flight", seed=2, controller=mn.plugin("flight", nodes=7), noise={"position": 1.0}, **FLIGHT)


def assert_same(one: mn.RunResult, other: mn.RunResult) -> None:
    """Two runs have the same arrays, bit for bit."""
    assert list(one.arrays) == list(other.arrays)
    for name, rows in one.arrays.items():
        assert rows.dtype == other[name].dtype
        np.testing.assert_array_equal(rows, other[name], err_msg=name)


def test_a_script_flies_what_the_command_line_flies(flight: mn.RunResult, tmp_path: Path) -> None:
    ends = [str(value) for name in ("start", "target") for value in (f"--{name}", *FLIGHT[name])]
    flags = ["--seed", "2", "--terrain", "jacksboro", *ends, "--planner.nodes", "7", "--noise.position", "1"]
    assert main(["run", "safe-flight", *flags, "--out", str(tmp_path / "run")]) == 0
    assert_same(flight, mn.load(tmp_path / "run"))
    flight.save(tmp_path / "saved")
    one, other = (json.loads((tmp_path / name / "config.json").read_text()) for name in ("run", "saved"))
    assert one == other


def titles(figure: Figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


@pytest.mark.parametrize("scenario", SHORT)
def test_a_run_is_read_back_as_it_was_and_shows_its_figure(scenario: str, tmp_path: Path) -> None:
    assert set(SHORT) == set(mn.available("scenarios"))
    run = mn.run(scenario, seed=1, **SHORT[scenario])
    again = mn.load(run.save(tmp_path / "one"))
    assert_same(run, again)
    assert (again.success, again.events) == (run.success, sorted(run.events, key=lambda event: event.t))
    assert again.recording.state_names == run.recording.state_names
    assert repr(again) == repr(run)
    assert scenario in repr(run).splitlines()[0]
    assert len(repr(run).splitlines()) <= 15
    figure = run.plot()
    assert isinstance(figure, Figure)
    assert titles(figure) != titles(signals_figure(run.arrays)), "a figure of its own"
    copied = again.save(tmp_path / "other")
    assert (copied / "log.npz").read_bytes() == (tmp_path / "one" / "log.npz").read_bytes()


def test_a_notebook_shows_the_table_and_the_picture(flight: mn.RunResult) -> None:
    html = flight._repr_html_()
    assert "min clearance" in html
    assert "data:image/png;base64," in html


def test_a_run_without_a_figure_of_its_own_shows_its_signals(flight: mn.RunResult) -> None:
    figure = signals_figure(flight.arrays)
    assert [axes.get_title(loc="left") for axes in figure.axes][:2] == ["truth.x", "command.u"]


@needs_opengl
def test_a_video_and_a_report_are_written(flight: mn.RunResult, tmp_path: Path) -> None:
    video = flight.video(tmp_path / "a.mp4", "overview", width=64, height=48, fps=1)
    assert video.read_bytes()[4:8] == b"ftyp"
    page = flight.report(tmp_path / "a.html").read_text(encoding="utf-8")
    assert "mathnavi run safe-flight --from" in page
    assert {path.name for path in tmp_path.iterdir()} == {"a.mp4", "a.html"}


def test_an_array_that_is_not_there_is_named_with_those_that_are(flight: mn.RunResult) -> None:
    with pytest.raises(KeyError, match=r"truth\.y.*did you mean truth\.x"):
        flight["truth.y"]


def test_fields_are_mappings_or_dotted_names_and_leave_the_others_as_they_are() -> None:
    nested = mn.run("arm-velocity", reading={"noise": 1e-3}, **BRIEF)
    dotted = mn.run("arm-velocity", **BRIEF, **{"reading.noise": 1e-3})
    assert_same(nested, dotted)
    assert nested.config["fields"]["reading"]["resolution"] == 14  # the scenario's own default
    spec = mn.plugin("quadrotor", flight={"nodes": 9})
    assert spec == mn.plugin("quadrotor", **{"flight.nodes": 9})
    assert spec.config.flight.nodes == 9


def test_a_plug_in_is_a_name_a_place_or_a_class() -> None:
    found = mn.plugin("range_ekf").plugin
    assert mn.plugin("mathnavi.estimators.ranging.pose_filter:RangeEkf").plugin is found
    assert mn.plugin(found) == mn.plugin("range_ekf")
    assert mn.plugin("laplacian").plugin.__name__ == "Laplacian"


@pytest.mark.usefixtures("trials_here")  # tests/sim/sweep has sweeps in child processes
def test_a_sweep_flies_what_the_command_line_flies(tmp_path: Path) -> None:
    store = tmp_path / "trials.db"
    vary = {"noise": [0.0, 0.01], "duration": (5.0, 6.0)}
    with pytest.raises(mn.FieldError, match="duration"):
        mn.sweep("textbook-observer", 2, vary={**vary, "duration": (5.0, 6.0, 7.0)}, workers=1)
    swept = mn.sweep("textbook-observer", 2, vary={"noise": [0.0, 0.01]}, store=store, workers=1, duration=5.0)
    assert [record.seed for record in swept.records] == [0, 0, 1, 1]
    assert [row["noise"] for row in swept.rows] == [0.0, 0.01, 0.0, 0.01]
    assert swept.failures.value == 0.0
    assert np.isfinite(swept.figures("error_end")).all()
    assert repr(swept).splitlines()[1:] == ["  noise 0     2 of 2  succeeded", "  noise 0.01  2 of 2  succeeded"]
    flags = ["--trials", "2", "--vary", "noise=0,0.01", "--duration", "5", "--store", str(store)]
    assert main(["sweep", "textbook-observer", *flags]) == 0
    with Store.open(store) as opened:
        assert len(opened.keys()) == 4  # found there


@pytest.mark.usefixtures("trials_here")
def test_a_field_is_drawn_as_the_command_line_draws_it(tmp_path: Path) -> None:
    store = tmp_path / "trials.db"
    mn.sweep("textbook-observer", 2, vary={"noise": (0.0, 0.01)}, store=store, workers=1, duration=1.0)
    flags = ["--trials", "2", "--vary", "noise=0..0.01", "--duration", "1", "--store", str(store)]
    assert main(["sweep", "textbook-observer", *flags]) == 0
    with Store.open(store) as opened:
        assert len(opened.keys()) == 2


@pytest.mark.usefixtures("trials_here")
def test_a_study_is_done_again(tmp_path: Path) -> None:
    done = mn.study("contraction", quick=True, distances=6, directions=3, points=1, out=tmp_path, workers=1)
    assert done.claims
    assert repr(done).startswith("contraction: ")
    assert (tmp_path / "contraction.json").is_file()
    assert isinstance(done.figure, Figure)


def test_a_scenario_is_an_environment() -> None:
    environment = mn.make("textbook-observer", system="krener-isidori", duration=1.0)
    assert environment.reset().observation["t"] == 0.0


WRONG: dict[str, tuple[type[ValueError], str, Callable[[], object]]] = {
    "scenario": (mn.PluginError, "did you mean safe-flight", lambda: mn.run("safe-flyght")),
    "controller": (mn.PluginError, "did you mean flight", lambda: mn.run("safe-flight", controller="fligt")),
    "plug-in": (mn.PluginError, "did you mean flight", lambda: mn.plugin("fligt")),
    "no plug-in": (mn.PluginError, "not a plug-in", lambda: mn.plugin(int)),
    "field": (mn.FieldError, "did you mean nodes", lambda: mn.plugin("flight", nods=3)),
    "scenario's field": (mn.FieldError, "did you mean noise", lambda: mn.run("safe-flight", noises=3)),
    "value": (mn.FieldError, "nodes = 1", lambda: mn.plugin("flight", nodes=1)),
    "type": (mn.FieldError, "terrain = 3", lambda: mn.make("safe-flight", terrain=3)),
    "seed": (mn.FieldError, "seed = -1", lambda: mn.run("safe-flight", seed=-1)),
    "mission": (mn.MissionError, "under ground", lambda: mn.run("safe-flight", **{**FLIGHT, "start": (0, 0, 0)})),
    "varied field": (mn.FieldError, "seedy", lambda: mn.sweep("safe-flight", vary={"seedy": (0, 1)})),
    "trials": (mn.FieldError, "trials = 0", lambda: mn.sweep("safe-flight", 0)),
    "study": (mn.PluginError, "did you mean horizon", lambda: mn.study("horizn")),
    "sample": (mn.FieldError, "foo is not a field", lambda: mn.study("consensus", foo=1)),
    "terrain of a study": (mn.FieldError, "not done on a terrain", lambda: mn.study("sphere", terrain="jacksboro")),
    "kind": (mn.FieldError, "kind = 'planes'", lambda: mn.available("planes")),
    "argument": (mn.ArgumentError, "horizontal is -1", lambda: mn.load_terrain("plain").inflated(-1.0, 0.0)),
    "folder": (mn.RunFolderError, "nowhere", lambda: mn.load("nowhere")),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_named(what: str) -> None:
    kind, words, call = WRONG[what]
    with pytest.raises(kind, match=words):
        call()
