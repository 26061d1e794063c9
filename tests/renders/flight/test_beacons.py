"""The beacons of a flight are in its scene, on its map, and in its report, with the times at which one was left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mathnavi.renders.film import Frame
from mathnavi.renders.flight.drawing import overlay
from mathnavi.renders.flight.report import beacons_figure, map_figure
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.flight.scene import flight_scene, places_of
from mathnavi.renders.palette import SceneElement


def among_beacons(run: FlightRun) -> FlightRun:
    """The run with two beacons, the second of which is left out in its second half."""
    beacons = run.x[[0, -1], :3] + np.array([[300.0, 0.0, 50.0], [0.0, 300.0, 50.0]])
    n = len(run.t)
    left_out = np.zeros((n, 2))
    left_out[n // 2 :, 1] = 1.0
    nu = np.random.default_rng(0).standard_normal((n, 2))
    nu[left_out > 0.0] = np.nan
    found = {
        "estimate.t": run.t, "estimate.x": run.x, "estimate.deviation": np.ones((n, 6)),
        "estimate.innovations": nu, "estimate.innovation_std": np.ones((n, 2)), "estimate.left_out": left_out,
    }  # fmt: skip
    log = replace(run.log, arrays={**run.log.arrays, **found})
    return replace(run, log=log, mission=replace(run.mission, beacons=beacons))


def test_beacons_are_marks_of_the_scene_and_names_on_the_map(run: FlightRun) -> None:
    drawn = among_beacons(run)
    marks = {mark.text: mark for mark in flight_scene(drawn).marks}
    for k, place in enumerate(drawn.mission.beacons):
        np.testing.assert_array_equal(marks[f"beacon {k}"].place, place)
        assert (places_of(drawn) == place).all(axis=1).any()
    (axes, *_) = map_figure(drawn).axes
    assert {"beacon 0", "beacon 1"} <= {text.get_text() for text in axes.texts}
    assert "beacon 0" not in {mark.text for mark in flight_scene(run).marks}


def test_the_legend_has_beacons_only_where_there_are_some(run: FlightRun) -> None:
    frame = Frame(0.5 * run.duration, "overview", 0.0, 1.0)
    assert SceneElement.BEACON in overlay(among_beacons(run), frame).legend
    assert SceneElement.BEACON not in overlay(run, frame).legend


def test_a_figure_shows_the_innovations_and_the_time_for_which_a_beacon_is_left_out(run: FlightRun) -> None:
    drawn = among_beacons(run)
    figure = beacons_figure(drawn)
    upper, lower = figure.axes
    figure.canvas.draw()
    top = max(float(np.max(line.get_ydata())) for line in upper.lines)
    assert upper.get_legend().get_window_extent().y0 >= upper.transData.transform((0.0, top))[1], "hides no curve"
    first, second = (line.get_xdata() for line in lower.lines[:2])
    assert len(first) == len(run.t)
    assert max(second) < run.t[len(run.t) // 2]
    shaded = [area.get_paths()[0].get_extents() for area in lower.collections if area.get_paths()]
    assert len(shaded) == 1
    assert shaded[0].x0 >= run.t[len(run.t) // 2 - 1]
