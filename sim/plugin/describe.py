"""Description of a plug-in, found by importing it: ``mathnavi.sim.plugin.index`` keeps it for later."""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from types import ModuleType
from typing import Any

from mathnavi.sim.plugin.leaves import Leaf, leaves_of
from mathnavi.sim.plugin.source_stamps import Plain, stamp

STATED = ("controller", "estimator")  # the defaults of a scenario


def described(value: str) -> Plain:
    """Return plain data on the class or function at "package.module:Name", with the fields of ``index.Description``.

    Any exception of the import except Ctrl-C, including SystemExit, is in ``error``.
    """
    try:
        plugin = EntryPoint(value, value, "").load()
        config = getattr(plugin, "Config", plugin if dataclasses.is_dataclass(plugin) else None)
        schema = config if isinstance(config, type) and dataclasses.is_dataclass(config) else None
        leaves = [*leaves_of(schema, "")] if schema else []
        return {
            "first_line": (plugin.__doc__ or "").strip().partition("\n")[0],
            "stated": {name: str(getattr(plugin, name)) for name in STATED if isinstance(vars(plugin).get(name), str)},
            "fields": [_field(leaf) for leaf in leaves if not leaf.positional],
            "files": {file: stamp(file) for file in _files(plugin, schema, leaves)},
            "error": "",
        }
    except BaseException as error:  # a third-party module may raise anything when it is imported
        if isinstance(error, KeyboardInterrupt):
            raise
        return {"first_line": "", "stated": {}, "fields": [], "files": {}, "error": str(error) or type(error).__name__}


def _field(leaf: Leaf) -> Plain:
    switch = leaf.hint is bool
    return {
        "name": leaf.path,
        "type": leaf.value_name,
        "choices": [] if leaf.form is None or switch else list(leaf.form.choices),
        "switch": switch,
        "repeats": leaf.form is not None and leaf.form.container is not None,
        "help": leaf.help,
    }


def _files(plugin: Any, schema: type | None, leaves: list[Leaf]) -> Iterator[str]:
    """Return sources that the description depends on: of the plug-in, its configuration, and the types named in it."""
    bases = getattr(plugin, "__mro__", (plugin,))
    owners = [*bases, *(schema.__mro__ if schema else ()), *(base for leaf in leaves for base in leaf.owner.__mro__)]
    named = (owner.__name__ if isinstance(owner, ModuleType) else getattr(owner, "__module__", "") for owner in owners)
    modules = {name: sys.modules.get(name) for name in named}
    found = {file for module in modules.values() if module for file in _file(module)}
    for leaf in leaves:
        module = modules.get(leaf.owner.__module__)
        for name in set(re.findall(r"[A-Za-z_]\w*", str(leaf.owner.__annotations__.get(leaf.name, "")))):
            found |= set(_definitions(module, name)) if module else set()
    yield from sorted(found)


def _definitions(module: ModuleType, name: str) -> Iterator[str]:
    """Return the sources of the modules of the same package that define ``name`` as used in a module."""
    missing = object()
    meaning = vars(module).get(name, missing)
    if meaning is missing:
        return
    package = module.__name__.partition(".")[0]
    for other in list(sys.modules.values()):
        if other and other.__name__.partition(".")[0] == package and vars(other).get(name, missing) is meaning:
            yield from _file(other)


def _file(module: ModuleType) -> Iterator[str]:
    file = getattr(module, "__file__", None)
    if file:
        yield str(file)
