"""A recorded log has a plan from above, and what pages, pictures and summaries say of it is true of a log."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.commands.summary import summary_table
from mathnavi.interfaces.reading_counts import COUNTS, Unused
from mathnavi.interfaces.signals import Array, Status
from mathnavi.renders.generic.drawing import annotations_of
from mathnavi.renders.generic.figures import board_figure
from mathnavi.renders.generic.log_plan import LogPlan, log_plan, plan_figure
from mathnavi.renders.generic.run_data import load_run
from mathnavi.renders.report import write_report
from mathnavi.renders.scene.charts import figure_charts, reading_charts, state_charts
from mathnavi.renders.scene.side_by_side import side_by_side
from mathnavi.renders.web.scene import read_scene
from mathnavi.sim.logs.imported import with_estimates
from mathnavi.sim.records.run_folder import read_log, write_run_files

COUNT, FIRST = 60, 10  # samples, and that from which on the estimate may be used
T = 0.5 * np.arange(COUNT)
TRUTH = np.column_stack([10.0 * np.cos(0.1 * T), 10.0 * np.sin(0.1 * T), 0.1 * T + 0.5 * np.pi])
PLACES = ((0.0, -20.0), None, (-18.0, 30.0), None)
ROBOT = mn.BeaconMission(PLACES, ranges=mn.BeaconQuality(0.3), start=mn.KnownStart((10.0, 0.0, 1.57), (0.1, 0.1, 0.1)))
FLIGHT = mn.FlightMission(
    mn.HeightField(np.zeros((2, 2)), 1000.0), (10.0, 0.0, 50.0), (90.0, 50.0, 50.0),
    beacons=mn.FlightBeacons(((0.0, -20.0, 5.0), None, (-18.0, 30.0, 9.0), None)),
)  # fmt: skip
WALLED = mn.RangingMission(mn.wall_through([(-15.0, -15.0), (15.0, -15.0), (15.0, 15.0), (-15.0, 15.0)]), (0.0,))
NAMES = ("x [m]", "y [m]", "heading [rad]")
FLIGHT_NAMES = tuple(f"{of}_{axis} [{unit}]" for of, unit in (("position", "m"), ("velocity", "m/s")) for axis in "xyz")


def imported(folder: Path, reference: tuple[str, ...]) -> Path:
    """The folder of a run, with the first columns of TRUTH under the names of the reference."""
    columns = [name.partition(" [")[0] for name in reference]
    rows = [",".join(["t", "r", *columns])]
    rows += [
        ",".join(map(repr, [t, 20.0, *row[: len(columns)]])) for t, row in zip(T.tolist(), TRUTH.tolist(), strict=True)
    ]
    (folder / "rover.csv").write_text("\n".join([*rows, ""]))
    words = ["--reference", ",".join(columns), "--reference-names", ",".join(reference)] if reference else []
    assert main(["log", "import", str(folder / "rover.csv"), "--readings", "beacon_ranges=r", *words,
                 "--out", str(folder / "run")]) == 0  # fmt: skip
    return folder / "run"


def history(names: tuple[str, ...], places: Mapping[str, Array], usable: int = FIRST) -> mn.EstimateHistory:
    """Estimates 0.1 m beside the truth that may be used from a sample on; at the end beacon 1 is found, 3 is not."""
    x = np.column_stack([TRUTH[:, :2] + 0.1, np.zeros((COUNT, len(names) - 2))])
    x[:, 2] = TRUTH[:, 2] + 2.0 * np.pi * (len(names) == 3)  # a turn off
    status = tuple(Status.OK if k >= usable else Status.INITIALISING for k in range(COUNT))
    left_out, unused = np.zeros((COUNT, 4)), np.zeros((COUNT, len(Unused)))
    left_out[20:30, 2] = 1.0
    unused[:, list(Unused).index(Unused.OUTLIER)] = 7.0
    extra = {"left_out": left_out, "protection": np.full((COUNT, 2), 0.5), COUNTS: unused, **places}
    figures = {
        "left_out": tuple(f"beacon {i}" for i in range(4)),
        "protection": ("protection, position [m]", "protection, heading [rad]"),
    }
    P = np.tile(0.04 * np.eye(len(names)), (COUNT, 1, 1))
    return mn.EstimateHistory("test", T, x, P, status, ("",) * COUNT, extra, {}, names, figures)


def robot_places() -> dict[str, Array]:
    places, P = np.full((COUNT, 8), np.nan), np.full((COUNT, 8, 8), np.nan)
    places[:, [0, 1, 4, 5]] = 0.0, -20.0, -18.0, 30.0
    places[30:, 2:4], P[30:, 2:4, 2:4] = (25.0, 2.0), np.diag([0.09, 0.16])
    return {"beacons": places, "beacons_covariance": P}


def flight_places() -> dict[str, Array]:
    places, P = np.full((COUNT, 4, 3), np.nan), np.full((COUNT, 4, 3, 3), np.nan)
    places[30:, 1], P[30:, 1] = (25.0, 2.0, 7.0), np.diag([0.09, 0.16, 1.0])
    return {"beacon_places": places, "beacon_places_covariance": P}


def estimated(folder: Path, found: mn.EstimateHistory, mission: Any, out: str = "found") -> Path:
    """The folder with estimates over an imported log."""
    made = with_estimates(folder, found, {"name": "beacon_bank", "fields": {}, "mission": "rover.py:mission"}, mission)
    place = folder.with_name(out)
    place.mkdir()
    write_run_files(place, made.config, made.summary, made.recording)
    return place


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    return estimated(imported(tmp_path, NAMES), history(NAMES, robot_places()), ROBOT)


def plan_of(folder: Path) -> LogPlan:
    plan = log_plan(load_run(folder))
    assert plan is not None
    return plan


def texts(axes: Axes) -> set[str]:
    return {each.get_text() for each in axes.texts}


def test_a_robot_among_beacons_is_seen_from_above(robot: Path) -> None:
    plan = plan_of(robot)
    np.testing.assert_allclose(plan.reference, TRUTH[:, :2], atol=1e-9)
    assert np.isnan(plan.estimate[:FIRST]).all()
    np.testing.assert_allclose(plan.estimate[FIRST:], TRUTH[FIRST:, :2] + 0.1, atol=1e-9)
    assert {i: place.tolist() for i, place in plan.beacons.items()} == {0: [0.0, -20.0], 2: [-18.0, 30.0]}
    assert plan.found(29) == {}
    ((number, (place, P)),) = plan.last_found.items()
    assert (number, place.tolist(), P.diagonal().tolist()) == (1, [25.0, 2.0], [0.09, 0.16])
    axes = plan_figure(plan).axes[0]
    assert axes.get_legend_handles_labels()[1] == ["reference", "estimate", "beacon", "beacon, as found"]
    assert texts(axes) == {"0", "2", "1, σ 0.5 m", "start", "end"}


def test_a_flight_is_too_and_so_are_walls_and_logs_without_a_reference(tmp_path: Path) -> None:
    for name in ("flight", "walled", "short"):
        (tmp_path / name).mkdir()
    flight = plan_of(estimated(imported(tmp_path / "flight", ()), history(FLIGHT_NAMES, flight_places()), FLIGHT))
    assert not flight.reference.shape[1]
    assert list(flight.beacons) == [0, 2]
    assert {i: place.tolist() for i, (place, _) in flight.last_found.items()} == {1: [25.0, 2.0]}
    assert texts(plan_figure(flight).axes[0]) >= {"0", "2", "1, σ 0.5 m"}
    walled = plan_of(estimated(imported(tmp_path / "walled", ("x", "y")), history(NAMES, {}), WALLED))
    assert walled.wall is not None
    assert walled.wall.outlines[0].tolist() == WALLED.curve.outlines[0].tolist()
    assert walled.reference.shape == (COUNT, 2)
    assert log_plan(load_run(imported(tmp_path / "short", ("q1 [rad]",)))) is None


def test_left_out_beacons_and_protection_are_in_the_charts_by_name(robot: Path) -> None:
    run = load_run(robot)
    charts = {chart.title: chart for chart in figure_charts(run)}
    assert set(charts) == {"left out while raised", "protection, position", "protection, heading"}
    (line,) = charts["left out while raised"].series
    assert line.name == "beacon 2"
    np.testing.assert_allclose(line.y - 2.0 > 0.5, (T >= 10.0) & (T < 15.0))
    figure, plan = board_figure(run, 6)
    assert plan is not None
    plan.show(20.0)
    for marker, beside in zip(plan.markers, (0.0, 0.1), strict=True):
        np.testing.assert_allclose(np.ravel(marker.get_data()), TRUTH[40, :2] + beside, atol=1e-9)
    assert figure.axes[1].get_ylabel() == "left out while\nraised"


def test_a_page_speaks_of_the_log_and_of_no_mission(robot: Path) -> None:
    page = write_report(robot).read_text(encoding="utf-8")
    visible = page.partition("config.json")[0].lower()
    for word in ("succeeded", "arrived", "mission failed", "seed 0", "simulat", "events of the flight", "truth"):
        assert word not in visible
    for words in ("estimate usable for 83.3 % of 29.5 s", "estimate ok at the end", "seen from above"):
        assert words in visible
    assert "not found by the end: 3." in visible
    assert "mathnavi estimate beacon_bank" in visible
    run = load_run(robot)
    assert annotations_of(run)[-1] == (run.duration, "estimate ok at the end")
    bare = write_report(robot.with_name("run")).read_text(encoding="utf-8").lower()
    assert "no estimator has run over this log" in bare


def test_the_browser_shows_it_and_what_runs_share_once(robot: Path) -> None:
    scene = read_scene(robot)
    assert [camera.name for camera in scene.cameras] == ["top", "slant"]
    assert [lines.layer.name for lines in scene.lines] == ["reference", "estimate", "beacons as found"]
    assert {mark.text for mark in scene.marks} == {"reference", "estimate", "beacon 0", "beacon 2", "beacon 1, σ 0.5 m"}
    errors = {chart.unit: chart.series[0].y for chart in scene.charts if chart.title == "estimate error"}
    assert {unit: float(np.nanmax(y)) for unit, y in errors.items()} == {
        "m": pytest.approx(0.1 * math.sqrt(2.0)), "rad": pytest.approx(0.0, abs=1e-9),
    }  # fmt: skip
    assert np.isnan(errors["m"][:FIRST]).all()  # while the estimate may not be used
    again = estimated(robot.with_name("run"), history(NAMES, {}), ROBOT, "again")
    both = side_by_side({name: read_scene(robot.with_name(name)) for name in ("run", "found", again.name)})
    names = [mark.text for mark in both.marks]
    assert (names.count("reference"), names.count("beacon 0"), names.count("found: beacon 0")) == (1, 1, 0)
    assert [lines.layer.name for lines in both.lines].count("reference") == 1


def test_the_summary_says_nothing_that_is_not_known(tmp_path: Path) -> None:
    """Of an estimate that may never be used there is no error, and of readings not used one number."""
    run = imported(tmp_path, NAMES)
    never = read_log(estimated(run, history(NAMES, {}, COUNT), ROBOT, "never")).summary
    for name in ("position_rms_m", "position_error_max_m", "heading_rms_deg", "nees_mean", "initialising_s"):
        assert never[name] is None or math.isnan(never[name])
    assert (never["usable_share"], never["unused_readings"], never["unused_reasons"]) == (0.0, 7, "7 outlier")
    silent = history(NAMES, {})
    extra = {name: values for name, values in silent.extra.items() if name != COUNTS}
    smoothed = mn.EstimateHistory("smoother", T, silent.x, silent.covariance, silent.status, silent.message, extra, {})
    again = read_log(estimated(tmp_path / "never", smoothed, ROBOT, "smoothed")).summary
    assert not {"unused_readings", "unused_reasons"} & set(again)
    assert again["position_error_max_m"] == pytest.approx(0.1 * math.sqrt(2.0))
    headings = [cell for cell in summary_table(again, ()).columns[0].cells if cell]
    assert headings == ["estimate", "log"]


def test_a_reference_of_a_position_alone_is_compared(tmp_path: Path) -> None:
    folder = estimated(imported(tmp_path, NAMES[:2]), history(NAMES, {}), ROBOT)
    assert read_log(folder).summary["position_rms_m"] == pytest.approx(0.1 * math.sqrt(2.0))
    assert state_charts(load_run(folder)) == []  # they are drawn with the estimate


def test_beacons_that_are_read_one_after_the_other_have_lines(tmp_path: Path) -> None:
    rows = [f"{t},{20.0 + k if k % 2 else ''},{'' if k % 2 else 30.0}" for k, t in enumerate(T.tolist())]
    (tmp_path / "rover.csv").write_text("\n".join(["t,r0,r1", *rows, ""]))
    words = ["--readings", "beacon_ranges=r0,r1", "--out", str(tmp_path / "run")]
    assert main(["log", "import", str(tmp_path / "rover.csv"), *words]) == 0
    (chart,) = reading_charts(load_run(tmp_path / "run"))
    assert [np.isfinite(series.y).all() and len(series.y) for series in chart.series] == [COUNT // 2, COUNT // 2]


def test_a_log_in_the_viewer_is_one_line(robot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", str(robot)]) == 2
    assert "mathnavi view DIR --web" in capsys.readouterr().err.replace("\n", " ")
