"""Descriptions of plug-ins: from their sources, from an index on disk, or by importing them.

To list plug-ins nothing is imported: ``sourced`` reads the docstring in the source. What needs the fields of a plug-in,
as completion does, asks ``describe``: each description is made once, by importing the plug-in in a separate process,
and kept in a file of the user's cache ($XDG_CACHE_HOME/mathnavi or ~/.cache/mathnavi) together with the sizes and times
of all sources of mathnavi and of the plug-in's package. All are made again when one of these changes. Without a folder
to write to they are made every time.
"""

from __future__ import annotations

import ast
import hashlib
import io
import json
import os
import re
import sys
import tokenize
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, is_dataclass
from importlib.metadata import EntryPoint
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any, NamedTuple

from mathnavi.interfaces.entry_points import home
from mathnavi.interfaces.field_table import leaves_of
from mathnavi.interfaces.reading.files import parsed, read_text

Point = tuple[str, EntryPoint]  # the kind of a plug-in, and its place
Plain = dict[str, Any]  # JSON data by name
COMMAND = "commands"  # the kind of the dataclasses that define a command's flags
STATED = ("controller", "estimator")  # the defaults of a scenario
_CHILD = """
import json, os, sys
answer = os.dup(1)
os.dup2(2, 1)  # what an import prints is no answer
request = json.load(sys.stdin)
sys.path[:] = request["path"]
from mathnavi.sim.plugin.index import entries_and_files
with os.fdopen(answer, "w", encoding="utf-8") as out:
    json.dump(entries_and_files(request["values"]), out)
"""


class FieldDescription(NamedTuple):
    """Field of a configuration on the command line."""

    name: str
    """dotted name, "noise.rate"; the flag is ``flag_of("PREFIX.NAME")``"""
    choices: tuple[str, ...]
    """all words that are allowed, if they can be listed"""
    switch: bool
    """whether it is a truth value, which --no-NAME sets to false"""


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


def sourced(kind: str, point: EntryPoint) -> Description:
    """Return the description of a plug-in by its source, with neither fields nor defaults; nothing is imported."""
    try:
        return _description(kind, point, _entry(docstring(point.value)))
    except (ImportError, AttributeError, OSError, SyntaxError, ValueError) as error:
        return _description(kind, point, _entry(error=str(error)))


def describe(points: Sequence[Point]) -> list[Description]:
    """Return the descriptions of some plug-ins, from the index if it has them; it is updated first."""
    path = _path()
    entries, files = _read(path)
    if missing := {_key(*point): point for point in points if _key(*point) not in entries}:
        made, sources = _described_apart([point.value for _, point in missing.values()])
        entries |= zip(missing, made, strict=True)
        kept = {key: entry for key, entry in entries.items() if not entry["error"]}  # others are tried again
        _write(path, {"files": files | sources, "entries": kept})
    return [_description(*point, entries[_key(*point)]) for point in points]


def imported(kind: str, point: EntryPoint) -> Description:
    """Return the description of a plug-in by importing it in this process."""
    return _description(kind, point, _imported(point.value))


def docstring(value: str) -> str:
    """Return the docstring of the class, the function or the module at "package.module:Name", from the source.

    Raises ModuleNotFoundError or AttributeError if there is none, as its import would.
    """
    module, _, name = value.partition(":")
    text = Path(_file(module)).read_text(encoding="utf-8")
    defined = re.search(rf"^(?:class|(?:async )?def) {re.escape(name)}\b", text, re.MULTILINE) if name else None
    if defined or not name:
        return _first_string(text[defined.start() :] if defined else text, of_module=not defined)
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if not isinstance(node, ast.ImportFrom):
            continue
        for alias in node.names:
            if name == (alias.asname or alias.name):
                package = module if _file(module).endswith("__init__.py") else module.rpartition(".")[0]
                return docstring(f"{resolve_name('.' * node.level + (node.module or ''), package)}:{alias.name}")
    if name not in {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    return ""


def _file(module: str) -> str:
    """Return the source file of a module, whose packages are not imported."""
    top, *rest = module.split(".")
    spec = find_spec(top)
    for place in (spec and spec.submodule_search_locations) or ():
        for file in (f"{os.path.join(place, *rest)}.py", os.path.join(place, *rest, "__init__.py")):
            if os.path.isfile(file):
                return file
    if spec is None or spec.origin is None or rest:
        raise ModuleNotFoundError(f"No module named {module if spec else top!r}")
    return spec.origin


def _first_string(text: str, *, of_module: bool) -> str:
    """Return the string that a module, or the body of the class or function at the start of the text, begins with."""
    begun = of_module
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NEWLINE:
            begun = True
        elif begun and token.type not in (tokenize.COMMENT, tokenize.NL, tokenize.INDENT):
            return str(ast.literal_eval(token.string)) if token.type == tokenize.STRING else ""
    return ""


def entries_and_files(values: Sequence[str]) -> tuple[list[Plain], dict[str, list[int]]]:
    """Import plug-ins; return the entry of each, and the stamps of the sources that these come from."""
    entries = [_imported(value) for value in values]
    packages = {"mathnavi", *(re.split("[.:]", value)[0] for value in values)}
    modules = [module for name, module in sys.modules.items() if name.partition(".")[0] in packages]
    return entries, {file: _stamp(file) for module in modules if (file := getattr(module, "__file__", None))}


def _imported(value: str) -> Plain:
    """Import the class or function at "package.module:Name", and return its entry.

    Any exception of the import except Ctrl-C, including SystemExit, is in ``error``.
    """
    try:
        plugin = EntryPoint(value, value, "").load()
        config = getattr(plugin, "Config", plugin)
        leaves = leaves_of(config) if isinstance(config, type) and is_dataclass(config) else ()
        fields = [FieldDescription(leaf.path, leaf.form.choices, leaf.switch) for leaf in leaves if not leaf.positional]
        stated = {name: str(getattr(plugin, name)) for name in STATED if isinstance(vars(plugin).get(name), str)}
        return _entry(plugin.__doc__ or "", stated, fields)
    except BaseException as error:  # a third-party module may raise anything when it is imported
        if isinstance(error, KeyboardInterrupt):
            raise
        return _entry(error=str(error) or type(error).__name__)


def _entry(doc: str = "", stated: Plain | None = None, fields: Sequence[Any] = (), error: str = "") -> Plain:
    return {"first_line": doc.strip().partition("\n")[0], "stated": stated or {}, "fields": fields, "error": error}


def _key(kind: str, point: EntryPoint) -> str:
    return f"{kind} {point.name} {point.value} {home(point)}"


def _description(kind: str, point: EntryPoint, entry: Plain) -> Description:
    fields = tuple(FieldDescription(name, tuple(choices), switch) for name, choices, switch in entry["fields"])
    own = (kind, point.name, point.value, home(point))
    return Description(*own, entry["first_line"], entry["stated"], fields, entry["error"])


def _stamp(file: str) -> list[int]:
    """Return size [bytes] and time of the last change [ns] of a file, which reveal changes; empty without the file."""
    try:
        status = os.stat(file)
    except OSError:
        return []
    return [status.st_size, status.st_mtime_ns]


def _path() -> Path:
    """Return the file of the index for this installation and this version of Python."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    installation = hashlib.sha256(f"{sys.prefix} {sys.version}".encode()).hexdigest()[:16]
    return Path(home) / "mathnavi" / f"plugins-{installation}.json"


def _read(path: Path) -> tuple[dict[str, Plain], dict[str, list[int]]]:
    """Return entries and stamps of the index; none from one that is missing, damaged, or older than a source."""
    try:
        content = parsed(read_text(path, ValueError), str(path), ValueError)
        entries, files = content["entries"], content["files"]
        if __file__ not in files or any(_stamp(file) != then for file, then in files.items()):
            return {}, {}
        for entry in entries.values():
            _description("", EntryPoint("", "", ""), entry)
        return entries, files
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}, {}


def _write(path: Path, content: Plain) -> None:
    """Replace the file atomically; nothing happens if it cannot be written."""
    import tempfile  # a tenth of the time that completion takes

    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, partial = tempfile.mkstemp(dir=path.parent, prefix=".plugins-")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                json.dump(content, file)
            os.replace(partial, path)
        except OSError:
            os.unlink(partial)


def _described_apart(values: Sequence[str]) -> tuple[list[Plain], dict[str, list[int]]]:
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
        answer: tuple[list[Plain], dict[str, list[int]]] = parsed(done.stdout, "the index", ValueError)
        return answer
    if len(values) == 1:
        return [_entry(error=f"its import ended the process, exit code {done.returncode}")], {}
    entries: list[Plain] = []
    files: dict[str, list[int]] = {}
    for value in values:
        (entry,), sources = _described_apart([value])
        entries.append(entry)
        files |= sources
    return entries, files
