"""Checks of fields; each raises FieldError, which names the field, its value and what is allowed."""

from __future__ import annotations

import difflib
import errno
import math
import os
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from mathnavi.interfaces.errors import FieldError

_LONGEST_NAME, _LONGEST_PATH = 255, 4095  # [bytes] that the file systems of Linux and macOS accept
_LONGEST_PLAIN = 100  # [bytes], which leaves room for endings
PAGES = (".html", ".htm")  # endings of a page
_OFFERED = 3  # names in the place of a misspelt one
_CLOSE, _CLOSE_AS_A_WHOLE, _AS_SIMILAR = 0.7, 0.85, 0.05  # similarities of names, 1 if equal


def check(value: float, name: str, low: float, high: float = math.inf, *, open_low: bool = False) -> None:
    """Check a finite value from ``low``, which it must exceed with ``open_low``, to ``high``."""
    allowed = f"{'>' if open_low else '>='} {low:g}" + (f" and <= {high:g}" if high < math.inf else "")
    inside = low < value <= high if open_low else low <= value <= high
    if not (math.isfinite(value) and inside):
        raise FieldError(f"{name} = {value!r}; allowed: a finite value {allowed}")


def check_path(path: Path, name: str) -> None:
    """Check a path: its parts must be names that a file system accepts, and no link in it may lead back to itself."""
    given, text = str(path), os.fsencode(path)
    if b"\0" in text:
        raise FieldError(f"{name} = {given!r}; allowed: a name without a null character")
    if len(text) > _LONGEST_PATH or any(len(os.fsencode(part)) > _LONGEST_NAME for part in path.parts):
        raise FieldError(
            f"{name} = {given[:40]}..., {len(text)} bytes; allowed: names of at most {_LONGEST_NAME} bytes, "
            f"{_LONGEST_PATH} with their folders"
        )
    try:
        path.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise FieldError(f"{name} = {given}, a link that leads back to itself; allowed: another path") from None


def checked_ending(path: object, allowed: Collection[str], name: str = "path") -> str:
    """Return the ending of a file's name in lower case, with its dot; FieldError for one that is not ``allowed``."""
    ending = Path(path).suffix.lower() if isinstance(path, (str, os.PathLike)) else ""
    if ending not in allowed:
        *others, last = allowed
        shown = path if isinstance(path, (str, os.PathLike)) else repr(path)
        raise FieldError(
            f"{name} = {shown}; allowed: a name that ends in {', '.join(others)}{' or ' * bool(others)}{last}"
        )
    return ending


def check_names(names: Sequence[str]) -> tuple[str, ...]:
    """Check that each name is there once."""
    if twice := sorted({name for name in names if list(names).count(name) > 1}):
        raise FieldError(f"names = {list(names)!r}; allowed: each once, and not {', '.join(twice)} again")
    return tuple(names)


def plain_name(name: object, what: str) -> str:
    """Return a name that may be part of a path: one line without a slash, which cannot lead to another folder.

    Raises FieldError unless it is a text of 1 to 100 bytes (UTF-8) that is printable, has neither "/" nor "\\", and
    begins with neither "." nor "-".
    """
    if not isinstance(name, str) or not is_plain_name(name):
        raise FieldError(
            f"{what} = {name!r:.120}; allowed: a name of 1 to {_LONGEST_PLAIN} bytes, printable, without slashes, that "
            "begins with neither . nor -"
        )
    return name


def is_plain_name(name: str) -> bool:
    """Return True for a name that ``plain_name`` accepts."""
    return (
        name.isprintable()
        and 1 <= len(name.encode()) <= _LONGEST_PLAIN
        and not set(name) & {"/", "\\"}
        and name[0] not in ".-"
        and name.strip() == name
    )


def check_spares(out: str | Path, sources: Iterable[str | Path], name: str = "out") -> None:
    """Check that writing ``out`` replaces none of the files and folders that are read, by any path or link."""
    for source in map(Path, sources):
        if os.path.exists(out) and source.exists() and source.samefile(out):
            also = "" if str(source) == str(out) else f", {source}"
            raise FieldError(f"{name} = {out} is what is read{also}; allowed: another name")


def allowed_for(name: str, known: Sequence[str], besides: str = "") -> str:
    """Return the end of a message about an unknown name: close matches, and all allowed names."""
    close = close_names(name, known)
    meant = f"did you mean {' or '.join(close)}? " if close else ""
    return f"{meant}allowed: {', '.join([*known, *[besides] * bool(besides)]) or 'none'}"


def close_names(name: str, known: Sequence[str]) -> list[str]:
    """Return the names that a misspelt one may stand for, the most similar first: three at most, none if all are far.

    Names have as many parts, between points, and each part is similar, or they are as a whole; case, "-" and "_" do not
    count. Where no name is, those that begin with the given one count, or one with which it begins.
    """
    given = _folded(name)
    similar = {each: _similarity(given, _folded(each)) for each in known}
    if not any(similar.values()):
        return [each for each in similar if _continues(given, _folded(each))][:_OFFERED]
    least = max(similar.values()) - _AS_SIMILAR
    return sorted((each for each in similar if similar[each] >= least), key=lambda each: -similar[each])[:_OFFERED]


def _folded(name: str) -> str:
    return name.lstrip("-").casefold().replace("_", "-")


def _similarity(given: str, known: str) -> float:
    """Return the similarity of two names, 0 if a part of one is no misspelling of the other's."""
    pairs = [*zip(given.split("."), known.split("."), strict=False)]
    if given.count(".") != known.count("."):
        return 0.0
    whole = difflib.SequenceMatcher(None, given, known).ratio()
    parts = min(difflib.SequenceMatcher(None, *pair).ratio() for pair in pairs)
    return whole if parts >= _CLOSE or (len(pairs) > 1 and whole >= _CLOSE_AS_A_WHOLE) else 0.0


def _continues(given: str, known: str) -> bool:
    """Return True if one name begins with the other, which is half of it at least, and not the group of its fields."""
    short, long = sorted((given, known), key=len)
    return long.startswith(short) and long[len(short)] != "." and 2 * len(short) >= len(long)
