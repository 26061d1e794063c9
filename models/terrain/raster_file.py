"""Raster files of heights, read by GDAL: one band, in any coordinate system that lies on the ground.

Rows and columns are turned to north and east. A picture whose sides run north and east, and that is true to scale, is
read unchanged. A rotated one lies on a north-up grid of the file's coordinate system; one whose projection stretches
lengths by more than 1 % (Web Mercator stretches them by 1 / cos(latitude)) on a grid in degrees. There the place of
each node in the picture is found, and its height read between four pixels, once.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.reading.files import MOST_TEXT, read_bytes
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.ascii_grid import check_ascii_grid
from mathnavi.models.terrain.ellipsoid import DEGREE, EARTH, Ellipsoid
from mathnavi.models.terrain.netcdf import check_axes, check_whole, outside_valid
from mathnavi.models.terrain.packed_files import MOST_BYTES, check_files, check_virtual, unpacked
from mathnavi.models.terrain.placement import corners_of, located, true_to_scale
from mathnavi.models.terrain.raster import Box, Raster, cropped, within
from mathnavi.models.terrain.vertical import Heights, heights_of, is_metre, parts_of
from mathnavi.models.terrain.voids import GROUND, check_ground

FORMATS = {
    ".tif": "GTiff",
    ".tiff": "GTiff",
    ".hgt": "SRTMHGT",
    ".asc": "AAIGrid",
    ".bil": "EHdr",
    ".flt": "EHdr",
    ".img": "HFA",
    ".nc": "netCDF",
    ".vrt": "VRT",
}
"""GDAL's driver by the ending of a file"""
OPTIONS = {".asc": {"DATATYPE": "Float64"}}  # where GDAL takes whole numbers, NaN becomes 0
TILES = ((1201, 1201), (3601, 3601), (3601, 1801))  # nodes north and east of an SRTM tile
MOST_READ = 2**27  # heights, of the part of a file that is read
_BESIDE, _INTO, _COPY = (
    "a .prj beside the file states one",
    "rio edit-info --crs writes one into the file",
    "gdal_translate -a_srs writes a copy that has one",
)
_PLACED = {
    **dict.fromkeys(FORMATS, _COPY),
    **dict.fromkeys((".asc", ".bil", ".flt"), _BESIDE),
    **dict.fromkeys((".tif", ".tiff", ".img"), _INTO),
}
"""how a file of an ending gets a coordinate system"""
UNSTATED_VOID = -32768  # where 16-bit heights state no void: SRTM's
FARTHEST = (1e8, 1e8)  # [m] of any projection's coordinates east and north
FARTHEST_DEGREES = (720.0, 90.5)  # of longitude; of latitude, where the outermost nodes of a tile may be the poles


def read_raster(
    path: Path,
    crop: Box | None = None,
    scale: float | None = None,
    nodata: float | None = None,
    heights: tuple[float, float] | None = None,
) -> Raster:
    """Read the heights of a file, or of the part within ``crop``; the file may lie in a ``.zip`` or be a ``.gz``.

    ``crop`` (west, south, east, north): [degrees], or [m] of a projection. ``scale`` [m per unit] of the heights,
    needed where the file does not say which unit they have. ``nodata``: a value that marks a void, in addition to the
    one that the file states. ``heights`` [m]: range of heights that are ground. Raises TerrainError for a file that is
    damaged, has no place on the ground, or has heights that no ground has.
    """
    import rasterio
    from rasterio._err import CPLE_BaseError  # GDAL's own, which some properties raise; it has no public name
    from rasterio.errors import RasterioError, RasterioIOError

    with unpacked(path, tuple(FORMATS)) as file:
        ending = file.suffix.lower()
        try:
            _check_before(file)
            # It warns of a missing place, which is an error below. Pictures may name files, and none is fetched.
            with (
                warnings.catch_warnings(action="ignore"),
                rasterio.Env(GDAL_VRT_ENABLE_PYTHON="NO", GDAL_HTTP_MAX_RETRY=0, CPL_DEBUG=False),
                rasterio.open(file, driver=FORMATS[ending], **OPTIONS.get(ending, {})) as dataset,
            ):
                check_files(file, dataset.files)
                if dataset.driver == "netCDF":
                    check_axes(dataset, file, str(path))
                if dataset.driver == "VRT":
                    _check_sources(dataset, check_virtual(file), str(path))
                return _Reader(dataset, path, file, scale, nodata, heights).raster(crop)
        except RasterioIOError as error:  # its cause says more than itself
            raise TerrainError(f"{path}: not a readable {_kind(file)} ({_line(error.__cause__ or error)})") from None
        except (RasterioError, CPLE_BaseError) as error:
            raise TerrainError(f"{path}: not a readable {_kind(file)} ({_line(error)})") from None


def _check_before(file: Path, placed: bool = False) -> None:
    """Raise TerrainError for a file that GDAL would not recognise, follow to others, or read beyond its end.

    ``placed``: it is a source of a virtual raster, which opens it without ``OPTIONS``.
    """
    if file.suffix.lower() == ".vrt":
        for source in check_virtual(file):
            _check_before(source, placed=True)
    if file.suffix.lower() == ".asc":
        check_ascii_grid(file, finite=placed)
    if file.suffix.lower() == ".nc":
        check_whole(file, MOST_BYTES)
    if file.suffix.lower() in (".bil", ".flt"):
        _check_raw(file)
    if file.suffix.lower() == ".hgt":
        if re.match(r"[NS]\d{2}[EW]\d{3}", file.stem, re.IGNORECASE) is None:
            raise TerrainError(f"{file}: the name must state the south-west corner, as N42E080.hgt does")
        size = file.stat().st_size
        if size not in {2 * rows * columns for rows, columns in TILES}:
            allowed = ", ".join(f"{2 * rows * columns} ({rows} x {columns})" for rows, columns in TILES)
            raise TerrainError(f"{file}: {size} bytes are not a whole tile; allowed: {allowed}")


def _check_sources(dataset: Any, sources: Sequence[Path], where: str) -> None:
    """Raise TerrainError if a picture states voids, a unit, a scale or an offset that the virtual raster does not."""
    import rasterio

    for source in sources:
        with rasterio.open(source, driver=FORMATS[source.suffix.lower()]) as own:
            voids = own.nodata is not None or own.mask_flag_enums[0][0].name != "all_valid"
            if voids and dataset.nodata is None:
                raise TerrainError(
                    f"{where}: {source.name} has voids; allowed: if the virtual raster has a NoDataValue"
                )
            stated = (("unit", "units", ""), ("scale", "scales", 1.0), ("offset", "offsets", 0.0))
            for name, names, default in stated:
                theirs, ours = getattr(own, names)[0] or default, getattr(dataset, names)[0] or default
                same = theirs == ours or (name == "unit" and is_metre(str(theirs)) and is_metre(str(ours)))
                if theirs != default and not same:
                    raise TerrainError(
                        f"{where}: {source.name} has the {name} {theirs}, the virtual raster {ours or 'none'}; "
                        "allowed: the same"
                    )


def _check_raw(file: Path) -> None:
    """Raise TerrainError for a raw file that is too short: GDAL reads zeros beyond its end."""
    import rasterio

    with rasterio.open(file, driver="EHdr") as dataset:
        bits = dataset.tags(1, ns="IMAGE_STRUCTURE").get("NBITS", 8 * np.dtype(dataset.dtypes[0]).itemsize)
        wanted = -(-dataset.count * dataset.height * dataset.width * int(bits) // 8)
    if file.stat().st_size < wanted:
        raise TerrainError(f"{file}: {file.stat().st_size} bytes; allowed: {wanted}, as its .hdr says")


def _kind(file: Path) -> str:
    return "GeoTIFF" if file.suffix.lower() in (".tif", ".tiff") else f"{file.suffix} file"


def _sidecar(name: str) -> bytes:
    return read_bytes(Path(name), TerrainError, MOST_TEXT)


def _counted(part: slice, count: int, from_end: bool) -> tuple[int, int]:
    """First and last, exclusive, of the rows or columns of a file; ``from_end``: ``part`` is counted from its end."""
    return (count - part.stop, count - part.start) if from_end else (part.start, part.stop)


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:300]


def ellipsoid_of(crs: Mapping[str, Any], where: str) -> Ellipsoid:
    """Ellipsoid of a coordinate system in PROJJSON; TerrainError if it states none, or angles to its centre."""
    across = parts_of(crs)[0]
    base = across.get("base_crs", across)
    datum = base.get("datum") or base.get("datum_ensemble") or {}
    stated = datum.get("ellipsoid", {})
    major = stated.get("radius", stated.get("semi_major_axis"))
    if isinstance(major, Mapping):
        major = major["value"] * major["unit"]["conversion_factor"]
    if not major:
        raise TerrainError(f"{where}: its coordinate system {base.get('name', 'unnamed')!r} states no ellipsoid")
    if "semi_minor_axis" in stated:
        squared = 1.0 - (stated["semi_minor_axis"] / major) ** 2
    else:
        flattening = 1.0 / stated["inverse_flattening"] if stated.get("inverse_flattening") else 0.0
        squared = flattening * (2.0 - flattening)
    axes = base.get("coordinate_system", {}).get("axis", [])
    # GDAL calls them ellipsoidal where it writes them into a file, but for these names.
    if squared and any("ocentric" in str(each.get("name", "")).lower() for each in (base, *axes)):
        raise TerrainError(f"{where}: planetocentric latitudes on an ellipsoid; allowed: planetographic ones")
    return Ellipsoid(str(stated.get("name", "unnamed")), float(major), float(squared))


class _Reader:
    """One open file."""

    def __init__(
        self,
        dataset: Any,
        path: Path,
        file: Path,
        scale: float | None,
        nodata: float | None,
        heights: tuple[float, float] | None,
    ) -> None:
        self._dataset, self._path, self._nodata, self._allowed = dataset, path, nodata, heights
        self._ending = file.suffix.lower()
        self._name = file.stem.partition(".")[0] if file.suffix.lower() == ".hgt" else file.stem
        self._check_bands(file)
        if scale is None:
            self._check_numbers()
        self._crs = self._projection()
        system = self._crs.to_dict(projjson=True)
        self._ellipsoid = ellipsoid_of(system, str(path))
        unit = str(dataset.units[0] or "")
        self._heights = heights_of(unit, system, scale, str(path))
        self._tile = file.suffix.lower() == ".hgt"
        if self._tile and not self._heights.datum:
            self._heights = Heights(self._heights.metres, "geoid (EGM96, as of all SRTM tiles)", self._heights.taken)
        degrees = self._crs.is_geographic and math.isclose(self._crs.units_factor[1], DEGREE, rel_tol=1e-9)
        self._kept = degrees or (self._crs.is_projected and true_to_scale(dataset, self._ellipsoid))
        self._degrees = degrees or not self._kept  # of the grid

    def _check_bands(self, file: Path) -> None:
        dataset, path = self._dataset, self._path
        names = [each.name for each in dataset.colorinterp]
        if dataset.count != 1 and not (dataset.count == 2 and names[1] == "alpha"):
            more = f", {len(dataset.subdatasets)} variables" if dataset.subdatasets else ""
            raise TerrainError(f"{path}: {dataset.count} bands{more}; allowed: one, the heights")
        if dataset.driver == "GTiff" and dataset.subdatasets:
            raise TerrainError(f"{path}: {len(dataset.subdatasets)} pages; allowed: one, the heights")
        if dataset.dtypes[0].startswith("complex"):
            raise TerrainError(f"{path}: heights of the type {dataset.dtypes[0]}; allowed: real numbers")
        block = math.prod(dataset.block_shapes[0]) * np.dtype(dataset.dtypes[0]).itemsize
        if block > MOST_BYTES:
            raise TerrainError(f"{path}: it expands to more than {MOST_BYTES // 2**30} GB; allowed: up to that")
        if (masked := Path(f"{file}.msk")).exists() and not any(
            flag.name == "per_dataset" for flag in dataset.mask_flag_enums[0]
        ):
            raise TerrainError(f"{path}: its mask {masked.name} cannot be read")
        scale, offset = dataset.scales[0], dataset.offsets[0]
        if not (math.isfinite(scale) and scale and math.isfinite(offset)):
            raise TerrainError(
                f"{path}: the band has scale {scale:g} and offset {offset:g}; allowed: finite, no scale 0"
            )
        if min(dataset.shape) < 2:
            raise TerrainError(f"{path}: {dataset.height} x {dataset.width} heights; allowed: at least 2 x 2")

    def _check_numbers(self) -> None:
        """Raise TerrainError where the numbers of the band are declared to be other than heights."""
        dataset, path = self._dataset, self._path
        if dataset.tags(1).get("positive", "").lower() == "down":
            raise TerrainError(f"{path}: depths, measured downwards (positive = down); allowed: heights")
        meaning = "colours, by its colour table" if dataset.colorinterp[0].name == "palette" else ""
        if dataset.tags(1).get("LAYER_TYPE") == "thematic":
            meaning = "classes, by its type of layer"
        if any(b"<CategoryNames" in _sidecar(each) for each in dataset.files if each.endswith(".aux.xml")):
            meaning = "categories, by their names"
        if meaning:
            raise TerrainError(
                f"{path}: scale is missing; the numbers of the band are {meaning}: --scale says how many metres one is"
            )

    def _projection(self) -> Any:
        """The coordinate system; TerrainError unless the picture lies on the ground."""
        dataset, crs, transform = self._dataset, self._dataset.crs, self._dataset.transform
        if transform.is_identity and (dataset.gcps[0] or dataset.rpcs):
            how = "ground control points" if dataset.gcps[0] else "rational polynomial coefficients"
            raise TerrainError(f"{self._path}: placed by {how}; allowed: by a transform, which gdalwarp brings it to")
        if crs is None or not (crs.is_geographic or crs.is_projected):
            raise TerrainError(f"{self._path}: no coordinate system on the ground ({_PLACED[self._ending]})")
        corners = np.abs(corners_of(dataset))
        unit = crs.units_factor[1] / (DEGREE if crs.is_geographic else 1.0)
        if not (
            abs(transform.determinant) > 0.0
            and (unit * corners.max(axis=1) < (FARTHEST_DEGREES if crs.is_geographic else FARTHEST)).all()
        ):
            raise TerrainError(f"{self._path}: its transform {tuple(transform)[:6]} places it nowhere on the ground")
        return crs

    def raster(self, crop: Box | None) -> Raster:
        transform = self._dataset.transform
        if self._kept and transform.b == transform.d == 0.0:
            return self._straight(crop)
        return self._turned(crop)

    def _straight(self, crop: Box | None) -> Raster:
        """The picture if its sides run north and east: from the north or from the south, from the west or the east."""
        dataset = self._dataset
        unit = 1.0 if self._degrees else self._crs.linear_units_factor[1]
        transform = dataset.transform
        from_north, from_west = transform.e < 0.0, transform.a > 0.0
        step_north, step_east = abs(transform.e) * unit, abs(transform.a) * unit
        # Heights are those of the pixels' centres.
        west = (transform.c + (0.5 if from_west else dataset.width - 0.5) * transform.a) * unit
        south = (transform.f + (dataset.height - 0.5 if from_north else 0.5) * transform.e) * unit
        rows, columns = slice(0, dataset.height), slice(0, dataset.width)
        if crop is not None:
            rows, columns = within(crop, dataset.shape, (south, west), (step_north, step_east), self._name)
        window = (_counted(rows, dataset.height, from_north), _counted(columns, dataset.width, not from_west))
        south, west = south + rows.start * step_north, west + columns.start * step_east
        latitude = south + 0.5 * (rows.stop - rows.start - 1) * step_north if self._degrees else None
        to_north, to_east = (1.0, 1.0) if latitude is None else self._ellipsoid.metres_per_degree(latitude)
        order = slice(None, None, -1 if from_north else 1), slice(None, None, 1 if from_west else -1)
        z = self._read(window, min(step_north * to_north, step_east * to_east), order)
        return self._labelled(Raster(self._name, z, step_north, step_east, latitude, south=south, west=west))

    def _turned(self, crop: Box | None) -> Raster:
        """The picture as it lies in the file, with the place in it of each node of a north-up grid."""
        dataset = self._dataset
        unit = 1.0 if self._degrees else self._crs.linear_units_factor[1]
        grid = located(dataset, self._ellipsoid, self._degrees, self._kept, str(self._path))
        latitude = 0.5 * (grid.box[1] + grid.box[3]) if self._degrees else None
        to_north, to_east = (unit, unit) if latitude is None else self._ellipsoid.metres_per_degree(latitude)
        z = self._read(None, min(grid.steps[0] * to_north, grid.steps[1] * to_east))
        raster = Raster(
            self._name, z, grid.steps[0] * unit, grid.steps[1] * unit, latitude,
            south=grid.box[1] * unit, west=grid.box[0] * unit,
            locate=lambda east, north: grid.places(east / unit, north / unit), extent=grid.nodes,
        )  # fmt: skip
        return cropped(self._labelled(raster), crop)

    def _labelled(self, raster: Raster) -> Raster:
        source = "SRTM" if self._tile else ""
        return replace(
            raster, source=source, ellipsoid=self._ellipsoid, datum=self._heights.datum, taken=self._heights.taken
        )

    def _read(
        self, window: Sequence[Sequence[int]] | None, step: float, order: tuple[slice, slice] | None = None
    ) -> Array:
        """Heights (rows, cols) [m], NaN where void; ``step`` [m] between neighbours.

        ``order`` brings rows and columns of the file to south first and west first; without, they stay unchanged.
        """
        dataset = self._dataset
        shape = dataset.shape if window is None else tuple(last - first for first, last in window)
        if math.prod(shape) > MOST_READ:
            raise TerrainError(f"{self._path}: {math.prod(shape)} heights; allowed: at most {MOST_READ}, --crop them")
        values = dataset.read(1, window=window, masked=True)
        void, raw = np.ma.getmaskarray(values), values.data
        if dataset.count == 2:  # GDAL takes one of mask, alpha and the value of voids, here all count
            void = void | (dataset.read(2, window=window) == 0)
        if dataset.driver == "netCDF":
            void = void | outside_valid(raw, dataset.tags(1), str(self._path))
        if dataset.nodata is None and dataset.dtypes[0] == "int16":
            void = void | (raw == UNSTATED_VOID)
        for value in (dataset.nodata, self._nodata):
            if value is not None:
                with np.errstate(over="ignore"):
                    void = void | (raw == np.float64(value)) | (raw == np.float32(value))
        if order is not None:
            void, raw = void[order], raw[order]
        with np.errstate(over="ignore", invalid="ignore"):
            z = raw.astype(np.float64) * dataset.scales[0] + dataset.offsets[0]
            z = np.where(void | ~np.isfinite(raw), np.nan, z * self._heights.metres)
        allowed = self._allowed or (GROUND if EARTH[0] < self._ellipsoid.semi_major < EARTH[1] else None)
        if self._allowed is None or not self._vouched(z):
            check_ground(raw, z, step, allowed, str(self._path), south_up=order is not None)
        return z

    def _vouched(self, z: Array) -> bool:
        """Whether the user has said which heights are ground, and all are."""
        low, high = self._allowed or (-math.inf, math.inf)
        return bool(np.nanmin(z, initial=high) >= low and np.nanmax(z, initial=low) <= high)
