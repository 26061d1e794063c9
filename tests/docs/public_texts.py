"""Texts that a user of the software reads, collected to be read from top to bottom.

    python -m tests.docs.public_texts FILE

These are the help of every command, the help of every field of a configuration, and the docstrings of the public
interface: the names of ``mathnavi``, the protocols and signals that a plug-in implements, the environments, and the
plug-ins themselves.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import inspect
import io
import pkgutil
import re
import sys
import types
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import benchmarks
import mathnavi
from mathnavi import commands, interfaces
from mathnavi.commands import cli
from mathnavi.interfaces.field_table import field_help
from mathnavi.sim.plugin.groups import GROUPS, installed

EXAMPLES = {"run": "safe-flight", "sweep": "safe-flight", "search": "safe-flight", "study": "beta"}  # one help of each
PUBLIC = (
    *(
        f"{interfaces.__name__}.{module.name}"
        for module in pkgutil.iter_modules(interfaces.__path__)
        if not module.ispkg
    ),
    "mathnavi.sim.environments",
    "mathnavi.sim.environments.dm",
    "mathnavi.sim.environments.gym",
    "mathnavi.sim.environments.vector",
    "mathnavi.sim.scenarios.task",
    "mathnavi.studies.framework.study",
)
OPTIONS = ("Options", "Arguments")  # ends of the names of the dataclasses of a command's options


@dataclass(frozen=True)
class Help:
    """Help text of a field of a configuration."""

    owner: type
    field: str
    hint: Any  # without ``Annotated``
    text: str

    @property
    def place(self) -> str:
        return f"{self.owner.__module__}.{self.owner.__qualname__}.{self.field}"


@dataclass(frozen=True)
class Docstring:
    """Docstring of a public name."""

    place: str
    text: str


def command_helps() -> Iterator[tuple[str, str]]:
    """Yield every command with its help as printed, and so every action of a command."""
    for name in cli.COMMANDS:
        usage = _printed(name, "--help")
        yield f"mathnavi {name} --help", usage
        actions = re.findall(rf"^(?:usage:)? *mathnavi {name} ([a-z]\w*) ", usage, re.MULTILINE)
        for word in dict.fromkeys([*actions, *([EXAMPLES[name]] if name in EXAMPLES else [])]):
            yield f"mathnavi {name} {word} --help", _printed(name, word, "--help")


def _printed(*words: str) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert cli.main(words) == 0, words
    return re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue()).strip()


def field_helps() -> list[Help]:
    """Return the help of every field of every command, plug-in and benchmark, once for each class that has it."""
    found: dict[tuple[type, str], Help] = {}
    for owner in _configurations():
        for each in _leaves(owner):
            found[each.owner, each.field] = each
    return list(found.values())


def _configurations() -> Iterator[type]:
    for package in (commands, benchmarks):
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            source = Path(package.__path__[0], f"{module.name.rpartition('.')[2]}.py")
            if source.is_file() and re.search(rf"^class \w*({'|'.join(OPTIONS)})\b", source.read_text(), re.MULTILINE):
                for name, value in vars(importlib.import_module(module.name)).items():
                    if name.endswith(OPTIONS) and dataclasses.is_dataclass(value) and isinstance(value, type):
                        yield value
    for kind in GROUPS:
        for point in installed(kind):
            if isinstance(config := getattr(point.load(), "Config", None), type):
                yield config


def _leaves(owner: type) -> Iterator[Help]:
    hints, texts = get_type_hints(owner, include_extras=True), field_help(owner)
    for entry in dataclasses.fields(owner):
        hint = hints[entry.name]
        while get_origin(hint) is Annotated:
            hint = get_args(hint)[0]
        if isinstance(hint, type) and dataclasses.is_dataclass(hint):
            yield from _leaves(hint)
        else:
            yield Help(owner, entry.name, hint, texts.get(entry.name, ""))


def docstrings() -> list[Docstring]:
    """Return the docstring of every public name, of its public members, and of every plug-in."""
    found: dict[str, Docstring] = {}
    for each in (*_names(), *_public(), *_plug_ins()):
        found.setdefault(each.place, each)
    return list(found.values())


def _names() -> Iterator[Docstring]:
    yield Docstring("mathnavi", inspect.getdoc(mathnavi) or "")
    for name in mathnavi.__all__:
        yield from _documented(f"mathnavi.{name}", getattr(mathnavi, name))


def _public() -> Iterator[Docstring]:
    for name in PUBLIC:
        module = importlib.import_module(name)
        yield Docstring(name, inspect.getdoc(module) or "")
        for own, value in vars(module).items():
            if getattr(value, "__module__", None) == name and not own.startswith("_"):
                yield from _documented(f"{name}.{own}", value)


def _plug_ins() -> Iterator[Docstring]:
    for kind in GROUPS:
        for point in installed(kind):
            plugin = point.load()
            if isinstance(plugin, types.ModuleType):
                yield Docstring(plugin.__name__, inspect.getdoc(plugin) or "")
            elif isinstance(plugin, (type, types.FunctionType)):
                yield Docstring(plugin.__module__, inspect.getdoc(sys.modules[plugin.__module__]) or "")
                yield Docstring(f"{plugin.__module__}.{plugin.__qualname__}", _own_docstring(plugin))


def _documented(place: str, value: Any) -> Iterator[Docstring]:
    """Yield the docstring of a class or a function, and of the public methods and properties of a class."""
    if not isinstance(value, (type, types.FunctionType)):
        return
    yield Docstring(place, _own_docstring(value))
    if not isinstance(value, type) or issubclass(value, (Enum, Exception)):
        return
    fields = {field.name for field in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else set()
    for name, member in vars(value).items():
        if isinstance(member, (staticmethod, classmethod)):
            member = member.__func__
        if (
            not name.startswith("_")
            and name not in fields
            and isinstance(member, (types.FunctionType, property, cached_property))
        ):
            yield Docstring(f"{place}.{name}", inspect.getdoc(member) or "")


def _own_docstring(value: Any) -> str:
    text = value.__doc__ or ""
    return "" if dataclasses.is_dataclass(value) and text.startswith(f"{value.__name__}(") else inspect.cleandoc(text)


def document(helps: Iterable[Help], docs: Iterable[Docstring]) -> str:
    """Return all texts as one document."""
    parts = ["# Commands\n"]
    parts += [f"## {name}\n\n{text}\n" for name, text in command_helps()]
    parts.append("# Fields\n")
    for owner, group in groupby(helps, key=lambda each: each.owner):
        lines = (f"{each.field}: {' '.join(each.text.split())}" for each in group)
        parts.append(f"## {owner.__module__}.{owner.__qualname__}\n\n{chr(10).join(lines)}\n")
    parts.append("# Docstrings\n")
    parts += [f"## {each.place}\n\n{each.text}\n" for each in docs]
    return "\n".join(parts)


def main(words: Iterable[str]) -> None:
    (file,) = words
    Path(file).write_text(document(field_helps(), docstrings()), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
