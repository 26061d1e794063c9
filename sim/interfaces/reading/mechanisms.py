"""MJCF files: the ones of this package, and those of a stranger."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import mujoco

from mathnavi.sim.interfaces.reading.files import MEBIBYTE, Refusal, read_bytes

MOST_MJCF = 16 * MEBIBYTE
MOST_ELEMENTS = 25_000_000  # of a height field or a texture
_NOT_A_NUMBER = re.compile(rb"\w+\s*=\s*[\"'][\s\d.e+-]*\bnan\b[\s\d.e+-]*[\"']", re.IGNORECASE)
_ELEMENT = re.compile(rb"<[^<>]*>")
_DECLARATION = re.compile(rb"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)


def read_spec(path: Path, error: Refusal) -> Any:
    """The ``mujoco.MjSpec`` of an MJCF file; ``error`` for one that MuJoCo cannot read.

    A document type is refused: MJCF has none, and entities expand without end.
    """
    content = read_bytes(path, error, MOST_MJCF)
    if _DECLARATION.search(content):
        raise error(f"{path}: it declares a document type or entities; allowed: MJCF, which has neither")
    if found := _NOT_A_NUMBER.search(content):
        raise error(f"{path}: {found[0].decode()}; allowed: finite numbers")
    for rows, columns in (("nrow", "ncol"), ("height", "width")):
        for element in _ELEMENT.findall(content):
            sizes = [re.search(rb"\b%s\s*=\s*[\"']\s*\+?(\d+)" % name.encode(), element) for name in (rows, columns)]
            count = math.prod(int(size[1][:20]) for size in sizes if size)
            if count > MOST_ELEMENTS:
                raise error(f"{path}: {rows} x {columns} are {count} in one element; allowed: at most {MOST_ELEMENTS}")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError, mujoco.FatalError) as fault:
        raise error(f"{path}: MuJoCo cannot read it ({fault})") from None
