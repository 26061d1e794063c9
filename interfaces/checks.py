"""Checks of fields; each raises FieldError, which names the field, its value and what is allowed."""

from __future__ import annotations

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
    """Return the names that a misspelt one may stand for: up to three at the least distance, none if all are far.

    Each part of a name, between points, may be off by a third of its letters, or one part by a letter; case, "-" and
    "_" do not count. Where no name is that close, those that begin with the given one count, or one with which it
    begins.
    """
    given, far = _folded(name), len(name) + 1
    distances = {each: _distance_by_part(given, _folded(each), far) for each in known}
    least = min(distances.values(), default=far)
    if least == far:
        return [each for each in distances if _continues(given, _folded(each))][:_OFFERED]
    return [each for each, distance in distances.items() if distance == least][:_OFFERED]


def _folded(name: str) -> str:
    return name.lstrip("-").casefold().replace("_", "-")


def _distance_by_part(given: str, known: str, far: int) -> int:
    """Return the number of edits between two names, ``far`` if a part of one is no misspelling of the other's."""
    parts, others = given.split("."), known.split(".")
    edits = [edit_distance(part, other) for part, other in zip(parts, others, strict=False)]
    close = all(edit <= len(part) // 3 for edit, part in zip(edits, parts, strict=False))
    close |= len(parts) > 1 and sum(edits) == 1  # truth.y for truth.x
    return sum(edits) if close and len(parts) == len(others) else far


def _continues(given: str, known: str) -> bool:
    """Return True if one name begins with the other, which is half of it at least, and not the group of its fields."""
    short, long = sorted((given, known), key=len)
    return long.startswith(short) and long[len(short)] != "." and 2 * len(short) >= len(long)


def edit_distance(first: str, second: str) -> int:
    """Return the least number of letters to insert, remove, replace or swap with their neighbour between two texts.

    No letter is edited twice (optimal string alignment): d[i, j] is the distance of the first i and j letters.
    """
    before: list[int] = []
    row = [*range(len(second) + 1)]
    for i, letter in enumerate(first, 1):
        last, row = row, [i]
        for j, other in enumerate(second, 1):
            edits = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (letter != other))
            if i > 1 and j > 1 and letter == second[j - 2] and first[i - 2] == other:
                edits = min(edits, before[j - 2] + 1)
            row.append(edits)
        before = last
    distance: int = row[-1]
    return distance
