"""Descriptions of plug-ins: from their sources, from an index on disk, or by importing them.

To list plug-ins nothing is imported: ``sourced`` reads the docstring in the source. What needs the fields of a plug-in,
as completion and the help do, asks the ``Index``: each description is made once, by importing the plug-in, and kept in
a file of the user's cache (``cache_folder``) together with the sizes and times of the sources that it comes from: of
mathnavi, of the plug-in's package, of whatever is not installed, and the first one of every other package. All are made
again when one of these changes. Without a folder to write to they are made every time.
"""

from __future__ import annotations

import ast
import dataclasses
import hashlib
import io
import json
import os
import re
import sys
import time
import tokenize
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any

from mathnavi.interfaces.cache_folder import cache_folder
from mathnavi.interfaces.entry_points import home
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.field_table import FieldDescription, fields_of, leaves_of
from mathnavi.interfaces.reading.files import parsed, read_text
from mathnavi.sim.plugin.groups import PREFIXES

Point = tuple[str, EntryPoint]  # the kind of a plug-in, and its place
Plain = dict[str, Any]  # JSON data by name
COMMAND = "commands"  # the kind of the dataclasses that define a command's flags
STATED = ("controller", "estimator")  # the defaults of a scenario
_BEGUN = time.time_ns()  # sources that are newer may not be those that this process has imported
_CHILD = """
import json, os, sys
answer = os.dup(1)
os.dup2(2, 1)  # what an import prints is no answer
request = json.load(sys.stdin)
sys.path[:] = request["path"]
from mathnavi.sim.plugin.index import entries_and_files
with os.fdopen(answer, "w", encoding="utf-8") as out:
    json.dump(entries_and_files(request["places"]), out)
"""


@dataclass(frozen=True)
class Description:
    """Description of a plug-in, without its code."""

    kind: str
    name: str
    value: str
    """place of the class, package.module:Class"""
    distribution: str
    """name and version of the package that it is installed with, "" without one"""
    first_line: str = ""
    """first line of its docstring"""
    error: str = ""
    """reason why it cannot be imported, "" if it can"""
    place: str = ""
    """package.module:Class, where the class is defined"""
    stated: Mapping[str, str] = dataclasses.field(default_factory=dict)
    """names of the controller and the estimator of a scenario"""
    fields: tuple[FieldDescription, ...] = ()
    checked: bool = False
    """whether the help can be made of it: the class is a plug-in of its kind, and all its defaults are constants"""


def sourced(kind: str, point: EntryPoint) -> Description:
    """Return the description of a plug-in by its source, with neither fields nor defaults; nothing is imported."""
    try:
        return _description(kind, point, {"first_line": _first_line(docstring(point.value))})
    except (ImportError, AttributeError, OSError, SyntaxError, ValueError) as error:
        return _description(kind, point, {"error": str(error)})


@dataclass(frozen=True)
class Index:
    """Descriptions that the file of the index holds, if they are those of the present sources."""

    entries: dict[str, Plain]
    files: dict[str, list[int]]
    """stamps of the sources"""

    @staticmethod
    def read() -> Index:
        """Read the index; without entries if it is missing, damaged, or older than a source."""
        try:
            path = _path()
            digest, _, content = read_text(path, ValueError).partition("\n") if path else ("", "", "")
            if digest == _digest(content):
                entries, files = parsed(content, "the index", ValueError)
                if __file__ in files and all(_stamp(file) == then for file, then in files.items()):
                    return Index(entries, files)
        except (OSError, ValueError):
            pass
        return Index({}, {})

    def holds(self, *points: Point) -> bool:
        """Return True if the descriptions of some plug-ins are there."""
        return all(_key(*point) in self.entries for point in points)

    def describe(self, *points: Point, apart: bool = True) -> list[Description]:
        """Return the descriptions of some plug-ins; the index is updated first.

        Those that are missing are made in a separate process, or in this one if not ``apart``.
        """
        if missing := {_key(*point): point for point in points if not self.holds(point)}:
            places = [(kind, point.value) for kind, point in missing.values()]
            made, sources = _described_apart(places) if apart else entries_and_files(places)
            self.entries.update(zip(missing, made, strict=True))
            self.files.update(sources)
            kept = {key: entry for key, entry in self.entries.items() if "error" not in entry}  # others are tried again
            path = _path()
            if path and (apart or all(stamp[1:] < [_BEGUN] for stamp in sources.values())):
                _write(path, json.dumps([kept, self.files]))
        return [_description(*point, self.entries[_key(*point)]) for point in points]


def imported(kind: str, point: EntryPoint) -> Description:
    """Return the description of a plug-in by importing it in this process."""
    return _description(kind, point, _imported(kind, point.value))


def docstring(value: str) -> str:
    """Return the docstring of the class, the function or the module at "package.module:Name", from the source.

    Raises ModuleNotFoundError or AttributeError if none exists, as its import would.
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


def entries_and_files(places: Sequence[tuple[str, str]]) -> tuple[list[Plain], dict[str, list[int]]]:
    """Import plug-ins, given by kind and place; return the entry of each, and the stamps of their sources."""
    from mathnavi.sim.plugin.code_version import is_installed  # not needed to list plug-ins

    entries = [_imported(kind, value) for kind, value in places]
    packages = {"mathnavi", *(re.split("[.:]", value)[0] for _, value in places)}
    stamps = {}
    for name, module in list(sys.modules.items()):
        top, _, inner = name.partition(".")
        file = getattr(module, "__file__", None)
        if not file or top in sys.stdlib_module_names:
            continue
        if top in packages or not inner or not is_installed(Path(file)):
            stamps[file] = _stamp(file)
    return entries, stamps


def _imported(kind: str, value: str) -> Plain:
    """Import the class or function at "package.module:Name", and return its entry.

    Any exception of the import except Ctrl-C, including SystemExit, is in "error".
    """
    from mathnavi.sim.plugin.registry import NEEDED, check_class  # not needed to list plug-ins

    try:
        plugin = EntryPoint(value, value, "").load()
        place = f"{plugin.__module__}:{plugin.__qualname__}" if isinstance(plugin, type) else value
        entry: Plain = {"first_line": _first_line(plugin.__doc__ or ""), "place": place}
        config = getattr(plugin, "Config", plugin)
        if not (isinstance(config, type) and dataclasses.is_dataclass(config)):
            return entry
        checked = kind == COMMAND
        with suppress(PluginError):
            if kind in NEEDED:
                check_class(kind, plugin, value)
                checked = True
        leaves = leaves_of(config, PREFIXES.get(kind, ""), config() if checked and kind in NEEDED else None)
        return entry | {
            "stated": {name: stated for name in STATED if isinstance(stated := getattr(plugin, name, None), str)},
            "fields": [leaf.description for leaf in leaves],
            "checked": checked and _is_constant(config),
        }
    except BaseException as error:  # a third-party module may raise anything when it is imported
        if isinstance(error, KeyboardInterrupt):
            raise
        return {"error": str(error) or type(error).__name__}


def _is_constant(config: Any) -> bool:
    """Return False for a dataclass with a default that a function computes: it may depend on the machine."""
    factories = [entry.default_factory for entry in dataclasses.fields(config)]
    inner = [field.inner for field in fields_of(config)]
    return all(isinstance(each, type) or each is dataclasses.MISSING for each in factories) and all(
        map(_is_constant, filter(None, inner))
    )


def _first_line(doc: str) -> str:
    return doc.strip().partition("\n")[0]


def module_of(point: EntryPoint) -> str:
    """Return the name of the module of a plug-in, also where its place is not "package.module:Class"."""
    return point.value.partition(":")[0].strip()


def _key(kind: str, point: EntryPoint) -> str:
    """Return the key of a plug-in, with the file of its package, which may be another one in another folder."""
    spec = PathFinder.find_spec(module_of(point).partition(".")[0], [*sys.path, ""])
    file = spec and (spec.origin or spec.submodule_search_locations)
    return f"{kind} {point.name} {point.value} {home(point)} {file}"


def _description(kind: str, point: EntryPoint, entry: Plain) -> Description:
    fields = tuple(FieldDescription._make((*most, tuple(choices))) for *most, choices in entry.get("fields", ()))
    return Description(kind, point.name, point.value, home(point), **entry | {"fields": fields})


def _stamp(file: str) -> list[int]:
    """Return size [bytes] and time of the last change [ns] of a file, which reveal changes; empty without the file."""
    try:
        status = os.stat(file)
    except OSError:
        return []
    return [status.st_size, status.st_mtime_ns]


def _path() -> Path | None:
    """Return the file of the index for this installation and this version of Python; None if nothing can be kept."""
    installation = hashlib.sha256(os.fsencode(f"{sys.prefix} {sys.version}")).hexdigest()[:16]
    folder = cache_folder()
    return folder and folder / f"plugins-{installation}.json"


def _digest(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()


def _write(path: Path, content: str) -> None:
    """Replace the file atomically, below a digest; nothing happens if it cannot be written."""
    import tempfile  # a tenth of the time that completion takes

    with suppress(OSError):
        handle, partial = tempfile.mkstemp(dir=path.parent, prefix=".plugins-")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(f"{_digest(content)}\n{content}")
            os.replace(partial, path)
        except OSError:
            os.unlink(partial)


def _described_apart(places: Sequence[tuple[str, str]]) -> tuple[list[Plain], dict[str, list[int]]]:
    """Describe plug-ins in a separate process, which imports each; a plug-in that ends the process is broken."""
    import subprocess

    folder = os.getcwd()
    request = {"path": [*sys.path, *[folder] * (folder not in sys.path)], "places": list(places)}
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
    if len(places) == 1:
        return [{"error": f"its import ended the process, exit code {done.returncode}"}], {}
    entries: list[Plain] = []
    files: dict[str, list[int]] = {}
    for place in places:
        (entry,), sources = _described_apart([place])
        entries.append(entry)
        files |= sources
    return entries, files
