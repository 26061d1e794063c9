"""GeoTIFFs: each is brought to the ground it shows, and what cannot be is refused by its name."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.transform import Affine, from_origin
from rasterio.warp import transform

from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.ellipsoid import WGS84 as ELLIPSOID
from mathnavi.models.terrain.height_field import HeightField

UTM, FEET, WEB_MERCATOR, WGS84 = "EPSG:32644", "EPSG:2263", "EPSG:3857", "EPSG:4326"
CORNER = from_origin(5e5, 4.7e6, 30.0, 30.0)  # the north-west corner, on the meridian of UTM's zone


def save(path: Path, values: NDArray[Any], crs: str | None = UTM, place: Affine | None = CORNER, **more: Any) -> Path:
    """Write ``values`` (rows, cols), row 0 north; ``units``, ``scales`` and ``offsets`` are the band's."""
    band = {name: more.pop(name) for name in ("units", "scales", "offsets") if name in more}
    bands = values if values.ndim == 3 else values[None]
    count, height, width = bands.shape
    profile = {"driver": "GTiff", "count": count, "height": height, "width": width, "dtype": values.dtype}
    with (
        warnings.catch_warnings(action="ignore"),
        rasterio.open(path, "w", crs=crs, transform=place, **profile, **more) as dataset,
    ):
        dataset.write(bands)
        for name, value in band.items():
            setattr(dataset, name, (value,))
    return path


def sampled(crs: str, place: Affine, shape: tuple[int, int]) -> NDArray[np.float32]:
    """The plane ``ground`` at the centres of a picture's pixels."""
    column, row = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    x = place.a * column.ravel() + place.b * row.ravel() + place.c
    y = place.d * column.ravel() + place.e * row.ravel() + place.f
    longitude, latitude = np.array(transform(crs, WGS84, list(x), list(y)))
    return ground(longitude, latitude).reshape(shape).astype(np.float32)


def ground(longitude: Any, latitude: Any) -> Any:
    """Height [m], a plane over degrees."""
    return 500.0 + 4000.0 * (longitude - 81.0) + 9000.0 * (latitude - 42.4)


def check_ground(terrain: HeightField, tolerance: float) -> None:
    """Slope of the map along its axes: that of ``ground`` in metres."""
    north, east = ELLIPSOID.metres_per_degree(42.44)
    rise_north, rise_east = np.diff(terrain.z, axis=0).mean(), np.diff(terrain.z, axis=1).mean()
    assert rise_north == pytest.approx(9000.0 / north * terrain.spacing, rel=tolerance)
    assert rise_east == pytest.approx(4000.0 / east * terrain.spacing, rel=tolerance)


@pytest.fixture
def heights() -> NDArray[np.float64]:
    """(5, 7) whole metres, row 0 south, no symmetry."""
    return np.random.default_rng(0).integers(0, 3000, (5, 7)).astype(np.float64)


@pytest.mark.honoured("DEM", "projection in metres")
def test_a_projected_picture_is_taken_as_it_is(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    terrain = import_dem(save(tmp_path / "a.tif", heights[::-1].astype(np.uint16)), tmp_path / "out.npz")
    np.testing.assert_array_equal(terrain.z, heights)
    assert terrain.spacing == 30.0


@pytest.mark.honoured("DEM", "pixels that are not square")
def test_a_projected_picture_is_resampled_to_the_distance_asked_for(tmp_path: Path) -> None:
    plane = np.add.outer(3.0 * np.arange(11.0), 5.0 * np.arange(21.0)).astype(np.float32)  # per 30 m north, 15 m east
    path = save(tmp_path / "a.tiff", plane[::-1], place=from_origin(5e5, 4.7e6, 15.0, 30.0))
    assert import_dem(path, tmp_path / "out.npz").z.shape == (21, 21)  # its smaller step
    terrain = import_dem(path, tmp_path / "out.npz", resample=20.0)
    assert (terrain.width, terrain.depth) == (300.0, 300.0)
    assert float(terrain.height(140.0, 100.0)) == pytest.approx(3.0 * 100.0 / 30.0 + 5.0 * 140.0 / 15.0, abs=1e-4)


@pytest.mark.honoured("DEM", "coordinate system in degrees")
def test_a_geographic_picture_is_brought_to_metres(tmp_path: Path) -> None:
    step = 1.0 / 1200
    path = save(
        tmp_path / "a.tif", np.zeros((61, 61), np.int16), WGS84, from_origin(80.0, 42.5 + 30.5 * step, step, step)
    )
    terrain = import_dem(path, tmp_path / "out.npz")
    north, east = ELLIPSOID.metres_per_degree(42.5)
    assert terrain.spacing == pytest.approx(step * east, rel=1e-9)
    assert terrain.depth == pytest.approx(60 * step * north, abs=terrain.spacing)


@pytest.mark.honoured("DEM", "rotated transform")
@pytest.mark.parametrize("crs", [UTM, WGS84])
def test_a_rotated_picture_shows_the_same_ground(tmp_path: Path, crs: str) -> None:
    size = 30.0 if crs == UTM else 30.0 / 111_000.0
    x, y = (5e5, 4.7e6) if crs == UTM else (81.0, 42.45)
    cosine, sine = size * math.cos(0.35), size * math.sin(0.35)
    place = Affine(cosine, sine, x, sine, -cosine, y)
    path = save(tmp_path / "a.tif", sampled(crs, place, (120, 150)), crs, place)
    with pytest.raises(ValueError, match="heights are void or NaN"):  # the corners around it
        import_dem(path, tmp_path / "out.npz")
    # A square within the picture, about its centre.
    x, y = place.a * 75.0 + place.b * 60.0 + place.c, place.d * 75.0 + place.e * 60.0 + place.f
    half = 25 * size
    terrain = import_dem(path, tmp_path / "out.npz", crop=(x - half, y - half, x + half, y + half))
    check_ground(terrain, 2e-3)
    longitude, latitude = (np.array(part) for part in transform(crs, WGS84, [x], [y]))
    middle = float(terrain.height(0.5 * terrain.width, 0.5 * terrain.depth))
    assert middle == pytest.approx(float(ground(longitude, latitude)[0]), abs=2.0)  # of 2.7 m a node


@pytest.mark.honoured("DEM", "projection that stretches lengths")
def test_a_projection_that_stretches_lengths_is_undone(tmp_path: Path) -> None:
    (x,), (y,) = transform(WGS84, WEB_MERCATOR, [81.0], [42.45])
    place = from_origin(x, y, 40.0, 40.0)  # 40 m of Web Mercator are 30 m of ground here
    path = save(tmp_path / "a.tif", sampled(WEB_MERCATOR, place, (80, 90)), WEB_MERCATOR, place)
    terrain = import_dem(path, tmp_path / "out.npz")
    assert terrain.spacing == pytest.approx(40.0 * math.cos(math.radians(42.45)), rel=5e-3)
    check_ground(terrain, 5e-3)


@pytest.mark.honoured("DEM", "projection in feet")
@pytest.mark.refused("DEM", "no unit of heights over coordinates in feet")
def test_a_projection_in_feet_is_brought_to_metres(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    place = from_origin(980_000.0, 200_000.0, 100.0, 100.0)  # New York
    path = save(tmp_path / "a.tif", heights[::-1], FEET, place)
    with pytest.raises(ValueError, match=r"scale is missing; no unit .* --scale 0\.3048006096 .* --scale 1 for metres"):
        import_dem(path, tmp_path / "out.npz")
    terrain = import_dem(path, tmp_path / "out.npz", scale=1.0)
    assert terrain.spacing == pytest.approx(30.48006, rel=1e-6)


FOOT, US_FOOT = 0.3048, 1200.0 / 3937.0


@pytest.mark.honoured("DEM", "unit of heights")
@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        *((name, FOOT) for name in ("foot", "ft", "feet", "Feet")),
        *((name, US_FOOT) for name in ("US survey foot", "sfoot", "ftUS", "us-ft", "US survey feet", "US_survey_foot")),
        *(("metre", 1.0), ("m", 1.0), ("meters", 1.0), ("cm", 0.01), ("dm", 0.1)),
    ],
)
def test_heights_in_another_unit_are_converted(
    tmp_path: Path, heights: NDArray[np.float64], unit: str, factor: float
) -> None:
    path = save(tmp_path / "a.tif", heights[::-1], units=unit)
    np.testing.assert_allclose(import_dem(path, tmp_path / "out.npz").z, factor * heights, rtol=1e-6)
    np.testing.assert_array_equal(import_dem(path, tmp_path / "out.npz", scale=0.5).z, 0.5 * heights)


@pytest.mark.refused("DEM", "unknown unit of heights")
def test_heights_in_an_unknown_unit_need_a_scale(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    path = save(tmp_path / "a.tif", heights[::-1], units="furlong")
    with pytest.raises(ValueError, match=r"scale is missing; heights are in 'furlong': --scale .* 0\.3048 for feet"):
        import_dem(path, tmp_path / "out.npz")


@pytest.mark.honoured("DEM", "scale and offset of the band")
def test_the_scale_and_offset_that_a_band_states_are_applied(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    path = save(tmp_path / "a.tif", heights[::-1].astype(np.int16), scales=0.25, offsets=100.0)
    np.testing.assert_array_equal(import_dem(path, tmp_path / "out.npz").z, 0.25 * heights + 100.0)


def test_a_crop_is_read_in_coordinates_of_the_projection(tmp_path: Path, heights: NDArray[np.float64]) -> None:
    path = save(tmp_path / "a.tif", heights[::-1])
    # Columns 2 to 4 and rows 1 to 3; coordinates are those of the pixels' centres.
    crop = (5e5 + 75.0, 4.7e6 - 150.0 + 45.0, 5e5 + 135.0, 4.7e6 - 150.0 + 105.0)
    np.testing.assert_array_equal(import_dem(path, tmp_path / "out.npz", crop=crop).z, heights[1:4, 2:5])
    edges = (5e5, 4.7e6 - 150.0, 5e5 + 210.0, 4.7e6)  # of the picture
    np.testing.assert_array_equal(import_dem(path, tmp_path / "out.npz", crop=edges).z, heights)


@pytest.mark.refused("DEM", "more nodes than a map may have")
def test_only_the_part_within_the_crop_counts_against_the_limit(tmp_path: Path) -> None:
    with rasterio.open(
        tmp_path / "large.tif", "w", driver="GTiff", count=1, height=6000, width=6000, dtype="int16", crs=UTM,
        transform=CORNER, sparse_ok=True, tiled=True,
    ):  # fmt: skip
        pass
    with pytest.raises(ValueError, match="36000000 nodes; allowed: at most 25000000"):
        import_dem(tmp_path / "large.tif", tmp_path / "out.npz")
    part = import_dem(tmp_path / "large.tif", tmp_path / "out.npz", crop=(5.1e5, 4.68e6, 5.11e5, 4.681e6))
    assert part.z.shape == (34, 34)


@pytest.mark.honoured("DEM", "value of voids")
@pytest.mark.honoured("DEM", "NaN as a void")
@pytest.mark.honoured("DEM", "-32768 of 16-bit numbers, without a stated value")
@pytest.mark.parametrize(
    ("dtype", "void", "stated"),
    [(np.int16, -9999.0, -9999.0), (np.int16, -32768.0, None), (np.float32, np.nan, None), (np.float64, -1e6, -1e6)],
)
def test_what_a_file_calls_no_data_is_a_void(
    tmp_path: Path, heights: NDArray[np.float64], dtype: type, void: float, stated: float | None
) -> None:
    heights[2, 3] = void
    path = save(tmp_path / "a.tif", heights[::-1].astype(dtype), nodata=stated)
    with pytest.raises(ValueError, match="1 heights are void or NaN, the first at row 2 from the south, column 3"):
        import_dem(path, tmp_path / "out.npz")
    terrain = import_dem(path, tmp_path / "out.npz", fill=True)
    assert "1 of 35 heights (2.9 %) were void" in terrain.source
    around = heights[1:4, 2:5].ravel()[[0, 1, 2, 3, 5, 6, 7, 8]]
    assert around.min() < terrain.z[2, 3] < around.max()


@pytest.mark.refused("DEM", "several bands")
@pytest.mark.refused("DEM", "complex numbers")
@pytest.mark.refused("DEM", "no coordinate system")
@pytest.mark.refused("DEM", "geocentric coordinate system")
@pytest.mark.refused("DEM", "transform without area, or off the ground")
@pytest.mark.parametrize(
    ("bands", "crs", "place", "message"),
    [
        (np.zeros((3, 3, 3), np.uint8), UTM, CORNER, "3 bands; allowed: one"),
        (np.zeros((3, 3), np.complex64), UTM, CORNER, "complex64; allowed: real numbers"),
        (np.zeros((3, 3)), None, CORNER, "no coordinate system on the ground"),
        (np.zeros((3, 3)), "EPSG:4978", CORNER, "no coordinate system on the ground"),
        (np.zeros((3, 3)), UTM, Affine(30.0, 0.0, math.nan, 0.0, -30.0, 4.7e6), "nowhere on the ground"),
        (np.zeros((3, 3)), UTM, Affine(30.0, 30.0, 5e5, 30.0, 30.0, 4.7e6), "nowhere on the ground"),
        (np.zeros((3, 3)), WEB_MERCATOR, from_origin(1e30, 1e30, 1.0, 1.0), "nowhere on the ground"),
        (np.zeros((3, 3)), WEB_MERCATOR, from_origin(0.0, 0.0, 1e-300, 1e-300), "nowhere on the ground"),
        (np.zeros((3, 3)), WGS84, from_origin(81.0, 300.0, 0.1, 0.1), "nowhere on the ground"),
    ],
)  # fmt: skip
def test_what_has_no_place_is_refused(
    tmp_path: Path, bands: NDArray[Any], crs: str | None, place: Affine, message: str
) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        import_dem(save(tmp_path / "a.tif", bands, crs, place), tmp_path / "out.npz")
    assert "a.tif" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.refused("DEM", "truncated file")
@pytest.mark.parametrize("length", [0, 5, 200, 3000])
def test_a_file_cut_off_is_refused(tmp_path: Path, length: int) -> None:
    values = np.random.default_rng(0).integers(0, 60000, (64, 64)).astype(np.uint16)
    path = save(tmp_path / "a.tif", values)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(ValueError, match=r"a\.tif: (not a readable GeoTIFF|no coordinate system)") as caught:
        import_dem(path, tmp_path / "out.npz")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out.npz").exists()


@pytest.mark.refused("DEM", "another format under the name")
def test_a_file_of_another_format_under_the_name_is_refused(tmp_path: Path) -> None:
    """rasterio reads two hundred formats, some of which name other files."""
    (tmp_path / "a.tif").write_text(f"<VRTDataset rasterXSize='1' rasterYSize='1'>{tmp_path}</VRTDataset>")
    with pytest.raises(ValueError, match="not a readable GeoTIFF"):
        import_dem(tmp_path / "a.tif", tmp_path / "out.npz")


def test_voids_that_cannot_be_filled_end_in_where_the_file_reaches(tmp_path: Path) -> None:
    place = Affine.translation(5e5, 4.65e6) @ Affine.rotation(25.0) @ Affine.scale(30.0, -30.0)
    path = save(tmp_path / "a.tif", np.full((400, 400), 700.0), UTM, place)
    with pytest.raises(ValueError, match=r"--crop keeps a part .* from west 5\d+.*, south 46\d+.* to east 51\d"):
        import_dem(path, tmp_path / "out.npz", fill=True)
