"""Table of the fields of a dataclass, made once for each class: the only code that looks into a type hint.

::

    @configuration
    class MapConfig:
        terrain: Annotated[str, InputFile(heights_digest)] = "tian_shan"
        start: tuple[float, float] | None = None  # x, y [m]; drawn if not given
        noise: Noise = Noise()

``fields_of(MapConfig)`` has an entry for each field, ``leaves_of(MapConfig)`` one for each field that is no dataclass
itself: "terrain", "start", "noise.rate". Bounds, files, validation, command line, help, completion and the reference
pages read what they need from these entries: the form of a type, its marks, its words, the help. The command line reads
``FieldDescription``, which is plain data, so that it can be kept where the class is not imported.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import linecache
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache, cached_property, lru_cache
from itertools import islice
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

NAMES: dict[Any, str] = {int: "INT", float: "FLOAT", str: "STR", Path: "PATH"}
TOGETHER = object()
"""Mark of a tuple of any length whose items follow one flag: ``--start 0.2 0.3``; else it is repeated for each item"""
NumberList = Annotated[tuple[float, ...], TOGETHER]


@dataclass(frozen=True)
class ValueName:
    """Mark of a field with the name of its value in the help."""

    name: str = ""


@dataclass(frozen=True)
class Positional(ValueName):
    """Mark of a field that is given without a flag, with its name in the help."""


@dataclass(frozen=True, eq=False)
class Form:
    """Type hint, taken apart."""

    hint: Any
    """the whole hint"""
    kind: Any
    """type without marks; without None if it is that of another one type too"""
    origin: Any
    """class, or Union, Literal, tuple, list, dict"""
    members: tuple[Form, ...] = ()
    """alternatives of a union without None, items of a tuple, item of a list, key and value of a dictionary"""
    marks: tuple[Any, ...] = ()
    """metadata of ``Annotated``"""
    optional: bool = False
    """whether None is allowed too"""

    def mark(self, kind: type[Any]) -> Any:
        """Return the first mark of a class anywhere in the type; None without one."""
        own = next((mark for mark in self.marks if isinstance(mark, kind)), None)
        return own or next(filter(None, (member.mark(kind) for member in self.members)), None)

    @cached_property
    def fixed(self) -> bool:
        """True for a tuple with one value for each of its types."""
        return self.origin is tuple and Ellipsis not in get_args(self.kind)

    @cached_property
    def repeats(self) -> bool:
        """True for a list of values, of which each occurrence of the flag adds one."""
        return self.origin is list or (self.origin is tuple and not self.fixed and TOGETHER not in self.marks)

    @cached_property
    def values(self) -> Mapping[str, Any]:
        """All values by their words, of a type whose values can be listed."""
        if self.origin is Literal:
            return {str(value): value for value in get_args(self.kind)}
        if self.kind is bool:
            return {"True": True, "False": False}
        return dict(self.kind.__members__) if isinstance(self.kind, type) and issubclass(self.kind, Enum) else {}

    @cached_property
    def readable(self) -> bool:
        """True for a type whose values can be given as words."""
        if self.origin in (Union, tuple, list):
            counted = not self.fixed or all(member.count is not None for member in self.members)
            return (
                bool(self.members)
                and counted
                and all(member.readable and not member.repeats for member in self.members)
            )
        return bool(self.values) or self.kind in NAMES

    @cached_property
    def count(self) -> int | None:
        """Number of words of one value; None for as many as follow."""
        counts = [member.count for member in self.members]
        if self.origin is Union:
            return 1 if {*counts} == {1} else None
        if self.fixed:
            return sum(count or 0 for count in counts)
        return counts[0] if self.repeats else None if self.origin is tuple else 1

    @cached_property
    def choices(self) -> tuple[str, ...]:
        """All words that are allowed, if they can be listed."""
        if self.origin is Union or self.repeats:
            lists = [member.choices for member in self.members]
            return tuple(word for words in lists for word in words) if all(lists) else ()
        return tuple(self.values)

    @cached_property
    def value_name(self) -> str:
        """Name of one value: INT, {uniform,arclength}, FLOAT FLOAT FLOAT."""
        if not self.readable:
            return "nothing"
        names = [member.value_name for member in self.members]
        if self.origin is Union:
            return "|".join(names)
        if names:
            return " ".join(names) if self.fixed or self.repeats else f"{names[0]}..."
        return f"{{{','.join(self.values)}}}" if self.values else NAMES[self.kind]

    def read(self, words: Sequence[str]) -> Any:
        """Return the value that some words express; for a list that of one item. ValueError for other words."""
        if self.repeats:
            return self.members[0].read(words)
        if self.origin is Union:
            for member in self.members[:-1]:
                with suppress(ValueError):
                    return member.read(words)
            return self.members[-1].read(words)
        if self.origin is tuple:
            rest = iter(words)
            items = self.members if self.fixed else self.members * len(words)
            values = tuple(item.read([*islice(rest, item.count)]) for item in items)
            if [*rest]:
                raise ValueError(f"{len(words)} values")
            return values
        (word,) = words  # ValueError for any other number
        if self.values:
            if word not in self.values:
                raise ValueError(f"{word}; allowed: {', '.join(self.values)}")
            return self.values[word]
        if self.kind is Path and not word:  # which Path reads as the current folder
            raise ValueError("an empty word")
        return self.kind(word)


def form_of(hint: Any) -> Form:
    """Take a type hint apart."""
    kind, marks = (get_args(hint)[0], get_args(hint)[1:]) if get_origin(hint) is Annotated else (hint, ())
    origin, arguments = get_origin(kind) or kind, get_args(kind)
    if origin is Literal:
        return Form(hint, kind, origin, (), marks)
    members = tuple(form_of(each) for each in arguments if each not in (NoneType, Ellipsis))
    if origin not in (Union, UnionType):
        return Form(hint, kind, origin, members, marks)
    optional = NoneType in arguments
    if len(members) > 1:
        return Form(hint, kind, Union, members, marks, optional)
    return replace(members[0], hint=hint, marks=(*members[0].marks, *marks), optional=optional)


class FieldDescription(NamedTuple):
    """Field of a dataclass on the command line, as plain data."""

    path: str
    """dotted name in the dataclass: "noise.rate"; empty strings below are texts that are not there"""
    flag: str
    """--PREFIX.PATH"""
    place: str
    """name in a message: the flag, or the name of a positional argument"""
    value_name: str
    help: str
    default: str | None
    """value if it is not given; None if it has to be"""
    group: str
    """dotted name of the dataclass in which it lies, "planner.noise" with the prefix"""
    group_help: str
    positional: bool
    switch: bool
    """whether it is a truth value, which --no-NAME sets to false"""
    repeats: bool
    """whether each occurrence of the flag adds one value"""
    readable: bool
    """whether its values can be given as words"""
    words: int | None
    """number of words of one value; None for as many as follow"""
    choices: tuple[str, ...]
    """all words that are allowed, if they can be listed"""


@dataclass(frozen=True)
class Field:
    """Field of a dataclass."""

    owner: type
    """dataclass in which it lies"""
    name: str
    form: Form
    """form of its type"""
    declared: tuple[Form, ...]
    """forms of its types in the base classes that declare it, those first, and in its own"""
    init: bool
    """whether an instance is made with it"""
    default: Any
    """value if it is not given; ``dataclasses.MISSING`` if it has to be"""
    path: str
    """dotted name: "noise.rate" in a dataclass with the field noise"""
    prefix: str = ""
    """before the path in a flag"""

    @property
    def inner(self) -> type | None:
        """Dataclass that the field holds; None for another type."""
        kind = self.form.kind
        return kind if isinstance(kind, type) and dataclasses.is_dataclass(kind) and not self.form.optional else None

    @property
    def flag(self) -> str:
        """Flag on the command line."""
        return flag_of(f"{self.prefix}.{self.path}")

    @property
    def positional(self) -> bool:
        """True for a field that is given without a flag."""
        return self.form.mark(Positional) is not None

    @property
    def switch(self) -> bool:
        """True for a truth value, which a flag without a value sets to true, and another one to false."""
        return self.form.kind is bool and not self.form.optional

    @property
    def value_name(self) -> str:
        """Name of the value in the help and in messages."""
        mark = self.form.mark(ValueName)
        return (mark and mark.name) or (self.name.upper() if self.positional else self.form.value_name)

    @property
    def help(self) -> str:
        """Documentation of the field, on one line."""
        return " ".join(field_help(self.owner).get(self.name, "").split())

    @property
    def description(self) -> FieldDescription:
        """Plain data of the field that the command line reads."""
        return FieldDescription(
            path=self.path,
            flag=self.flag,
            place=self.value_name if self.positional else self.flag,
            value_name=self.value_name,
            help=self.help,
            default=None if self.default is dataclasses.MISSING else shown(self.default),
            group=f"{self.prefix}.{self.path}".strip(".").rpartition(".")[0],
            group_help=docstring(self.owner),
            positional=self.positional,
            switch=self.switch,
            repeats=self.form.repeats,
            readable=self.form.readable,
            words=self.form.count if self.form.readable else None,
            choices=self.form.choices,
        )


@cache
def fields_of(kind: Any) -> tuple[Field, ...]:
    """Return the fields of a dataclass in their order; NameError for a type that means nothing in its module."""
    bases = [base for base in reversed(kind.__mro__) if "__dataclass_fields__" in vars(base)]
    hints = [(inspect.get_annotations(base), get_type_hints(base, include_extras=True)) for base in bases]
    found = []
    for entry in dataclasses.fields(kind):
        declared = tuple(form_of(types[entry.name]) for own, types in hints if entry.name in own)
        default = entry.default if entry.default_factory is dataclasses.MISSING else entry.default_factory()
        found.append(Field(kind, entry.name, declared[-1], declared, entry.init, default, entry.name))
    return tuple(found)


def field_of(kind: Any, name: str) -> Field:
    """Return the field of a dataclass with a name; KeyError if none exists."""
    return {field.name: field for field in fields_of(kind)}[name]


def leaves_of(kind: Any, prefix: str = "", instance: Any = None, above: str = "") -> Iterator[Field]:
    """Return the fields that an instance is made with, and in place of one that holds a dataclass the fields of that.

    Defaults are the values of the ``instance``, if there is one. ``above`` is the path of the dataclass.
    """
    for field in fields_of(kind):
        value = field.default if instance is None else getattr(instance, field.name)
        path = f"{above}.{field.name}".strip(".")
        if field.init and field.inner:
            yield from leaves_of(field.inner, prefix, None if value is dataclasses.MISSING else value, path)
        elif field.init:
            yield replace(field, default=value, path=path, prefix=prefix)


def flag_of(name: str) -> str:
    """Return the flag of a dotted name: --planner.grid-nodes for planner.grid_nodes, --from for from_."""
    name = re.sub(r"_+(?=\.|$)", "", name.strip("."))
    return f"--{name.replace('_', '-')}"


def negation(flag: str) -> str:
    """Return the flag that sets a truth value to false: --planner.no-warm for --planner.warm."""
    above, dot, name = flag.removeprefix("--").rpartition(".")
    return f"--{above}{dot}no-{name}"


def shown(value: Any) -> str:
    """Return a value as the help shows it, without the brackets of a sequence; "" for None."""
    if isinstance(value, (tuple, list)):
        return " ".join(shown(item) for item in value)
    return "" if value is None else value.name if isinstance(value, Enum) else str(value)


def docstring(owner: type) -> str:
    """Return the first paragraph of a dataclass's docstring; "" without one."""
    text = inspect.cleandoc(owner.__doc__ or "").partition("\n\n")[0]
    return "" if text.startswith(f"{owner.__name__}(") else text  # as dataclasses write it


@cache
def field_help(owner: type) -> dict[str, str]:
    """Return the help by name of the field, of a dataclass and of its base classes; "" for a field without text.

    It is the string below a field in the source, else the comment next to it. The result is empty without a source.
    """
    texts: dict[str, str] = {}
    for each in reversed([base for base in owner.__mro__ if dataclasses.is_dataclass(base)]):
        file = getattr(sys.modules.get(each.__module__), "__file__", None) or ""  # none in a notebook
        linecache.checkcache(file)
        lines = linecache.getlines(file)
        try:
            statements = _classes("".join(lines))[each.__qualname__].body
        except (KeyError, SyntaxError):  # defined by a call, or there is no source
            continue
        for field, below in zip(statements, [*statements[1:], None], strict=True):
            match field, below:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                    texts[name] = inspect.cleandoc(text)
                case ast.AnnAssign(target=ast.Name(id=name)), _:
                    texts[name] = beside(field, lines)
    return texts


@lru_cache(maxsize=32)
def _classes(source: str) -> dict[str, ast.ClassDef]:
    """Return the classes that the source of a module defines, by their qualified names."""
    found: dict[str, ast.ClassDef] = {}
    waiting: list[tuple[str, ast.AST]] = [("", ast.parse(source))]
    while waiting:
        above, node = waiting.pop()
        if isinstance(node, ast.ClassDef):
            found.setdefault(f"{above}{node.name}", node)
            above = f"{above}{node.name}."
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            above = f"{above}{node.name}.<locals>."
        inner = [(above, each) for each in ast.iter_child_nodes(node) if not isinstance(each, ast.expr)]
        waiting += reversed(inner)
    return found


def beside(node: ast.stmt, lines: Sequence[str]) -> str:
    """Return the comment next to a statement in the lines of a source, with the lines that continue it below."""
    number = node.end_lineno or node.lineno
    comment = lines[number - 1].encode()[node.end_col_offset or 0 :].decode().strip()
    if not comment.startswith("#"):
        return ""
    column = lines[number - 1].rindex(comment)
    texts = [comment]
    for line in lines[number:]:
        if not line.startswith(f"{' ' * column}#"):
            break
        texts.append(line)
    return " ".join(text.lstrip("# ").rstrip() for text in texts)
