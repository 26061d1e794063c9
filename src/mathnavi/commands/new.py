"""``mathnavi new``: a folder with a plug-in, its test, its notebook and its metadata, which runs at once.

The files are those of ``templates/KIND`` with ``@name@``, the package, ``@Name@``, the class, and ``@title@``, the name
on the command line, replaced. They are written whole or not at all, into a folder that is new.
"""

from __future__ import annotations

import keyword
import os
import re
import shlex
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.commands.output import output_folder
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import check_path
from mathnavi.interfaces.field_table import Positional
from mathnavi.interfaces.reading.files import MEBIBYTE, read_text
from mathnavi.interfaces.writing import naming
from mathnavi.sim.plugin.groups import GROUPS
from mathnavi.sim.plugin.registry import names

TEMPLATES = Path(__file__).with_name("templates")
ENDING = ".template"
MOST = MEBIBYTE  # of a template
Kind = Literal["vehicle", "planner", "observer", "scenario", "terrain"]
DESCRIPTIONS: dict[str, str] = {
    "vehicle": "A robot on wheels for mathnavi",
    "planner": "A planner of aerial missions for mathnavi",
    "observer": "An observer of aerial vehicles for mathnavi",
    "scenario": "A scenario of an aerial vehicle for mathnavi",
    "terrain": "A terrain for mathnavi",
}
POINTS: dict[str, dict[str, str]] = {  # place of each plug-in that a kind brings, by the kind of plug-in
    "vehicle": {
        "scenarios": "@name@.scenario:@Name@",
        "controllers": "@name@.controller:ToTheDock",
        "estimators": "@name@.estimator:DeadReckoning",
    },
    "planner": {"controllers": "@name@.planner:@Name@"},
    "observer": {"estimators": "@name@.observer:@Name@"},
    "scenario": {"scenarios": "@name@.scenario:@Name@"},
    "terrain": {"terrains": "@name@.terrain:@name@"},
}
_NAME = re.compile(r"[a-z][a-z0-9]*(?:[-_][a-z0-9]+)*")
_LONGEST = 40  # characters


@configuration
class NewOptions:
    """Words of the command: what is made, and its name."""

    kind: Annotated[Kind, Positional("KIND")]
    """vehicle, planner, observer, scenario or terrain"""
    name: Annotated[str, Positional("NAME")]
    """name on the command line, and of the package and the class: lower-case letters, digits and hyphens"""
    out: Path | None = None
    """folder to make; NAME in the current folder if not given"""


def main(argv: Sequence[str]) -> int:
    purpose = "Make a folder with a plug-in that runs at once: code, model, test, notebook, README and pyproject.toml."
    (options,) = parse(argv, "mathnavi new", purpose, FlagGroup(NewOptions))
    flag, folder = ("NAME", Path(options.name)) if options.out is None else ("--out", options.out)
    check_name(options.kind, options.name)
    with bad_input():
        check_path(folder, flag)
        if os.path.lexists(folder):
            raise BadInputError(f"{flag} = {folder} exists; allowed: a new folder")
        with output_folder(folder.parent, flag):
            written = make(options.kind, options.name, folder)
    for path in written:
        print(path)
    place = shlex.quote(f"./{folder}" if str(folder).startswith("-") else str(folder))
    print(f"next    cd {place}; its README.md has the commands")
    return 0


def check_name(kind: str, name: str) -> None:
    """Raise BadInputError for a name that no package can have, or that is taken by a module or a plug-in."""
    package = package_of(name)
    allowed = f"allowed: 2 to {_LONGEST} lower-case letters and digits, with single hyphens, beginning with a letter"
    if not (_NAME.fullmatch(name) and 2 <= len(name) <= _LONGEST) or keyword.iskeyword(package):
        raise BadInputError(f"NAME = {name!r}; {allowed}")
    if find_spec(package) is not None:
        raise BadInputError(f"NAME = {name!r}: a Python module {package!r} exists already; allowed: another name")
    word = package if kind == "terrain" else class_of(name)  # of what is defined
    if any(re.search(rf"(?<![\w@]){word}(?![\w@])", text) for text in templates(kind).values()):
        raise BadInputError(f"NAME = {name!r}: the code has another {word!r}; allowed: another name")
    for group in POINTS[kind]:
        if name in names(group):
            raise BadInputError(f"NAME = {name!r} is that of installed {group}; allowed: another name")


def package_of(name: str) -> str:
    """Return the name of the package: "my-rover" is my_rover."""
    return name.replace("-", "_")


def class_of(name: str) -> str:
    """Return the name of the class: "my-rover" is MyRover."""
    return "".join(part.capitalize() for part in package_of(name).split("_"))


def make(kind: str, name: str, folder: Path) -> list[Path]:
    """Write the files of a kind into a folder that is new, whole or not at all; return their paths.

    Raises OSError where it cannot be written, or where it is not new when all files are.
    """
    files = contents(kind, name)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".mathnavi-new.") as scratch:
        made = Path(scratch) / "made"
        for path, text in files.items():
            with naming(folder / path):
                (made / path).parent.mkdir(parents=True, exist_ok=True)
                (made / path).write_text(text, encoding="utf-8")
        with naming(folder):
            os.rename(made, folder)  # which replaces no folder with files
    return [folder / path for path in files]


def contents(kind: str, name: str) -> dict[str, str]:
    """Return the texts of the files of a kind, by their paths in the folder."""
    title = name.replace("_", "-")
    points = [f'[project.entry-points."{GROUPS[group]}"]\n{title} = "{place}"' for group, place in POINTS[kind].items()]
    words = {"@entry_points@": "\n\n".join(points), "@description@": DESCRIPTIONS[kind]}
    words |= {"@name@": package_of(name), "@Name@": class_of(name), "@title@": title}

    def filled(text: str) -> str:
        for token, word in words.items():
            text = text.replace(token, word)
        return text

    return {filled(path): filled(text) for path, text in templates(kind).items()}


def templates(kind: str) -> dict[str, str]:
    """Return the texts of the templates of a kind, by their paths in the folder that is made."""
    own = TEMPLATES / kind
    files = {path.relative_to(own).as_posix(): path for path in own.rglob(f"*{ENDING}")}
    files[f"pyproject.toml{ENDING}"] = TEMPLATES / f"pyproject.toml{ENDING}"
    paths = sorted(files, key=lambda path: ("/" in path, not path.startswith("README"), path))
    return {path.removesuffix(ENDING): read_text(files[path], ValueError, MOST) for path in paths}
