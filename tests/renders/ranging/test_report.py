"""The report of a robot that finds itself stands alone and has a figure of all that its estimator says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from mathnavi.models.field.curve import ellipse
from mathnavi.renders.ranging.field_figure import field_figure
from mathnavi.renders.ranging.report import WINDOW, consistency_figure, hypotheses_figure, pose_figure, report
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.sim.records.run_folder import described
from tests.renders.reading import Page, check_stands_alone, checked_report


@pytest.fixture(autouse=True)
def no_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")


def test_the_report_stands_alone_and_shows_every_figure_and_event(bank_dir: Path, bank_run: RangingRun) -> None:
    _, page = checked_report(bank_dir)
    for event in bank_run.log.events:
        assert described(event)[0] in page.words
    assert "No picture of the scene: MUJOCO_GL = disable switches drawing off" in page.text
    assert "The robot found itself" in page.text
    for title in ("Path", "Errors: at the start", "Pose", "Hypotheses", "Consistency", "Ranges", "Inputs"):
        assert title in page.words
    assert "What the observer makes small" not in page.words


def test_the_report_of_an_observer_has_what_it_makes_small(observer_run: RangingRun) -> None:
    page = Page(report(observer_run))
    assert "What the observer makes small" in page.words
    assert not {"Hypotheses", "Consistency"} & set(page.words)
    assert "±3σ" not in page.words


def test_a_run_without_an_estimate_is_reported_too(silent_run: RangingRun) -> None:
    source = report(silent_run)
    check_stands_alone(source)
    text = Page(source).text
    assert "The robot did not find itself" in text
    assert "Ranges" in text
    assert "Errors: at the start" not in text


def test_an_answer_that_is_an_image_is_explained(bank_run: RangingRun) -> None:
    beliefs = bank_run.beliefs
    turned = replace(bank_run, beliefs=replace(beliefs, x=np.array([bank_run.curve.images(x)[1] for x in beliefs.x])))
    for run, explained in ((bank_run, False), (turned, True)):
        names = field_figure(run).axes[0].get_legend_handles_labels()[1]
        assert ("indistinguishable from it" in names) == explained


def test_the_field_has_room_for_beacons_far_outside_the_wall(bank_run: RangingRun) -> None:
    far = replace(bank_run, beacons=np.array([[0.0, -9.0], [0.0, 9.0]]))
    heights = [float(field_figure(run).get_size_inches()[1]) for run in (bank_run, far)]
    assert heights[1] > 1.1 * heights[0]


def test_a_circle_and_its_continuum_of_images_are_drawn(bank_run: RangingRun) -> None:
    run = replace(bank_run, mission=replace(bank_run.mission, curve=ellipse(3.0, 3.0)))
    assert run.curve.symmetry == 0
    assert np.isfinite(run.mirrored).all()
    for figure in (field_figure(run), pose_figure(run)):
        figure.canvas.draw()


def test_bounds_of_the_mean_of_nis_are_those_of_chi_square(bank_run: RangingRun) -> None:
    upper, lower = consistency_figure(bank_run).axes
    bounds = sorted(float(line.get_ydata()[-1]) for line in upper.lines if line.get_linestyle() == ":")
    freedom = 2 * WINDOW
    assert bounds == pytest.approx([chi2.ppf(q, freedom) / freedom for q in (0.025, 0.975)])
    assert len([line for line in lower.lines if line.get_linestyle() == ":"]) == 2
    (mean,) = (line for line in upper.lines if line.get_label().startswith("mean"))
    assert np.asarray(mean.get_ydata()) == pytest.approx(1.0)  # a NIS of 2 with 2 degrees of freedom


def test_every_hypothesis_that_was_dropped_ends_in_a_cross(bank_run: RangingRun) -> None:
    (axes,) = hypotheses_figure(bank_run).axes
    crosses = [line for line in axes.lines if line.get_marker() == "x"]
    assert len(crosses) == 3
    assert all(-20.5 < float(line.get_ydata()[0]) < -19.0 for line in crosses)
