"""Readers of bytes, text and JSON from files; every file is read by these and their neighbours here.

A file that is larger than a file of its kind can be is refused before it is read. An error is one line that names the
file, the place in it, the value, and what is allowed.
"""

from __future__ import annotations

import json
import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MEBIBYTE = 2**20
MOST_TEXT = 64 * MEBIBYTE  # of a document that is read as a whole
MOST_LINES = 1024 * MEBIBYTE  # of a file that is read line by line
MOST_OF_A_LINE = MEBIBYTE
_MOST_DIGITS = 300
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")  # the escape of half a character

Refusal = type[ValueError]  # the type of the error that is raised for a wrong file


def read_bytes(path: Path, error: Refusal, most: int) -> bytes:
    """Read the content of a file of at most ``most`` bytes; FileNotFoundError if it does not exist."""
    with opened(path, error, most) as file:
        content: bytes = file.read(most + 1)
    if len(content) > most:  # it has grown, or does not state its size
        raise _too_large(path, error, len(content), most)
    return content


def opened(path: Path, error: Refusal, most: int) -> Any:
    """Open a file of at most ``most`` bytes for reading bytes; a folder, a pipe or a device is refused."""
    try:
        file = open(path, "rb", opener=_without_waiting)  # noqa: SIM115 - the caller closes it
    except IsADirectoryError:
        raise error(f"{path} is a folder; allowed: a file") from None
    except ValueError as fault:  # a null character
        raise error(f"{str(path)!r} is not the name of a file ({fault})") from None
    about = os.fstat(file.fileno())
    if not stat.S_ISREG(about.st_mode):
        file.close()
        raise error(f"{path} is not a regular file; allowed: a file that is not a pipe or a device")
    if about.st_size > most:
        file.close()
        raise _too_large(path, error, about.st_size, most)
    return file


def read_text(path: Path, error: Refusal, most: int = MOST_TEXT) -> str:
    """Read the text of a file in UTF-8."""
    try:
        return read_bytes(path, error, most).decode("utf-8")
    except UnicodeDecodeError as fault:
        raise error(f"{path} is not text in UTF-8: byte {fault.start} is {fault.object[fault.start]:#04x}") from None


def read_json(path: Path, kind: Any, error: Refusal, *, closed: bool = False) -> Any:
    """Read the document in a JSON file as an instance of ``kind``, by ``schema.validated``."""
    return read_document(path, kind, error, closed=closed)[0]


def read_document(path: Path, kind: Any, error: Refusal, *, closed: bool = False) -> tuple[Any, Any]:
    """Read the document in a JSON file as an instance of ``kind``, and as plain data."""
    tree = parsed(read_text(path, error), str(path), error)
    return checked(kind, tree, str(path), error, closed=closed), tree


def read_lines(path: Path, kind: Any, error: Refusal) -> Iterator[Any]:
    """Read the documents in a file that holds one in each line."""
    with opened(path, error, MOST_LINES) as file:
        number = 0
        while line := file.readline(MOST_OF_A_LINE + 1):
            number += 1
            where = f"{path} line {number}"
            if len(line) > MOST_OF_A_LINE:
                raise error(f"{where} is longer than {MOST_OF_A_LINE} bytes")
            if line.strip():
                yield decoded(line, kind, where, error)


def decoded(text: str | bytes, kind: Any, where: str, error: Refusal, *, closed: bool = False) -> Any:
    """Decode a JSON text, found at ``where``, as an instance of ``kind``."""
    return checked(kind, parsed(text, where, error), where, error, closed=closed)


def parsed(text: str | bytes, where: str, error: Refusal) -> Any:
    """Parse a JSON text, found at ``where``, as plain data of any shape."""
    try:
        text = text.decode("utf-8") if isinstance(text, bytes) else text
        tree = json.loads(text, parse_int=_integer)
        if _SURROGATE.search(text) and (half := re.search("[\ud800-\udfff]", json.dumps(tree, ensure_ascii=False))):
            raise ValueError(f"{half[0]!r} is half a character, which UTF-8 cannot hold")
    except RecursionError:
        raise error(f"{where} is nested too deeply; allowed: less than some hundred levels") from None
    except (ValueError, TypeError) as fault:
        raise error(f"{where} is not JSON: {fault}") from None
    return tree


def checked(kind: Any, tree: Any, where: str, error: Refusal, *, closed: bool = False) -> Any:
    """Check plain data, found at ``where``, and return it as an instance of ``kind``."""
    from mathnavi.interfaces.schema import validated  # not needed to list plug-ins

    try:
        return validated(kind, tree, closed=closed)
    except ValueError as fault:
        raise error(f"{where}: {fault}") from None


def _integer(digits: str) -> int:
    """Return a whole number that a double can hold too."""
    if len(digits) > _MOST_DIGITS:
        raise ValueError(f"a whole number of {len(digits)} digits, where {_MOST_DIGITS} are allowed")
    return int(digits)


def _without_waiting(path: str, flags: int) -> int:
    """Open a file without waiting for a writer, as opening a pipe would."""
    return os.open(path, flags | os.O_NONBLOCK)


def _too_large(path: Path, error: Refusal, size: int, most: int) -> ValueError:
    return error(f"{path} has {size} bytes; allowed: at most {most}")
