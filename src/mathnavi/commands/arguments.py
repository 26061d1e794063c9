"""Parser of a command line into frozen dataclasses, which validate themselves.

Each leaf of a dataclass is a flag or a positional argument: ``argparse`` finds the words of each and prints the help,
and the table of fields (``mathnavi.interfaces.field_table``) reads the words. A flag that is given twice is an error
unless it takes a list; so are nan and infinity. A wrong word raises a ``BadInputError`` of one line that names the
flag, its value and what is allowed.
"""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

from mathnavi.commands.errors import BadInputError, bad_input, short
from mathnavi.interfaces.checks import check_path, close_names
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.failures import failures_named
from mathnavi.interfaces.field_table import Field, field_of, leaves_of, negation

_HELP = frozenset(("-h", "--help"))
_HELP_COLUMN = 27  # where the help of a flag begins
_LONGEST_NAME = 45  # of the values of a flag: longer lists of choices stand in its help
_LIKE_A_FLAG = re.compile(r"(?!-(inf|infinity|nan)$)-+[^\W\d_]", re.IGNORECASE)
_HYPHEN = "\ue000"  # in place of "-" while a help is laid out, for no line is to be broken there
_FLAGS_ALLOWED = "allowed: flags, each followed by its values"


class HelpPrinted(Exception):  # noqa: N818
    """Signal that the help was requested and has been printed."""


@dataclass(frozen=True)
class FlagGroup:
    """A dataclass whose fields are flags: ``--FIELD``, or ``--PREFIX.FIELD``."""

    schema: type
    prefix: str = ""
    default: Any = None  # an instance; None where fields have to be given
    heading: str | None = None  # in the help; the docstring of the dataclass if not given

    @property
    def leaves(self) -> list[Field]:
        """Fields on the command line, with the defaults of the group."""
        return [*leaves_of(self.schema, self.prefix, self.default)]


def parse(argv: Sequence[str], prog: str, description: str, *groups: FlagGroup) -> tuple[Any, ...]:
    """Return the dataclasses of the groups with the fields that ``argv`` gives; BadInputError if ``argv`` is wrong.

    ``--help`` prints the help and raises HelpPrinted.
    """
    known: dict[str, bool] = {}
    owners: dict[str, type] = {}
    for group in groups:
        for name, repeats in flags(group.schema, group.prefix):
            known[name] = repeats
            if (owner := owners.setdefault(name, group.schema)) is not group.schema:
                raise BadInputError(
                    f"{name} is a field of {owner.__qualname__} and of {group.schema.__module__}."
                    f"{group.schema.__qualname__}; allowed: another name for the latter"
                )
    if _HELP & set(argv):
        print(_parser(prog, description, groups, add_help=True).format_help().replace(_HYPHEN, "-"), end="")
        raise HelpPrinted
    _check_flags(argv, prog, known)
    parser = _parser(prog, description, groups, add_help=False)
    words = _words(argv, [leaf for group in groups for leaf in group.leaves], parser)
    parsed = []
    for group in groups:
        values = {leaf.path: _value(leaf, words[leaf.flag], argv) for leaf in group.leaves if leaf.flag in words}
        parsed.append(_built(group.schema, group.default, values, group.prefix, list(known)))
    for group, value in zip(groups, parsed, strict=True):
        for leaf in leaves_of(type(value), group.prefix, value):
            _check_value(leaf.default, leaf.flag)
    return tuple(parsed)


class _Parser(argparse.ArgumentParser):
    """Parser that raises an exception for every mistake."""

    def error(self, message: str) -> Any:
        raise argparse.ArgumentError(None, message)


class _Switch(argparse.Action):
    """Pair of flags without values, which set a truth value to true and to false."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        setattr(namespace, self.dest, [[f" {option_string == self.option_strings[0]}"]])


def _parser(prog: str, description: str, groups: Sequence[FlagGroup], *, add_help: bool) -> _Parser:
    """Return a parser that gathers the words of each leaf of some groups under its flag, without the hyphens."""
    leaves = [(group, leaf) for group in groups for leaf in group.leaves]
    usage = " ".join([prog, "[-h] [OPTIONS]", *(leaf.place for _, leaf in leaves if leaf.positional)])
    parser = _Parser(
        usage=_laid_out(usage),
        description=_laid_out(description),
        formatter_class=partial(argparse.HelpFormatter, max_help_position=_HELP_COLUMN),
        add_help=add_help,
        allow_abbrev=False,
        exit_on_error=False,
    )
    sections: dict[str, Any] = {"": parser}
    for group, leaf in leaves:
        above = f"{leaf.prefix}.{leaf.path}".strip(".").rpartition(".")[0]
        if above not in sections:
            text = group.heading if above == group.prefix else _docstring(leaf.owner)
            sections[above] = parser.add_argument_group(f"{above} options", _laid_out(text or ""))
        _add(sections[above], leaf, _told(leaf) if add_help else "")  # sources are read for the help alone
    return parser


def _docstring(owner: type) -> str:
    text = inspect.cleandoc(owner.__doc__ or "").partition("\n\n")[0]
    return "" if text.startswith(f"{owner.__name__}(") else text  # as dataclasses write it


def _add(section: Any, leaf: Field, told: str) -> None:
    name = "NAME" if len(leaf.value_name) > _LONGEST_NAME else leaf.value_name.removesuffix("...")
    count = leaf.form.count if leaf.form.readable else None
    settings: dict[str, Any] = {"help": told, "default": argparse.SUPPRESS}
    if leaf.switch:
        section.add_argument(leaf.flag, negation(leaf.flag), dest=leaf.flag[2:], action=_Switch, nargs=0, **settings)
    else:
        settings |= {} if leaf.positional else {"dest": leaf.flag[2:]}
        settings |= {"nargs": count or "*", "metavar": tuple(name.split()) if (count or 0) > 1 else name}
        section.add_argument(leaf.flag[2:] if leaf.positional else leaf.flag, action="append", **settings)


def flags(schema: type, prefix: str = "") -> Iterator[tuple[str, bool]]:
    """Map each flag of a dataclass to whether it may be given several times; a truth value also has --no-FIELD."""
    for leaf in leaves_of(schema, prefix):
        if not leaf.positional:
            yield leaf.flag, leaf.form.repeats
            if leaf.switch:
                yield negation(leaf.flag), False


def fields_by_flag(schema: type, prefix: str = "") -> dict[str, str]:
    """Map each flag of a dataclass to the dotted name of the field that it sets."""
    return {leaf.flag: leaf.path for leaf in leaves_of(schema, prefix) if not leaf.positional}


def _words(argv: Sequence[str], leaves: Sequence[Field], parser: _Parser) -> dict[str, list[list[str]]]:
    """Return the words of each leaf that is given, one list for each occurrence, by the flag of the leaf.

    Raises BadInputError where words are missing or left over.
    """
    namespace = argparse.Namespace()
    left_over: list[str] = []
    refused = ""
    try:
        _, left_over = parser.parse_known_args(_marked(argv, leaves), namespace)
    except argparse.ArgumentError as error:
        for leaf in leaves:
            if leaf.flag == error.argument_name:
                raise _wrong(leaf, argv) from None
        refused = str(error)
    words = {
        f"--{name}": [[word[1:] for word in value] for value in values] for name, values in vars(namespace).items()
    }
    if missing := [leaf for leaf in leaves if leaf.default is dataclasses.MISSING and leaf.flag not in words]:
        raise BadInputError("; ".join(f"{leaf.place} is missing; allowed: {_wanted(leaf)}" for leaf in missing))
    if refused:
        raise BadInputError(refused)
    if left_over:
        for leaf in leaves:
            if leaf.flag in words and 1 < (leaf.form.count or 0) < len(_following(leaf.flag, argv)):
                raise _wrong(leaf, argv)
        named = ", ".join(short(word.removeprefix(" ")) or repr("") for word in left_over)
        raise BadInputError(f"{named}: this argument is not expected here; {_FLAGS_ALLOWED}")
    return words


def _marked(argv: Sequence[str], leaves: Sequence[Field]) -> Iterator[str]:
    """Return the words for ``argparse``: values with a blank before each, so that none (-1e3) is taken for a flag.

    A misspelt flag is no value of the flag before it; after "--" there are values only.
    """
    known = {flag for leaf in leaves if not leaf.positional for flag in (leaf.flag, negation(leaf.flag))}
    flags_too = True
    for word in argv:
        name, equals, value = word.partition("=")
        flag = name.replace("_", "-")
        if flags_too and word == "--":
            flags_too = False
        elif flags_too and flag in known:
            yield flag
            if equals:
                yield f" {value}"
        else:
            yield word if flags_too and _LIKE_A_FLAG.match(name) else f" {word}"


def _value(leaf: Field, occurrences: Sequence[Sequence[str]], argv: Sequence[str]) -> Any:
    """Return the value of a leaf that its words express."""
    form = leaf.form
    if not form.readable:
        raise _wrong(leaf, argv, "no value on the command line")
    for word in (word for words in occurrences for word in words if form.choices):
        if word not in form.choices:
            raise BadInputError(f"{leaf.place} = {short(word)}; allowed: {', '.join(sorted(form.choices))}")
    try:
        values = [form.read(words) for words in occurrences]
    except (ValueError, TypeError):
        raise _wrong(leaf, argv, _explained(leaf)) from None
    before = () if leaf.default in (None, dataclasses.MISSING) else leaf.default
    return form.origin([*before, *values]) if form.repeats else values[-1]


def _built(kind: type, instance: Any, values: Mapping[str, Any], prefix: str, known: Sequence[str]) -> Any:
    """Build a dataclass with some values by their paths; the others are those of the instance, if there is one."""
    own: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    for path, value in values.items():
        name, _, rest = path.partition(".")
        if rest:
            nested.setdefault(name, {})[rest] = value
        else:
            own[name] = value
    for name, inner in nested.items():
        part = field_of(kind, name).default if instance is None else getattr(instance, name)
        part = None if part is dataclasses.MISSING else part
        own[name] = _built(field_of(kind, name).form.kind, part, inner, f"{prefix}.{name}".strip("."), known)
    try:
        with failures_named(f"{kind.__module__}.{kind.__qualname__} failed:", PluginError, (ValueError,)):
            return kind(**own) if instance is None else dataclasses.replace(instance, **own)
    except ValueError as error:
        raise BadInputError(with_flag(str(error), known, prefix)) from None


def given(argv: Sequence[str]) -> list[str]:
    """Return the flags in ``argv`` in their order, with repetitions."""
    words = [word.partition("=")[0] for word in argv if word.startswith("--") and len(word) > 2]
    return [word.replace("_", "-") for word in words]


def value_of(flag: str, argv: Sequence[str]) -> str | None:
    """Return the first word given with ``flag``, None without the flag."""
    return next(iter(values_of(flag, argv)), None)


def values_of(flag: str, argv: Sequence[str]) -> list[str]:
    """Return the first word of each occurrence of ``flag``."""
    values = []
    for k, word in enumerate(argv):
        if word.startswith(f"{flag}="):
            values.append(word.partition("=")[2])
        elif word == flag:
            if k + 1 == len(argv) or argv[k + 1].startswith("--"):
                raise BadInputError(f"{flag}: its value is missing")
            values.append(argv[k + 1])
    return values


def without(flag: str, argv: Sequence[str]) -> list[str]:
    """Return ``argv`` without every ``flag`` and the word that follows it."""
    kept: list[str] = []
    words = iter(argv)
    for word in words:
        if word == flag:
            next(words, None)
        elif not word.startswith(f"{flag}="):
            kept.append(word)
    return kept


def with_flag(message: str, known: Sequence[str], prefix: str = "") -> str:
    """Return the message with the flag in place of the field if it starts with "field = ", "field: " or "field is "."""
    found = re.match(r"([A-Za-z_][\w.]*)(?= = |: | is )", message)
    if found is None:
        return message
    name = found[1].replace("_", "-")
    candidates = [flag for flag in (f"--{prefix}.{name}", f"--{name}") if flag in known]
    candidates += [flag for flag in known if flag.endswith(f".{name}")]
    return f"{candidates[0]}{message[found.end() :]}" if candidates else message


def _check_flags(argv: Sequence[str], prog: str, known: Mapping[str, bool]) -> None:
    counts = Counter(given(argv))
    for name, count in counts.items():
        if name not in known:
            raise BadInputError(f"{short(name)} is not a field of {prog!r}; {suggestion(name, list(known), prog)}")
        if count > 1 and not known[name]:
            raise BadInputError(f"{name} is given {count} times; allowed: once")
        if negation(name) in counts:
            raise BadInputError(f"{name} is given together with {negation(name)}; allowed: one of both")


def suggestion(name: str, known: Sequence[str], prog: str) -> str:
    """Return a hint for an unknown flag: the flags that it may be a misspelling of, or those that are allowed."""
    if not name.startswith("--no-"):
        known = [flag for flag in known if flag not in {negation(other) for other in known}]
    # A field may be named without its group, which is no misspelling: --nodes means --planner.nodes.
    close = [flag for flag in known if flag.rpartition(".")[2] == name.lstrip("-")] or close_names(name, known)
    if close:
        return f"did you mean {' or '.join(close)}? (`{prog} --help` lists all)"
    group = f"{name.partition('.')[0]}."
    if members := [flag for flag in known if flag.startswith(group)]:
        return f"allowed: {', '.join(members)}"
    return f"allowed: {', '.join(dict.fromkeys(re.sub(r'[.].*', '.*', flag) for flag in known))}"


def _check_value(value: Any, flag: str) -> None:
    """Raise BadInputError for a number that is not finite and for a path that no file can have."""
    if isinstance(value, (tuple, list)):
        for item in value:
            _check_value(item, flag)
    elif isinstance(value, float) and not math.isfinite(value):
        raise BadInputError(f"{flag} = {value}; allowed: finite numbers")
    elif isinstance(value, Path):
        with bad_input():
            check_path(value, flag)


def _wanted(leaf: Field) -> str:
    """Return the allowed values, for the message if a field is missing."""
    return (leaf.help if leaf.positional else f"{leaf.value_name} {leaf.help}".rstrip()) or leaf.value_name


def _explained(leaf: Field) -> str:
    """Return the allowed values, for the message if one is wrong: the type, or number and meanings of the values."""
    name = leaf.value_name.strip("{}")
    count = len(name.split())
    if count == 1:
        return name
    meaning = leaf.help.replace(" (", ";").partition(";")[0]
    return f"{count} values{f': {meaning}' if meaning else ''} ({name})"


def _wrong(leaf: Field, argv: Sequence[str], allowed: str = "") -> BadInputError:
    """Return the error for words that are no value; without ``allowed`` for a number of them that is wrong."""
    allowed = allowed or ("1 value" if leaf.form.count == 1 else _explained(leaf))
    words = short(" ".join(_following(leaf.place, argv)))
    return BadInputError(f"{leaf.place}{f' = {words}' if words else ': its value is missing'}; allowed: {allowed}")


def _following(flag: str, argv: Sequence[str]) -> list[str]:
    """Return the words that follow the last occurrence of a flag."""
    words: list[str] = []
    inside = False
    for word in argv:
        name, assigned, value = word.partition("=")
        if name.startswith("--"):
            inside = name.replace("_", "-") == flag
            if inside:
                words = [value] if assigned else []
        elif inside:
            words.append(word)
    return words


def _told(leaf: Field) -> str:
    """Return the help of a leaf as ``argparse`` takes it."""
    if not leaf.form.readable:
        return argparse.SUPPRESS
    notes = [leaf.help]
    if len(leaf.value_name) > _LONGEST_NAME:
        notes[0] += f": one of {', '.join(leaf.form.choices)}"
    if leaf.default is dataclasses.MISSING:
        notes.append("(required)")
    elif leaf.form.repeats:
        notes.append("(repeatable)")
    elif shown := _shown(leaf.default):
        notes.append(f"(default: {shown})")
    return _laid_out(" ".join(notes))


def _shown(value: Any) -> str:
    if isinstance(value, (tuple, list)):
        return " ".join(_shown(item) for item in value)
    return "" if value is None else value.name if isinstance(value, Enum) else str(value)


def _laid_out(text: str) -> str:
    return text.replace("%", "%%").replace("-", _HYPHEN)
