"""Elevation models in archives and by reference: what a file may bring with it.

A map is data. What is read lies in its own folder: no address, no other folder, and no more than ``MOST_BYTES``.
"""

from __future__ import annotations

import gzip
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO
from xml.etree import ElementTree

from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.reading.files import MOST_TEXT, read_bytes

MOST_BYTES = 4 * 2**30  # of what a file expands to
_CHUNK = 1 << 20
_ELEMENTS = frozenset(
    [
        "VRTDataset",
        "SRS",
        "GeoTransform",
        "Metadata",
        "MDI",
        "VRTRasterBand",
        "Description",
        "NoDataValue",
        "ColorInterp",
        "Scale",
        "Offset",
        "UnitType",
        "HideNoDataValue",
        "SimpleSource",
        "ComplexSource",
        "SourceFilename",
        "SourceBand",
        "SourceProperties",
        "SrcRect",
        "DstRect",
        "NODATA",
        "ScaleOffset",
        "ScaleRatio",
        "Histograms",
        "HistItem",
        "OverviewList",
        "BlockXSize",
        "BlockYSize",
    ]
)
"""elements of a virtual raster that places pictures side by side"""


@contextmanager
def unpacked(path: Path, endings: tuple[str, ...]) -> Iterator[Path]:
    """The file itself, or the one elevation model in a ``.zip`` or ``.gz``, unpacked for as long as the context lasts.

    ``endings`` are those of elevation models. Raises TerrainError for an archive that is damaged, has none or several,
    or expands to more than ``MOST_BYTES``. A TerrainError of the context names the archive in place of that folder.
    """
    if path.suffix.lower() not in (".zip", ".gz"):
        yield path
        return
    with TemporaryDirectory(prefix="mathnavi-terrain-") as folder:
        try:
            if path.suffix.lower() == ".gz":
                found = [Path(folder) / path.stem]
                with gzip.open(path) as content:
                    _copy(content, found[0], path, 0)
            else:
                found = _members(path, Path(folder))
        except (zipfile.BadZipFile, OSError, EOFError, zlib.error, NotImplementedError, RuntimeError) as error:
            raise TerrainError(f"{path}: not a readable archive ({error})") from None
        maps = sorted(each for each in found if each.suffix.lower() in endings)
        if len(maps) != 1:
            names = ", ".join(each.name for each in maps) or "none"
            raise TerrainError(f"{path}: elevation models in it: {names}; allowed: one, {', '.join(endings)}")
        try:
            yield maps[0]
        except TerrainError as error:  # of a file in the archive, which lies in no folder that the user knows
            raise TerrainError(str(error).replace(folder, str(path))) from None


def _members(path: Path, folder: Path) -> list[Path]:
    """Unpack the files of a ``.zip`` into one folder, without its own folders."""
    found: list[Path] = []
    total = 0
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            name = Path(member.filename.replace("\\", "/")).name
            if member.is_dir() or not name or name.startswith("."):
                continue
            target = folder / name
            if target in found:
                raise TerrainError(f"{path}: two files are named {name}; allowed: one")
            with archive.open(member) as content:
                total = _copy(content, target, path, total)
            found.append(target)
    return found


def _copy(content: IO[bytes] | gzip.GzipFile, target: Path, path: Path, total: int) -> int:
    """Copy what an archive holds, and return the bytes so far."""
    with target.open("wb") as out:
        while chunk := content.read(_CHUNK):
            total += len(chunk)
            if total > MOST_BYTES:
                raise TerrainError(f"{path}: it expands to more than {MOST_BYTES // 2**30} GB; allowed: up to that")
            out.write(chunk)
    return total


def check_virtual(path: Path) -> list[Path]:
    """Return the pictures that a virtual raster (``.vrt``) places.

    Raises TerrainError for one that does more than place pictures of the same folder.
    """
    sources = []
    content = read_bytes(path, TerrainError, MOST_TEXT)
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise TerrainError(f"{path}: it declares entities; allowed: elements alone")
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise TerrainError(f"{path}: not a readable virtual raster ({error})") from None
    for each in root.iter():
        if each.tag not in _ELEMENTS or "subClass" in each.attrib:
            what = each.attrib.get("subClass", each.tag)
            raise TerrainError(f"{path}: {what}; allowed: a mosaic of pictures, SimpleSource or ComplexSource")
        if each.tag == "SourceFilename":
            sources.append(_source(path, (each.text or "").strip()))
    return [source for source in dict.fromkeys(sources) if source.is_file()]


def _source(path: Path, name: str) -> Path:
    folder = path.parent.resolve()
    source = (folder / name).resolve()
    if not name or "://" in name or "/vsi" in name or not source.is_relative_to(folder):
        raise TerrainError(f"{path}: it refers to {name!r}; allowed: a file in its own folder")
    if source.suffix.lower() not in (".tif", ".tiff", ".hgt", ".img", ".asc", ".bil"):
        raise TerrainError(f"{path}: it refers to {name!r}; allowed: a picture, .tif, .hgt, .img, .asc or .bil")
    return source


def check_files(path: Path, files: list[str]) -> None:
    """Raise TerrainError if a file that was opened consists of files outside its folder."""
    folder = path.parent.resolve()
    for each in files:
        if each.startswith("/vsi") or not Path(each).resolve().is_relative_to(folder):
            raise TerrainError(f"{path}: it refers to {each!r}; allowed: a file in its own folder")
