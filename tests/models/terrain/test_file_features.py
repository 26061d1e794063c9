"""What a file of heights may say beside its heights: each is honoured, or refused by its name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from rasterio.control import GroundControlPoint
from rasterio.crs import CRS
from rasterio.rpc import RPC
from rasterio.transform import Affine, from_origin

from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.ellipsoid import WGS84 as ELLIPSOID
from mathnavi.models.terrain.raster_file import read_raster
from tests.models.terrain.test_geotiff import CORNER, UTM, WEB_MERCATOR, WGS84, save
from tests.models.terrain.test_raster_files import HEIGHTS, SHAPE

SOUTH_FIRST = HEIGHTS[::-1]
GONE = np.zeros(SHAPE, bool)
GONE[4:8, 20:25] = True
SEEN = np.where(GONE, 0, 255).astype(np.uint8)
VALUES = HEIGHTS.astype(np.int16)
FIRST = np.equal(VALUES, VALUES[0, 0])


def imported(path: Path, **words: Any) -> NDArray[np.float64]:
    """Heights of the map of a file, row 0 south."""
    return import_dem(path, path.parent / "out.npz", **words).z


def refusal(path: Path, **words: Any) -> str:
    """The line with which a file is refused."""
    with pytest.raises(ValueError, match=path.name.partition(".")[0]) as caught:
        import_dem(path, path.parent / "out.npz", **words)
    assert "\n" not in str(caught.value)
    assert "mathnavi-terrain-" not in str(caught.value)  # the folder where an archive is unpacked
    return str(caught.value)


@pytest.mark.honoured("DEM", "transform with south up")
@pytest.mark.honoured("DEM", "transform with east on the left")
@pytest.mark.parametrize(("south_up", "mirrored"), [(True, False), (False, True), (True, True)])
def test_a_picture_from_the_south_or_the_east_is_the_same_ground_at_its_finer_step(
    tmp_path: Path, south_up: bool, mirrored: bool
) -> None:
    step = 1.0 / 1200.0
    place = from_origin(80.0, 50.0, step, step)
    expected = import_dem(save(tmp_path / "a.tif", HEIGHTS, WGS84, place), tmp_path / "out.npz")
    values = HEIGHTS[:: -1 if south_up else 1, :: -1 if mirrored else 1]
    a, c = (-step, 80.0 + SHAPE[1] * step) if mirrored else (step, 80.0)
    e, f = (step, 50.0 - SHAPE[0] * step) if south_up else (-step, 50.0)
    path = save(tmp_path / "b.tif", values, WGS84, Affine(a, 0.0, c, 0.0, e, f))
    terrain = import_dem(path, tmp_path / "b.npz")
    np.testing.assert_allclose(terrain.z, expected.z, atol=1e-3)
    assert terrain.spacing == pytest.approx(expected.spacing, rel=1e-9)
    part = (80.003, 49.985, 80.012, 49.995)
    np.testing.assert_allclose(
        imported(path, crop=part), import_dem(tmp_path / "a.tif", tmp_path / "c.npz", crop=part).z, atol=1e-3
    )


@pytest.mark.honoured("DEM", "pixels that are not square")
def test_a_turned_picture_keeps_the_shorter_side_of_its_pixels(tmp_path: Path) -> None:
    place = Affine.translation(5e5, 4.7e6) @ Affine.rotation(20.0) @ Affine.scale(10.0, -40.0)
    assert read_raster(save(tmp_path / "a.tif", HEIGHTS, UTM, place)).step_east == pytest.approx(10.0, rel=1e-3)
    grid = read_raster(save(tmp_path / "b.tif", HEIGHTS, "EPSG:4087", from_origin(5e5, 6.67e6, 30.0, 30.0)))  # 60 N
    east = ELLIPSOID.metres_per_degree(59.91)[1] / ELLIPSOID.metres_per_degree(0.0)[1]
    assert grid.step_north * grid.metres[0] == pytest.approx(30.0 * east, rel=1e-3)


@pytest.mark.honoured("DEM", "coordinate system in grads")
def test_grads_are_brought_to_degrees(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", HEIGHTS, "EPSG:4807", from_origin(1.0, 50.0, 0.001, 0.001))
    raster = read_raster(path)
    _, east = ELLIPSOID.metres_per_degree(45.0)
    assert raster.step_east * raster.metres[1] == pytest.approx(0.0009 * east, rel=1e-3)
    assert raster.box[3] - raster.box[1] == pytest.approx(0.0009 * (SHAPE[0] - 1), rel=0.02)


@pytest.mark.honoured("DEM", "AREA_OR_POINT")
@pytest.mark.parametrize(("kind", "half"), [("Area", 15.0), ("Point", 0.0)])
def test_the_point_that_a_picture_is_tied_to_is_a_corner_of_an_area_or_a_point(
    tmp_path: Path, kind: str, half: float
) -> None:
    path = tmp_path / "a.tif"
    with rasterio.open(
        path, "w", driver="GTiff", width=31, height=24, count=1, dtype="int16", crs=UTM, transform=CORNER
    ) as file:
        file.update_tags(AREA_OR_POINT=kind)
        file.write(VALUES, 1)
    with Image.open(path) as picture:
        east, north = picture.tag_v2[33922][3:5]  # type: ignore[attr-defined] # GeoTIFF's tie point, as in the file
    raster = read_raster(path)
    assert raster.west == pytest.approx(east + half)
    assert raster.box[3] == pytest.approx(north - half)


@pytest.mark.honoured("DEM", "bound coordinate system")
@pytest.mark.honoured("DEM", "citation without a code")
@pytest.mark.parametrize("crs", ["+proj=utm +zone=44 +ellps=krass +towgs84=23,-141,-81", "+proj=utm +zone=44"])
def test_a_projection_without_a_code_is_a_projection(tmp_path: Path, crs: str) -> None:
    np.testing.assert_array_equal(imported(save(tmp_path / "a.tif", HEIGHTS, crs)), SOUTH_FIRST)


@pytest.mark.refused("DEM", "local coordinate system")
@pytest.mark.refused("DEM", "planetocentric latitudes")
@pytest.mark.parametrize(
    ("crs", "words"),
    [
        ('LOCAL_CS["yard",UNIT["metre",1]]', "no coordinate system on the ground"),
        ("IAU_2015:49902", "planetocentric latitudes on an ellipsoid; allowed: planetographic ones"),
        ("IAU_2015:49912", "planetocentric latitudes on an ellipsoid; allowed: planetographic ones"),
    ],
)
def test_a_coordinate_system_that_is_not_on_the_ground_is_refused(tmp_path: Path, crs: str, words: str) -> None:
    save(tmp_path / "b.tif", HEIGHTS)
    (tmp_path / "a.vrt").write_text(
        f"<VRTDataset rasterXSize='31' rasterYSize='24'><SRS>{crs}</SRS><GeoTransform>0, 1, 0, 0, 0, -1</GeoTransform>"
        "<VRTRasterBand dataType='Float32' band='1'><SimpleSource><SourceFilename relativeToVRT='1'>b.tif"
        "</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    assert words in refusal(tmp_path / "a.vrt")


@pytest.mark.refused("DEM", "projection that PROJ does not know")
def test_what_gdal_says_of_a_projection_is_said_in_the_line(tmp_path: Path) -> None:
    """It says it as late as where colours are asked for, as an error of a kind that has no public name."""
    keys = ImageFileDirectory_v2()
    keys[33550], keys[33922] = (600.0, 600.0, 0.0), (0.0, 0.0, 0.0, -15648.0, -1817274.0, 0.0)
    keys[34735] = (1, 1, 0, 4, 1024, 0, 1, 1, 3075, 0, 1, 7, 3081, 34736, 1, 0, 3092, 34736, 1, 1)  # Mercator's
    keys[34736] = (-35.72, 0.0)  # latitude of origin, scale
    keys.tagtype[34735], keys.tagtype[34736] = 3, 12
    path = tmp_path / "a.tif"
    Image.fromarray(np.ones((5, 5), np.uint8)).save(path, tiffinfo=keys)
    assert "not a readable GeoTIFF (PROJ: " in refusal(path)


@pytest.mark.refused("DEM", "ground control points")
@pytest.mark.refused("DEM", "rational polynomial coefficients")
def test_a_picture_that_is_placed_by_points_or_coefficients_says_so(tmp_path: Path) -> None:
    points = [GroundControlPoint(row, column, 80.0 + column, 40.0 - row) for row in (0, 9) for column in (0, 9)]
    path = save(tmp_path / "a.tif", VALUES, WGS84, None, gcps=points)
    assert "placed by ground control points; allowed: by a transform" in refusal(path)
    ones = [1.0] * 20
    model = RPC(0.0, 1.0, 40.0, 1.0, ones, ones, 0.0, 1.0, 80.0, 1.0, ones, ones, 0.0, 1.0)
    assert "placed by rational polynomial" in refusal(save(tmp_path / "b.tif", VALUES, WGS84, None, rpcs=model))


@pytest.mark.honoured("DEM", "world file")
@pytest.mark.honoured("DEM", ".aux.xml: coordinate system, void, unit, scale")
@pytest.mark.refused("DEM", "no coordinate system")
def test_sidecars_say_what_the_file_does_not(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", VALUES, None, None)
    (tmp_path / "a.tfw").write_text("30\n0\n0\n-30\n500015\n4699985\n")
    assert "no coordinate system on the ground" in refusal(path)
    (tmp_path / "a.tif.aux.xml").write_text(
        f"<PAMDataset><SRS>{CRS.from_user_input(UTM).to_wkt()}</SRS><PAMRasterBand band='1'><UnitType>cm</UnitType>"
        f"<Scale>50</Scale><NoDataValue>{VALUES[2, 3]}</NoDataValue></PAMRasterBand></PAMDataset>"
    )
    raster = read_raster(path)
    np.testing.assert_allclose(raster.z, np.where(VALUES[2, 3] == SOUTH_FIRST, np.nan, 0.5 * SOUTH_FIRST))
    assert (raster.west, raster.box[3]) == (500015.0, 4699985.0)


@pytest.mark.honoured("DEM", "a picture across the meridian of 180 degrees")
@pytest.mark.refused("DEM", "a stretched picture across the meridian of 180 degrees, or with a pole")
def test_the_far_side_of_the_world_is_ground_or_refused(tmp_path: Path) -> None:
    over = (WGS84, from_origin(179.99, 45.0, 0.001, 0.001)), ("EPSG:32660", from_origin(732e3, 5e6, 100.0, 100.0))
    for crs, place in over:
        assert np.isfinite(imported(save(tmp_path / "a.tif", HEIGHTS, crs, place))).all()
    mercator = WEB_MERCATOR, from_origin(20037508.0 - 1500.0, 5e6, 100.0, 100.0)
    for crs, place in (mercator, ("EPSG:3413", from_origin(-1500.0, 1200.0, 100.0, 100.0))):
        words = refusal(save(tmp_path / "b.tif", HEIGHTS, crs, place))
        assert "crosses the meridian where longitudes begin again, or holds a pole" in words


@pytest.mark.honoured("DEM", "lengths of a degree over many degrees")
def test_a_map_of_many_degrees_says_how_far_its_lengths_are_off(tmp_path: Path) -> None:
    for step, said in ((0.04, False), (0.4, True)):
        path = save(tmp_path / "a.tif", HEIGHTS, WGS84, from_origin(10.0, 60.0, 0.04, step))
        source = import_dem(path, tmp_path / "a.npz").source  # cos 59.8 / cos 55.2 = 0.88
        assert ("lengths east are off by 12 % at its north or south end" in source) == said


@pytest.mark.refused("DEM", "fewer than 2 x 2 heights")
@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1)])
def test_one_row_of_heights_is_no_ground(tmp_path: Path, shape: tuple[int, int]) -> None:
    words = refusal(save(tmp_path / "a.tif", np.zeros(shape, np.int16)))
    assert f"{shape[0]} x {shape[1]} heights; allowed: at least 2 x 2" in words


@pytest.mark.refused("DEM", "fewer than 2 x 2 heights")
def test_four_heights_in_a_turned_square_hold_no_north_up_one(tmp_path: Path) -> None:
    place = from_origin(-7273083.024, 5048950.328, 231.656, 231.656)
    path = save(tmp_path / "a.tif", np.zeros((2, 2), np.int16), "+proj=sinu +R=6371007.181", place)
    assert "2 x 2 heights, turned or stretched, hold less than 2 x 2 nodes" in refusal(path)


@pytest.mark.honoured("DEM", "whole numbers of 8 to 64 bits, signed or not")
@pytest.mark.honoured("DEM", "floating-point numbers")
@pytest.mark.parametrize(
    "dtype", ["int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64"]
)
def test_heights_have_any_real_type(tmp_path: Path, dtype: str) -> None:
    values = (HEIGHTS % 120).astype(dtype)
    np.testing.assert_array_equal(imported(save(tmp_path / "a.tif", values)), HEIGHTS[::-1] % 120)


@pytest.mark.refused("DEM", "complex numbers")
@pytest.mark.parametrize("dtype", ["complex_int16", "complex64", "complex128"])
def test_heights_of_complex_numbers_are_refused(tmp_path: Path, dtype: str) -> None:
    with rasterio.open(
        tmp_path / "a.tif", "w", driver="GTiff", width=3, height=3, count=1, dtype=dtype, crs=UTM, transform=CORNER
    ):
        pass
    assert f"heights of the type {dtype}; allowed: real numbers" in refusal(tmp_path / "a.tif")


@pytest.mark.honoured("DEM", "mask beside a value of voids")
@pytest.mark.honoured("DEM", "alpha band beside a value of voids")
@pytest.mark.parametrize("kind", ["internal mask", "mask beside the file", "alpha"])
def test_a_void_is_what_mask_alpha_or_value_call_void(tmp_path: Path, kind: str) -> None:
    bands: dict[str, Any] = {"photometric": "MINISBLACK", "alpha": "YES"} if kind == "alpha" else {}
    with (
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=kind.startswith("internal")),
        rasterio.open(
            tmp_path / "a.tif", "w", driver="GTiff", width=31, height=24, count=1 + (kind == "alpha"), dtype="int16",
            crs=UTM, transform=CORNER, nodata=int(VALUES[0, 0]), **bands,
        ) as file,
    ):  # fmt: skip
        file.write(VALUES, 1)
        if kind == "alpha":
            file.write(SEEN.astype(np.int16), 2)
        else:
            file.write_mask(SEEN)
    assert (tmp_path / "a.tif.msk").exists() == (kind == "mask beside the file")
    np.testing.assert_array_equal(np.isnan(read_raster(tmp_path / "a.tif").z[::-1]), GONE | FIRST)


@pytest.mark.refused("DEM", "colour table")
@pytest.mark.refused("DEM", "category names")
@pytest.mark.refused("DEM", "type of layer: thematic")
@pytest.mark.honoured("DEM", "colour table over heights, with --scale")
def test_numbers_of_colours_and_categories_are_no_heights_until_somebody_says_so(tmp_path: Path) -> None:
    values = (HEIGHTS % 250).astype(np.uint8)
    path = save(tmp_path / "a.tif", values)
    with rasterio.open(path, "r+") as file:
        file.write_colormap(1, {0: (0, 0, 0, 255), 7: (255, 0, 0, 255)})
    assert "scale is missing; the numbers of the band are colours, by its colour table" in refusal(path)
    np.testing.assert_array_equal(imported(path, scale=2.0), 2.0 * values[::-1])
    with rasterio.open(save(tmp_path / "c.tif", values), "r+") as file:
        file.update_tags(1, LAYER_TYPE="thematic")
    assert "the numbers of the band are classes, by its type of layer" in refusal(tmp_path / "c.tif")
    named = save(tmp_path / "b.tif", values)
    (tmp_path / "b.tif.aux.xml").write_text(
        "<PAMDataset><PAMRasterBand band='1'><CategoryNames><Category>water</Category></CategoryNames></PAMRasterBand>"
        "</PAMDataset>"
    )
    assert "the numbers of the band are categories, by their names" in refusal(named)


@pytest.mark.refused("DEM", "mask that cannot be read")
@pytest.mark.refused("DEM", "scale of 0 or that is not finite")
def test_what_beside_a_file_makes_no_sense_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", VALUES)
    (tmp_path / "a.tif.msk").write_bytes(path.read_bytes()[:200])
    assert "its mask a.tif.msk cannot be read" in refusal(path)
    for scale in ("0", "nan", "inf"):
        named = save(tmp_path / "b.tif", VALUES)
        (tmp_path / "b.tif.aux.xml").write_text(
            f"<PAMDataset><PAMRasterBand band='1'><Scale>{scale}</Scale></PAMRasterBand></PAMDataset>"
        )
        assert f"scale {scale} and offset 0; allowed: finite, no scale 0" in refusal(named)
