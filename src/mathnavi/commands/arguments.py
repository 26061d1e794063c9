"""Parser of a command line into frozen dataclasses, which validate themselves.

Each leaf of a dataclass is a flag or a positional argument. ``read_words`` finds the words of each by ``argparse``, and
prints the help; it needs the descriptions of the fields alone. ``parse`` reads the words as values and makes the
dataclasses. A flag that is given twice is an error unless it takes a list; so are nan and infinity. A wrong word raises
a ``BadInputError`` of one line that names the flag, its value and what is allowed.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from mathnavi.commands.errors import BadInputError, HelpPrinted, bad_input, short
from mathnavi.interfaces.checks import check_path, close_names
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.failures import failures_named
from mathnavi.interfaces.field_table import Field, FieldDescription, field_of, leaves_of, negation

_HELP = frozenset(("-h", "--help"))
_HELP_COLUMN = 27  # where the help of a flag begins
_LONGEST_NAME = 45  # of the values of a flag: longer lists of choices stand in its help
_LIKE_A_FLAG = re.compile(r"(?!-(inf|infinity|nan)$)-+[^\W\d_]", re.IGNORECASE)
_HYPHEN = "\ue000"  # in place of "-" while a help is laid out, for no line is to be broken there
_LATENCY = "--latency"  # of `mathnavi run` alone
_FLAGS_ALLOWED = "allowed: flags, each followed by its values"


@dataclass(frozen=True)
class Section:
    """Flags and positional arguments of one dataclass, as plain data."""

    fields: Sequence[FieldDescription]
    prefix: str = ""
    heading: str | None = None
    """heading in the help, if there is a prefix"""

    @cached_property
    def flags(self) -> dict[str, bool]:
        """Whether each flag may be given several times; a truth value also has --no-FIELD."""
        found = {}
        for field in self.fields:
            if not field.positional:
                found[field.flag] = field.repeats
                if field.switch:
                    found[negation(field.flag)] = False
        return found


@dataclass(frozen=True)
class FlagGroup:
    """A dataclass whose fields are flags: ``--FIELD``, or ``--PREFIX.FIELD``."""

    schema: type
    prefix: str = ""
    default: Any = None  # an instance; None where fields have to be given
    heading: str | None = None

    @property
    def leaves(self) -> list[Field]:
        """Fields on the command line, with the defaults of the group."""
        return [*leaves_of(self.schema, self.prefix, self.default)]

    @cached_property
    def section(self) -> Section:
        """Description of the fields."""
        return Section([leaf.description for leaf in self.leaves], self.prefix, self.heading)


def parse(argv: Sequence[str], prog: str, description: str, *groups: FlagGroup) -> tuple[Any, ...]:
    """Return the dataclasses of the groups with the fields that ``argv`` gives; BadInputError if ``argv`` is wrong.

    ``--help`` prints the help and raises HelpPrinted.
    """
    owners: dict[str, type] = {}
    for group in groups:
        for name in group.section.flags:
            if (owner := owners.setdefault(name, group.schema)) is not group.schema:
                raise BadInputError(
                    f"{name} is a field of {owner.__qualname__} and of {group.schema.__module__}."
                    f"{group.schema.__qualname__}; allowed: another name for the latter"
                )
    words = read_words(argv, prog, description, [group.section for group in groups])
    parsed = []
    for group in groups:
        values = {leaf.path: _value(leaf, words[leaf.flag], argv) for leaf in group.leaves if leaf.flag in words}
        parsed.append(_built(group.schema, group.default, values, group.prefix, list(owners)))
    for group, value in zip(groups, parsed, strict=True):
        for leaf in leaves_of(type(value), group.prefix, value):
            _check_value(leaf.default, leaf.flag)
    return tuple(parsed)


def read_words(
    argv: Sequence[str], prog: str, description: str, sections: Sequence[Section]
) -> dict[str, list[list[str]]]:
    """Return the words of each field that ``argv`` gives, one list for each occurrence, by the flag of the field.

    ``--help`` prints the help and raises HelpPrinted. Raises BadInputError for an unknown flag, for a flag that is
    given too often, and where words are missing or left over.
    """
    if _HELP & set(argv):
        print(_parser(prog, description, sections, add_help=True).format_help().replace(_HYPHEN, "-"), end="")
        raise HelpPrinted
    _check_flags(argv, prog, {flag: repeats for section in sections for flag, repeats in section.flags.items()})
    parser = _parser(prog, description, sections, add_help=False)
    return _words(argv, [field for section in sections for field in section.fields], parser)


class _Parser(argparse.ArgumentParser):
    """Parser that raises an exception for every mistake."""

    def error(self, message: str) -> Any:
        raise argparse.ArgumentError(None, message)


class _Switch(argparse.Action):
    """Pair of flags without values, which set a truth value to true and to false."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        setattr(namespace, self.dest, [[f" {option_string == self.option_strings[0]}"]])


def _parser(prog: str, description: str, sections: Sequence[Section], *, add_help: bool) -> _Parser:
    """Return a parser that gathers the words of each field of some sections under its flag, without the hyphens."""
    fields = [(section, field) for section in sections for field in section.fields]
    usage = " ".join([prog, "[-h] [OPTIONS]", *(field.place for _, field in fields if field.positional)])
    parser = _Parser(
        usage=_laid_out(usage),
        description=_laid_out(description),
        formatter_class=partial(argparse.HelpFormatter, max_help_position=_HELP_COLUMN),
        add_help=add_help,
        allow_abbrev=False,
        exit_on_error=False,
    )
    groups: dict[str, Any] = {"": parser}
    for section, field in fields:
        if field.group not in groups:
            text = section.heading if field.group == section.prefix else field.group_help
            groups[field.group] = parser.add_argument_group(f"{field.group} options", _laid_out(text or ""))
        _add(groups[field.group], field, _told(field))
    return parser


def _add(group: Any, field: FieldDescription, told: str) -> None:
    name = "NAME" if len(field.value_name) > _LONGEST_NAME else field.value_name.removesuffix("...")
    settings: dict[str, Any] = {"help": told, "default": argparse.SUPPRESS}
    if field.switch:
        group.add_argument(field.flag, negation(field.flag), dest=field.flag[2:], action=_Switch, nargs=0, **settings)
    else:
        settings |= {} if field.positional else {"dest": field.flag[2:]}
        settings |= {"nargs": field.words or "*", "metavar": tuple(name.split()) if (field.words or 0) > 1 else name}
        group.add_argument(field.flag[2:] if field.positional else field.flag, action="append", **settings)


def flags(schema: type, prefix: str = "") -> dict[str, bool]:
    """Map each flag of a dataclass to whether it may be given several times; a truth value also has --no-FIELD."""
    return FlagGroup(schema, prefix).section.flags


def fields_by_flag(schema: type, prefix: str = "") -> dict[str, str]:
    """Map each flag of a dataclass to the dotted name of the field that it sets."""
    return {leaf.flag: leaf.path for leaf in leaves_of(schema, prefix) if not leaf.positional}


def _words(argv: Sequence[str], fields: Sequence[FieldDescription], parser: _Parser) -> dict[str, list[list[str]]]:
    """Return the words of each field that is given; BadInputError where words are missing or left over."""
    namespace = argparse.Namespace()
    left_over: list[str] = []
    refused = ""
    try:
        _, left_over = parser.parse_known_args(_marked(argv, fields), namespace)
    except argparse.ArgumentError as error:
        for field in fields:
            if field.flag == error.argument_name:
                raise _wrong(field, argv) from None
        refused = str(error)
    words = {
        f"--{name}": [[word[1:] for word in value] for value in values] for name, values in vars(namespace).items()
    }
    if missing := [field for field in fields if field.default is None and field.flag not in words]:
        raise BadInputError("; ".join(f"{field.place} is missing; allowed: {_wanted(field)}" for field in missing))
    if refused:
        raise BadInputError(refused)
    if left_over:
        for field in fields:
            if field.flag in words and 1 < (field.words or 0) < len(_following(field.flag, argv)):
                raise _wrong(field, argv)
        named = ", ".join(short(word.removeprefix(" ")) or repr("") for word in left_over)
        raise BadInputError(f"{named}: this argument is not expected here; {_FLAGS_ALLOWED}")
    return words


def _marked(argv: Sequence[str], fields: Sequence[FieldDescription]) -> Iterator[str]:
    """Return the words for ``argparse``: values with a blank before each, so that none (-1e3) is taken for a flag.

    A misspelt flag is no value of the flag before it; after "--" there are values only.
    """
    known = {flag for field in fields if not field.positional for flag in (field.flag, negation(field.flag))}
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
    form, field = leaf.form, leaf.description
    if not form.readable:
        raise _wrong(field, argv, "no value on the command line")
    for word in (word for words in occurrences for word in words if form.choices):
        if word not in form.choices:
            raise BadInputError(f"{field.place} = {short(word)}; allowed: {', '.join(sorted(form.choices))}")
    try:
        values = [form.read(words) for words in occurrences]
    except (ValueError, TypeError):
        raise _wrong(field, argv, _explained(field)) from None
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
    if name == _LATENCY:
        return (
            "allowed: only with `mathnavi run`, which records what it has measured; a trial is the same on any machine"
        )
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


def _wanted(field: FieldDescription) -> str:
    """Return the allowed values, for the message if a field is missing."""
    return (field.help if field.positional else f"{field.value_name} {field.help}".rstrip()) or field.value_name


def _explained(field: FieldDescription) -> str:
    """Return the allowed values, for the message if one is wrong: the type, or number and meanings of the values."""
    name = field.value_name
    if name.startswith("{"):
        name = name.removesuffix("...").strip("{}")
    count = len(name.split())
    if count == 1:
        return name
    meaning = field.help.replace(" (", ";").partition(";")[0]
    return f"{count} values{f': {meaning}' if meaning else ''} ({name})"


def _wrong(field: FieldDescription, argv: Sequence[str], allowed: str = "") -> BadInputError:
    """Return the error for words that are no value; without ``allowed`` for a number of them that is wrong."""
    allowed = allowed or ("1 value" if field.words == 1 else _explained(field))
    words = short(" ".join(_following(field.place, argv)))
    return BadInputError(f"{field.place}{f' = {words}' if words else ': its value is missing'}; allowed: {allowed}")


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


def _told(field: FieldDescription) -> str:
    """Return the help of a field as ``argparse`` takes it."""
    if not field.readable:
        return argparse.SUPPRESS
    notes = [field.help]
    if len(field.value_name) > _LONGEST_NAME:
        notes[0] += f": one of {', '.join(field.choices)}"
    if field.default is None:
        notes.append("(required)")
    elif field.repeats:
        notes.append("(repeatable)")
    elif field.default:
        notes.append(f"(default: {field.default})")
    return _laid_out(" ".join(notes))


def _laid_out(text: str) -> str:
    return text.replace("%", "%%").replace("-", _HYPHEN)
