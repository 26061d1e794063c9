"""Arrays from .npz files and raw bytes: every header is checked before anything is allocated for it.

An .npz file is a zip archive of .npy files. Each of these states its type and its shape, which must fit the size of
the member, and their sum the largest allowed size: neither a false shape nor a zip bomb takes memory.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from mathnavi.interfaces.reading.files import MEBIBYTE, Refusal, opened, read_bytes
from mathnavi.interfaces.signals import Array

MOST_BYTES = 1024 * MEBIBYTE  # of all arrays of a file, uncompressed
MOST_ARRAYS = 10_000  # of a file
NUMBERS = "biuf"  # kinds of arrays of numbers and truth values
NUMBERS_AND_TEXTS = NUMBERS + "U"
_ENDING = ".npy"
_LONGEST_HEADER = 10_000  # [characters], which numpy considers safe


def read_npz(
    path: Path, error: Refusal, *, kinds: str = NUMBERS, names: Collection[str] | None = None
) -> dict[str, Array]:
    """Read the arrays of an .npz file by name, or those of ``names`` that it has; ``kinds`` are their types' ``kind``.

    Raises FileNotFoundError if there is no file.
    """
    with opened(path, error, MOST_BYTES) as file:
        return _arrays(file, str(path), error, kinds, names)


def decoded_npz(content: bytes, where: str, error: Refusal, *, kinds: str = NUMBERS) -> dict[str, Array]:
    """Decode the arrays of an .npz file from its bytes, found at ``where``."""
    return _arrays(io.BytesIO(content), where, error, kinds, None)


def read_raw(path: Path, dtype: str, shape: tuple[int, ...], error: Refusal) -> Array:
    """Read the array of a type and a shape from a file without a header."""
    size = np.dtype(dtype).itemsize * math.prod(shape)
    content = read_bytes(path, error, size)
    if len(content) != size:
        raise error(f"{path}: {len(content)} bytes; allowed: {size}")
    values: Array = np.frombuffer(content, dtype=dtype).reshape(shape)
    return values


def _arrays(file: IO[bytes], where: str, error: Refusal, kinds: str, names: Collection[str] | None) -> dict[str, Array]:
    try:
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            if len(members) > MOST_ARRAYS:
                raise error(f"{where}: {len(members)} arrays; allowed: at most {MOST_ARRAYS}")
            chosen = {member.filename.removesuffix(_ENDING): member for member in members}
            if len(chosen) < len(members):
                raise error(f"{where}: two arrays have one name; allowed: each name once")
            if names is not None:
                chosen = {name: member for name, member in chosen.items() if name in names}
            size = sum(member.file_size for member in chosen.values())
            if size > MOST_BYTES:
                raise error(f"{where}: its arrays have {size} bytes; allowed: at most {MOST_BYTES}")
            return {
                name: _array(archive, member, f"{where}: array {name!r}", error, kinds)
                for name, member in chosen.items()
            }
    except error:
        raise
    except Exception as fault:  # a damaged archive raises nearly anything: BadZipFile, zlib.error, struct.error, ...
        reason = str(fault) or type(fault).__name__
        raise error(f"{where}: not a readable .npz file ({reason})") from None


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo, where: str, error: Refusal, kinds: str) -> Array:
    with archive.open(member) as stream:
        shape, dtype = _header(stream)
        declared = dtype.itemsize * math.prod(shape)
        there = member.file_size - stream.tell()
        if dtype.kind not in kinds:
            raise error(f"{where} has the type {dtype}; allowed: numbers{' and texts' * ('U' in kinds)}")
        if min(shape, default=0) < 0 or declared != there:
            raise error(f"{where} states the shape {shape} of {dtype}, {declared} bytes, and holds {there}")
    with archive.open(member) as stream:
        array: Array = npy.read_array(stream, allow_pickle=False, max_header_size=_LONGEST_HEADER)
    return array


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Return the shape and the type that an .npy file states."""
    version = npy.read_magic(stream)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(stream, max_header_size=_LONGEST_HEADER)
    return shape, dtype
