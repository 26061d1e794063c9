"""Pictures of a fleet show every vehicle in its colour and place, and its slot; video and report are written whole."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import rgb_to_hsv

from mathnavi.interfaces.signals import Array
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.film import Frame
from mathnavi.renders.fleet.drawing import drawing, overlay
from mathnavi.renders.fleet.report import report
from mathnavi.renders.fleet.run_data import FleetRun
from mathnavi.renders.palette import VEHICLES, vehicle_colour
from mathnavi.sim.records.run_folder import described
from tests.renders.drawn import differing, drawn, needs_opengl, video_pictures
from tests.renders.reading import Page, check_stands_alone, checked_report, lines_named

FIGURES = ("map", "to-go", "separation", "clearance", "solve", "events")


def _lab(colour: tuple[float, float, float]) -> Array:
    """CIE L*a*b* of an sRGB colour under D65, IEC 61966-2-1 and CIE 15."""
    channels = np.array(colour)
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    matrix = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    ratio = matrix @ linear / np.array([0.9505, 1.0, 1.089])
    f = np.where(ratio > 216.0 / 24389.0, np.cbrt(ratio), (24389.0 / 27.0 * ratio + 16.0) / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def test_sixteen_vehicles_can_be_distinguished_from_each_other_and_from_paper_and_snow() -> None:
    """A difference of 2.3 is just noticeable; lines of a few pixels need ten times that."""
    assert len(VEHICLES) == 16
    places = [_lab(colour) for colour in (*VEHICLES, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))]
    assert min(float(np.linalg.norm(one - other)) for one, other in combinations(places, 2)) > 23.0
    assert vehicle_colour(17) == VEHICLES[1]


@needs_opengl
def test_every_vehicle_is_in_sight_where_it_should_be_in_its_colour(
    fleet_dir: Path, fleet_run: FleetRun, tmp_path: Path
) -> None:
    pictures = drawn("fleet", tmp_path, fleet_dir)
    for camera in drawing.cameras:
        shown = pictures[f"{camera}.with"].astype(int)
        assert shown.std() > 15.0
        for (name, colour), (column, row, depth) in zip(
            zip(fleet_run.vehicles, fleet_run.colours, strict=True), pictures[f"{camera}.pixels"], strict=True
        ):
            assert depth > 0.0
            assert 0 < column < 320
            assert 0 < row < 180
            rows, columns = differing(shown, pictures[f"{camera}.without.{name}"])
            assert len(rows) > 10, (camera, name)
            assert np.hypot(rows - row, columns - column).max() < 25  # nothing else moves with it
            middle = np.median(shown[rows, columns], axis=0) / 255.0
            hues = [float(rgb_to_hsv(each)[0]) for each in (middle, np.array(colour))]
            assert abs((hues[0] - hues[1] + 0.5) % 1.0 - 0.5) < 0.08, (camera, name)
        assert {"1", "2", "3"} & set(pictures[f"{camera}.labels"].tolist())
        assert ("slots" in pictures[f"{camera}.labels"]) == (camera != "arrival")
    for (column, row, _), colour in zip(pictures["end.targets"], fleet_run.colours, strict=True):
        assert 0.2 * 320 < column < 0.9 * 320
        assert 0.1 * 180 < row < 0.85 * 180
        near = pictures["end"][round(row) - 4 : round(row) + 5, round(column) - 9 : round(column) + 10] / 255.0
        hues = rgb_to_hsv(near)
        assert (np.abs((hues[..., 0] - rgb_to_hsv(colour)[0] + 0.5) % 1.0 - 0.5)[hues[..., 1] > 0.5] < 0.08).sum() > 20


@needs_opengl
def test_a_video_is_of_the_right_length_and_shows_something(fleet_dir: Path) -> None:
    count, _ = video_pictures(fleet_dir)
    assert 12 <= count <= 25


def test_the_report_stands_alone_and_shows_every_figure_vehicle_and_event(
    fleet_dir: Path, fleet_run: FleetRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    assert drawing_of(fleet_dir) is drawing
    source, page = checked_report(fleet_dir)
    for name in FIGURES:
        assert f'id="{name}-' in source, name
    for event in fleet_run.events:
        assert described(event)[0] in page.words
    for name in fleet_run.vehicles:
        assert name in page.words
    (scene,) = page.scenes
    for name, flight in fleet_run.vehicles.items():
        (path,) = (lines for lines in lines_named(scene, name) if lines["cut"] == "past")
        np.testing.assert_allclose(path["points"][-1], flight.x[-1, :3], atol=0.1)
        assert name in {mark["text"] for mark in scene["marks"] if mark["place"] is not None}  # at its start
    assert f"{fleet_run.summary['spread_s']:.2g}" in page.text
    assert "Of the fleet all 3 arrived within" in page.text
    assert f"--from {fleet_dir}" in page.text


def test_a_fleet_that_said_nothing_did_not_arrive_and_left_the_map_is_reported_too(
    fleet_run: FleetRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    outside = np.array([20_000.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    mute: dict[str, Any] = {"plans": (), "adopted": np.empty(0), "events": ()}
    lost = {
        name: replace(flight, log=replace(flight.log, x=flight.x + (outside if name == "vehicle_2" else 0.0), **mute))
        for name, flight in fleet_run.vehicles.items()
    }
    bare = replace(fleet_run, vehicles=lost, events=(), summary={"shortfall": "arrived is no"})
    assert bare.arrived(bare.duration) == 2
    assert not bare.everybody_arrived
    source = report(bare)
    check_stands_alone(source)
    text = Page(source).text
    assert "Of the fleet 2 of 3 arrived (arrived is no)" in text
    assert "Nothing happened" in text
    shown = overlay(bare, Frame(0.5 * bare.duration, "overview", 0.0, 0.0))
    assert ("AGREED ARRIVAL", "–", "known to 0 of 3") in shown.numbers
