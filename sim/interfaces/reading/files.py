"""Bytes, text and JSON from files: the one place, with its neighbours here, through which every file is read.

A file that is larger than a file of its kind can be is refused before it is read. What is wrong with a file is one
line that names it, the place in it, the value, and what is allowed.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MEBIBYTE = 2**20
MOST_TEXT = 64 * MEBIBYTE  # of a document that is read as a whole
MOST_LINES = 1024 * MEBIBYTE  # of a file that is read line by line
MOST_OF_A_LINE = MEBIBYTE
_MOST_DIGITS = 300

Refusal = type[ValueError]  # the kind of error that is raised for a file that is not as it should be


def read_bytes(path: Path, error: Refusal, most: int) -> bytes:
    """The content of a file of at most ``most`` bytes; FileNotFoundError where there is none."""
    with opened(path, error, most) as file:
        content: bytes = file.read(most + 1)
    if len(content) > most:  # it has grown, or does not say its size
        raise _too_large(path, error, len(content), most)
    return content


def opened(path: Path, error: Refusal, most: int) -> Any:
    """An open file of at most ``most`` bytes, to be read as bytes; a folder, a pipe or a device is refused."""
    try:
        file = open(path, "rb", opener=_without_waiting)  # noqa: SIM115 - it is the caller's to close
    except IsADirectoryError:
        raise error(f"{path} is a folder; allowed: a file") from None
    except ValueError as fault:  # a null character
        raise error(f"{str(path)!r} is no name of a file ({fault})") from None
    about = os.fstat(file.fileno())
    if not stat.S_ISREG(about.st_mode):
        file.close()
        raise error(f"{path} is no regular file; allowed: a file that is not a pipe or a device")
    if about.st_size > most:
        file.close()
        raise _too_large(path, error, about.st_size, most)
    return file


def read_text(path: Path, error: Refusal, most: int = MOST_TEXT) -> str:
    """The text of a file, which is UTF-8."""
    try:
        return read_bytes(path, error, most).decode("utf-8")
    except UnicodeDecodeError as fault:
        raise error(f"{path} is not text in UTF-8: byte {fault.start} is {fault.object[fault.start]:#04x}") from None


def read_json(path: Path, kind: Any, error: Refusal, *, closed: bool = False) -> Any:
    """The document in a JSON file as an instance of ``kind``, as ``schema.validated`` makes it."""
    return read_document(path, kind, error, closed=closed)[0]


def read_document(path: Path, kind: Any, error: Refusal, *, closed: bool = False) -> tuple[Any, Any]:
    """The document in a JSON file as an instance of ``kind``, and as the plain data that it is."""
    tree = parsed(read_text(path, error), str(path), error)
    return checked(kind, tree, str(path), error, closed=closed), tree


def read_lines(path: Path, kind: Any, error: Refusal) -> Iterator[Any]:
    """The documents in a file that holds one in each line."""
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
    """A JSON text, found at ``where``, as an instance of ``kind``."""
    return checked(kind, parsed(text, where, error), where, error, closed=closed)


def parsed(text: str | bytes, where: str, error: Refusal) -> Any:
    """A JSON text, found at ``where``, as plain data of whatever shape."""
    try:
        return json.loads(text, parse_int=_integer)
    except RecursionError:
        raise error(f"{where} is nested too deeply; allowed: less than some hundred levels") from None
    except (ValueError, TypeError) as fault:
        raise error(f"{where} is not JSON: {fault}") from None


def checked(kind: Any, tree: Any, where: str, error: Refusal, *, closed: bool = False) -> Any:
    """Plain data, found at ``where``, as an instance of ``kind``."""
    from mathnavi.sim.interfaces.schema import validated  # not needed by what only lists plug-ins

    try:
        return validated(kind, tree, closed=closed)
    except ValueError as fault:
        raise error(f"{where}: {fault}") from None


def _integer(digits: str) -> int:
    """A whole number that a double holds too."""
    if len(digits) > _MOST_DIGITS:
        raise ValueError(f"a whole number of {len(digits)} digits, where {_MOST_DIGITS} are allowed")
    return int(digits)


def _without_waiting(path: str, flags: int) -> int:
    """Open a file, and never wait for whoever may write to it, as a pipe has one."""
    return os.open(path, flags | os.O_NONBLOCK)


def _too_large(path: Path, error: Refusal, size: int, most: int) -> ValueError:
    return error(f"{path} has {size} bytes; allowed: at most {most}")
