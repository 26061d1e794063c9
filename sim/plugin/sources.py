"""What the source of a class says of it, read without importing anything: first line, fields of a configuration.

To import every plug-in takes seconds, to read them a tenth of that. A module is found by the import system's own
finders; a name in it is followed from statement to statement: a definition, an import from another module, another
name for one of these. What is bound in any other way, by a call or within a condition, is not followed:
``UnreadableError``, and whoever asks may import it.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path

GROUPS = {  # of entry points, by kind of plug-in
    kind: f"mathnavi.{kind}" for kind in ("controllers", "estimators", "consensus", "scenarios", "studies", "terrains")
}


def installed(kind: str) -> list[EntryPoint]:
    """The entry points of a kind, in order of their names."""
    return sorted(entry_points(group=GROUPS[kind]))


class UnreadableError(LookupError):
    """The source does not say it in a way that can be read here."""


@dataclass(frozen=True)
class Definition:
    """A class or a function, and the module in which its names mean something."""

    module: str
    node: ast.ClassDef | ast.FunctionDef

    @property
    def first_line(self) -> str:
        """Of its docstring."""
        return (ast.get_docstring(self.node) or "").strip().partition("\n")[0]


@dataclass(frozen=True)
class Field:
    """A field of a dataclass, its type as it is written in ``module``."""

    name: str
    kind: ast.expr
    module: str


def definition(module: str, name: str) -> Definition:
    """What ``name`` means in a module; UnreadableError if the sources do not tell."""
    return _meaning(module, name, frozenset())


def named(expression: ast.expr, module: str) -> Definition:
    """What an expression of a module names, "Config" or "other_module.Config"; UnreadableError as above."""
    match expression:
        case ast.Name(id=name):
            return definition(module, name)
        case ast.Constant(value=str(name)) if name.isidentifier():
            return definition(module, name)
        case ast.Attribute(value=ast.Name(id=owner), attr=name):
            bound = _binding(module, owner)
            if isinstance(bound, ast.ImportFrom | ast.Import):
                return definition(_imported(bound, module, owner), name)
    raise UnreadableError(f"{module}: {ast.unparse(expression)}")


def config_fields(plugin: Definition) -> list[Field]:
    """The fields of a plug-in class's ``Config``, none without one; UnreadableError as above."""
    for entry in plugin.node.body:
        match entry:
            case ast.ClassDef(name="Config"):
                return fields(Definition(plugin.module, entry))
            case ast.Assign(targets=[ast.Name(id="Config")], value=value):
                return fields(named(value, plugin.module))
            case ast.AnnAssign(target=ast.Name(id="Config"), value=ast.expr() as value):
                return fields(named(value, plugin.module))
    return []


def fields(config: Definition) -> list[Field]:
    """The fields of a dataclass, those that it inherits first; UnreadableError as above."""
    if not isinstance(config.node, ast.ClassDef):
        raise UnreadableError(f"{config.module}: {config.node.name} is no class")
    found: dict[str, Field] = {}
    for base in reversed(config.node.bases):  # the order of dataclasses
        found |= {entry.name: entry for entry in fields(named(base, config.module))}
    for entry in config.node.body:
        match entry:
            case ast.AnnAssign(target=ast.Name(id=name), annotation=kind) if _is_field(kind):
                found[name] = Field(name, kind, config.module)
    return list(found.values())


def spelt_out(kind: ast.expr, module: str) -> tuple[ast.expr, str]:
    """A type in full, and the module in which it is written so: what it stands for where it is only a name for that."""
    if isinstance(kind, ast.Name):
        match _binding(module, kind.id):
            case ast.Assign(value=value):
                return spelt_out(value, module)
            case ast.ImportFrom() as bound:
                return spelt_out(ast.Name(_original(bound, kind.id)), _source(bound, module))
    return kind, module


def is_dataclass(made: Definition) -> bool:
    """True for a class that is decorated as a dataclass or as a configuration, which is one."""
    calls = (entry.func if isinstance(entry, ast.Call) else entry for entry in made.node.decorator_list)
    return any(ast.unparse(entry).rpartition(".")[2] in ("dataclass", "configuration") for entry in calls)


def _is_field(kind: ast.expr) -> bool:
    return not ast.unparse(kind).rpartition("dataclasses.")[2].startswith(("ClassVar", "InitVar", "KW_ONLY"))


def _meaning(module: str, name: str, seen: frozenset[tuple[str, str]]) -> Definition:
    if (module, name) not in seen:
        seen |= {(module, name)}
        match _binding(module, name):
            case (ast.ClassDef() | ast.FunctionDef()) as node:
                return Definition(module, node)
            case ast.ImportFrom() as bound:
                return _meaning(_source(bound, module), _original(bound, name), seen)
            case ast.Assign(value=ast.Name(id=other)):
                return _meaning(module, other, seen)
    raise UnreadableError(f"{module}: {name}")


def _binding(module: str, name: str) -> ast.stmt | None:
    """The statement of a module that binds a name, the last if there are several."""
    return _bindings(module, _end_of_class(_text(module), name)).get(name)


def _end_of_class(text: str, name: str) -> int:
    """Where a class of this name ends, if its module has one: what follows it need not be parsed, which takes long."""
    found = re.search(rf"^class {name}\b.*(\n([ \t#)].*)?)*", text, re.MULTILINE)
    return found.end() if found else len(text)


@cache
def _bindings(module: str, end: int) -> dict[str, ast.stmt]:
    """The statements that bind names in the first ``end`` characters of a module, or in all of it."""
    text = _text(module)
    try:
        tree = ast.parse(text[:end])
    except (SyntaxError, ValueError) as error:  # what looked like a class may stand in a string
        if end < len(text):
            return _bindings(module, len(text))
        raise UnreadableError(f"{module}: {error}") from error
    return {name: statement for statement in tree.body for name in _bound(statement)}


def _bound(statement: ast.stmt) -> Iterator[str]:
    match statement:
        case ast.ClassDef(name=name) | ast.FunctionDef(name=name):
            yield name
        case ast.ImportFrom(names=aliases) | ast.Import(names=aliases):
            yield from (alias.asname or alias.name for alias in aliases)
        case ast.Assign(targets=[ast.Name(id=name)]):
            yield name


@cache
def _text(module: str) -> str:
    spec = _spec(module)
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        raise UnreadableError(f"{module} has no source")
    try:
        return Path(spec.origin).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise UnreadableError(f"{module}: {error}") from error


@cache
def _spec(module: str) -> ModuleSpec | None:
    """Where a module lies; the packages above it are found and not imported."""
    above, _, _ = module.rpartition(".")
    if not above:
        try:
            return find_spec(module)
        except ValueError:  # of __main__, say
            return None
    package = _spec(above)
    if package is None or package.submodule_search_locations is None:
        return None
    return PathFinder.find_spec(module, list(package.submodule_search_locations))


def _source(bound: ast.ImportFrom, module: str) -> str:
    """The module that a statement imports from, relative ones included."""
    if not bound.level:
        return bound.module or ""
    spec = _spec(module)
    package = module if spec is not None and spec.submodule_search_locations is not None else module.rpartition(".")[0]
    for _ in range(bound.level - 1):
        package = package.rpartition(".")[0]
    return f"{package}.{bound.module}" if bound.module else package


def _imported(bound: ast.ImportFrom | ast.Import, module: str, name: str) -> str:
    """The module that a statement binds to ``name``."""
    original = _original(bound, name)
    return f"{_source(bound, module)}.{original}" if isinstance(bound, ast.ImportFrom) else original


def _original(bound: ast.ImportFrom | ast.Import, name: str) -> str:
    """What is called ``name`` after an import, by its own name."""
    return next(alias.name for alias in bound.names if (alias.asname or alias.name) == name)
