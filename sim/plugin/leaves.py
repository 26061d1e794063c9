"""Leaves of a configuration: its fields, and those of the dataclasses in it, as flags."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import tyro

from mathnavi.sim.plugin.field_help import field_help
from mathnavi.sim.plugin.flag_names import flag_of, joined
from mathnavi.sim.plugin.word_forms import Form, form_of


@dataclass(frozen=True)
class Leaf:
    """Field that does not hold a dataclass."""

    owner: type
    name: str  # of the field in its owner
    path: str  # dotted, below the prefix
    field_name: str  # dotted, in the dataclass of the group
    hint: Any
    marks: tuple[Any, ...]  # the metadata of the type within Annotated
    required: bool

    @property
    def flag(self) -> str:
        """Flag as given on the command line."""
        return flag_of(self.path)

    @property
    def positional(self) -> bool:
        """True for a field that is given without a flag."""
        return tyro.conf.Positional in self.marks

    @cached_property
    def form(self) -> Form | None:
        """Form of the words of its value; None for a field without values."""
        return form_of(Annotated[(self.hint, *self.marks)] if self.marks else self.hint)

    @property
    def value_name(self) -> str:
        """Name of the value in the help."""
        return self.form.name if self.form else "nothing"

    @property
    def help(self) -> str:
        """Documentation of the field, on one line."""
        return " ".join(field_help(self.owner).get(self.name, "").split())

    @property
    def wanted(self) -> str:
        """Allowed values, for the message if the field is missing."""
        return (self.help if self.positional else f"{self.value_name} {self.help}".rstrip()) or self.value_name

    @property
    def explained(self) -> str:
        """Allowed values, for the message if one is wrong: the type, or the number and the meanings of the values."""
        name = self.value_name.strip("{}")
        count = len(name.split())
        if count == 1:
            return name
        meaning = self.help.replace(" (", ";").partition(";")[0]
        return f"{count} values{f': {meaning}' if meaning else ''} ({name})"

    @property
    def place(self) -> str:
        """Name in a message: the flag, or the name of the positional argument in the help."""
        given = next((str(mark.metavar) for mark in self.marks if getattr(mark, "metavar", None)), None)
        return (given or self.name.upper()) if self.positional else self.flag


def leaves_of(schema: type, prefix: str, above: str = "", filled: bool = False) -> Iterator[Leaf]:
    """Return the leaves of a dataclass; with ``filled`` all its fields have values already."""
    hints = get_type_hints(schema, include_extras=True)
    for entry in dataclasses.fields(schema):
        if not entry.init:
            continue
        hint: Any = hints[entry.name]
        marks: tuple[Any, ...] = ()
        if get_origin(hint) is Annotated:
            hint, marks = get_args(hint)[0], get_args(hint)[1:]
        has_value = filled or not (entry.default is entry.default_factory is dataclasses.MISSING)
        path, field_name = joined(prefix, entry.name), f"{above}.{entry.name}".strip(".")
        if isinstance(hint, type) and dataclasses.is_dataclass(hint):
            yield from leaves_of(hint, path, field_name, has_value)
        else:
            yield Leaf(schema, entry.name, path, field_name, hint, marks, not has_value)
