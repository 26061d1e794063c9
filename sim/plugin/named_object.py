"""Objects that a user names on the command line: "FILE.py:NAME", or "package.module:NAME" of an importable module."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, get_origin

import numpy as np

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.failures import failures_named

_Feature = type(annotations)  # of `from __future__ import annotations`

PLACE = "FILE.py:NAME or package.module:NAME"
_VALUES = (bool, int, float, complex, str, bytes, tuple, list, set, dict, np.ndarray, np.generic, type(None))


def named_object(place: str) -> Any:
    """Return the object called NAME, of a file, which may import its neighbours, or of a module.

    A function or a class without arguments is called for the object. The code is that of the user who names it, and
    runs with the user's rights.

    Raises PluginError for a file or a module that is not there or fails, and for a name that it has not.
    """
    origin, colon, name = place.rpartition(":")
    if not colon or not origin or not name.isidentifier():
        raise PluginError(f"{place!r} names no object; allowed: {PLACE}")
    with failures_named(f"{place!r}: {origin} cannot be imported:", PluginError), _refusals_named(place):
        module = _module_of(Path(origin)) if origin.endswith(".py") else importlib.import_module(origin)
    if not hasattr(module, name):
        raise PluginError(f"{place!r}: {origin} has no {name}; {allowed_for(name, list(objects_in(module)))}")
    found = getattr(module, name)
    if not callable(found):
        return found
    with failures_named(f"{place!r}: {name}() failed:", PluginError), _refusals_named(place):
        return found()


@contextmanager
def _refusals_named(place: str) -> Iterator[None]:
    """Name the place, and the line of the user's file, of a value that mathnavi refuses there."""
    try:
        yield
    except PluginError:
        raise
    except ValueError as error:
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if Path(frame.filename).name == Path(place.rpartition(":")[0]).name]
        where = f" ({own[-1].filename}:{own[-1].lineno})" if own else ""
        raise PluginError(f"{place!r}: {error}{where}") from error


def objects_in(module: ModuleType) -> dict[str, Any]:
    """Return by name what a module offers as such an object: instances, and what makes one without arguments.

    Modules, types and values (numbers, texts, lists, arrays) are none, nor are functions and classes that it has
    imported, and plug-ins and their configurations.
    """
    public = {name: value for name, value in vars(module).items() if not name.startswith("_")}
    plugins = [value for value in public.values() if isinstance(value, type) and hasattr(value, "Config")]
    others = {id(each) for plugin in plugins for each in (plugin, plugin.Config)}
    offered = {name: value for name, value in public.items() if id(value) not in others}
    return {name: value for name, value in offered.items() if _is_offered(value, module)}


def _is_offered(value: Any, module: ModuleType) -> bool:
    if isinstance(value, ModuleType | _Feature) or type(value) in _VALUES or get_origin(value) is not None:
        return False
    if not (isinstance(value, type) or inspect.isroutine(value)):
        return True
    if getattr(value, "__module__", None) != module.__name__:
        return False
    try:
        inspect.signature(value).bind()
    except (TypeError, ValueError):  # it needs arguments, or does not say which
        return False
    return True


def _module_of(path: Path) -> ModuleType:
    """Return the module of a file, the same one for all who import it: of two, the classes would be different ones."""
    if not path.is_file():
        raise PluginError(f"{path} is not there; allowed: {PLACE}")
    name, folder = str(path.resolve()), str(path.resolve().parent)  # a name that no installed module has
    for module in list(sys.modules.values()):
        if getattr(module, "__file__", None) == name and module.__name__ != name:
            return module
    if path.stem.isidentifier() and path.stem not in sys.modules:  # as its neighbours, and package.module:NAME, do
        sys.path.append(folder)
        importlib.invalidate_caches()
        found = importlib.util.find_spec(path.stem)
        sys.path.remove(folder)
        if found is not None and found.origin == name:
            sys.path.append(folder)
            return importlib.import_module(path.stem)
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise PluginError(f"{path} is no Python file; allowed: {PLACE}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses look up the names of their types
    if folder not in sys.path:
        sys.path.append(folder)  # for its neighbours, after all that is installed
    spec.loader.exec_module(module)
    return module
