"""Maps of ROS and walls traced from cells."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.map_file import load_map, map_digest
from mathnavi.models.field.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mathnavi.models.field.ros_map import read_ros_map, ros_map_files
from mathnavi.models.field.scan_map import grid_of_scans
from mathnavi.models.field.tracing import traced

from .walls import FURNISHED

TEXT = """image: map.pgm
resolution: 0.5  # m
origin: [-1.0, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
PIXELS = np.array([[0, 0, 0, 0], [0, 254, 205, 0], [0, 254, 254, 0], [0, 0, 0, 0]], dtype=np.uint8)


def ros_map(folder: Path, text: str = TEXT, pixels: Array = PIXELS, name: str = "map.pgm") -> Path:
    Image.fromarray(pixels).save(folder / name)
    path = folder / "map.yaml"
    path.write_text(text)
    return path


def round_room(resolution: float = 0.05) -> OccupancyGrid:
    """A round room with a slanted block and specks."""
    y, x = np.mgrid[-60:60, -60:60] * resolution
    solid = (x**2 + y**2 > 2.8**2) | ((np.abs(y - 0.6 * x) < 0.2) & (np.abs(x) < 1.0))
    cells = np.where(solid, OCCUPIED, FREE).astype(np.uint8)
    cells[20:100:9, 85:100:5] = UNKNOWN
    return OccupancyGrid(cells, resolution, (-3.0, -3.0, 0.0))


def test_a_map_of_ros_has_its_lowest_row_at_its_origin(tmp_path: Path) -> None:
    grid = read_ros_map(ros_map(tmp_path))
    assert grid.cells.tolist() == [[1, 1, 1, 1], [1, 0, 0, 1], [1, 0, 2, 1], [1, 1, 1, 1]]
    walls = traced(grid, 0.0).walls
    assert walls.area == pytest.approx(3 * 0.25)
    assert walls.contains(np.array([0.25 - 0.5 + 0.1, 3.25]))
    assert not walls.contains(np.array([0.25, 3.25]))  # the unknown cell
    assert traced(grid, 0.0, unknown_is_free=True).walls.area == pytest.approx(1.0)
    assert load_map(tmp_path / "map.yaml").area == pytest.approx(0.75, abs=0.3)


@pytest.mark.parametrize(
    ("text", "pixels"),
    [
        (TEXT.replace("negate: 0", "negate: 1"), 255 - PIXELS),
        (TEXT + "mode: raw\n", np.where(PIXELS == 0, 100, np.where(PIXELS == 254, 0, 255)).astype(np.uint8)),
        (TEXT + "mode: scale\n", PIXELS),
    ],
)
def test_negated_raw_and_scaled_maps_say_the_same(tmp_path: Path, text: str, pixels: Array) -> None:
    expected = read_ros_map(ros_map(tmp_path)).cells.tolist()
    assert read_ros_map(ros_map(tmp_path, text, pixels)).cells.tolist() == expected


def test_yaw_turns_the_map_about_its_origin(tmp_path: Path) -> None:
    path = ros_map(tmp_path, TEXT.replace("[-1.0, 2.0, 0.0]", f"[1.0, 1.0, {math.pi / 2.0!r}]"))
    low = traced(read_ros_map(path), 0.0).walls.polyline.min(axis=0)
    np.testing.assert_allclose(low, [-0.5, 1.5], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TEXT.replace("resolution: 0.5", "resolution: fine"), "resolution = 'fine'; allowed: a finite number"),
        (TEXT.replace("0.5 ", "-0.5 "), "resolution = -0.5; allowed"),
        (TEXT.replace(", 0.0]", "]"), r"origin = '\[-1.0, 2.0\]'; allowed"),
        (TEXT.replace("negate: 0", "negate: 2"), "negate = '2'; allowed: 0 or 1"),
        (TEXT.replace("0.196", "0.7"), "free_thresh = 0.7 > occupied_thresh = 0.65"),
        (TEXT.replace("0.65", "1.5"), "occupied_thresh = 1.5; allowed: 0 to 1"),
        (TEXT + "mode: fancy\n", "mode = 'fancy'; allowed: trinary, scale, raw"),
        (TEXT + "negate: 0\n", "line 7: negate is there twice"),
        (TEXT + "colour: 3\n", "line 7: colour is not known"),
        (TEXT + "nonsense\n", "line 7: 'nonsense' is no entry"),
        (TEXT.replace("negate: 0\n", ""), "negate is missing"),
        (TEXT.replace("map.pgm", "map.bmp"), "image = 'map.bmp'; allowed: a .png or .pgm file"),
    ],
)
def test_a_malformed_map_is_refused_by_its_entry(tmp_path: Path, text: str, said: str) -> None:
    path = ros_map(tmp_path)
    path.write_text(text)
    with pytest.raises(FieldError, match=said):
        read_ros_map(path)


def test_a_map_without_free_cells_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="no free cells"):
        load_map(ros_map(tmp_path, pixels=np.zeros((3, 3), np.uint8)))


def test_the_digest_of_a_map_changes_with_its_picture(tmp_path: Path) -> None:
    before = map_digest(str(ros_map(tmp_path)))
    assert map_digest(str(ros_map(tmp_path, pixels=PIXELS[::-1].copy()))) != before


def test_rays_in_the_traced_cells_end_where_a_cell_is_not_free() -> None:
    grid = round_room()
    found, rng = traced(grid, 0.0, 0.0), np.random.default_rng(1)
    assert found.closed == found.holes_left_out == 0
    walls = found.walls
    for _ in range(60):
        pose = walls.draw(rng, 0.01)
        rho = walls.ranges(pose, np.zeros(1))[0][0]
        e = np.array([math.cos(pose[2]), math.sin(pose[2])])
        steps = np.array([rho * share for share in (0.2, 0.5, 0.9)] + [rho + 1e-6])
        at = ((pose[:2] + steps[:, None] * e + 3.0) / grid.resolution).astype(int)
        assert (grid.cells[at[:3, 1], at[:3, 0]] == FREE).all()
        assert grid.cells[at[3, 1], at[3, 0]] != FREE


@pytest.mark.parametrize("deviation", [0.05, 0.12])
def test_simplified_walls_stay_within_the_deviation(deviation: float) -> None:
    exact, simple = traced(round_room(), 0.0), traced(round_room(), deviation)
    assert simple.deviation <= deviation
    assert len(simple.walls.segments) < 0.5 * len(exact.walls.segments)
    far = max(simple.walls.distance(corner) for corner in exact.walls.polyline[::7])
    assert far <= deviation + 1e-12


def test_cells_that_touch_by_a_corner_are_parted() -> None:
    cells = np.full((7, 7), OCCUPIED, dtype=np.uint8)
    cells[1:6, 1:6] = FREE
    cells[2, 3] = cells[3, 2] = OCCUPIED
    found = traced(OccupancyGrid(cells, 1.0), 0.0, 0.0)
    assert found.closed == 1
    assert found.walls.area == 5 * 5 - 2 - 1


def test_scans_of_a_room_become_its_walls(tmp_path: Path) -> None:
    rng, angles = np.random.default_rng(0), np.linspace(-math.pi, math.pi, 360, endpoint=False)
    poses = np.array([FURNISHED.draw(rng, 0.2) for _ in range(120)])
    ranges = np.array([FURNISHED.ranges(pose, angles)[0] for pose in poses])
    ranges[:, ::50] = 81.0  # without an echo
    found = traced(grid_of_scans(poses, angles, ranges, longest=80.0))
    assert found.walls.area == pytest.approx(FURNISHED.area, rel=0.03)
    assert len(found.walls.rings) == len(FURNISHED.rings)
    for corner in found.walls.polyline:
        assert FURNISHED.distance(corner) < 0.12
    text, pixels = ros_map_files(grid_of_scans(poses, angles, ranges, longest=80.0), "map.png")
    again = read_ros_map(ros_map(tmp_path, text, np.ascontiguousarray(pixels), "map.png"))
    assert traced(again).walls.rings == found.walls.rings
