"""ASCII grids (``.asc``): what GDAL passes over in them.

After lines of a key and a value come nrows times ncols numbers, in any number of lines. GDAL takes as many as it needs,
a word for 0, and NaN for 0 among whole numbers; a wrong number of columns shifts each row against the last.
"""

from __future__ import annotations

import re
from pathlib import Path

from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.reading.files import opened

MOST_TEXT = 2**33  # [bytes]
_CHUNK, _LINE = 1 << 22, 1 << 16  # [bytes]
_PLAIN = b"0123456789.,eE+- \t\r\n"
_FINITE = re.compile(rb"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?")
_NUMBER = re.compile(rb"(?:" + _FINITE.pattern + rb"|[+-]?(?i:nan|inf|infinity|\d[.,]#\w+))")


def check_ascii_grid(path: Path, finite: bool = False) -> None:
    """Raise TerrainError for a word among the numbers, and for another number of them than rows and columns say.

    ``finite``: also for NaN and infinity, where GDAL is not told that heights are no whole numbers.
    """
    allowed = _FINITE if finite else _NUMBER
    with opened(path, TerrainError, MOST_TEXT) as file:
        sizes: dict[bytes, bytes] = {}
        count, rest = 0, b""
        line = file.readline(_LINE)
        while words := line.split():
            if _NUMBER.fullmatch(words[0]) or len(words) != 2:
                break
            sizes[words[0].lower()] = words[1]
            line = file.readline(_LINE)
        chunk = line
        while chunk or rest:
            text = rest + chunk
            words = text.split()
            # The last word of a chunk may go on in the next one.
            rest = words.pop() if chunk and words and not chunk[-1:].isspace() else b""
            plain = not text.translate(None, _PLAIN)  # quicker than word by word
            if not plain and (odd := next((word for word in words if not allowed.fullmatch(word)), None)):
                raise TerrainError(f"{path}: {odd[:40].decode(errors='replace')!r} among the heights; allowed: numbers")
            count += len(words)
            chunk = file.read(_CHUNK)
    rows, columns = (int(sizes[key]) if sizes.get(key, b"").isdigit() else 0 for key in (b"nrows", b"ncols"))
    if rows and columns and count != rows * columns:
        raise TerrainError(f"{path}: {count} heights; allowed: {rows * columns}, {rows} rows of {columns}")
