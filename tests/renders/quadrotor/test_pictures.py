"""Pictures of a quadrotor's flight show it where it is, its report is complete, and other runs are refused."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.signals import Event
from mathnavi.models.quadrotor.dynamics import ATTITUDE
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.film import Frame
from mathnavi.renders.quadrotor.drawing import CAMERAS, drawing, overlay
from mathnavi.renders.quadrotor.inset import Inset
from mathnavi.renders.quadrotor.report import report
from mathnavi.renders.quadrotor.run_data import QuadrotorRun, load_run
from mathnavi.sim.records.run_folder import described
from tests.renders.drawn import differing, drawn, needs_opengl
from tests.renders.reading import Page, checked_report

FIGURES = ("map", "profile", "clearance", "tracking", "rotors", "solve")


@needs_opengl
def test_the_vehicle_is_in_sight_where_it_should_be(quadrotor_dir: Path, tmp_path: Path) -> None:
    pictures = drawn("quadrotor", tmp_path, quadrotor_dir)
    for camera, least in zip(CAMERAS, (120, 30, 30), strict=True):
        shown = pictures[f"{camera}.with"].astype(int)
        assert shown.std() > 15.0
        column, row, depth = pictures[f"{camera}.pixels"][0]
        assert depth > 0.0
        rows, columns = differing(shown, pictures[f"{camera}.without.vehicle"])
        assert len(rows) > least, camera
        assert np.hypot(rows - row, columns - column).max() < 40, camera  # nothing else moves with it
        if camera != "chase":
            assert {"start", "target"} <= set(pictures[f"{camera}.labels"].tolist())
    middle = pictures["chase.pixels"][0]
    assert abs(middle[0] - 160) < 50
    assert abs(middle[1] - 90) < 50
    red, _, blue = pictures["chase.with"][:90].reshape(-1, 3).astype(int).T
    assert (red > blue + 30).mean() > 0.05  # the walls are of red stone


def test_a_frame_of_each_moment_and_the_flight_is_covered(quadrotor_run: QuadrotorRun) -> None:
    frames = drawing.frames(quadrotor_run, fps=10)
    assert 18.0 <= len(frames) / 10 <= 26.0
    assert {frame.camera for frame in frames} == set(CAMERAS)
    times = [frame.t for frame in frames]
    assert times == sorted(times)
    assert (times[0], times[-1]) == (0.0, quadrotor_run.duration)
    assert frames[-1].annotation == "arrived"
    assert sum(frame.camera == "chase" for frame in frames) > 0.55 * len(frames)
    with pytest.raises(ValueError, match=r"camera = 'side'; allowed: chase, overview, top"):
        drawing.frames(quadrotor_run, "side")


def test_the_caption_says_how_fast_how_high_and_how_tilted(quadrotor_run: QuadrotorRun) -> None:
    run, t = quadrotor_run, 0.4 * quadrotor_run.duration
    i = run.flight.index(t)
    caption = overlay(run, Frame(t, "chase", 0.0, 0.0))
    values = {name: (value, note) for name, value, note in caption.numbers}
    assert values["SPEED"] == (f"{np.linalg.norm(run.truth[i, 7:10]):.1f} m/s", "bound 14 m/s")
    assert values["CLEARANCE"] == (f"{run.clearance[i]:.1f} m", "at least 4 m")
    assert values["TILT"][0] == f"{run.tilt[i]:.0f}°"
    assert caption.state == "flying the optimised plan"


def test_the_small_map_shows_where_it_is(quadrotor_run: QuadrotorRun) -> None:
    blank = np.zeros((180, 320, 3), np.uint8)
    shown = [Inset(quadrotor_run, 180).put(blank, share * quadrotor_run.duration) for share in (0.2, 0.9)]
    rows, columns = np.nonzero(shown[0].max(axis=-1))
    assert columns.min() > 240
    assert rows.max() < 70
    assert (np.abs(shown[0].astype(int) - shown[1]).max(axis=-1) > 40).sum() > 5
    assert not blank.any()


def test_the_pose_is_that_of_the_log_and_between_its_ticks(quadrotor_run: QuadrotorRun) -> None:
    run = quadrotor_run
    position, quaternion = run.pose(float(run.flight.t[100]))
    np.testing.assert_allclose(position, run.truth[100, :3])
    np.testing.assert_allclose(quaternion, run.truth[100, ATTITUDE], atol=1e-9)
    _, between = run.pose(float(0.5 * (run.flight.t[100] + run.flight.t[101])))
    assert np.linalg.norm(between) == pytest.approx(1.0)
    assert np.nanmin(run.clearance) >= run.flight.summary["min_clearance_m"]
    farthest = float(np.nanmax(np.hypot(*run.tracking_error.T)))
    assert farthest == pytest.approx(run.flight.summary["tracking_error_max_m"])


def test_the_report_stands_alone_and_shows_every_figure_and_event(
    quadrotor_dir: Path, quadrotor_run: QuadrotorRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    assert drawing_of(quadrotor_dir) is drawing
    source, page = checked_report(quadrotor_dir)
    for name in FIGURES:
        assert f'id="{name}-' in source, name
    assert "The quadrotor arrived, no part of it ever nearer than 4 m above the ground." in page.text
    assert f"--from {quadrotor_dir}" in page.text
    (scene,) = page.scenes
    assert {"flown", "first plan, to rest"} <= {layer["name"] for layer in scene["layers"]}


def test_a_flight_without_a_plan_that_did_not_arrive_is_reported_too(
    quadrotor_run: QuadrotorRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    event = Event(1.0, "vehicle", "tracking-breach", "far <off>")
    flight = quadrotor_run.flight
    log = replace(flight.log, plans=(), adopted=np.empty(0), events=(event,), summary={"shortfall": "not arrived"})
    flight = replace(flight, log=log)
    text = Page(report(replace(quadrotor_run, flight=flight))).text
    assert "did not arrive, and came too close to the ground (not arrived)" in text
    assert described(event)[0] in text


def test_the_run_of_something_else_is_refused(quadrotor_dir: Path, run_dir: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"truth\.x \(\d+, 6\) and command\.u \(\d+, 3\) are not"):
        load_run(run_dir)
    copy = shutil.copytree(quadrotor_dir, tmp_path / "run")
    config = json.loads((copy / "config.json").read_text(encoding="utf-8"))
    del config["mission"]["reach"]
    (copy / "config.json").write_text(json.dumps(config), encoding="utf-8")
    with pytest.raises(ValueError, match="does not describe a quadrotor"):
        load_run(copy)
