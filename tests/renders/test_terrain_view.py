"""The scene's ground is the terrain's, its tracks are where they were flown, and bad ones are refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders import page
from mathnavi.renders.palette import hexadecimal
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.renders.scene.ground import NODES
from mathnavi.renders.terrain_view import Track, terrain_view
from tests.renders.reading import Page, check_identifiers, check_stands_alone, lines_named
from tests.renders.synthetic import ridges

PATH = np.column_stack([np.linspace(1e3, 9e3, 5000), np.full(5000, 4e3), np.linspace(2500.0, 2600.0, 5000)])
ASPECT = 16.0 / 9.0  # of the view in a report


def drawn(*arguments: Any, **named: Any) -> dict[str, Any]:
    return Page(terrain_view(*arguments, **named)).scenes[0]


def vertices(surface: dict[str, Any]) -> np.ndarray:
    found: np.ndarray = surface["vertices"].reshape(-1, 3)
    return found


def test_nodes_are_the_terrains_own_and_every_cell_has_two_triangles() -> None:
    terrain = ridges()
    ground = drawn(terrain, [])["surfaces"][0]
    np.testing.assert_allclose(vertices(ground)[:, 2].reshape(terrain.z.shape), terrain.z, rtol=1e-6)
    np.testing.assert_allclose(vertices(ground)[-1, :2], [terrain.width, terrain.depth])
    rows, columns = terrain.z.shape
    faces = ground["faces"].reshape(-1, 3)
    assert len(faces) == 2 * (rows - 1) * (columns - 1)
    np.testing.assert_array_equal(faces[0], [0, 1, columns + 1])
    assert faces.max() == rows * columns - 1


def test_a_large_terrain_is_drawn_with_every_second_node_and_stays_small() -> None:
    rows, columns = np.mgrid[0:513, 0:257]
    terrain = HeightField(2000.0 + 900.0 * np.sin(rows / 40.0) * np.cos(columns / 30.0), 160.0)
    ground = vertices(drawn(terrain, [])["surfaces"][0])
    np.testing.assert_allclose(ground[:, 2].reshape(NODES, -1), terrain.z[::2, ::2], rtol=1e-6)
    assert len(terrain_view(terrain, [])) < 1e6


def test_a_track_keeps_its_ends_its_name_and_its_colour_and_is_thinned() -> None:
    scene = drawn(ridges(), [Track("as <planned>", PATH, "#2166ac", dashed=True)])
    (track,) = lines_named(scene, "as <planned>")
    layer = scene["layers"][track["layer"]]
    assert (layer["name"], layer["dashed"], layer["shown"]) == ("as <planned>", True, True)
    assert hexadecimal(layer["colour"]) == "#2166ac"
    assert len(track["points"]) < 2000
    np.testing.assert_allclose(track["points"][[0, -1]], PATH[[0, -1]], atol=1e-3)


def test_tracks_of_one_name_share_an_entry_of_the_legend() -> None:
    scene = drawn(ridges(), [Track(name, PATH, "#2166ac") for name in ("flow", "flow", "other")])
    assert [layer["name"] for layer in scene["layers"]][:2] == ["flow", "other"]
    assert len(lines_named(scene, "flow")) == 2


def test_places_have_names_and_radars_reach_as_far_as_they_see() -> None:
    radar = (6e3, 6e3, 2100.0, 2.5e3)
    scene = drawn(ridges(), [], {"start": PATH[0], "base & camp": PATH[-1]}, [radar])
    names = [mark["text"] for mark in scene["marks"]]
    assert names[:2] == ["start", "base & camp"]
    assert {"north", "5 km"} <= set(names)
    dome = next(each for each in scene["surfaces"] if each["layer"] is not None)
    assert scene["layers"][dome["layer"]]["name"] == "radar"
    np.testing.assert_allclose(np.linalg.norm(vertices(dome) - radar[:3], axis=1), radar[3], atol=0.2)


@pytest.mark.parametrize("tall", [1.0, 0.02])
def test_the_map_lies_in_the_view_and_fills_it(tall: float) -> None:
    terrain = HeightField(tall * ridges().z, ridges().spacing, "ridges")
    scene = drawn(terrain, [Track("flown", PATH * [1.0, 1.0, tall], "#ff8000")])
    camera = scene["cameras"][0]
    assert camera["tall"] == EXAGGERATION  # as in every other picture of a whole map
    points = np.vstack(
        [vertices(each) for each in scene["surfaces"]] + [each["points"].reshape(-1, 3) for each in scene["lines"]]
    )
    points[:, 2] = scene["low"] + camera["tall"] * (points[:, 2] - scene["low"])
    azimuth, elevation = math.radians(camera["azimuth"]), math.radians(camera["elevation"])
    level = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    forward = math.cos(elevation) * level + np.array([0.0, 0.0, math.sin(elevation)])
    right = np.array([level[1], -level[0], 0.0])
    ahead = points - (np.array(camera["target"]) - camera["distance"] * forward)
    half = math.tan(math.radians(camera["field_of_view"]) / 2.0) * (ahead @ forward)
    across, along = ahead @ right / half / ASPECT, ahead @ np.cross(right, forward) / half
    assert half.min() > 0.0
    assert max(np.abs(across).max(), np.abs(along).max()) < 1.0
    assert max(np.ptp(across), np.ptp(along)) > 1.6


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((4, 2)), np.zeros(3)])
def test_a_track_of_another_shape_is_refused(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match="odd"):
        terrain_view(ridges(33), [Track("odd", points, "#000000")])


def test_a_track_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        terrain_view(ridges(33), [Track("lost", np.array([[0.0, 0.0, np.nan]]), "#000000")])


def test_a_page_with_a_scene_stands_alone_and_no_name_ends_its_script() -> None:
    track = Track("</script><script>alert(1)</script>", PATH, "#000000")
    source = page.document("a view", terrain_view(ridges(33), [track]))
    check_stands_alone(source)
    check_identifiers(source)
    parsed = Page(source)
    assert len(parsed.scripts) == 2
    assert len(parsed.scenes) == 1
    assert "JavaScript" in parsed.text
    assert len(source.encode()) < 1e6
