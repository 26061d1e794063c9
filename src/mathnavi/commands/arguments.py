"""Parser of a command line into frozen dataclasses, which validate themselves.

Each leaf of a dataclass is a flag or a positional argument. A flag that is given twice is an error unless it takes a
list; so are nan and infinity. A wrong word raises a ``BadInputError`` of one line that names the flag, its value and
what is allowed. tyro prints the help.
"""

from __future__ import annotations

import dataclasses
import io
import math
import re
import sys
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TextIO, get_type_hints

import tyro

from mathnavi.commands.errors import BadInputError, bad_input, short
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.checks import check_path, close_names
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.failures import failures_named
from mathnavi.sim.plugin.flag_names import joined, negation
from mathnavi.sim.plugin.leaves import Leaf, leaves_of

_CONFIG = (tyro.conf.UseAppendAction, tyro.conf.DisallowNone)
_COLOUR = r"(?:\x1b\[[\d;]*m)*"
_NO_DEFAULT = re.compile(rf"\s+{_COLOUR}\(default:{_COLOUR}\s+{_COLOUR}None\){_COLOUR}")
_TRAILING = re.compile(r" +$", re.MULTILINE)
_HELP = frozenset(("-h", "--help"))
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
        _print_help(prog, description, groups)
    _check_flags(argv, prog, known)
    leaves = {
        leaf.path: leaf
        for group in groups
        for leaf in leaves_of(group.schema, group.prefix, filled=group.default is not None)
    }
    words = _Words(argv, list(leaves.values())).by_path()
    parsed = tuple(_built(group, leaves, words, argv, list(known)) for group in groups)
    for group, value in zip(groups, parsed, strict=True):
        _check_values(value, group.prefix)
    return parsed


def _print_help(prog: str, description: str, groups: Sequence[FlagGroup]) -> None:
    names = [f"group_{k}" for k in range(len(groups))]
    schema = dataclasses.make_dataclass(
        "Arguments", [_help_field(*pair) for pair in zip(names, groups, strict=True)], kw_only=True
    )
    captured = _CapturedHelp(sys.stdout)
    try:
        with redirect_stdout(captured):
            tyro.cli(schema, prog=prog, description=description, args=["--help"], config=_CONFIG)
    except SystemExit:
        shown = _TRAILING.sub("", _NO_DEFAULT.sub("", captured.getvalue()))
        print(shown.replace(description, wrapped(description)), end="")  # which tyro leaves on one line
        raise HelpPrinted from None


class _CapturedHelp(io.StringIO):
    """Output of tyro, in colours where the terminal has them."""

    def __init__(self, output: TextIO) -> None:
        super().__init__()
        self._output = output

    def isatty(self) -> bool:
        return self._output.isatty()


def _help_field(name: str, group: FlagGroup) -> tuple[str, Any, Any]:
    kind = Annotated[group.schema, tyro.conf.arg(name=group.prefix, help=group.heading)]  # type: ignore[name-defined]
    default = group.default
    return name, kind, field() if default is None else field(default_factory=lambda: default)


def flags(schema: type, prefix: str = "") -> Iterator[tuple[str, bool]]:
    """Map each flag of a dataclass to whether it may be given several times; a truth value also has --no-FIELD."""
    for leaf in leaves_of(schema, prefix):
        if not leaf.positional:
            yield leaf.flag, leaf.form is not None and leaf.form.container is not None
            if leaf.hint is bool:
                yield negation(leaf.flag), False


def fields_by_flag(schema: type, prefix: str = "") -> dict[str, str]:
    """Map each flag of a dataclass to the dotted name of the field that it sets."""
    return {leaf.flag: leaf.field_name for leaf in leaves_of(schema, prefix) if not leaf.positional}


class _Words:
    """Assigns the words of ``argv`` to the leaves that they are given to."""

    def __init__(self, argv: Sequence[str], leaves: Sequence[Leaf]) -> None:
        self._argv = argv
        self._rest = deque((word, False) for word in argv)  # each with whether "=" ties it to the flag before it
        self._by_flag = {leaf.flag: leaf for leaf in leaves if not leaf.positional}
        self._places = deque(leaf for leaf in leaves if leaf.positional)
        self._places_only = False  # since "--"
        self._required = [leaf for leaf in leaves if leaf.required]

    def by_path(self) -> dict[str, list[list[str]]]:
        """Return the words of each leaf that is given, one list for each occurrence, by the path of the leaf.

        Raises BadInputError where words are missing, are not among the choices, or are left over.
        """
        switches = {
            flag: (leaf.path, state)
            for leaf in self._by_flag.values()
            if leaf.hint is bool
            for flag, state in ((leaf.flag, "True"), (negation(leaf.flag), "False"))
        }
        given: dict[str, list[list[str]]] = {}
        left_over = []
        while self._rest:
            word, _ = self._rest.popleft()
            if word == "--" and not self._places_only:
                self._places_only = True
                continue
            name, equals, value = word.partition("=")
            flag = name.replace("_", "-") if name.startswith("--") and not self._places_only else ""
            if equals and flag in {*self._by_flag, *switches}:
                self._rest.appendleft((value, True))
            if flag in switches:
                path, state = switches[flag]
                given[path] = [[state]]
            elif flag in self._by_flag:
                leaf = self._by_flag[flag]
                given.setdefault(leaf.path, []).append(self._value(leaf))
            elif self._places:
                self._rest.appendleft((word, False))
                leaf = self._places.popleft()
                given[leaf.path] = [self._value(leaf)]
            else:
                left_over.append(word)
        if missing := [leaf for leaf in self._required if leaf.path not in given]:
            raise BadInputError("; ".join(f"{leaf.place} is missing; allowed: {leaf.wanted}" for leaf in missing))
        if left_over:
            named = ", ".join(short(word) or repr(word) for word in left_over)
            raise BadInputError(f"{named}: this argument is not expected here; {_FLAGS_ALLOWED}")
        return given

    def _value(self, leaf: Leaf) -> list[str]:
        """Return the words of one value of a leaf."""
        form = leaf.form
        if form is None:
            raise BadInputError(f"{_as_given(leaf.flag, self._argv)}; allowed: no value on the command line")
        words: list[str] = []
        while self._rest and (form.count is None or len(words) < form.count):
            word, tied = self._rest[0]
            if not (tied or self._places_only or word in form.choices) and self._is_flag(word):
                break
            if form.count is None and len(self._rest) <= len(self._places):  # these are for the positional arguments
                break
            words.append(self._rest.popleft()[0])
        if form.count is not None and len(words) < form.count:
            raise _wrong(leaf, self._argv, f"{form.count} value{'s' * (form.count > 1)}")
        if form.choices:
            for word in words:
                if word not in form.choices:
                    raise BadInputError(f"{leaf.place} = {short(word)}; allowed: {', '.join(sorted(form.choices))}")
        return words

    def _is_flag(self, word: str) -> bool:
        """Return True for a flag, or for what looks like one: a misspelt flag is no value of the flag before it."""
        name = word.partition("=")[0]
        if word == "--" or name.replace("_", "-") in self._by_flag:
            return True
        number = re.match(r"-(\d|\.|(inf|infinity|nan)$)", name, re.IGNORECASE)
        return not number and re.match(r"-+[^\W\d_]", name) is not None


def _built(
    group: FlagGroup,
    leaves: Mapping[str, Leaf],
    words: Mapping[str, Sequence[Sequence[str]]],
    argv: Sequence[str],
    known: Sequence[str],
) -> Any:
    """Build the dataclass of a group: each field from its words, or from the default."""

    def built(schema: type, prefix: str, default: Any) -> Any:
        hints, values = get_type_hints(schema), {}
        for entry in dataclasses.fields(schema):
            if not entry.init:
                continue
            path, hint, value = joined(prefix, entry.name), hints[entry.name], _default(entry, default)
            if path in words:
                value = _converted(leaves[path], words[path], value, argv)
            elif isinstance(hint, type) and dataclasses.is_dataclass(hint):
                value = built(type(value) if isinstance(value, hint) else hint, path, value)
            values[entry.name] = value
        try:
            with failures_named(f"{schema.__module__}.{schema.__qualname__} failed:", PluginError, (ValueError,)):
                return schema(**values)
        except ValueError as error:
            raise BadInputError(with_flag(str(error), known, prefix)) from None

    return built(group.schema, group.prefix, group.default)


def _default(entry: dataclasses.Field[Any], instance: Any) -> Any:
    """Return the default of a field that is not given; None if the field is required."""
    if instance is not None:
        return getattr(instance, entry.name)
    if entry.default_factory is not dataclasses.MISSING:
        return entry.default_factory()
    return None if entry.default is dataclasses.MISSING else entry.default


def _converted(leaf: Leaf, words: Sequence[Sequence[str]], default: Any, argv: Sequence[str]) -> Any:
    form = leaf.form
    assert form is not None  # else there would be no words
    try:
        values = [form.read(each) for each in words]
    except (ValueError, TypeError):
        raise _wrong(leaf, argv, leaf.explained) from None
    return values[-1] if form.container is None else form.container([*(default or ()), *values])


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


def _check_values(value: Any, name: str) -> None:
    """Raise BadInputError for a number that is not finite and for a path that no file can have."""
    if dataclasses.is_dataclass(value):
        for entry in dataclasses.fields(value):
            _check_values(getattr(value, entry.name), f"{name}.{entry.name}".strip("."))
    elif isinstance(value, (tuple, list)):
        for item in value:
            _check_values(item, name)
    elif isinstance(value, float) and not math.isfinite(value):
        raise BadInputError(f"--{name.replace('_', '-')} = {value}; allowed: finite numbers")
    elif isinstance(value, Path):
        with bad_input():
            check_path(value, f"--{name.replace('_', '-')}")


def _wrong(leaf: Leaf, argv: Sequence[str], allowed: str) -> BadInputError:
    return BadInputError(f"{_as_given(leaf.place, argv)}; allowed: {allowed}")


def _as_given(flag: str, argv: Sequence[str]) -> str:
    values = _values(flag, argv)
    return f"{flag} = {values}" if values else f"{flag}: its value is missing"


def _values(flag: str, argv: Sequence[str]) -> str:
    """Return the words that follow the last occurrence of a flag in ``argv``."""
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
    return short(" ".join(words))
