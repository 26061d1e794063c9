"""Files that a mechanism is read from: its MJCF, the files it includes, and every mesh, texture and height field.

MuJoCo names a file in an attribute ``file``, ``filename`` or ``fileup`` and the like, of an ``<include>``, an asset, a
``<model>`` that is attached or a ``<flexcomp>``, relative to the folder of the first file, of the including one or of
the assets (``meshdir``, ``texturedir``, ``assetdir``), with or without the folders in the name (``strippath``). Each
place where it may lie is tried, and each file that exists counts: with one too many results are computed again, with
one too few old results would pass for new ones.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import unescape
from os.path import normpath, relpath
from pathlib import Path

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.input_files import MOST, digest_of
from mathnavi.interfaces.reading.files import read_bytes

_NAMED = re.compile(r"""\bfile\w*\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_FOLDER = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*(?:"([^"]*)"|'([^']*)')""")


def files_of(mjcf: Path) -> dict[str, bytes]:
    """Contents of an MJCF file, at "", and of every file that it names, by their paths from its folder.

    Raises OSError for a file that cannot be read.
    """
    mjcf = Path(normpath(mjcf))
    contents = {mjcf: read_bytes(mjcf, FieldError, MOST)}
    texts = {mjcf: contents[mjcf].decode(errors="replace")}
    while found := [path for path in _named(mjcf, texts) if path not in contents]:
        for path in dict.fromkeys(found):
            contents[path] = read_bytes(path, FieldError, MOST)
            if contents[path].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
                texts[path] = contents[path].decode(errors="replace")
    return {"" if path == mjcf else Path(relpath(path, mjcf.parent)).as_posix(): contents[path] for path in contents}


def files_digest(mjcf: Path) -> str:
    """SHA-256 of ``files_of``: of the contents of the files, and of their relative paths."""
    return digest_of(files_of(mjcf))


def _named(mjcf: Path, texts: dict[Path, str]) -> Iterator[Path]:
    """Every file that some MJCF texts may name, in each place where MuJoCo may find it."""
    folders = list(dict.fromkeys(path.parent for path in texts))
    assets = [name for text in texts.values() for name in _values(_FOLDER, text)]
    places = list(dict.fromkeys([*folders, *(folder / name for folder in folders for name in assets)]))
    for text in texts.values():
        for name in _values(_NAMED, text):
            for place in places:
                for path in (place / name, place / Path(name.replace("\\", "/")).name):
                    if path.is_file():
                        yield Path(normpath(path))


def _values(pattern: re.Pattern[str], text: str) -> list[str]:
    return [unescape(one or other) for one, other in pattern.findall(text) if one or other]
