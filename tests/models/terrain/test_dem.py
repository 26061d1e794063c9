"""Readers of elevation models: what goes in comes out, and every bad file names its culprit."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import map_coordinates

from mathnavi.models.terrain.dem import read_npz, write_npz
from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.ellipsoid import WGS84
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.raster import Raster
from mathnavi.models.terrain.raster_file import read_raster
from mathnavi.models.terrain.resampling import square_grid


def save_npz(path: Path, z: Any, meta: Any) -> Path:
    np.savez(path, z=z, meta=np.array(meta if isinstance(meta, str) else json.dumps(meta)))
    return path


def save_png(path: Path, values: NDArray[Any]) -> Path:
    Image.fromarray(values).save(path)
    return path


def save_hgt(path: Path, values: NDArray[Any]) -> Path:
    values.astype(">i2").tofile(path)
    return path


@pytest.fixture
def heights() -> NDArray[np.float64]:
    """(5, 7) whole metres, row 0 south, no symmetry."""
    return np.random.default_rng(0).integers(0, 3000, (5, 7)).astype(np.float64)


@pytest.mark.honoured("DEM", ".npz: z, spacing_m, name, source, licence")
def test_an_npz_comes_back_as_it_was_written(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    terrain = HeightField(heights + 0.25, 92.5, "hills", "me", "CC0")
    write_npz(terrain, tmp_path / "a.npz")
    back = read_npz(tmp_path / "a.npz")
    assert back.digest == terrain.digest  # quarters of a metre are exact in float32
    assert (back.name, back.source, back.licence) == ("hills", "me", "CC0")
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_an_npz_without_a_name_bears_that_of_its_file(tmp_path: Path) -> None:
    assert read_npz(save_npz(tmp_path / "dunes.npz", np.zeros((2, 3), np.float32), {"spacing_m": 5})).name == "dunes"


@pytest.mark.refused("DEM", ".npz: meta or z that is malformed, pickled objects")
@pytest.mark.parametrize(
    ("z", "meta", "message"),
    [
        (np.zeros((2, 3)), {}, r"meta: \$.spacing_m is missing"),
        (np.zeros((2, 3)), [1], r"meta: \$ = \[1\]; allowed: an object"),
        (np.zeros((2, 3)), "{spacing", "meta is not JSON"),
        (np.zeros((2, 3)), {"spacing_m": "5"}, r"\$.spacing_m = '5'; allowed: float"),
        (np.zeros((2, 3)), {"spacing_m": True}, r"\$.spacing_m = True"),
        (np.zeros((2, 3)), {"spacing_m": 0}, r"\$.spacing_m = 0\.0; allowed: a finite value > 0"),
        (np.zeros((2, 3)), {"spacing_m": -2.5}, r"\$.spacing_m = -2\.5"),
        (np.zeros((2, 3)), {"spacing_m": 5, "name": 3}, r"\$.name = 3; allowed: str"),
        (np.zeros(6), {"spacing_m": 5}, r"z has shape \(6,\)"),
        (
            np.array([[1.0, np.nan]] * 2),
            {"spacing_m": 5},
            "2 heights are not finite, the first is nan at row 0, column 1",
        ),
        (np.array([["a"]]), {"spacing_m": 5}, "z has the type <U1"),
        (np.zeros((2, 3), bool), {"spacing_m": 5}, "z has the type bool"),
        (np.array([[1, None]], dtype=object), {"spacing_m": 5}, "'z' has the type object"),
    ],
)
def test_a_bad_npz_names_its_culprit(tmp_path: Path, z: Any, meta: Any, message: str) -> None:
    path = save_npz(tmp_path / "bad.npz", z, meta)
    with pytest.raises(ValueError, match=message) as caught:
        read_npz(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.refused("DEM", ".npz: no z, no meta")
@pytest.mark.parametrize("missing", ["z", "meta"])
def test_an_npz_without_a_part_names_it(tmp_path: Path, missing: str) -> None:
    parts = {"z": np.zeros((2, 2)), "meta": np.array('{"spacing_m": 1}')}
    del parts[missing]
    np.savez(tmp_path / "bad.npz", **parts)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=f"{missing} is missing"):
        read_npz(tmp_path / "bad.npz")


@pytest.mark.refused("DEM", ".npz: damaged")
def test_a_file_that_is_no_npz_or_cut_off_or_a_bare_array_is_refused(
    tmp_path: Path, heights: NDArray[np.float64]
) -> None:
    write_npz(HeightField(heights, 10.0), tmp_path / "a.npz")
    whole, bare = (tmp_path / "a.npz").read_bytes(), io.BytesIO()
    np.save(bare, np.zeros((2, 2)))
    cut = whole[: len(whole) // 2]
    for content in (b"", b"PK\x03\x04 cut off", b"hello", b"\x93NUMPY\x01\x00", cut, bare.getvalue()):
        (tmp_path / "bad.npz").write_bytes(content)
        with pytest.raises(ValueError, match=r"not a readable \.npz"):
            read_npz(tmp_path / "bad.npz")


@pytest.mark.parametrize("name", ["none.npz", "none.png", "N42E080.hgt", "none.tif"])
def test_a_file_that_is_not_there_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileNotFoundError, match=name):
        import_dem(tmp_path / name, tmp_path / "out.npz", spacing=1.0, scale=1.0)


@pytest.mark.honoured("DEM", ".png: 16-bit grey")
def test_a_png_is_flipped_and_scaled(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    path = save_png(tmp_path / "a.png", heights[::-1].astype(np.uint16))
    terrain = import_dem(path, tmp_path / "out.npz", spacing=25.0, scale=0.5)
    np.testing.assert_array_equal(terrain.z, 0.5 * heights)
    assert terrain.spacing == 25.0
    assert terrain.digest == read_npz(tmp_path / "out.npz").digest


GREY, MAP, TILE = np.zeros((3, 3), np.uint16), np.zeros((5, 7), np.uint16), np.zeros((1201, 1201), np.int16)
VOID = np.where(np.arange(1201)[:, None] > 0, -32768, TILE)
PNG: dict[str, Any] = {"spacing": 10.0, "scale": 1.0}


@pytest.mark.refused("DEM", ".png: 8 bits, colours")
@pytest.mark.refused("DEM", ".png: no --spacing, no --scale")
@pytest.mark.refused("DEM", ".hgt: another number of nodes")
@pytest.mark.refused("DEM", ".hgt: no corner in the name")
@pytest.mark.refused("DEM", "an ending that is not known")
@pytest.mark.parametrize(
    ("name", "content", "options", "message"),
    [
        ("a.png", GREY, {"scale": 1.0}, "needs both spacing"),
        ("a.png", GREY, {"spacing": 1.0}, "needs both spacing"),
        ("a.png", GREY, PNG | {"spacing": 0.0}, r"spacing is 0\.0 m"),
        ("a.png", GREY, PNG | {"spacing": math.nan}, "spacing is nan m"),
        ("a.png", GREY, PNG | {"scale": -1.0}, r"scale is -1\.0 m per unit"),
        ("a.png", GREY, PNG | {"scale": 1e308}, r"scale is 1e\+308 m per unit; allowed: .* at most 1e\+06"),
        ("a.png", GREY.astype(np.uint8), PNG, "allowed: 16-bit grey"),
        ("a.png", np.zeros((3, 3, 3), np.uint8), PNG, "allowed: 16-bit grey"),
        ("a.png", MAP, PNG | {"crop": (-20.0, 0.0, 30.0, 30.0)}, r"crop = .*; allowed: within 0 0 60 40"),
        ("a.png", MAP, PNG | {"crop": (0.0, 0.0, 70.0, 30.0)}, r"crop = .*; allowed: within 0 0 60 40"),
        ("a.png", MAP, PNG | {"crop": (0.0, 0.0, 30.0, 50.0)}, r"crop = .*; allowed: within 0 0 60 40"),
        ("a.png", MAP, PNG | {"crop": (30.0, 0.0, 0.0, 30.0)}, r"crop = .*; allowed: within 0 0 60 40"),
        ("a.png", MAP, PNG | {"crop": (0.0, math.nan, 30.0, 30.0)}, r"crop = .*; allowed: within 0 0 60 40"),
        ("a.png", MAP, PNG | {"crop": (0.0, 0.0, math.inf, 30.0)}, r"crop = .*; allowed: within 0 0 60 40"),
        ("a.npz", MAP, {"crop": (11.0, 0.0, 19.0, 40.0)}, "crop = 11 0 19 40: 5 x 0 nodes of a; allowed: at least 2 x"),
        ("a.npz", MAP, {"resample": 41.0}, r"resample = 41\.0 m leaves 1 x 2 nodes of a"),
        ("N00E006.hgt", b"", {}, "0 bytes are not a whole tile"),
        ("N00E006.hgt", bytes(2 * 1201**2 - 2), {}, f"{2 * 1201**2 - 2} bytes are not a whole tile"),
        ("N00E006.hgt", bytes(2 * 1201 * 1200), {}, f"{2 * 1201 * 1200} bytes are not a whole tile"),
        ("N00E006.hgt", bytes(2 * 1000**2), {}, "2000000 bytes are not a whole tile"),
        ("N00E006.hgt", VOID, {"fill": True}, r"\d+ voids are more than 100 nodes from any height"),
        ("mountains.hgt", TILE, {}, "the name must state the south-west corner"),
        ("a.xyz", b"1 2 3", {}, r"the ending '\.xyz' is not known; allowed: \.png, \.npz, \.tif"),
        ("a.asc", b"ncols 3", {}, r"a\.asc: not a readable \.asc file"),
    ],
)  # fmt: skip
def test_what_is_no_map_is_refused(
    tmp_path: Path, name: str, content: NDArray[Any] | bytes, options: dict[str, Any], message: str
) -> None:
    path = tmp_path / name
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif path.suffix == ".npz":
        save_npz(path, content, {"spacing_m": 10.0})
    else:
        {".png": save_png, ".hgt": save_hgt}[path.suffix](path, content)
    with pytest.raises(ValueError, match=message):
        import_dem(path, tmp_path / "out.npz", **options)
    assert not (tmp_path / "out.npz").exists()


@pytest.mark.refused("DEM", ".png: truncated")
def test_a_picture_cut_off_is_refused(tmp_path: Path) -> None:
    values = np.random.default_rng(0).integers(0, 60000, (64, 64)).astype(np.uint16)
    path = save_png(tmp_path / "a.png", values)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(ValueError, match=r"a\.png"):
        import_dem(path, tmp_path / "out.npz", spacing=1.0, scale=1.0)
    assert not (tmp_path / "out.npz").exists()


@pytest.mark.honoured("DEM", ".hgt: corner in the name, nodes on the borders")
def test_an_hgt_tile_is_flipped_and_brought_to_square_metres(tmp_path: Path) -> None:
    north, east = WGS84.metres_per_degree(42.5)
    row, column = np.mgrid[0:1201, 0:1201]
    values = 1000 + row - 2 * column // 3  # row 0 is north
    terrain = import_dem(save_hgt(tmp_path / "N42E080.hgt", values), tmp_path / "out.npz", resample=500.0)
    assert terrain.spacing == 500.0
    assert terrain.width == pytest.approx(east, abs=500.0)
    assert terrain.depth == pytest.approx(north, abs=500.0)
    assert terrain.z[0, 0] == values[-1, 0]
    x, y = 30_000.0, 80_000.0
    expected = 1000 + 1200 * (1.0 - y / north) - 2 / 3 * 1200 * x / east
    assert float(terrain.height(x, y)) == pytest.approx(expected, abs=1.0)  # the tile holds whole metres


def test_the_spacing_of_an_hgt_tile_follows_from_the_latitude_in_its_name(tmp_path: Path) -> None:
    values = np.zeros((1201, 1201))
    for name, latitude in (("N00E006.hgt", 0.5), ("s34w071.hgt", -33.5), ("N59E018.hgt", 59.5)):
        terrain = import_dem(save_hgt(tmp_path / name, values), tmp_path / "out.npz")
        assert terrain.spacing == pytest.approx(min(WGS84.metres_per_degree(latitude)) / 1200, rel=1e-5)
        assert max(terrain.z.shape) >= 1201


def test_metres_per_degree_are_those_of_the_ellipsoid() -> None:
    # NGA's table of the length of a degree (WGS84): latitude, north, east.
    for latitude, north, east in ((0.0, 110574.3, 111319.5), (45.0, 111131.8, 78846.8), (60.0, 111412.2, 55800.0)):
        assert WGS84.metres_per_degree(latitude) == pytest.approx((north, east), abs=0.5)


@pytest.mark.honoured("DEM", ".hgt: -32768 as a void")
def test_voids_are_counted_and_the_first_is_placed(tmp_path: Path) -> None:
    values = np.zeros((1201, 1201))
    values[1200, 7] = values[1100, 900] = -32768  # the last row is south
    path = save_hgt(tmp_path / "N00E006.hgt", values)
    assert np.isnan(read_raster(path).z).sum() == 2
    with pytest.raises(
        ValueError, match=r"\d+ heights are void or NaN, the first at row 0 from the south, column [67]"
    ):
        import_dem(path, tmp_path / "out.npz")
    assert not (tmp_path / "out.npz").exists()
    assert (
        import_dem(path, tmp_path / "out.npz", crop=(6.1, 0.3, 6.2, 0.4)).z.shape[0] == 121
    )  # voids outside do no harm


def test_a_crop_of_a_picture_is_in_metres_from_the_south_west(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    path = save_png(tmp_path / "a.png", heights[::-1].astype(np.uint16))
    terrain = import_dem(path, tmp_path / "out.npz", spacing=10.0, scale=1.0, crop=(20.0, 10.0, 40.0, 30.0))
    np.testing.assert_array_equal(terrain.z, heights[1:4, 2:5])


def test_a_crop_of_an_hgt_tile_is_in_degrees(tmp_path: Path) -> None:
    row, column = np.mgrid[0:1201, 0:1201]
    path = save_hgt(tmp_path / "S34W071.hgt", 2 * row + column)  # row 0 is north
    terrain = import_dem(path, tmp_path / "out.npz", crop=(-70.5, -33.75, -70.25, -33.5))
    north, east = WGS84.metres_per_degree(-33.625)  # of the part, not of the tile
    assert terrain.z.shape == (1 + int(300 * north / east), 301)
    assert terrain.spacing == pytest.approx(east / 1200)
    assert terrain.z[0, 0] == pytest.approx(2 * 900 + 600, abs=1e-3)
    assert terrain.z[-1, 0] == pytest.approx(2 * 600 + 600, abs=2.0)


def test_voids_are_filled_from_the_heights_around_them_and_counted(tmp_path: Path) -> None:
    row, column = np.mgrid[0:1201, 0:1201]
    values = 1000 + row - 2 * (column // 2)
    values[500:506, 700:703] = -32768
    path = save_hgt(tmp_path / "N00E006.hgt", values)
    box = (6.5, 0.5, 6.65, 0.65)
    terrain = import_dem(path, tmp_path / "out.npz", fill=True, crop=box)
    assert "18 of 32761 heights (0.055 %) were void and filled from those around" in terrain.source
    whole = save_hgt(tmp_path / "N00E007.hgt", np.where(values == -32768, 1000 + row - 2 * (column // 2), values))
    truth = import_dem(whole, tmp_path / "whole.npz", crop=(7.5, 0.5, 7.65, 0.65))
    assert np.abs(terrain.z - truth.z).max() < 6.0  # as far as the ground falls across the void
    assert (terrain.z == truth.z).mean() > 0.999  # what the file has stays as it is
    assert "void" not in truth.source


def test_an_npz_can_be_resampled_but_not_scaled(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    path = save_npz(tmp_path / "a.npz", heights, {"spacing_m": 10.0, "licence": "CC0"})
    coarse = import_dem(path, tmp_path / "out.npz", resample=20.0)
    np.testing.assert_array_equal(coarse.z, heights[::2, ::2])
    assert (coarse.name, coarse.licence) == ("a", "CC0")
    with pytest.raises(ValueError, match=r"scale is 2\.0"):
        import_dem(path, tmp_path / "out.npz", scale=2.0)
    with pytest.raises(ValueError, match=r"spacing is 20\.0; .* --resample"):
        import_dem(path, tmp_path / "out.npz", spacing=20.0)


def test_the_output_must_be_an_npz_in_a_folder_that_exists(tmp_path: Path) -> None:
    terrain = HeightField(np.zeros((2, 2)), 1.0)
    with pytest.raises(ValueError, match=r"written as \.npz"):
        write_npz(terrain, tmp_path / "out.png")
    with pytest.raises(FileNotFoundError, match=r"the folder .* does not exist"):
        write_npz(terrain, tmp_path / "none" / "out.npz")


def test_a_failed_write_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_npz(HeightField(np.zeros((2, 2)), 1.0), tmp_path / "out.npz")
    before = (tmp_path / "out.npz").read_bytes()

    def full_disc(file: Any, **arrays: Any) -> None:
        file.write(b"half")
        raise OSError("no space left on device")

    save: Callable[..., None] = full_disc
    monkeypatch.setattr(np, "savez_compressed", save)
    with pytest.raises(OSError, match="no space"):
        write_npz(HeightField(np.ones((2, 2)), 1.0), tmp_path / "out.npz")
    assert (tmp_path / "out.npz").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["out.npz"]


@given(rows=st.integers(3, 30), columns=st.integers(3, 30), spacing=st.floats(25.0, 170.0))
def test_resampled_heights_have_the_bits_of_scipys(rows: int, columns: int, spacing: float) -> None:
    """A node next to a void is void; the raster's edge is not passed."""
    z = np.random.default_rng(rows * columns).uniform(0.0, 3000.0, (rows, columns))
    z[rows // 2, columns // 3] = np.nan
    found = square_grid(Raster("raster", z, 100.0, 90.0), spacing).z
    row = np.minimum(np.arange(found.shape[0]) * (spacing / 100.0), rows - 1)
    column = np.minimum(np.arange(found.shape[1]) * (spacing / 90.0), columns - 1)
    expected = map_coordinates(z, np.meshgrid(row, column, indexing="ij"), order=1, mode="nearest")
    np.testing.assert_array_equal(found, expected)
