"""Which code a result comes from: the version of the package and a digest of the sources as they are installed."""

from __future__ import annotations

import hashlib
import importlib
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mathnavi.sim.interfaces.reading.files import MEBIBYTE, read_bytes

PACKAGE = "mathnavi"
FOLDERS = ("controllers", "estimators", "models", "sim")  # what a result can depend on; renders draws afterwards
_DIGITS = 16  # of a digest
MOST_SOURCE = 1024 * MEBIBYTE  # of a file that lies in a package


def code_version(*plugins: Any) -> str:
    """The version of mathnavi and the digest of its sources, with those of plug-ins that lie elsewhere.

    Of another's package every Python file counts, of a module that lies in no package the one file. It is the code as
    it was when this process first asked.
    """
    strangers = {plugin.__module__.partition(".")[0] for plugin in plugins} - {PACKAGE}
    return "+".join((_own(), *(f"{name}-{_stranger(name)}" for name in sorted(strangers))))


@cache
def _own() -> str:
    folders = [Path(folder) for name in FOLDERS for folder in importlib.import_module(f"{PACKAGE}.{name}").__path__]
    digest = _digest((folder.name, folder, file) for folder in folders for file in _files(folder))
    return f"{version('mathnavi')}+{digest}"


@cache
def _stranger(name: str) -> str:
    module = sys.modules[name]
    if hasattr(module, "__path__"):
        folders = [Path(folder) for folder in module.__path__]
        return _digest((name, folder, file) for folder in folders for file in _files(folder) if file.suffix == ".py")
    if module.__file__ is None:
        raise ValueError(f"the plug-ins of module {name!r} come from no file; allowed: modules with sources")
    file = Path(module.__file__)
    return _digest([(name, file.parent, file)])


def _files(folder: Path) -> Iterator[Path]:
    """Everything in a package but caches and hidden files, in order."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.name == "__pycache__":
            continue
        if path.is_dir():
            yield from _files(path)
        elif path.is_file():
            yield path


def _digest(files: Iterable[tuple[str, Path, Path]]) -> str:
    """Digest of (package, folder of the package, file): where each file lies in its package, and its content."""
    digest = hashlib.sha256()
    for package, folder, file in files:
        content = hashlib.sha256(read_bytes(file, ValueError, MOST_SOURCE)).hexdigest()
        digest.update(f"{package}/{file.relative_to(folder).as_posix()} {content}\n".encode())
    return digest.hexdigest()[:_DIGITS]
