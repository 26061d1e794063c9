"""Arrays and texts from MATLAB files: sizes are checked before anything is unpacked."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.reading.files import Refusal, opened
from mathnavi.interfaces.signals import Array

_LARGEST_ITEM = 16  # bytes of a number
_NUMBERS = "biuf"
_SHOWN = 80  # characters of a reason
_HDF5 = b"\x89HDF\r\n\x1a\n"  # of a file of version 7.3, after its own 512 bytes or none


def read_mat(path: Path, error: Refusal, most: int) -> tuple[dict[str, Array], dict[str, str], tuple[str, ...]]:
    """Read the numeric arrays of a MATLAB file of version 4 to 7.2, its texts, and the names of all else.

    Those of a struct are called "struct.field". Raises FileNotFoundError if there is no file, ``error`` for a file of
    another kind, and for arrays of more than ``most`` bytes.
    """
    import scipy.io

    with opened(path, error, most) as file:
        start = file.read(520)
        if start.startswith(_HDF5) or start[512:].startswith(_HDF5):
            raise error(f"{path} is a MATLAB file of version 7.3; allowed: one that save(..., '-v7') has written")
        try:
            file.seek(0)
            size = sum(_LARGEST_ITEM * math.prod(map(int, shape)) for _, shape, _ in scipy.io.whosmat(file))
            if size > most:
                raise error(f"{path}: its arrays may have {size} bytes; allowed: at most {most}")
            file.seek(0)
            content = scipy.io.loadmat(file, simplify_cells=True)
        except error:
            raise
        except Exception as fault:  # a damaged file raises nearly anything
            reason = ascii(str(fault))[1:_SHOWN] if str(fault) else type(fault).__name__  # it may cite binary data
            raise error(f"{path}: not a readable MATLAB file ({reason})") from None
    if wrong := [name for name in content if not name.isprintable()]:
        raise error(f"{path}: not a readable MATLAB file (an array is called {wrong[0]!a:.{_SHOWN}})")
    arrays: dict[str, Array] = {}
    texts: dict[str, str] = {}
    others: list[str] = []
    for name, value in _flat({name: each for name, each in content.items() if not name.startswith("__")}):
        array = np.asarray(value)
        if isinstance(value, str):
            texts[name] = value
        elif array.dtype.kind in _NUMBERS:
            arrays[name] = array
        else:
            others.append(name)
    return arrays, texts, tuple(others)


def _flat(tree: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value
