"""Index of plug-ins: the description and the fields of each, kept so that nothing has to be imported to list them.

Each description is made once, by importing the plug-in in a separate process, and kept in a file of the user's cache
($XDG_CACHE_HOME/mathnavi or ~/.cache/mathnavi) together with the sizes and times of the sources that it comes from. It
is made again when one of these changes, or another version is installed. Without a folder to write to it is made every
time.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path

from mathnavi.interfaces.entry_points import home
from mathnavi.interfaces.reading.files import parsed, read_text
from mathnavi.sim.plugin.groups import GROUPS, installed
from mathnavi.sim.plugin.source_stamps import Plain, stamp

Point = tuple[str, EntryPoint]  # the kind of a plug-in, and its place
COMMAND = "commands"  # the kind of the dataclasses that define a command's flags
_FORMAT = 1
_CHILD = """
import json, os, sys
answer = os.dup(1)
os.dup2(2, 1)  # what an import prints is no answer
request = json.load(sys.stdin)
sys.path[:] = request["path"]
from mathnavi.sim.plugin.describe import described
with os.fdopen(answer, "w", encoding="utf-8") as out:
    json.dump([described(value) for value in request["values"]], out)
"""


@dataclass(frozen=True)
class FieldDescription:
    """Field of a configuration on the command line."""

    name: str
    """dotted name, "noise.rate"; the flag is ``flag_of(name)``"""
    type: str
    """type of the value: INT, FLOAT FLOAT FLOAT, {uniform,arclength}"""
    choices: tuple[str, ...]
    """all words that are allowed, if they can be listed"""
    switch: bool
    """whether it is a truth value, which --no-NAME sets to false"""
    repeats: bool
    help: str


@dataclass(frozen=True)
class Description:
    """Description of a plug-in, without its code."""

    kind: str
    name: str
    value: str
    """place of the class, package.module:Class"""
    distribution: str
    """name and version of the package that it is installed with, "" without one"""
    first_line: str
    """first line of its docstring"""
    stated: Mapping[str, str]
    """names of the controller and the estimator of a scenario"""
    fields: tuple[FieldDescription, ...]
    error: str
    """reason why it cannot be imported, "" if it can"""


def describe(points: Sequence[Point]) -> list[Description]:
    """Return the descriptions of some plug-ins, from the index if it has them; it is updated first."""
    path = _path()
    entries = _read(path)
    if any(not _fresh(entries.get(_key(*point))) for point in points):
        plugins = [(kind, point) for kind in GROUPS for point in installed(kind)]
        stale = {_key(*point): point for point in [*points, *plugins] if not _fresh(entries.get(_key(*point)))}
        entries |= zip(stale, _described_apart([point.value for _, point in stale.values()]), strict=True)
        lasting = {_key(*point) for point in plugins}
        kept = {key: entry for key, entry in entries.items() if key in lasting or key.startswith(f"{COMMAND} ")}
        _write(path, {key: entry for key, entry in kept.items() if _fresh(entry)})
    return [_description(*point, entries[_key(*point)]) for point in points]


def imported(kind: str, point: EntryPoint) -> Description:
    """Return the description of a plug-in by importing it in this process."""
    from mathnavi.sim.plugin.describe import described

    return _description(kind, point, described(point.value))


def _key(kind: str, point: EntryPoint) -> str:
    return f"{kind} {point.name} {point.value} {home(point)}"


def _description(kind: str, point: EntryPoint, entry: Plain) -> Description:
    fields = tuple(FieldDescription(**{**field, "choices": tuple(field["choices"])}) for field in entry["fields"])
    own = (kind, point.name, point.value, home(point))
    return Description(*own, entry["first_line"], entry["stated"], fields, entry["error"])


def _fresh(entry: Plain | None) -> bool:
    """Return an entry that is still valid for its sources; one that could not be imported is tried again."""
    return (
        entry is not None and not entry["error"] and all(stamp(file) == then for file, then in entry["files"].items())
    )


def _path() -> Path:
    """Return the file of the index for this installation and this version of Python."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    installation = hashlib.sha256(f"{sys.prefix} {sys.version}".encode()).hexdigest()[:16]
    return Path(home) / "mathnavi" / f"plugins-{installation}.json"


def _rules() -> dict[str, list[int]]:
    """Return the stamps of the sources that define how a plug-in is described."""
    here = os.path.dirname(__file__)
    names = ("describe.py", "field_help.py", "flag_names.py", "index.py", "leaves.py", "word_forms.py")
    return {name: stamp(os.path.join(here, name)) for name in names}


def _read(path: Path) -> dict[str, Plain]:
    """Return entries of the index by their keys; none from a file that is missing, damaged or made by other rules."""
    try:
        content = parsed(read_text(path, ValueError), str(path), ValueError)
        if content["rules"] != _rules():
            return {}
        entries: dict[str, Plain] = content["entries"]
        for entry in entries.values():
            _description("", EntryPoint("", "", ""), entry)
            entry["files"].items()
        return entries
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}


def _write(path: Path, entries: Mapping[str, Plain]) -> None:
    """Replace the file atomically; nothing happens if it cannot be written."""
    import tempfile  # a tenth of the time that the list takes

    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, partial = tempfile.mkstemp(dir=path.parent, prefix=".plugins-")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                json.dump({"rules": _rules(), "entries": entries}, file)
            os.replace(partial, path)
        except OSError:
            os.unlink(partial)


def _described_apart(values: Sequence[str]) -> list[Plain]:
    """Describe plug-ins in a separate process, which imports each value; a plug-in that ends the process is broken."""
    import subprocess

    folder = os.getcwd()
    request = {"path": [*sys.path, *[folder] * (folder not in sys.path)], "values": list(values)}
    done = subprocess.run(
        [sys.executable, "-P", "-c", _CHILD],  # -P: no file of this folder takes precedence over a module
        input=json.dumps(request),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        encoding="utf-8",
        env={**os.environ, "MUJOCO_GL": "disable"},
        check=False,
    )
    if not done.returncode:
        made: list[Plain] = parsed(done.stdout, "the index", ValueError)
        return made
    if len(values) == 1:
        error = f"its import ended the process, exit code {done.returncode}"
        return [{"first_line": "", "stated": {}, "fields": [], "files": {}, "error": error}]
    return [entry for value in values for entry in _described_apart([value])]
