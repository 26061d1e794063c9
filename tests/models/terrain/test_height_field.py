"""Input that a height field refuses, and invariants that it keeps."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest

from mathnavi.models.terrain.height_field import HeightField


@pytest.mark.parametrize(
    ("z", "spacing", "message"),
    [
        (np.zeros(4), 1.0, r"shape \(4,\)"),
        (np.zeros((2, 2, 2)), 1.0, r"shape \(2, 2, 2\)"),
        (np.zeros((1, 5)), 1.0, r"shape \(1, 5\)"),
        ([[0.0, 1.0], [2.0]], 1.0, "not a rectangle"),
        ([["a", "b"], ["c", "d"]], 1.0, "not a rectangle of numbers"),
        ([[0.0, 1.0], [math.nan, 2.0]], 1.0, "1 heights are not finite, the first is nan at row 1, column 0"),
        ([[0.0, math.inf], [0.0, -math.inf]], 1.0, "2 heights are not finite, the first is inf at row 0, column 1"),
        (np.zeros((2, 2)), 0.0, r"spacing is 0\.0 m"),
        (np.zeros((2, 2)), -3.0, r"spacing is -3\.0 m"),
        (np.zeros((2, 2)), math.nan, "spacing is nan m"),
    ],
)
def test_a_bad_height_field_names_its_culprit(z: Any, spacing: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        HeightField(z, spacing)


def test_heights_are_a_read_only_copy() -> None:
    z = np.zeros((3, 4))
    terrain = HeightField(z, 10)
    z[:] = 5.0
    assert terrain.z.dtype == np.float64
    assert terrain.z.max() == 0.0
    with pytest.raises(ValueError, match="read-only"):
        terrain.z[0, 0] = 1.0


def test_a_source_and_a_licence_are_one_line_of_at_most_a_thousand_characters() -> None:
    assert HeightField(np.eye(2), 1.0, source="x" * 1000, licence="").source == "x" * 1000
    for bad in ("x" * 1001, "two\nlines", 3):
        with pytest.raises(ValueError, match="allowed: one line of at most 1000 printable characters"):
            HeightField(np.eye(2), 1.0, licence=bad)  # type: ignore[arg-type]


def test_pickling_keeps_the_heights_read_only() -> None:
    terrain = HeightField(np.eye(3), 10.0, "a", "b", "c")
    copy = pickle.loads(pickle.dumps(terrain))
    assert (copy.digest, copy.name, copy.source, copy.licence) == (terrain.digest, "a", "b", "c")
    assert not copy.z.flags.writeable


def test_a_terrain_of_a_users_own_array_shows_its_name_shape_spacing_and_heights() -> None:
    terrain = HeightField([[0.0, 10.0, 20.0], [5.0, -2.5, 30.0]], spacing=30.0, name="mine")
    table = "terrain 'mine'\n  shape           2 x 3  nodes\n  spacing            30  m\n  heights  -2.5 to 30.0  m"
    assert repr(terrain) == table
    assert "-2.5 to 30.0" in terrain._repr_html_()


def test_rows_run_north_and_columns_east() -> None:
    terrain = HeightField(np.array([[0.0, 1.0, 2.0], [10.0, 11.0, 12.0]]), 50.0)
    assert (terrain.width, terrain.depth) == (100.0, 50.0)
    assert terrain.height(100.0, 0.0) == 2.0
    assert terrain.height(0.0, 50.0) == 10.0


def test_the_digest_is_that_of_the_ground_alone() -> None:
    z = np.arange(6.0).reshape(2, 3)
    terrain = HeightField(z, 50.0)
    assert terrain.digest == HeightField(z, 50.0, name="other").digest
    assert len(terrain.digest) == 64
    others = [HeightField(z + 1e-9, 50.0), HeightField(z, 50.1), HeightField(z.reshape(3, 2), 50.0)]
    assert len({terrain.digest, *(other.digest for other in others)}) == 4


def test_the_border_belongs_to_the_map() -> None:
    terrain = HeightField(np.zeros((2, 3)), 50.0)
    inside = terrain.contains([0.0, 100.0, 100.1, -0.1, 50.0], [0.0, 50.0, 0.0, 0.0, math.nan])
    assert inside.tolist() == [True, True, False, False, False]


@pytest.mark.parametrize("call", ["arc_clearance", "line_of_sight", "visible"])
def test_a_vector_of_the_wrong_shape_is_named(call: str) -> None:
    terrain = HeightField(np.zeros((2, 2)), 50.0)
    arguments = {
        "arc_clearance": ([0.0, 0.0], [0.0] * 3, [0.0] * 3, 1.0),
        "line_of_sight": ([0.0, 0.0], [0.0] * 3),
        "visible": ([0.0, 0.0], [[0.0] * 3]),
    }[call]
    with pytest.raises(ValueError, match=r"p has shape \(2,\); allowed: \(3,\)"):
        getattr(terrain, call)(*arguments)
