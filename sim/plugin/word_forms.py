"""Forms of the types of fields on a command line: number of words of a value, allowed words, conversion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from tyro.constructors import PrimitiveConstructorSpec

NAMES: dict[Any, str] = {int: "INT", float: "FLOAT", str: "STR", Path: "PATH"}


@dataclass(frozen=True)
class Form:
    """Form of the words of one value of a field."""

    count: int | None
    """number of words of a value; None for as many as follow"""
    name: str
    """name of the value in a message: INT, {uniform,arclength}, FLOAT FLOAT FLOAT"""
    read: Callable[[Sequence[str]], Any]
    """function that converts some words to the value; raises ValueError"""
    choices: tuple[str, ...] = ()
    """all words that are allowed, if they can be listed"""
    container: type | None = None
    """container, tuple or list, to which each occurrence of the flag adds one value; None if the flag is given once"""


def form_of(hint: Any) -> Form | None:
    """Return the form of a type with its annotations; None for a type that no words can express."""
    if get_origin(hint) is Annotated:
        hint, *marks = get_args(hint)
        for mark in marks:
            if isinstance(mark, PrimitiveConstructorSpec):
                return _own_form(mark)
        return form_of(hint)
    origin, members = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return _either([form_of(member) for member in members if member is not NoneType])
    if origin is list and members:
        return _repeated(list, form_of(members[0]))
    if origin is tuple and members:
        return _repeated(tuple, form_of(members[0])) if Ellipsis in members else _fixed([*map(form_of, members)])
    if origin is Literal:
        return _chosen({str(member): member for member in members})
    if hint is bool:
        return _chosen({"True": True, "False": False})
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _chosen(dict(hint.__members__))
    if hint is Path:
        return Form(1, NAMES[hint], lambda words: _path(words[0]))
    if hint in NAMES:
        return Form(1, NAMES[hint], lambda words: hint(words[0]))
    return None


def _own_form(spec: PrimitiveConstructorSpec[Any]) -> Form:
    count = spec.nargs if isinstance(spec.nargs, int) else None
    return Form(count, spec.metavar, lambda words: spec.instance_from_str(list(words)), spec.choices or ())


def _chosen(values: dict[str, Any]) -> Form:
    return Form(1, f"{{{','.join(values)}}}", lambda words: _member(values, words[0]), tuple(values))


def _member(values: dict[str, Any], word: str) -> Any:
    if word not in values:
        raise ValueError(f"{word}; allowed: {', '.join(values)}")
    return values[word]


def _path(word: str) -> Path:
    if not word:
        raise ValueError("an empty word")  # which Path reads as the current folder
    return Path(word)


def _repeated(container: type, item: Form | None) -> Form | None:
    if item is None or item.container is not None:
        return None
    return Form(item.count, item.name, item.read, item.choices, container)


def _fixed(items: Sequence[Form | None]) -> Form | None:
    """Return the form of a tuple with one value for each of its types."""
    forms = [form for form in items if form is not None and form.count is not None and form.container is None]
    if len(forms) < len(items):
        return None
    counts = [form.count or 0 for form in forms]

    def read(words: Sequence[str]) -> Any:
        if len(words) != sum(counts):
            raise ValueError(f"{len(words)} values")
        rest = iter(words)
        return tuple(form.read([next(rest) for _ in range(count)]) for form, count in zip(forms, counts, strict=True))

    return Form(sum(counts), " ".join(form.name for form in forms), read)


def _either(options: Sequence[Form | None]) -> Form | None:
    """Return the form of the first of some types that the words can be read as; a tuple takes the words that follow."""
    forms = [form for form in options if form is not None and form.container is None]
    if not forms or len(forms) < len(options):
        return None
    choices = tuple(choice for form in forms for choice in form.choices) if all(form.choices for form in forms) else ()

    def read(words: Sequence[str]) -> Any:
        for form in forms:
            try:
                return form.read(words) if form.count in (None, len(words)) else _refuse(words)
            except ValueError:
                if form is forms[-1]:
                    raise
        raise ValueError(words)

    count = 1 if all(form.count == 1 for form in forms) else None
    return Form(count, "|".join(form.name for form in forms), read, choices)


def _refuse(words: Sequence[str]) -> Any:
    raise ValueError(f"{len(words)} values")
