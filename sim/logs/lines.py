"""Lines of a text file, plain or packed by gzip, with their numbers."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path

from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.reading.files import MOST_LINES, MOST_OF_A_LINE, opened

_HEAD = 4096  # bytes by which a format is recognised


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """Number, from 1, and text of each line; LogError for what is no text in UTF-8, is damaged or too large."""
    with opened(path, LogError, MOST_LINES) as file:
        content = gzip.GzipFile(fileobj=file) if path.suffix == ".gz" else file
        number = size = 0
        try:
            while line := content.readline(MOST_OF_A_LINE + 1):
                number, size = number + 1, size + len(line)
                if len(line) > MOST_OF_A_LINE:
                    raise LogError(f"{path} line {number} is longer than {MOST_OF_A_LINE} bytes")
                if size > MOST_LINES:
                    raise LogError(f"{path} expands to more than {MOST_LINES} bytes")
                yield number, line.decode("utf-8").rstrip("\r\n")
        except UnicodeDecodeError as fault:
            what = f"byte {fault.start} is {fault.object[fault.start]:#04x}"
            raise LogError(f"{path} line {number} is not text in UTF-8: {what}") from None
        except (OSError, EOFError, zlib.error) as fault:
            raise LogError(f"{path}: not a readable .gz file ({fault})") from None


def head_of(path: Path) -> bytes:
    """The first bytes of a file, of its content where it is packed by gzip; none of a folder, or of damaged content."""
    if path.is_dir():
        return b""
    with opened(path, LogError, 2**63 - 1) as file:
        start: bytes = file.read(_HEAD)
    if not start.startswith(b"\x1f\x8b"):
        return start
    try:
        return zlib.decompressobj(wbits=31).decompress(start, _HEAD)
    except zlib.error:
        return b""
