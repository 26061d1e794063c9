"""Version of the code that a result comes from: that of the package, and a digest of the installed sources."""

from __future__ import annotations

import hashlib
import importlib
import re
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.reading.files import MEBIBYTE, read_bytes

PACKAGE = "mathnavi"
# A result depends on these; renders, commands and scripting read it afterwards.
FOLDERS = ("controllers", "estimators", "interfaces", "models", "sim", "studies")
MOST_SOURCE = 1024 * MEBIBYTE  # of a file in a package
_DIGITS = 16  # of a digest
_IMPORT = re.compile(rb"^\s*(?:from\s+([A-Za-z_]\w*)[\w.]*\s+import\b|import\s+([^\n#;(]+))", re.MULTILINE)


def code_version(*plugins: Any, need_sources: bool = True) -> str:
    """Return the version of mathnavi and the digest of its sources, with those of plug-ins from elsewhere.

    Raises ValueError for a plug-in without sources, from a notebook for example, unless they are not needed.

    Of a third-party package every file counts, of a module outside of packages the one file; so do the user's modules
    that these import, and the installed packages that they import: their version, or their sources if the distribution
    has another name. It is the code at the first call in this process.
    """
    strangers = {plugin.__module__.partition(".")[0] for plugin in plugins} - {PACKAGE}
    digests = {name: _stranger(name) if need_sources or _places(name) else "without-sources" for name in strangers}
    return "+".join((_own(), *(f"{name}-{digests[name]}" for name in sorted(digests))))


@cache
def _own() -> str:
    folders = [Path(folder) for name in FOLDERS for folder in importlib.import_module(f"{PACKAGE}.{name}").__path__]
    digest = _digest((folder.name, folder, file) for folder in folders for file in _files(folder))
    return f"{version('mathnavi')}+{digest}"


@cache
def _stranger(name: str) -> str:
    """Return digest of the sources of a third-party plug-in's top-level module, and of everything that it imports."""
    counted: list[tuple[str, Path, Path]] = []
    versions: set[str] = set()
    waiting, seen = [name], {name}
    while waiting:
        module = waiting.pop()
        places = _places(module)
        if module == name and not places:
            raise ArgumentError(f"the plug-ins of module {name!r} have no file; allowed: modules with sources")
        if module != name and places and is_installed(places[0][1]) and (number := _version(module)):
            versions.add(f"{module} {number}")
            continue
        own = [(module, folder, file) for folder, start in places for file in _files(start)]
        counted += own
        if module != name and places and is_installed(places[0][1]):
            continue  # imports of an installed package are not followed
        found = {each for *_, file in own if file.suffix == ".py" for each in _imports(file)} - seen
        seen |= found
        waiting += sorted(found)
    return _digest(sorted(counted), *sorted(versions))


def _places(name: str) -> list[tuple[Path, Path]]:
    """Return the folder above a top-level module's files, and the file or the folder itself; none without sources."""
    module = sys.modules.get(name)
    try:
        spec = module.__spec__ if module is not None and module.__spec__ is not None else find_spec(name)
    except (ImportError, ValueError):  # perhaps an optional import
        return []
    if spec is None:
        return []
    if spec.submodule_search_locations is not None:
        return [(Path(folder), Path(folder)) for folder in spec.submodule_search_locations]
    return [(Path(spec.origin).parent, Path(spec.origin))] if spec.origin and spec.has_location else []


def _imports(file: Path) -> Iterator[str]:
    """Return the top-level modules that a source imports, without Python's own and mathnavi."""
    for module, listed in _IMPORT.findall(read_bytes(file, ValueError, MOST_SOURCE)):
        for each in (module,) if module else listed.split(b","):
            name = each.split(b" as ")[0].strip().partition(b".")[0].decode(errors="replace")
            if name.isidentifier() and name not in sys.stdlib_module_names and name != PACKAGE:
                yield name


def is_installed(file: Path) -> bool:
    """Return True for a path among the installed packages."""
    return any(file.is_relative_to(sysconfig.get_path(each)) for each in ("purelib", "platlib"))


def _version(name: str) -> str | None:
    """Return the version of the distribution with the name of its module; None if absent."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _files(place: Path) -> Iterator[Path]:
    """Return all files of a package except caches and hidden files, in order; for a file the file itself."""
    if place.is_file():
        yield place
        return
    for path in sorted(place.iterdir()):
        if path.name.startswith(".") or path.name == "__pycache__":
            continue
        if path.is_dir() or path.is_file():
            yield from _files(path)


def _digest(files: Iterable[tuple[str, Path, Path]], *more: str) -> str:
    """Return the digest of (package, folder of the package, file): the place of each file in its package, and its
    content.
    """
    digest = hashlib.sha256()
    for package, folder, file in files:
        content = hashlib.sha256(read_bytes(file, ValueError, MOST_SOURCE)).hexdigest()
        digest.update(f"{package}/{file.relative_to(folder).as_posix()} {content}\n".encode())
    for each in more:
        digest.update(f"{each}\n".encode())
    return digest.hexdigest()[:_DIGITS]
