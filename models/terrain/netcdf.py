"""NetCDF files: what they say and GDAL passes over.

Coordinates are separate variables, of which GDAL takes the first and the last. ``valid_min`` and ``valid_max`` mark
voids; GDAL honours them together only. What is cut off from a classic file (CDF-1, -2 and -5), it reads as zeros: its
header says where each variable begins and which dimensions it has, and a variable along the unlimited dimension has one
part in each record.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.reading.files import opened
from mathnavi.interfaces.signals import Array

_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}  # [bytes] of a value, by its type
_STREAMING = {4: 2**32 - 1, 8: 2**64 - 1}  # number of records that is not known
_LONGEST = 2**20  # [bytes] of a name or a list of the header
_AXES = ("latitude", "longitude", "projection_x_coordinate", "projection_y_coordinate")
_UNEVEN = 0.05  # steps that a coordinate may be beside its place, as one of 32 bits is by rounding


def check_axes(dataset: Any, file: Path, where: str) -> None:
    """Raise TerrainError for coordinates of an open netCDF file that are not in equal steps."""
    import rasterio
    from rasterio.errors import RasterioIOError

    tags = dataset.tags()
    for name in sorted({key.partition("#")[0] for key, value in tags.items() if _is_axis(key, value)}):
        try:
            with rasterio.open(f'netcdf:"{file}":{name}') as axis:
                if min(axis.shape) > 1 or max(axis.shape) < 3 or max(axis.shape) not in dataset.shape:
                    continue
                values = axis.read(1).ravel().astype(float)
        except RasterioIOError:  # a single number, which is no axis
            continue
        places = np.linspace(values[0], values[-1], values.size)
        off = np.abs(values - places) / abs(places[1] - places[0])
        if not off.max() <= _UNEVEN:
            k = int(off.argmax())
            raise TerrainError(f"{where}: {name}[{k}] = {values[k]:.10g}; allowed: coordinates in equal steps")


def _is_axis(key: str, value: str) -> bool:
    return (key.endswith("#standard_name") and value in _AXES) or (
        key.endswith("#units") and value.startswith("degree")
    )


def outside_valid(values: Array, tags: dict[str, str], where: str) -> NDArray[np.bool_]:
    """Return True where values of a variable with attributes ``tags`` are below valid_min or above valid_max.

    Raises TerrainError for a limit that is no number.
    """
    limits = {"valid_min": -np.inf, "valid_max": np.inf}
    for name in limits:
        try:
            limits[name] = float(tags.get(name, limits[name]))
        except ValueError:
            raise TerrainError(f"{where}: {name} = {tags[name]!r}; allowed: a number") from None
    return (values < limits["valid_min"]) | (values > limits["valid_max"])


def check_whole(path: Path, most: int) -> None:
    """Raise TerrainError for a classic netCDF file that ends before its last variable does; other files pass."""
    with opened(path, TerrainError, most) as file:
        if file.read(3) != b"CDF":
            return
        try:
            wanted = _Header(file).length
        except (struct.error, IndexError, KeyError):
            raise TerrainError(f"{path}: not a readable .nc file (its header is damaged or cut off)") from None
    if path.stat().st_size < wanted:
        raise TerrainError(f"{path}: {path.stat().st_size} bytes; allowed: {wanted}, as its header says")


class _Header:
    """The header of a classic netCDF file, read in its order."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        version = self._number(1)
        self._word = 8 if version == 5 else 4  # [bytes] of a count
        records = self._number(self._word)
        sizes = [self._dimension() for _ in range(self._count())]
        self._attributes()
        ends, slabs, along = [], [], []  # along: beginnings of variables along the unlimited dimension, 0 long
        for _ in range(self._count()):
            self._text()
            shape = [sizes[self._number(self._word)] for _ in range(self._number(self._word))]
            self._attributes()
            kind = self._number(4)
            self._number(self._word)  # its length, which may be too large to be stated
            begin = self._number(4 if version == 1 else 8)
            if shape[:1] == [0]:
                slabs.append(math.prod(shape[1:]) * _SIZES[kind])
                along.append(begin)
            else:
                ends.append(begin + math.prod(shape) * _SIZES[kind])
        if along and records not in (0, _STREAMING[self._word]):
            record = slabs[0] if len(slabs) == 1 else sum(-(-slab // 4) * 4 for slab in slabs)
            ends += [begin + (records - 1) * record + slab for begin, slab in zip(along, slabs, strict=True)]
        self.length = max(ends, default=0)
        """bytes that the file must have"""

    def _number(self, size: int) -> int:
        return int(struct.unpack({1: ">B", 4: ">I", 8: ">Q"}[size], self._file.read(size))[0])

    def _count(self) -> int:
        self._number(4)  # tag of the list
        return self._number(self._word)

    def _text(self) -> None:
        self._skip(self._number(self._word))

    def _skip(self, length: int) -> None:
        if length > _LONGEST or len(self._file.read(-(-length // 4) * 4)) < length:
            raise IndexError(length)

    def _dimension(self) -> int:
        self._text()
        return self._number(self._word)

    def _attributes(self) -> None:
        for _ in range(self._count()):
            self._text()
            kind = self._number(4)
            self._skip(self._number(self._word) * _SIZES[kind])
