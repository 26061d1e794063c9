"""The view's ground is the terrain's, its tracks are where they were flown, and bad ones are refused."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders import page
from mathnavi.renders.relief import EXAGGERATION, relief
from mathnavi.renders.terrain_view import MOST_NODES, Track, script, terrain_view
from tests.renders.reading import Page, check_stands_alone
from tests.renders.synthetic import ridges

PATH = np.column_stack([np.linspace(1e3, 9e3, 5000), np.full(5000, 4e3), np.linspace(2500.0, 2600.0, 5000)])


def drawn(*arguments: Any, **named: Any) -> dict[str, Any]:
    return Page(terrain_view(*arguments, **named)).views[0]


def heights(view: dict[str, Any]) -> np.ndarray:
    ground = view["ground"]
    packed = np.frombuffer(base64.b64decode(ground["heights"]), "<u2").reshape(ground["rows"], ground["columns"])
    return ground["low_m"] + ground["unit_m"] * packed


def test_nodes_are_the_terrains_own_to_a_tenth_of_a_metre() -> None:
    terrain = ridges()
    view = drawn(terrain, [])
    np.testing.assert_allclose(heights(view), terrain.z, atol=0.051)
    assert (view["ground"]["east_km"], view["ground"]["north_km"]) == (terrain.width / 1e3, terrain.depth / 1e3)


def test_a_large_terrain_is_drawn_with_every_second_node_and_stays_small() -> None:
    rows, columns = np.mgrid[0:513, 0:257]
    terrain = HeightField(2000.0 + 900.0 * np.sin(rows / 40.0) * np.cos(columns / 30.0), 160.0)
    view = drawn(terrain, [])
    assert max(view["ground"]["rows"], view["ground"]["columns"]) == MOST_NODES
    np.testing.assert_allclose(heights(view), terrain.z[::2, ::2], atol=0.051)
    assert len(terrain_view(terrain, [])) < 1e6


def test_great_heights_keep_the_resolution_that_sixteen_bits_have() -> None:
    z = np.linspace(-400.0, 8849.0, 64).reshape(8, 8)
    view = drawn(HeightField(z, 90.0), [])
    np.testing.assert_allclose(heights(view), z, atol=0.08)


def test_colours_are_those_of_the_relief_with_row_0_in_the_south() -> None:
    terrain = ridges(33)
    colours = np.frombuffer(base64.b64decode(drawn(terrain, [])["ground"]["colours"]), np.uint8).reshape(33, 33, 3)
    np.testing.assert_array_equal(colours[::-1], relief(terrain, 33))


def test_heights_are_as_tall_as_in_every_other_picture() -> None:
    terrain = ridges()
    scene = drawn(terrain, [Track("flown", PATH, "#ff8000")])["layout"]["scene"]
    east, up = (np.ptp(scene[f"{axis}axis"]["range"]) for axis in "xz")
    of_length = scene["aspectratio"]["x"] / (1e3 * east)
    of_height = scene["aspectratio"]["z"] / up
    assert of_height / of_length == pytest.approx(EXAGGERATION)


def test_everything_lies_inside_the_box_that_is_drawn() -> None:
    terrain = ridges()
    view = drawn(terrain, [Track("flown", PATH, "#ff8000")], radars=[(6e3, 6e3, 2000.0, 3e3)])
    low, high = view["layout"]["scene"]["zaxis"]["range"]
    for trace in view["traces"]:
        assert min(trace["z"], default=low) >= low - 0.1
        assert max(trace["z"], default=high) <= high


def test_a_track_keeps_its_ends_its_name_and_its_colour_and_is_thinned() -> None:
    view = drawn(ridges(), [Track("as <planned>", PATH, "#2166ac", dashed=True)])
    trace = next(trace for trace in view["traces"] if trace.get("name") == "as &lt;planned&gt;")
    assert (trace["line"]["color"], trace["line"]["dash"]) == ("#2166ac", "dash")
    assert len(trace["x"]) < 2000
    ends = np.array([[trace[axis][k] for axis in "xyz"] for k in (0, -1)])
    np.testing.assert_allclose(ends, PATH[[0, -1]] * [1e-3, 1e-3, 1.0], atol=1e-3)


def test_tracks_of_one_name_share_an_entry_of_the_legend() -> None:
    tracks = [Track(name, PATH, "#2166ac") for name in ("flow", "flow", "other")]
    view = drawn(ridges(), tracks)
    assert [trace["showlegend"] for trace in view["traces"] if trace.get("mode") == "lines"] == [True, False, True]


def test_places_have_names_and_radars_reach_as_far_as_they_see() -> None:
    radar = (6e3, 6e3, 2100.0, 2.5e3)
    view = drawn(ridges(), [], {"start": PATH[0], "base & camp": PATH[-1]}, [radar])
    annotations = view["layout"]["scene"]["annotations"]
    names = [annotation["text"] for annotation in annotations if annotation.get("showarrow", True)]
    assert names == ["start", "base &amp; camp"]
    assert "north" in {annotation["text"] for annotation in annotations}
    dome = next(trace for trace in view["traces"] if trace.get("name") == "radar")
    points = np.column_stack([1e3 * np.array(dome["x"]), 1e3 * np.array(dome["y"]), dome["z"]])
    np.testing.assert_allclose(np.linalg.norm(points - radar[:3], axis=1), radar[3], atol=0.2)
    assert max(dome["z"]) == pytest.approx(radar[2] + radar[3], abs=0.1)


@pytest.mark.parametrize("radars", [[], [(6e3, 6e3, 2100.0, 3.5e3)]])
@pytest.mark.parametrize("tall", [1.0, 0.02])
def test_all_that_is_drawn_fills_the_view(radars: list[tuple[float, float, float, float]], tall: float) -> None:
    terrain = HeightField(tall * ridges().z, ridges().spacing, "ridges")
    path = PATH * [1.0, 1.0, tall]
    view = drawn(terrain, [Track("flown", path, "#ff8000")], radars=radars)
    scene = view["layout"]["scene"]
    camera, ratio = scene["camera"], scene["aspectratio"]
    shown = [trace for trace in view["traces"] if trace["x"]]
    corners = [{"x": [0.0, terrain.width / 1e3], "y": [terrain.depth / 1e3] * 2, "z": terrain.z[-1, [0, -1]]}]
    labels = [{axis: [each[axis]] for axis in "xyz"} for each in scene["annotations"]]
    points = np.hstack([[each[axis] for axis in "xyz"] for each in (*shown, *corners, *labels)])
    low, high = np.array([scene[f"{axis}axis"]["range"] for axis in "xyz"]).T
    points = ((points.T - 0.5 * (low + high)) / (high - low)) * [ratio[axis] for axis in "xyz"]
    eye, centre, up = (np.array([camera[name][axis] for axis in "xyz"]) for name in ("eye", "center", "up"))
    forward = (centre - eye) / np.linalg.norm(centre - eye)
    right = np.cross(forward, up) / np.linalg.norm(np.cross(forward, up))
    depth = (points - eye) @ forward
    half = np.tan(np.pi / 8.0) * depth  # of plotly's field of view of 45 degrees
    across = (points - eye) @ right / half / (16.0 / 9.0)
    along = (points - eye) @ np.cross(right, forward) / half
    assert depth.min() > 0.0
    assert max(np.abs(across).max(), np.abs(along).max()) < 1.0
    assert max(np.ptp(across), np.ptp(along)) > 1.6


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((4, 2)), np.zeros(3)])
def test_a_track_of_another_shape_is_refused(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match="odd"):
        terrain_view(ridges(33), [Track("odd", points, "#000000")])


def test_a_track_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        terrain_view(ridges(33), [Track("lost", np.array([[0.0, 0.0, np.nan]]), "#000000")])


def test_a_page_with_a_view_stands_alone_and_no_name_ends_its_script() -> None:
    track = Track("</script><script>alert(1)</script>", PATH, "#000000")
    source = page.document("a view", terrain_view(ridges(33), [track]), script=script())
    check_stands_alone(source)
    parsed = Page(source)
    assert len(parsed.scripts) == 2
    assert len(parsed.views) == 1
    assert "JavaScript" in parsed.text
    assert len(source.encode()) < 8e6
