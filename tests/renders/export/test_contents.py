"""What is exported of a scene: meshes with normals, lines at the moments at which they change."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from mathnavi.renders.export.contents import MOST_MOMENTS, chart_names, marks_of, mesh_of, moments_of, stretches
from mathnavi.renders.scene.elements import Chart, Layer, Lines, Mark, Motion, Scene, Surface

SQUARE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
LAYER = Layer("flown", (1.0, 0.5, 0.0))


def picture() -> bytes:
    """North-west red, the rest blue."""
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[..., 2] = 255
    pixels[0, 0] = [255, 0, 0]
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


@pytest.mark.parametrize("smooth", [True, False])
def test_a_surface_keeps_its_triangles_and_gets_their_normals(smooth: bool) -> None:
    corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3]])
    mesh = mesh_of(Surface(corner, faces, (1.0, 1.0, 1.0), smooth=smooth))
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], corner[faces])
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)
    down, forward = mesh.normals[mesh.faces]
    if smooth:  # at the common edge they are those of both triangles
        np.testing.assert_allclose(down[0], [0.0, -np.sqrt(0.5), -np.sqrt(0.5)])
    else:
        np.testing.assert_allclose(down, [[0.0, 0.0, -1.0]] * 3)
        np.testing.assert_allclose(forward, [[0.0, -1.0, 0.0]] * 3)


def test_a_picture_colours_a_floor_where_it_lies() -> None:
    mesh = mesh_of(Surface(SQUARE, HALVES, (1.0, 1.0, 1.0), picture=picture(), picture_box=(0.0, 0.0, 2.0, 1.0)))
    assert mesh.colours is not None
    for place, colour in (((0.1, 0.9), [255, 0, 0]), ((1.9, 0.9), [0, 0, 255]), ((0.1, 0.1), [0, 0, 255])):
        nearest = np.argmin(np.linalg.norm(mesh.vertices[:, :2] - place, axis=1))
        assert mesh.colours[nearest].tolist() == colour
    assert (mesh.vertices[mesh.faces][:, :, 2] == 0.0).all()


def test_a_line_that_stays_has_one_moment_and_one_that_grows_ends_at_the_end() -> None:
    points, t = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)]), np.arange(5.0)
    (still,) = moments_of(Lines(LAYER, points, np.array([0, 5]), LAYER.colour), 4.0)
    assert still.t == 0.0
    np.testing.assert_array_equal(still.polylines[0], points)
    grown = list(moments_of(Lines(LAYER, points, np.array([0, 5]), LAYER.colour, times=t, cut="past"), 4.0))
    assert len(grown) == MOST_MOMENTS
    for moment in grown:
        np.testing.assert_allclose(moment.polylines[0][-1], [moment.t, 0.0, 0.0], atol=1e-9)


def test_frames_follow_each_other_with_their_opacities_and_end() -> None:
    points = np.arange(18.0).reshape(6, 3)
    lines = Lines(
        LAYER, points, np.array([0, 2, 4, 6]), LAYER.colour, frames=np.array([0, 1, 3]), starts=np.array([0.0, 1.0]),
        end=2.0, opacities=np.array([0.1, 0.2, 0.3]),
    )  # fmt: skip
    one, other, nothing = moments_of(lines, 3.0)
    assert (one.t, one.opacities) == (0.0, [0.1])
    assert (other.t, other.opacities) == (1.0, [0.2, 0.3])
    np.testing.assert_array_equal(other.polylines, points[2:].reshape(2, 2, 3))
    assert nothing.t > 2.0
    assert nothing.polylines == []


def test_what_comes_and_goes_is_shown_between_within_the_run() -> None:
    t, pos = np.zeros(1), np.zeros((1, 3))
    assert stretches(None, 4.0) == [(0.0, np.inf)]
    assert stretches(Motion(t, pos), 4.0) == [(0.0, np.inf)]
    assert stretches(Motion(t, pos, shown=((1.0, 2.0), (3.0, 9.0), (5.0, 6.0))), 4.0) == [(1.0, 2.0), (3.0, np.inf)]


def test_what_the_page_enlarges_has_a_mark() -> None:
    vehicle = Surface(SQUARE, HALVES, (1.0, 1.0, 1.0), motion="vehicle", layer=LAYER, span=12.0)
    scene = Scene("run", 1.0, (), {"vehicle": Motion(np.zeros(1), np.zeros((1, 3)))}, [vehicle, vehicle])
    (mark,) = marks_of(scene)
    assert (mark.motion, mark.colour) == ("vehicle", LAYER.colour)
    named = Mark("me", LAYER.colour, motion="vehicle")
    assert marks_of(Scene("run", 1.0, (), scene.motions, [vehicle], marks=[named])) == [named]


def test_charts_of_one_title_have_names_of_their_own() -> None:
    charts = [Chart("error", "m", []), Chart("error", "m/s", []), Chart("speed", "m/s", []), Chart("error", "m", [])]
    assert chart_names(charts) == ["error (m)", "error (m per s)", "speed", "error (m) 2"]
