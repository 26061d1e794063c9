"""Fields that name files, and the digests by which their contents enter keys and records.

::

    @configuration
    class MapConfig:
        terrain: TerrainPlace = "tian_shan"               # Annotated[str, InputFile(heights_digest)]
        table: Annotated[Path | None, InputFile()] = None

A result depends on the content of a file, not on its place. The mark ``InputFile`` declares that with the field, so
that no scenario, plug-in or study has to do anything else: ``input_digests`` finds every marked field of a
configuration. A ``Path`` or a text without a mark counts too if it is the path of an existing file, and its name
remains in the key.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import fields_of
from mathnavi.interfaces.reading.files import MEBIBYTE, read_bytes

MOST = 4096 * MEBIBYTE  # of a file that a field names


def content_digest(place: str | Path) -> str:
    """Return the SHA-256 of the content of a file, in hexadecimal, or of every file in a folder with its place in it.

    Raises FileNotFoundError if neither exists.
    """
    path = Path(place)
    if path.is_dir():
        files = [each for each in path.rglob("*") if each.is_file()]
        return digest_of({each.relative_to(path).as_posix(): read_bytes(each, FieldError, MOST) for each in files})
    if not path.is_file():
        raise FileNotFoundError(f"{place}: no such file; allowed: a file that can be read")
    return hashlib.sha256(read_bytes(path, FieldError, MOST)).hexdigest()


def digest_of(contents: Mapping[str, bytes]) -> str:
    """Return the SHA-256 of several contents with their names, in hexadecimal, independent of their order."""
    digest = hashlib.sha256()
    for name in sorted(contents):
        digest.update(f"{name}\0{hashlib.sha256(contents[name]).hexdigest()}\n".encode())
    return digest.hexdigest()


@dataclass(frozen=True)
class InputFile:
    """Mark of a field that names a file, or several; "" and None name none.

    ``digest`` takes the value of the field and returns the digest of everything that is read for it.
    """

    digest: Callable[[str], str] = content_digest


_UNDECLARED = InputFile(content_digest)
"""Mark of a path or a text that has no other"""


@dataclass(frozen=True)
class PluginName:
    """Mark of a field that names a plug-in, whose sources are part of the version of the code.

    ``load`` takes the value of the field and returns the class or the function, None for a value that names none.
    """

    load: Callable[[str], Any]


Digests = dict[tuple[InputFile, str], str]
"""Digests that are already known, by mark and value of a field."""


def input_digests(config: Any, prefix: str = "", known: Digests | None = None) -> dict[str, str]:
    """Return the digest of the files of each field of a configuration, by the field's dotted name with ``prefix``.

    A field with several files has their digests, separated by commas. Digests that are ``known`` are not made again,
    and others are added. Raises FileNotFoundError for a missing file, and other errors as the digest of a field does.
    """
    known = {} if known is None else known
    found: dict[str, str] = {}
    for name, mark, places in _named(config, InputFile, prefix):
        for place in places:
            if (mark, place) not in known:
                known[mark, place] = mark.digest(place)
        found[name] = ",".join(known[mark, place] for place in places)
    return found


def argument_digests(value: Any) -> list[str]:
    """Return the digests of the files that arguments of a call name, in order: paths, and fields of dataclasses.

    Errors as of ``input_digests``.
    """
    if isinstance(value, str | Path):
        return [content_digest(value)] if _is_file(str(value), isinstance(value, Path)) else []
    if isinstance(value, Mapping):
        return [digest for item in value.values() for digest in argument_digests(item)]
    if isinstance(value, tuple | list):
        return [digest for item in value for digest in argument_digests(item)]
    if dataclasses.is_dataclass(value):
        kind: Any = type(value)
        return [
            digest
            for name, mark in _marks(kind, InputFile)
            for digest in (
                argument_digests(getattr(value, name))
                if mark is None
                else [mark.digest(place) for place in _places(getattr(value, name))]
            )
        ]
    return []


def named_plugins(config: Any) -> list[Any]:
    """Return the plug-ins that fields of a configuration name; errors as of their ``load``."""
    loaded = [mark.load(place) for _, mark, places in _named(config, PluginName, "") for place in places]
    return [each for each in loaded if each is not None]


def declared_inputs(config: Any) -> set[str]:
    """Return the dotted names of the fields of a configuration that declare files, and name some."""
    return {name for name, mark, _ in _named(config, InputFile, "") if mark is not _UNDECLARED}


def _named(config: Any, kind: Any, prefix: str) -> Iterator[tuple[str, Any, list[str]]]:
    """Return name, mark and places of each marked field that is given, in the order of the fields."""
    made: Any = type(config)
    for name, mark in _marks(made, kind):
        value = getattr(config, name)
        if dataclasses.is_dataclass(value):
            yield from _named(value, kind, f"{prefix}{name}.")
            continue
        places = [] if mark is None else list(_places(value))
        if mark is None and kind is InputFile:
            mark, places = _UNDECLARED, [place for place in _places(value) if _is_file(place, isinstance(value, Path))]
        if places:
            yield f"{prefix}{name}", mark, places


def _places(value: Any) -> Iterator[str]:
    if isinstance(value, str | Path):
        if str(value):
            yield str(value)
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _places(item)


@cache
def _marks(config: Any, kind: Any) -> tuple[tuple[str, Any], ...]:
    """Return name and mark of each field of a class of configurations; None for a field without a mark."""
    return tuple((field.name, field.form.mark(kind)) for field in fields_of(config))


def _is_file(place: str, is_path: bool) -> bool:
    """Return True for the path of an existing file; a text must have a folder or an ending as paths do."""
    try:
        return (is_path or "." in place or os.sep in place) and Path(place).is_file()
    except (OSError, ValueError):  # too long, or with a null in it: some other text
        return False
