"""Whatever is declared of a run is drawn under its name: inputs, readings, and an estimate of a part of the state."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Estimate
from mathnavi.renders.comparison.runs import read_run, run_figures
from mathnavi.renders.generic.figures import states_figure
from mathnavi.renders.generic.run_data import load_run
from mathnavi.renders.report import write_report
from mathnavi.renders.scene.elements import Chart
from mathnavi.renders.web.document import packed
from mathnavi.renders.web.scene import read_scene
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.records.log_channels import channels_of
from mathnavi.sim.records.run_folder import read_signal_names, write_run

T = np.linspace(0.0, 2.0, 41)
STATES = (*(f"attitude_{axis} [-]" for axis in "wxyz"), "position_x [m]", "position_y [m]", "speed [m/s]")
NAMES = SignalNames(
    STATES,
    ("left [rad/s]", "right [rad/s]"),
    {"gyro": ("x [rad/s]", "y [rad/s]", "z [rad/s]"), "bumper": ("bumper [N]",)},
    groups={"attitude": tuple(f"attitude_{axis}" for axis in "wxyz"), "position": ("position_x", "position_y")},
)
CONFIG = {"scenario": "yard:Rover", "seed": 2, "fields": {}, "controller": {"name": "a.b:Wheels", "fields": {}}}
DEVIATION = 0.3


def recording(names: SignalNames, *, covariance: bool = True) -> Recording:
    """A rover whose estimator knows its heading and its speed, in this order."""
    truth = np.column_stack([np.ones_like(T), *np.zeros((3, len(T))), T, 2.0 * T, np.full_like(T, 2.2)])
    readings = {"gyro": np.zeros((len(T), 3)), "bumper": np.where(np.arange(len(T)) % 4, np.nan, 5.0)[:, None]}
    agent = AgentRecorder("rover", [], np.ones((len(T), 2)), readings)
    P = DEVIATION**2 * np.eye(2) if covariance else None
    for k, t in enumerate(T):
        agent.estimate(Estimate(t, np.array([1.1, 2.0]), P if k else None, extra={"pressed": np.zeros(1)}))
    made = Recording(T, {"rover": truth}, {"rover": agent}, [], {"rover": STATES}, len(T), signals={"rover": names})
    if names.estimands:
        made.estimands["rover"] = np.column_stack([np.full_like(T, 1.0), truth[:, 6]])
    return made


def charts_of(folder: Path, made: Recording) -> dict[str, Chart]:
    write_run(folder, CONFIG, {"arrived": True}, made)
    return {chart.title: chart for chart in read_scene(folder).charts}


DECLARED = replace(NAMES, estimands=("heading [rad]", "speed [m/s]"))


def test_the_figures_of_an_estimate_have_names_and_an_axis_each(tmp_path: Path) -> None:
    """The changes of a scale near 0 are not seen on the axis of one near 1."""
    made = recording(replace(DECLARED, figures={"scales": ("scale of speed [-]", "offset [m]"), "pressed": ("a", "b")}))
    made.agents["rover"].estimates[:] = [
        replace(each, extra={**each.extra, "scales": np.array([1.0, 1e-3 * each.t, 0.0])[:2]})
        for each in made.agents["rover"].estimates
    ]
    charts = charts_of(tmp_path, made)
    assert [len(charts[name].series) for name in ("scale of speed", "offset")] == [1, 1]
    assert (charts["scale of speed"].unit, charts["offset"].unit) == ("", "m")
    assert "pressed, estimated" in charts  # one number, for which two names are none
    assert read_signal_names(tmp_path)["rover"].figures["scales"] == ("scale of speed [-]", "offset [m]")


def test_the_browser_has_an_estimate_of_a_part_of_the_state_over_its_truth(tmp_path: Path) -> None:
    charts = charts_of(tmp_path, recording(DECLARED))
    assert next(iter(charts)) == "heading"  # first what is estimated, and attitudes last of the states
    assert list(charts).index("attitude") > list(charts).index("position")
    truth, estimate = charts["heading"].series
    assert (truth.name, estimate.name, charts["heading"].unit) == ("truth", "estimate", "rad")
    np.testing.assert_allclose(truth.y, 1.0)
    assert estimate.band is not None
    assert np.isnan(estimate.band[0])  # that estimate had no covariance
    np.testing.assert_allclose(estimate.band[1:], 2.0 * DEVIATION)
    assert [series.name for series in charts["position"].series] == ["x", "y"]


def test_the_browser_has_every_reading_and_input_by_its_name(tmp_path: Path) -> None:
    charts = charts_of(tmp_path, recording(DECLARED))
    assert (charts["left"].unit, charts["right"].unit) == ("rad/s", "rad/s")
    assert [series.name for series in charts["gyro"].series] == ["x", "y", "z"]
    assert charts["gyro"].unit == "rad/s"
    np.testing.assert_allclose(charts["bumper"].series[0].t, T[::4])
    assert "pressed, estimated" in charts
    errors = [chart for chart in read_scene(tmp_path).charts if chart.title == "estimate error"]
    assert {chart.unit: chart.series[0].y[0] for chart in errors} == pytest.approx({"rad": 0.1, "m/s": 0.2})


def test_the_page_of_the_browser_carries_the_bands_and_the_cameras_of_the_model(tmp_path: Path) -> None:
    write_run(tmp_path, CONFIG, {}, recording(DECLARED))
    data = packed(read_scene(tmp_path))
    bands = [series["band"] for chart in data["charts"] for series in chart["series"] if series["band"]]
    assert len(bands) == 2


CAPTION = "The estimate over time"
CASES = {
    "declared": (DECLARED, f"{CAPTION}, and the truth; the bands are 2 standard deviations"),
    "in part": (
        replace(NAMES, estimands=("heading [rad]",), estimates=("heading [rad]", "slip [-]")),
        f"{CAPTION}, and the truth where it is declared; the bands",
    ),
    "a state": (replace(NAMES, estimates=("slip [-]", "speed [m/s]")), f"{CAPTION}, and the truth where it is"),
    "not declared": (NAMES, f"{CAPTION}; the bands"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_the_report_says_of_an_estimate_is_true_of_it(case: str, tmp_path: Path) -> None:
    names, said = CASES[case]
    made = recording(replace(names, estimands=DECLARED.estimands) if case == "in part" else names)
    made.signals["rover"] = names
    if case == "in part":
        made.estimands["rover"] = made.estimands["rover"][:, :1]
    write_run(tmp_path, CONFIG, {"arrived": True}, made)
    source = write_report(tmp_path).read_text(encoding="utf-8")
    assert said in source
    assert ("Estimate less truth" in source) is (case != "not declared")
    for name in ("left", "right", "gyro", "bumper", "pressed"):
        assert name in source
    assert "input 1" not in source


def test_an_estimate_of_the_whole_state_is_drawn_with_the_states(tmp_path: Path) -> None:
    made = recording(NAMES, covariance=False)
    agent = made.agents["rover"]
    agent.estimates[:] = [replace(each, x=x) for each, x in zip(agent.estimates, made.truths["rover"], strict=True)]
    write_run(tmp_path, CONFIG, {"arrived": True}, made)
    source = write_report(tmp_path).read_text(encoding="utf-8")
    assert "The states over time, truth and estimate." in source
    assert "Further figures of the estimate over time." in source
    assert CAPTION not in source


def test_without_a_covariance_no_band_is_promised(tmp_path: Path) -> None:
    made = recording(DECLARED, covariance=False)
    assert "estimate.deviation" not in made.arrays()
    write_run(tmp_path, CONFIG, {"arrived": True}, made)
    source = write_report(tmp_path).read_text(encoding="utf-8")
    assert f"{CAPTION}, and the truth." in source
    assert "standard deviations" not in source


def test_a_figure_has_a_band_where_the_browser_has_one(tmp_path: Path) -> None:
    write_run(tmp_path, CONFIG, {}, recording(DECLARED))
    figure = states_figure(load_run(tmp_path))
    assert [len(axes.collections) for axes in figure.axes][:3] == [1, 1, 0]
    assert figure.axes[0].get_ylabel() == "heading\n[rad]"


def test_the_log_has_every_name_and_gives_it_to_what_is_exported(tmp_path: Path) -> None:
    write_run(tmp_path, CONFIG, {}, recording(DECLARED))
    assert read_signal_names(tmp_path) == {"rover": DECLARED}
    run = load_run(tmp_path)
    fields = {
        f"{channel.name} {field.name}": field.columns
        for channel in channels_of(run.vehicles, run.signals, {})
        for field in channel.fields
    }
    assert fields["input u"] == DECLARED.inputs
    assert fields["readings/gyro value"] == DECLARED.readings["gyro"]
    assert fields["estimate x"] == fields["truth estimands"] == DECLARED.estimands


def test_two_runs_are_compared_by_what_their_estimators_estimate(tmp_path: Path) -> None:
    for name in ("one", "other"):
        write_run(tmp_path / name, CONFIG, {"arrived": True}, recording(DECLARED))
    runs = read_run(tmp_path / "one"), read_run(tmp_path / "other")
    drawn = {name: figure for name, figure, _ in run_figures(*runs, ("one", "other"))}
    assert [axes.get_title(loc="left") for axes in drawn["errors"].axes] == ["heading [rad]", "speed [m/s]"]
    for axes, error in zip(drawn["errors"].axes, (0.1, -0.2), strict=True):
        for line in axes.lines:
            np.testing.assert_allclose(line.get_ydata(), error, atol=1e-12)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({}, "The same seed gives the same log"),
        ({"latency": "measured"}, "The same seed and the delays of the plans as they were measured give the same log"),
        ({"recorded": "there"}, "Its estimator ran over the readings and inputs of there."),
    ],
)
def test_what_the_command_that_repeats_a_run_gives_is_said_of_this_run(
    more: dict[str, str], said: str, tmp_path: Path
) -> None:
    write_run(tmp_path, {**CONFIG, **more}, {}, recording(DECLARED))
    assert [sentence in write_report(tmp_path).read_text(encoding="utf-8") for sentence in (said, "the same log")] == [
        True,
        "recorded" not in more,
    ]
