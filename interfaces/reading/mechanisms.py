"""Reader of MJCF files: those of this package, and those of users."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Any

import mujoco

from mathnavi.interfaces.reading.files import MEBIBYTE, Refusal, read_bytes

MOST_MJCF = 16 * MEBIBYTE
MOST_ELEMENTS = 25_000_000  # of a height field or a texture
_NOT_A_NUMBER = re.compile(rb"\w+\s*=\s*[\"'][\s\d.e+-]*\bnan\b[\s\d.e+-]*[\"']", re.IGNORECASE)
_FILE = re.compile(rb"""\bfile\s*=\s*["']([^"'\0]*)["']""")
_FOLDER = re.compile(rb"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"'\0]*)["']""")
_ELEMENT = re.compile(rb"<[^<>]*>")
_XACRO = re.compile(rb"<xacro:\w+")  # of files that are to be expanded first; MuJoCo passes over them
_DECLARATION = re.compile(rb"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)


def read_spec(path: Path, error: Refusal) -> Any:
    """Read the ``mujoco.MjSpec`` of an MJCF file; ``error`` for one that MuJoCo cannot read.

    A document type is refused: MJCF has none, and entities expand without end. The files that it includes are checked
    in the same way, and every file that it names must be a regular one.
    """
    _check(path, path.parent, error, set())
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError, mujoco.FatalError) as fault:
        raise error(f"{path}: MuJoCo cannot read it ({fault})") from None


def _check(path: Path, folder: Path, error: Refusal, seen: set[Path]) -> None:
    """Check an MJCF file and those that it includes; ``folder`` is that of the first one."""
    if path in seen:
        return
    seen.add(path)
    content = read_bytes(path, error, MOST_MJCF)
    if _DECLARATION.search(content):
        raise error(f"{path}: it declares a document type or entities; allowed: MJCF, which has neither")
    if found := _XACRO.search(content):
        raise error(f"{path}: {found[0].decode()}; allowed: what xacro has expanded the file to")
    if found := _NOT_A_NUMBER.search(content):
        raise error(f"{path}: {found[0].decode()}; allowed: finite numbers")
    elements = _ELEMENT.findall(content)
    for element in elements:
        for rows, columns in (("nrow", "ncol"), ("height", "width")):
            sizes = (re.search(rb"\b%s\s*=\s*[\"']\s*\+?(\d+)" % name.encode(), element) for name in (rows, columns))
            count = math.prod(int(size[1][:20]) for size in sizes if size)
            if count > MOST_ELEMENTS:
                raise error(f"{path}: {rows} x {columns} are {count} in one element; allowed: at most {MOST_ELEMENTS}")
    folders = {folder} | {folder / os.fsdecode(name) for name in _FOLDER.findall(content)}
    for element in elements:
        for name in _FILE.findall(element):
            for named in {each / os.fsdecode(name) for each in folders}:
                if named.is_file() and element.startswith(b"<include"):
                    _check(named, folder, error, seen)
                elif named.exists() and not named.is_file():
                    raise error(f"{path}: file {str(named)!r}; allowed: a regular file")
