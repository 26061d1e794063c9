"""Several runs in one scene: what they have in common is shown once, and every other element is told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.framing import Box
from mathnavi.renders.palette import SceneElement, vehicle_colour
from mathnavi.renders.scene.cameras import framing_camera
from mathnavi.renders.scene.charts import TRUTH, curve
from mathnavi.renders.scene.elements import Camera, Chart, Framed, Layer, Lines, Mark, Motion, Scene, Surface
from mathnavi.renders.scene.landscape import flown
from mathnavi.renders.scene.side_by_side import side_by_side

T = np.array([0.0, 1.0, 2.0])
TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
FACES = np.array([[0, 1, 2]])
WALL = Surface(TRIANGLE, FACES, (0.5, 0.5, 0.5))


def scene(shift: float, duration: float = 2.0, unit: str = "m") -> Scene:
    """A vehicle that moves to the east, shifted to the north, with a plan, a wall and a radar."""
    places = np.column_stack([T, np.full(3, shift), np.zeros(3)])
    path, plan = Layer.for_element(SceneElement.FLOWN), Layer.for_element(SceneElement.OPTIMISED)
    framed = Framed(places, Box(0.1, 0.9, 0.1, 0.9))
    return Scene(
        f"shifted by {shift:g} m", duration,
        [
            framing_camera("top", framed, (90.0, -89.0), 36.0),
            Camera("follow", (0.0, 0.0, 0.0), 5.0, 0.0, -20.0, "vehicle"),
        ],
        {"vehicle": Motion(T, places), "radar 1": Motion(T[:1], np.zeros((1, 3)))},
        [
            WALL,
            replace(WALL, motion="vehicle", layer=path, span=1.0),
            replace(WALL, motion="radar 1", layer=Layer("radar")),
        ],
        [
            flown(T, places, path),
            Lines(
                plan, places, np.array([0, 3]), plan.colour, times=T, cut="ahead", frames=np.array([0, 1]), starts=T[:1]
            ),
        ],
        [Mark("target", (1.0, 1.0, 0.0), places[-1]), Mark("home", (1.0, 1.0, 1.0), np.zeros(3))],
        [Chart("height", "m", [curve("", TRUTH, T, T + shift)]), Chart("speed", unit, [curve("", TRUTH, T, T)], [3.0])],
        [(0.5 + shift, "landed", False)],
        [("arrived", "yes"), ("shift", f"{shift:g} m")],
    )  # fmt: skip


def test_what_runs_have_in_common_is_shown_once_and_the_rest_by_run() -> None:
    found = side_by_side({"calm": scene(0.0), "windy": scene(0.25)})
    assert [surface.motion for surface in found.surfaces] == [None, "calm/vehicle", "radar 1", "windy/vehicle"]
    assert set(found.motions) == {"calm/vehicle", "windy/vehicle", "radar 1"}
    assert found.surfaces[1].colour == vehicle_colour(0) != found.surfaces[3].colour == vehicle_colour(1)
    paths = [lines for lines in found.lines if lines.cut == "past"]
    assert [(lines.layer.name, lines.colour) for lines in paths] == [
        ("calm", vehicle_colour(0)), ("windy", vehicle_colour(1)),
    ]  # fmt: skip
    plans = [lines.layer for lines in found.lines if lines.cut == "ahead"]
    assert [layer.name for layer in plans] == ["calm: optimised plan", "windy: optimised plan"]
    assert not any(layer.shown for layer in plans)
    assert {mark.text for mark in found.marks} == {"calm", "windy", "home", "calm: target", "windy: target"}
    assert [camera.name for camera in found.cameras] == ["top", "calm: follow", "windy: follow"]
    assert found.cameras[1].follow == "calm/vehicle"
    assert found.events == [(0.5, "calm: landed", False), (0.75, "windy: landed", False)]
    assert found.facts == [("arrived", "yes"), ("shift", "0 m · 0.25 m")]


def test_a_camera_that_stands_still_has_all_runs_in_its_picture() -> None:
    near, far = scene(0.0), scene(50.0)
    both = side_by_side({"near": near, "far": far})
    assert both.cameras[0].distance > 5.0 * near.cameras[0].distance
    assert 20.0 < both.cameras[0].target[1] < 30.0


def test_charts_of_one_name_and_unit_are_merged_and_others_come_last() -> None:
    other = scene(1.0, 5.0, "km/h")
    first = other.charts[0]
    other = replace(
        other, charts=[replace(first, series=[*first.series, curve("estimate", TRUTH, T, T)]), other.charts[1]]
    )
    found = side_by_side({"a": scene(0.0), "b": other})
    assert found.duration == 5.0
    assert [(chart.title, chart.unit) for chart in found.charts] == [("height", "m"), ("speed", "m"), ("speed", "km/h")]
    assert [(own.name, own.colour, own.pattern) for own in found.charts[0].series] == [
        ("a", vehicle_colour(0), 0), ("b", vehicle_colour(1), 0), ("b: estimate", vehicle_colour(1), 1),
    ]  # fmt: skip
    assert found.charts[1].bounds == [3.0]


def test_runs_over_different_grounds_are_refused() -> None:
    flat, tilted = (HeightField(z, 10.0) for z in (np.zeros((3, 3)), np.eye(3)))
    with pytest.raises(ArgumentError, match="different grounds"):
        side_by_side({"a": replace(scene(0.0), ground=flat), "b": replace(scene(1.0), ground=tilted)})
    together = side_by_side({"a": replace(scene(0.0), ground=flat), "b": replace(scene(1.0), ground=flat)})
    assert together.ground is flat
