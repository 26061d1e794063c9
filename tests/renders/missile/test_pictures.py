"""Pictures of a missile show it, its way and its target; stills, videos and the report are written whole."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.renders.missile.drawing import closing
from mathnavi.renders.missile.ground import PIXELS, ground_picture
from mathnavi.renders.missile.report import LENGTHS, angles_figure, approach_figure, inputs_figure, report
from mathnavi.renders.missile.run_data import MissileRun
from mathnavi.renders.video import write_still
from mathnavi.sim.records.run_folder import described
from tests.renders.drawn import differing, drawn, needs_opengl, video_pictures
from tests.renders.reading import Page, check_stands_alone, checked_report


@needs_opengl
def test_the_missile_is_in_sight_of_every_camera_and_where_it_should_be(missile_dir: Path, tmp_path: Path) -> None:
    pictures = drawn("missile", tmp_path, missile_dir)
    for camera, least in (("chase", 400), ("side", 20), ("target", 12)):
        shown = pictures[f"{camera}.with"].astype(int)
        assert shown.std() > 15.0
        column, row, depth = pictures[f"{camera}.pixels"][0]
        assert depth > 0.0
        assert 0 < column < 320
        assert 0 < row < 180
        without = pictures[f"{camera}.without.missile"]
        rows, columns = differing(shown, without)
        assert len(rows) > least
        assert np.median(np.hypot(rows - row, columns - column)) < 60  # its shadow may lie elsewhere
        assert (pictures[f"{camera}.earlier"] != without).mean() > 0.001
    assert {"target", "100 m"} <= set(pictures["side.labels"].tolist())


@needs_opengl
def test_a_still_is_not_blank(missile_dir: Path, tmp_path: Path) -> None:
    picture = np.asarray(Image.open(write_still(missile_dir, None, tmp_path / "side.png", width=320, height=180)))
    assert picture.shape == (180, 320, 3)
    assert picture.astype(float).std() > 20.0


@needs_opengl
def test_a_video_is_of_the_right_length_and_moves(missile_dir: Path) -> None:
    count, pictures = video_pictures(missile_dir)
    assert 12 <= count <= 20
    assert all((a != b).any() for a, b in pairwise(pictures))


def test_the_ground_fits_together_at_its_edges() -> None:
    picture = ground_picture().astype(float)
    assert picture.shape == (PIXELS, PIXELS, 3)
    plain = picture.mean(axis=-1)[10:-10:20, 10:-10:20]  # off the lines
    assert plain.std() > 10.0
    for one, other, inner in ((picture[3], picture[-1], picture[5]), (picture[:, 3], picture[:, -1], picture[:, 5])):
        seam, step = (np.abs(one - neighbour).mean() for neighbour in (other, inner))
        assert seam < 3.0 * step


def test_the_report_stands_alone_and_shows_every_figure_and_event(
    missile_dir: Path, missile_run: MissileRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    _, page = checked_report(missile_dir)
    for event in missile_run.log.events:
        assert described(event)[0] in page.words
    assert "No picture of the scene: MUJOCO_GL = disable switches drawing off" in page.text
    assert "The missile hit" in page.text


def test_the_report_of_a_flight_in_space_has_what_is_beside_the_plane(
    spatial_run: MissileRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    text = Page(report(spatial_run)).text
    for words in ("v, to the right", "N, yawing", "to the left [m]"):
        assert words in text


def test_a_flight_that_never_had_a_plan_is_reported_too(
    missile_run: MissileRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    bare = replace(missile_run, log=replace(missile_run.log, plans=(), adopted=np.empty(0), events=()))
    source = report(bare)
    check_stands_alone(source)
    assert "Nothing happened" in Page(source).text


def test_the_figures_show_what_was_flown_however_small(missile_run: MissileRun) -> None:
    error, end = missile_run.log.summary["tracking_error_max_m"], missile_run.approach
    axes = angles_figure(missile_run).axes[2]
    (unit,) = [name for name in LENGTHS if axes.get_ylabel() == f"off the plan [{name}]"]
    (curve,) = axes.lines
    assert axes.get_yscale() == "linear"
    assert np.nanmax(curve.get_ydata()) == pytest.approx(LENGTHS[unit] * error, rel=1e-6)
    assert np.nanmax(curve.get_ydata()) >= 1.0
    distance = approach_figure(missile_run).axes[0]
    curve, dot = distance.lines[:2]
    assert distance.get_yscale() == "linear"
    assert min(curve.get_ydata()) == pytest.approx(end.miss, abs=1e-12)
    assert dot.get_ydata() == pytest.approx([end.miss], abs=1e-12)


@pytest.mark.parametrize("run", ["missile_run", "spatial_run"])
def test_the_last_shot_has_target_and_missile_in_the_picture(run: str, request: pytest.FixtureRequest) -> None:
    from mathnavi.renders.missile.scene import OPTICS, target_view  # imports mujoco

    flown: MissileRun = request.getfixturevalue(run)
    tangent = np.tan(np.radians(OPTICS["target"].field_of_view) / 2.0)
    for t in np.linspace(closing(flown), flown.duration, 9):
        view = target_view(flown, float(t))
        forward = (view.lookat - view.eye) / view.distance
        right = np.cross(forward, [0.0, 0.0, 1.0])
        up = np.cross(right / np.linalg.norm(right), forward)
        ahead = np.array([flown.target_at(float(t)), flown.place(float(t))]) - view.eye
        depth = ahead @ forward
        assert depth.min() > 5.0
        assert np.abs(ahead @ up / depth / tangent).max() < 0.9
        assert np.abs(ahead @ right / depth / tangent).max() < 1.3  # of 16:9
        assert view.eye[2] > 0.5
        assert np.ptp(ahead @ up / depth / tangent) > min(0.5, 0.01 * np.linalg.norm(ahead[0] - ahead[1]))


def test_limits_are_drawn_where_they_are_near(missile_run: MissileRun) -> None:
    tight = replace(missile_run, input_max=1.05 * np.abs(missile_run.log.u).max(axis=0))
    near, far = (inputs_figure(run) for run in (tight, replace(missile_run, input_max=np.full(3, 1e9))))
    for axes in near.axes:
        assert sum(line.get_linestyle() == ":" for line in axes.lines) == 2
    assert all(line.get_linestyle() != ":" for axes in far.axes for line in axes.lines)
