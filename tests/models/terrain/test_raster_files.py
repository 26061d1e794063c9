"""Raster files as people bring them: each means what its format says, or is refused in one line."""

from __future__ import annotations

import gzip
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.shutil import copy
from rasterio.transform import from_origin

from mathnavi.models.terrain import packed_files
from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.raster_file import read_raster
from tests.models.terrain.test_geotiff import CORNER, UTM, WEB_MERCATOR, WGS84, save

SHAPE = (24, 31)
HEIGHTS = np.random.default_rng(0).uniform(200.0, 900.0, SHAPE).round()


def holed(value: float, dtype: str) -> NDArray[Any]:
    heights = HEIGHTS.copy()
    heights[4:8, 20:25] = value
    return heights.astype(dtype)


@pytest.mark.refused("DEM", "heights that no ground has")
@pytest.mark.honoured("DEM", "heights that no ground has, with --nodata or --heights")
@pytest.mark.parametrize(
    ("value", "dtype", "stated"),
    [
        *((value, "int16", None) for value in (-32767, -9999, 9999, 32767)),
        *((-32768, dtype, None) for dtype in ("int32", "float32")),
        (-32768, "int16", -9999),  # the file states another one
        *((value, "float32", None) for value in (-9999, -99999, -3.4028234663852886e38, 1e20)),
        (65535, "uint16", None),
    ],
)
def test_a_value_that_no_ground_has_is_refused_until_somebody_says_what_it_is(
    tmp_path: Path, value: float, dtype: str, stated: float | None
) -> None:
    path = save(tmp_path / "a.tif", holed(value, dtype)[::-1], nodata=stated)
    with pytest.raises(ValueError, match=r"20 heights are \S+, the first at row 4 from the south, column 20") as caught:
        import_dem(path, tmp_path / "out.npz")
    assert f"--nodata {np.array(value, dtype).item():.10g} makes them voids" in str(caught.value)
    with pytest.raises(ValueError, match="20 heights are void"):
        import_dem(path, tmp_path / "out.npz", nodata=value)
    if abs(value) < 1e5:
        terrain = import_dem(path, tmp_path / "out.npz", heights=(-1e5, 1e5))
        assert (terrain.z == value).sum() == 20


@pytest.mark.refused("DEM", "plateau with cliffs about it")
def test_a_plateau_with_cliffs_about_it_is_no_ground_until_somebody_says_so(tmp_path: Path) -> None:
    rows, columns = np.mgrid[0.0:40.0, 0.0:50.0]
    slope = 300.0 + 2.0 * rows + columns
    slope[10:14, 10:15] = slope[20:22, 30:33] = 0.0
    path = save(tmp_path / "a.tif", slope[::-1].astype(np.int16))
    with pytest.raises(
        ValueError, match=r"26 heights are 0, a plateau with cliffs about it, the first at row 10 .* 10"
    ):
        import_dem(path, tmp_path / "out.npz")
    assert import_dem(path, tmp_path / "out.npz", heights=(0.0, 1000.0)).z.min() == 0.0
    sea = np.maximum(300.0 - 10.0 * rows + columns, 0.0)  # with a shore
    assert import_dem(save(tmp_path / "b.tif", sea.astype(np.int16)), tmp_path / "out.npz").z.min() == 0.0


@pytest.mark.honoured("DEM", "mask")
@pytest.mark.honoured("DEM", "alpha band")
def test_a_mask_of_the_file_is_its_voids(tmp_path: Path) -> None:
    for bands in (1, 2):
        profile: dict[str, Any] = {"photometric": "MINISBLACK", "alpha": "YES"} if bands == 2 else {}
        with rasterio.open(
            tmp_path / "a.tif", "w", driver="GTiff", width=31, height=24, count=bands, dtype="uint16", crs=UTM,
            transform=CORNER, **profile,
        ) as file:  # fmt: skip
            file.write(holed(7, "uint16"), 1)
            seen = np.where(holed(0, "uint16") == 0, 0, 255)
            if bands == 2:
                file.write((257 * seen).astype("uint16"), 2)
            else:
                file.write_mask(seen.astype("uint8"))
        assert np.isnan(read_raster(tmp_path / "a.tif").z).sum() == 20


@pytest.mark.honoured("DEM", ".img (Erdas Imagine)")
@pytest.mark.honoured("DEM", ".nc (netCDF)")
@pytest.mark.honoured("DEM", ".vrt: copy of a file")
@pytest.mark.parametrize(
    ("ending", "driver"), [(".asc", "AAIGrid"), (".bil", "EHdr"), (".img", "HFA"), (".nc", "netCDF"), (".vrt", "VRT")]
)
def test_other_formats_are_the_same_ground(tmp_path: Path, ending: str, driver: str) -> None:
    save(tmp_path / "a.tif", HEIGHTS.astype(np.int16))
    copy(tmp_path / "a.tif", tmp_path / f"a{ending}", driver=driver)
    terrain = import_dem(tmp_path / f"a{ending}", tmp_path / "out.npz")
    np.testing.assert_array_equal(terrain.z, HEIGHTS[::-1])
    assert terrain.spacing == pytest.approx(30.0)


@pytest.mark.honoured("DEM", ".zip, .gz: one model")
@pytest.mark.refused("DEM", ".zip: several models")
def test_an_archive_is_unpacked_and_may_hold_one_map(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", HEIGHTS.astype(np.int16))
    with gzip.open(tmp_path / "a.tif.gz", "wb") as file:
        file.write(path.read_bytes())
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(path, "folder/a.tif")
        archive.writestr("README.txt", "heights")
    for packed in ("a.tif.gz", "a.zip"):
        np.testing.assert_array_equal(import_dem(tmp_path / packed, tmp_path / "out.npz").z, HEIGHTS[::-1])
    with zipfile.ZipFile(tmp_path / "a.zip", "a") as archive:
        archive.write(path, "b.tif")
    with pytest.raises(ValueError, match=r"elevation models in it: a\.tif, b\.tif; allowed: one"):
        import_dem(tmp_path / "a.zip", tmp_path / "out.npz")


@pytest.mark.refused("DEM", ".zip, .gz: expands beyond 4 GB")
@pytest.mark.parametrize("packed", ["a.tif.gz", "a.zip"])
def test_what_expands_to_more_than_is_allowed_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, packed: str
) -> None:
    content = bytes(3_000_000)
    if packed == "a.zip":
        with zipfile.ZipFile(tmp_path / packed, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a.tif", content)
    else:
        (tmp_path / packed).write_bytes(gzip.compress(content))
    monkeypatch.setattr(packed_files, "MOST_BYTES", 2_000_000)
    with pytest.raises(ValueError, match="it expands to more than"):
        import_dem(tmp_path / packed, tmp_path / "out.npz")


SOURCE = "<SourceFilename relativeToVRT='1'>{}</SourceFilename>"


@pytest.mark.refused("DEM", ".vrt: addresses, files elsewhere")
@pytest.mark.refused("DEM", ".vrt: warped, nested, or with code")
@pytest.mark.parametrize(
    ("inside", "message"),
    [
        (SOURCE.format("/vsicurl/http://127.0.0.1:9/a.tif"), "refers to '/vsicurl.*allowed: a file in its own folder"),
        (SOURCE.format("../secret.tif"), r"refers to '\.\./secret\.tif'; allowed: a file in its own folder"),
        (SOURCE.format("/etc/passwd"), "refers to '/etc/passwd'; allowed: a file in its own folder"),
        (SOURCE.format("other.vrt"), "allowed: a picture"),
        ("<PixelFunctionCode>import os</PixelFunctionCode>", "PixelFunctionCode; allowed: a mosaic"),
    ],
)
def test_a_virtual_raster_brings_nothing_from_elsewhere(tmp_path: Path, inside: str, message: str) -> None:
    (tmp_path / "a.vrt").write_text(
        "<VRTDataset rasterXSize='3' rasterYSize='3'><SRS>EPSG:32644</SRS><GeoTransform>0, 30, 0, 0, 0, -30"
        "</GeoTransform><VRTRasterBand dataType='Int16' band='1'><SimpleSource>"
        f"{inside}<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    with pytest.raises(ValueError, match=message) as caught:
        import_dem(tmp_path / "a.vrt", tmp_path / "out.npz")
    assert "\n" not in str(caught.value)


@pytest.mark.honoured("DEM", "ellipsoid of another body")
@pytest.mark.parametrize(
    ("crs", "degree"),
    [("IAU_2015:30100", math.pi * 1737400.0 / 180.0), ("IAU_2015:49900", math.pi * 3396190.0 / 180.0)],
)
def test_another_body_has_its_own_size(tmp_path: Path, crs: str, degree: float) -> None:
    values = np.linspace(-8000.0, 8000.0, HEIGHTS.size, dtype=np.float32).reshape(SHAPE)
    path = save(tmp_path / "a.tif", values, crs, from_origin(10.0, 0.012, 0.001, 0.001))
    assert import_dem(path, tmp_path / "out.npz").spacing == pytest.approx(0.001 * degree, rel=1e-6)


@pytest.mark.honoured("DEM", "ellipsoid of another body")
def test_a_projected_moon_is_a_map(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", HEIGHTS.astype(np.float32), "IAU_2015:30110", from_origin(0.0, 0.0, 100.0, 100.0))
    np.testing.assert_array_equal(import_dem(path, tmp_path / "out.npz").z, HEIGHTS[::-1])


def test_a_mercator_picture_has_no_voids_at_its_borders(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", HEIGHTS.astype(np.float32), WEB_MERCATOR, from_origin(1.1e6, 8.4e6, 100.0, 100.0))
    terrain = import_dem(path, tmp_path / "out.npz")
    assert HEIGHTS.min() <= terrain.z.min()
    assert terrain.z.max() <= HEIGHTS.max() + 1e-3


@pytest.mark.parametrize("latitude", [0.5, 47.0, 69.5])
def test_ridges_one_column_wide_keep_their_height(tmp_path: Path, latitude: float) -> None:
    values = np.full((50, 50), 100.0)
    values[:, 3::7] = 400.0
    step = 1.0 / 3600.0
    path = save(tmp_path / "a.tif", values.astype(np.float32), WGS84, from_origin(10.0, latitude, step, step))
    terrain = import_dem(path, tmp_path / "out.npz")
    assert terrain.highest.z.max() >= 400.0 - 1e-3
    if latitude > 1.0:  # the steps east are the smaller ones
        assert terrain.z.max() == pytest.approx(400.0, abs=1e-3)


def test_a_picture_may_have_more_heights_than_a_map_if_it_is_made_coarser(tmp_path: Path) -> None:
    with rasterio.open(
        tmp_path / "large.tif", "w", driver="GTiff", count=1, height=6000, width=6000, dtype="int16", crs=UTM,
        transform=CORNER, sparse_ok=True, tiled=True,
    ):  # fmt: skip
        pass
    assert import_dem(tmp_path / "large.tif", tmp_path / "out.npz", resample=300.0).z.shape == (600, 600)


@pytest.mark.refused("DEM", "units of band and coordinate system that disagree")
@pytest.mark.refused("DEM", "depths: vertical axis downwards")
def test_what_is_stated_of_heights_must_agree(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", HEIGHTS.astype(np.int16), "EPSG:32644+6360", units="m")
    with pytest.raises(ValueError, match=r"heights are in 'm' by the band, in units of 0\.3048006 m by the coordinate"):
        import_dem(path, tmp_path / "out.npz")
    depths = save(tmp_path / "b.tif", HEIGHTS.astype(np.int16), "EPSG:32644+5831")
    with pytest.raises(ValueError, match="depths, measured downwards"):
        import_dem(depths, tmp_path / "out.npz")
