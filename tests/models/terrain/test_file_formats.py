"""How files store heights, format by format: all that is read comes out the same, the rest is refused by its name."""

from __future__ import annotations

import gzip
import os
import warnings
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from PIL import Image
from rasterio.crs import CRS
from rasterio.shutil import copy
from rasterio.transform import from_origin
from scipy.io import netcdf_file

from mathnavi.interfaces.errors import TerrainError
from mathnavi.models.terrain import ascii_grid
from mathnavi.models.terrain.dem_import import import_dem
from mathnavi.models.terrain.netcdf import check_whole
from mathnavi.models.terrain.raster_file import read_raster
from tests.models.terrain.test_file_features import FIRST, SOUTH_FIRST, VALUES, imported, refusal
from tests.models.terrain.test_geotiff import CORNER, UTM, WEB_MERCATOR, save
from tests.models.terrain.test_raster_files import HEIGHTS


@pytest.mark.honoured("DEM", "compression and predictor")
@pytest.mark.honoured("DEM", "tiles inside the file")
@pytest.mark.honoured("DEM", "BigTIFF")
@pytest.mark.honoured("DEM", "byte order")
@pytest.mark.parametrize(
    "how",
    [
        *({"compress": name} for name in (None, "packbits", "deflate", "lzw", "zstd", "lerc")),
        {"compress": "deflate", "predictor": 2, "tiled": True, "blockxsize": 16, "blockysize": 16},
        {"bigtiff": "YES", "endianness": "BIG"},
        {"endianness": "LITTLE"},
    ],
)
def test_how_heights_are_stored_changes_none(tmp_path: Path, how: dict[str, Any]) -> None:
    np.testing.assert_array_equal(imported(save(tmp_path / "a.tif", VALUES, **how)), SOUTH_FIRST)


@pytest.mark.honoured("DEM", "overviews")
def test_overviews_are_left_aside(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", VALUES)
    with rasterio.open(path, "r+") as file:
        file.build_overviews([2, 4])
    np.testing.assert_array_equal(imported(path), SOUTH_FIRST)


@pytest.mark.honoured("DEM", "tiles that were not written")
def test_tiles_that_were_not_written_are_voids_if_the_file_has_any(tmp_path: Path) -> None:
    tiles: dict[str, Any] = {"sparse_ok": True, "tiled": True, "blockxsize": 16, "blockysize": 16}
    for void, expected in ((-1, np.nan), (None, 0.0)):
        with rasterio.open(
            tmp_path / "a.tif", "w", driver="GTiff", width=32, height=16, count=1, dtype="int16", crs=UTM,
            transform=CORNER, nodata=void, **tiles,
        ) as file:  # fmt: skip
            file.write(np.full((16, 16), 40, np.int16), 1, window=((0, 16), (0, 16)))
        z = read_raster(tmp_path / "a.tif").z
        np.testing.assert_array_equal(z, np.repeat([[40.0, expected]], 16, axis=1).repeat(16, axis=0))


@pytest.mark.refused("DEM", "several pages")
def test_a_file_of_several_pages_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", VALUES)
    save(path, VALUES, append_subdataset=True)
    assert "2 pages; allowed: one" in refusal(path)


def prj(path: Path, crs: str = UTM) -> None:
    path.with_suffix(".prj").write_text(CRS.from_user_input(crs).to_wkt(version="WKT1_ESRI"))


HEAD = "ncols 31\nnrows 24\n{}\ncellsize 30\n{}"
ROWS = "\n".join(" ".join(f"{value:g}" for value in row) for row in HEIGHTS)


@pytest.mark.honoured("DEM", ".asc: corner or centre, value of voids")
@pytest.mark.honoured("DEM", ".prj")
@pytest.mark.parametrize(
    ("place", "west"), [("xllcorner 5e5\nyllcorner 4e6", 500015.0), ("xllcenter 5e5\nyllcenter 4e6", 5e5)]
)
def test_an_ascii_grid_says_where_its_corner_is(tmp_path: Path, place: str, west: float) -> None:
    path = tmp_path / "a.asc"
    path.write_text(HEAD.format(place, f"NODATA_value {HEIGHTS[0, 0]:g}\n{ROWS}"))
    assert "no coordinate system on the ground (a .prj beside the file states one)" in refusal(path)
    prj(path)
    raster = read_raster(path)
    assert raster.west == west
    np.testing.assert_array_equal(raster.z[::-1], np.where(FIRST, np.nan, HEIGHTS))


@pytest.mark.honoured("DEM", ".asc: whole numbers first")
def test_an_ascii_grid_that_begins_with_whole_numbers_keeps_its_fractions(tmp_path: Path) -> None:
    values = np.full((300, 300), 250.0)
    values[250:] = 250.25 + 0.5 * (np.arange(300) % 9)
    text = "\n".join(" ".join(f"{value:g}" for value in row) for row in values)
    (tmp_path / "a.asc").write_text(f"ncols 300\nnrows 300\nxllcorner 500000\nyllcorner 4000000\ncellsize 30\n{text}\n")
    prj(tmp_path / "a.asc")
    np.testing.assert_array_equal(imported(tmp_path / "a.asc"), values[::-1])


@pytest.mark.honoured("DEM", ".asc: nan, decimal comma")
@pytest.mark.refused("DEM", ".asc: words, or another number of heights than rows and columns")
@pytest.mark.parametrize(
    ("numbers", "found"),
    [
        ("1 nan 3\n4 5 6", [[4.0, 5.0, 6.0], [1.0, np.nan, 3.0]]),  # whole numbers, which know no NaN
        ("1,5 2 3\n4 5 6,25\n", [[4.0, 5.0, 6.25], [1.5, 2.0, 3.0]]),
        ("1 2\n3 4 5\n6", [[4.0, 5.0, 6.0], [1.0, 2.0, 3.0]]),
        ("1 2 3\n4 5 6\n7", "7 heights; allowed: 6, 2 rows of 3"),
        ("1 2 3\n4 5", "5 heights; allowed: 6, 2 rows of 3"),
        ("1 2 3\n4 tree 6", "'tree' among the heights; allowed: numbers"),
    ],
)
@pytest.mark.parametrize("chunk", [1, 7, 1 << 22])
def test_an_ascii_grid_has_a_number_for_each_node(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, numbers: str, found: list[list[float]] | str, chunk: int
) -> None:
    monkeypatch.setattr(ascii_grid, "_CHUNK", chunk)
    path = tmp_path / "a.asc"
    path.write_text(f"ncols 3\nnrows 2\nxllcorner 500000\nyllcorner 4000000\ncellsize 30\n{numbers}")
    prj(path)
    if isinstance(found, str):
        assert found in refusal(path)
    else:
        np.testing.assert_array_equal(read_raster(path).z, found)


@pytest.mark.honoured("DEM", ".bil, .flt: byte order, type and void in .hdr")
@pytest.mark.refused("DEM", ".bil, .flt: no .hdr, truncated")
@pytest.mark.parametrize(
    ("ending", "dtype", "kind"),
    [(".bil", "<i2", "SIGNEDINT"), (".bil", ">u2", "UNSIGNEDINT"), (".flt", ">f4", "FLOAT")],
)
def test_a_header_says_how_heights_are_stored(tmp_path: Path, ending: str, dtype: str, kind: str) -> None:
    path = tmp_path / f"a{ending}"
    HEIGHTS.astype(dtype).tofile(path)
    assert f"not a readable {ending} file" in refusal(path)
    path.with_suffix(".hdr").write_text(
        f"NROWS 24\nNCOLS 31\nNBANDS 1\nNBITS {8 * np.dtype(dtype).itemsize}\nPIXELTYPE {kind}\nULXMAP 500015\n"
        f"ULYMAP 4699985\nXDIM 30\nYDIM 30\nBYTEORDER {'I' if dtype[0] == '<' else 'M'}\nNODATA {HEIGHTS[0, 0]:g}\n"
    )
    prj(path)
    np.testing.assert_array_equal(read_raster(path).z[::-1], np.where(FIRST, np.nan, HEIGHTS))
    path.write_bytes(path.read_bytes()[:-1])
    assert f"{24 * 31 * np.dtype(dtype).itemsize - 1} bytes; allowed: " in refusal(path)


@pytest.mark.honoured("DEM", ".nc: scale_factor, add_offset, _FillValue, units")
@pytest.mark.refused("DEM", ".nc: positive down")
def test_a_netcdf_variable_says_how_it_is_packed(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", VALUES, scales=0.25, offsets=100.0, nodata=int(VALUES[0, 0]))
    with rasterio.open(path, "r+") as file:
        file.update_tags(1, units="cm")
    copy(tmp_path / "a.tif", tmp_path / "b.nc", driver="netCDF")
    expected = np.where(FIRST, np.nan, 0.01 * (0.25 * HEIGHTS + 100.0))
    np.testing.assert_allclose(read_raster(tmp_path / "b.nc").z[::-1], expected)
    with rasterio.open(save(tmp_path / "d.tif", VALUES), "r+") as file:
        file.update_tags(1, positive="down")
    copy(tmp_path / "d.tif", tmp_path / "d.nc", driver="netCDF")
    assert "depths, measured downwards" in refusal(tmp_path / "d.nc")


@pytest.mark.refused("DEM", ".nc, .img: truncated")
@pytest.mark.parametrize(
    ("ending", "driver", "how"),
    [
        *((".nc", "netCDF", {"FORMAT": name}) for name in ("NC", "NC2", "NC4")),
        (".img", "HFA", {}),
        (".img", "HFA", {"COMPRESSED": "YES"}),
    ],
)
def test_what_is_cut_off_is_no_sea(tmp_path: Path, ending: str, driver: str, how: dict[str, str]) -> None:
    copy(save(tmp_path / "a.tif", VALUES), tmp_path / f"a{ending}", driver=driver, **how)
    path = tmp_path / f"a{ending}"
    np.testing.assert_array_equal(read_raster(path).z, SOUTH_FIRST)
    whole, refused = path.read_bytes(), 0
    for length in np.linspace(20, len(whole) - 4, 12, dtype=int):
        path.write_bytes(whole[:length])
        try:
            found = read_raster(path).z
        except TerrainError:
            refused += 1
        else:  # what is missing are no heights
            np.testing.assert_array_equal(found, SOUTH_FIRST)
    assert refused > 5


def with_coordinates(path: Path, latitudes: Sequence[float], **attributes: Any) -> Path:
    """A netCDF file of the heights 100, 101, ... on the ellipsoid, the first in the first latitude."""
    with netcdf_file(path, "w") as file:
        axes = (("lat", latitudes, "latitude"), ("lon", (10.0, 10.01, 10.02), "longitude"))
        for name, values, standard_name in axes:
            file.createDimension(name, len(values))
            axis = file.createVariable(name, "d", (name,))
            axis[:], axis.standard_name = values, standard_name
            axis.units = f"degrees_{'north' if name == 'lat' else 'east'}"
        crs = file.createVariable("crs", "i", ())
        crs.grid_mapping_name, crs.semi_major_axis, crs.inverse_flattening = "latitude_longitude", 6378137.0, 298.25722
        z = file.createVariable("z", "f", ("lat", "lon"))
        z[:] = 100.0 + np.arange(len(latitudes) * 3).reshape(-1, 3)
        for name, value in {"grid_mapping": "crs", "units": "m", **attributes}.items():
            setattr(z, name, value)
    return path


@pytest.mark.honoured("DEM", ".nc: latitudes from south or north")
@pytest.mark.refused("DEM", ".nc: coordinates in unequal steps")
def test_coordinates_of_a_netcdf_file_count_one_by_one(tmp_path: Path) -> None:
    for latitudes in ([40.0, 40.01, 40.02, 40.03], [40.03, 40.02, 40.01, 40.0]):
        raster = read_raster(with_coordinates(tmp_path / "a.nc", latitudes))
        assert (raster.south, raster.west) == pytest.approx((40.0, 10.0))
        assert raster.z[0, 0] == (100.0 if latitudes[0] == 40.0 else 109.0)
    words = refusal(with_coordinates(tmp_path / "b.nc", [40.0, 40.01, 40.02, 40.07]))
    assert "lat[2] = 40.02; allowed: coordinates in equal steps" in words


@pytest.mark.honoured("DEM", ".nc: valid_min, valid_max, valid_range, missing_value")
@pytest.mark.parametrize(
    ("attributes", "voids"),
    [
        ({"valid_min": np.float32(103.0)}, 3),
        ({"valid_max": np.float32(103.0)}, 8),
        ({"valid_range": np.array([101.0, 110.0], np.float32)}, 2),
        ({"missing_value": np.float32(105.0)}, 1),
    ],
)
def test_what_a_netcdf_file_calls_not_valid_is_void(tmp_path: Path, attributes: dict[str, Any], voids: int) -> None:
    path = with_coordinates(tmp_path / "a.nc", [40.0, 40.01, 40.02, 40.03], **attributes)
    assert np.isnan(read_raster(path).z).sum() == voids
    odd = with_coordinates(tmp_path / "b.nc", [40.0, 40.01], valid_min="sea")
    assert "valid_min = 'sea'; allowed: a number" in refusal(odd)


def test_a_netcdf_file_of_records_has_all_of_them(tmp_path: Path) -> None:
    for version in (1, 2):
        with netcdf_file(tmp_path / "a.nc", "w", version=version) as file:
            file.title = "heights"
            for name, size in (("t", None), ("x", 3)):
                file.createDimension(name, size)
            for name, kind, dimensions in (("z", "h", ("t", "x")), ("u", "d", ("t",)), ("x", "d", ("x",))):
                file.createVariable(name, kind, dimensions)
            file.variables["z"][:4], file.variables["u"][:4] = np.ones((4, 3)), np.ones(4)
        size = (tmp_path / "a.nc").stat().st_size
        check_whole(tmp_path / "a.nc", size)
        os.truncate(tmp_path / "a.nc", size - 9)
        with pytest.raises(TerrainError, match=rf"{size - 9} bytes; allowed: {size}, as its header says"):
            check_whole(tmp_path / "a.nc", size)


@pytest.mark.refused("DEM", ".nc: several variables")
def test_a_netcdf_file_of_several_variables_is_refused(tmp_path: Path) -> None:
    save(tmp_path / "a.tif", np.stack([VALUES, VALUES]))
    copy(tmp_path / "a.tif", tmp_path / "b.nc", driver="netCDF")
    assert "0 bands, 2 variables; allowed: one, the heights" in refusal(tmp_path / "b.nc")


@pytest.mark.honoured("DEM", ".png: transparent value")
@pytest.mark.refused("DEM", ".png: palette")
def test_a_transparent_value_of_a_picture_is_a_void(tmp_path: Path) -> None:
    picture = Image.fromarray(HEIGHTS.astype(np.uint16))
    picture.save(tmp_path / "a.png", transparency=int(HEIGHTS[0, 0]))
    words: dict[str, Any] = {"spacing": 10.0, "scale": 1.0}
    assert "heights are void" in refusal(tmp_path / "a.png", **words)
    Image.fromarray(np.eye(5, dtype=np.uint8)).convert("P").save(tmp_path / "b.png")
    assert "the mode P; allowed: 16-bit grey" in refusal(tmp_path / "b.png", **words)


@pytest.mark.refused("DEM", "GDAL's connection strings")
@pytest.mark.parametrize("name", ["/vsicurl/http://127.0.0.1:9/a.tif", "GTIFF_DIR:1:a.tif", "netcdf:a.nc:z"])
def test_a_file_is_a_path(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileNotFoundError, match="no such file"):
        import_dem(name, tmp_path / "out.npz")


def with_zip(path: Path) -> Path:
    with zipfile.ZipFile(path.with_suffix(".zip"), "w") as archive:
        archive.write(path, f"folder/{path.name}")
    return path.with_suffix(".zip")


def with_gzip(path: Path) -> Path:
    packed = path.with_name(path.name + ".gz")
    packed.write_bytes(gzip.compress(path.read_bytes()))
    return packed


@pytest.mark.refused("DEM", ".zip, .gz: a damaged model inside")
@pytest.mark.parametrize("pack", [with_zip, with_gzip])
def test_what_an_archive_holds_is_named_with_the_archive(tmp_path: Path, pack: Callable[[Path], Path]) -> None:
    for name in ("a.vrt", "a.img", "a.hgt", "a.tif"):
        (tmp_path / name).write_bytes(b"<VRTDataset")
        packed = pack(tmp_path / name)
        assert refusal(packed).startswith(str(packed))


@pytest.mark.refused("DEM", ".vrt: warped, nested, or with code")
@pytest.mark.parametrize(
    ("attribute", "inside"),
    [("subClass='VRTWarpedDataset'", ""), ("", "<GCPList/>"), ("", "<MaskBand/>"), ("", "<ColorTable/>")],
)
def test_a_virtual_raster_is_a_mosaic_and_no_more(tmp_path: Path, attribute: str, inside: str) -> None:
    path = tmp_path / "a.vrt"
    path.write_text(f"<VRTDataset rasterXSize='3' rasterYSize='3' {attribute}>{inside}</VRTDataset>")
    assert "allowed: a mosaic of pictures" in refusal(path)


@pytest.mark.refused("DEM", ".vrt: truncated or damaged sources")
def test_a_source_of_a_virtual_raster_is_checked_as_a_file_of_its_own(tmp_path: Path) -> None:
    for name, content, words in (
        ("a.asc", f"ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 30\n{'1 ' * 7}", "7 heights; allowed: 6"),
        ("a.asc", f"ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 30\n{'nan ' * 6}", "'nan' among the heights"),
        ("a.bil", "short", "5 bytes; allowed: 12"),
        ("N10E010.hgt", "short", "5 bytes are not a whole tile"),
    ):
        (tmp_path / name).write_text(content)
        (tmp_path / "a.hdr").write_text("NROWS 2\nNCOLS 3\nNBITS 16\n")
        (tmp_path / "b.vrt").write_text(
            "<VRTDataset rasterXSize='3' rasterYSize='2'><VRTRasterBand dataType='Int16' band='1'><SimpleSource>"
            f"<SourceFilename relativeToVRT='1'>{name}</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>"
        )
        with pytest.raises(TerrainError, match=words):
            read_raster(tmp_path / "b.vrt")


@pytest.mark.refused("DEM", ".vrt: voids, unit or scale of a source alone")
@pytest.mark.parametrize(
    ("own", "inside", "words"),
    [
        ({"nodata": 300}, "", "b.tif has voids; allowed: if the virtual raster has a NoDataValue"),
        ({"units": "ft"}, "", "b.tif has the unit ft, the virtual raster none; allowed: the same"),
        ({"scales": 0.5}, "", "b.tif has the scale 0.5, the virtual raster 1.0"),
        ({"offsets": 9.0}, "<Offset>8</Offset>", "b.tif has the offset 9.0, the virtual raster 8.0"),
        ({"units": "metre"}, "", ""),
        ({"nodata": 300, "units": "ft"}, "<NoDataValue>300</NoDataValue><UnitType>ft</UnitType>", ""),
    ],
)
def test_what_a_source_states_the_virtual_raster_states_too(
    tmp_path: Path, own: dict[str, Any], inside: str, words: str
) -> None:
    save(tmp_path / "b.tif", VALUES, **own)
    (tmp_path / "a.vrt").write_text(
        "<VRTDataset rasterXSize='31' rasterYSize='24'><SRS>EPSG:32644</SRS><GeoTransform>0, 30, 0, 0, 0, -30"
        f"</GeoTransform><VRTRasterBand dataType='Int16' band='1'>{inside}<SimpleSource><SourceFilename "
        "relativeToVRT='1'>b.tif</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    if words:
        assert words in refusal(tmp_path / "a.vrt")
    else:
        np.testing.assert_array_equal(read_raster(tmp_path / "a.vrt").z, read_raster(tmp_path / "b.tif").z)


@pytest.mark.honoured("DEM", ".vrt: mosaic with voids and scale of its sources")
def test_a_virtual_raster_places_pictures_side_by_side(tmp_path: Path) -> None:
    save(tmp_path / "west.tif", VALUES[:, :16], nodata=int(VALUES[0, 0]))
    save(tmp_path / "east.tif", VALUES[:, 16:], place=from_origin(5e5 + 480.0, 4.7e6, 30.0, 30.0))
    sources = "".join(
        f"<ComplexSource><SourceFilename relativeToVRT='1'>{name}.tif</SourceFilename><SourceBand>1</SourceBand>"
        f"<SrcRect xOff='0' yOff='0' xSize='{size}' ySize='24'/><DstRect xOff='{off}' yOff='0' xSize='{size}' "
        f"ySize='24'/><ScaleRatio>2</ScaleRatio>{void}</ComplexSource>"
        for name, size, off, void in (("west", 16, 0, f"<NODATA>{VALUES[0, 0]}</NODATA>"), ("east", 15, 16, ""))
    )
    (tmp_path / "a.vrt").write_text(
        "<VRTDataset rasterXSize='31' rasterYSize='24'><SRS>EPSG:32644</SRS><GeoTransform>500000, 30, 0, 4700000, 0, "
        "-30</GeoTransform><VRTRasterBand dataType='Float32' band='1'><NoDataValue>-5</NoDataValue>"
        f"{sources}</VRTRasterBand></VRTDataset>"
    )
    void = FIRST & (np.arange(31) < 16)
    np.testing.assert_array_equal(read_raster(tmp_path / "a.vrt").z[::-1], np.where(void, np.nan, 2.0 * HEIGHTS))


def test_no_warning_of_gdal_reaches_the_caller(tmp_path: Path) -> None:
    path = save(tmp_path / "a.tif", HEIGHTS, WEB_MERCATOR, from_origin(1.1e6, 8.4e6, 100.0, 100.0))
    with warnings.catch_warnings(action="error"):
        imported(path)
