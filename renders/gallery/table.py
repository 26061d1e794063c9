"""Table of README.md next to this file: the commands that make each committed picture.

A row is ``| [NAME](NAME) | what it shows | `command`, then `command` |``. The commands are run from the repository's
root, and the last one makes the picture:

- ``mathnavi render`` prints its path;
- ``mathnavi study NAME`` leaves NAME.png in its folder;
- ``python -m mathnavi.renders.optimum NAME FILE`` says it;
- ``chromium --screenshot=PATH`` says it.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from mathnavi.interfaces.errors import ArgumentError

HERE = Path(__file__).resolve().parent  # of the repository, not of the links in src/mathnavi
README = HERE / "README.md"
STUDIES = Path("renders/out/study")  # what `mathnavi study` writes to, by default
MATHNAVI = ".venv/bin/mathnavi"
OPTIMUM = (".venv/bin/python", "-m", "mathnavi.renders.optimum")
_ROW = re.compile(r"^\| \[([\w.]+)\]\(\1\) \| (.+) \| (.+) \|$")

Command = tuple[str, ...]


@dataclass(frozen=True)
class GalleryPicture:
    """Picture, with the commands that make it."""

    name: str
    commands: tuple[Command, ...]

    def made(self, printed: str) -> Path:
        """Path of the picture that the last command made, given what it printed; ValueError for one that makes none."""
        last = self.commands[-1]
        if last[:2] == (MATHNAVI, "render"):
            return Path(printed.strip().rpartition("\n")[2])
        if last[:2] == (MATHNAVI, "study"):
            return STUDIES / f"{last[2]}.png"
        if last[:3] == OPTIMUM:
            return Path(last[-1])
        for word in last:
            if word.startswith("--screenshot="):
                return Path(word.partition("=")[2])
        raise ArgumentError(
            f"{self.name}: {shlex.join(last)!r} makes no picture; allowed: render, study, renders.optimum, --screenshot"
        )


def entries(text: str) -> Mapping[str, GalleryPicture]:
    """The rows of a README.md by the names of their pictures; ArgumentError for a row without a command."""
    found = {}
    for line in text.splitlines():
        if row := _ROW.match(line):
            name, commands = row[1], tuple(tuple(shlex.split(words)) for words in re.findall(r"`([^`]+)`", row[3]))
            if not commands:
                raise ArgumentError(f"{name}: {row[3]!r} holds no command; allowed: commands between backquotes")
            found[name] = GalleryPicture(name, commands)
    return found


def chosen(wanted: Sequence[str], known: Mapping[str, GalleryPicture]) -> list[GalleryPicture]:
    """Return the entries chosen by name, with or without its ending, or by pattern; ValueError for an unknown one."""
    found: dict[str, GalleryPicture] = {}
    for pattern in wanted or ["*"]:
        matching = [entry for name, entry in known.items() if pattern == Path(name).stem or fnmatch(name, pattern)]
        if not matching:
            raise ArgumentError(f"NAME = {pattern!r} is no picture of the gallery; allowed: {', '.join(known)}")
        found |= {entry.name: entry for entry in matching}
    return list(found.values())
