"""From words to frozen dataclasses that validate themselves.

tyro reads the words and prints the help. Its errors are told again in one line that names the flag, its value and what
is allowed. Beyond what tyro checks, a flag given twice is an error unless it is a list, and so is nan or an infinity.
"""

from __future__ import annotations

import dataclasses
import io
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import tyro
from tyro.constructors import PrimitiveConstructorSpec

from mathnavi.sim.commands.errors import BadInputError
from mathnavi.sim.commands.flag_names import flag_of, joined, negation
from mathnavi.sim.interfaces.checks import close_names

_CONFIG = (tyro.conf.UseAppendAction, tyro.conf.DisallowNone)


@dataclass(frozen=True)
class Group:
    """A dataclass whose fields are flags: ``--FIELD``, or ``--PREFIX.FIELD``."""

    of: type
    prefix: str = ""
    default: Any = None  # an instance; None where fields have to be given
    heading: str | None = None  # in the help; the docstring of the dataclass if not given


def parse(argv: Sequence[str], prog: str, description: str, *groups: Group) -> tuple[Any, ...]:
    """The dataclasses of the groups with the fields that ``argv`` gives; BadInputError if it cannot be.

    ``--help`` prints the help and raises SystemExit.
    """
    known = {name: repeats for group in groups for name, repeats in flags(group.of, group.prefix)}
    if not {"-h", "--help"} & set(argv):
        _check_flags(argv, prog, known)
    names = [f"group_{k}" for k in range(len(groups))]
    whole = dataclasses.make_dataclass(
        "Arguments", [_field(*pair) for pair in zip(names, groups, strict=True)], kw_only=True
    )
    said = io.StringIO()
    try:
        with redirect_stderr(said):
            parsed: Any = tyro.cli(whole, prog=prog, description=description, args=list(argv), config=_CONFIG)
    except SystemExit as stop:
        if not stop.code:
            raise
        raise BadInputError(_one_line(said.getvalue(), argv, known, [group.prefix for group in groups])) from None
    except ValueError as error:  # tyro lets pass what a group without a prefix raises
        raise BadInputError(with_flag(str(error), list(known))) from None
    for group, name in zip(groups, names, strict=True):
        _check_finite(getattr(parsed, name), group.prefix)
    return tuple(getattr(parsed, name) for name in names)


def _field(name: str, group: Group) -> tuple[str, Any, Any]:
    kind = Annotated[group.of, tyro.conf.arg(name=group.prefix, help=group.heading)]  # type: ignore[name-defined]
    default = group.default
    return name, kind, field() if default is None else field(default_factory=lambda: default)


def flags(of: type, prefix: str = "") -> Iterator[tuple[str, bool]]:
    """The flags of a dataclass, each with whether it may be given several times; --no-FIELD for a truth value too."""
    for flag, _, hint in _leaves(of, prefix, ""):
        yield flag, get_origin(hint) is list or Ellipsis in get_args(hint)
        if hint is bool:
            yield negation(flag), False


def fields_by_flag(of: type, prefix: str = "") -> dict[str, str]:
    """The dotted name of the field that each flag of a dataclass sets."""
    return {flag: name for flag, name, _ in _leaves(of, prefix, "")}


def _leaves(of: type, prefix: str, above: str) -> Iterator[tuple[str, str, Any]]:
    """Of each flag: itself, the dotted name of its field, and the type of that."""
    hints = get_type_hints(of, include_extras=True)
    for entry in dataclasses.fields(of):
        hint: Any = hints[entry.name]
        marks: tuple[Any, ...] = ()
        if get_origin(hint) is Annotated:
            hint, marks = get_args(hint)[0], get_args(hint)[1:]
        if tyro.conf.Positional in marks:
            continue
        name, field_name = joined(prefix, entry.name), f"{above}.{entry.name}".strip(".")
        if isinstance(hint, type) and dataclasses.is_dataclass(hint):
            yield from _leaves(hint, name, field_name)
        else:
            # All the words of a field with a constructor of its own are one value, which is given once.
            whole = any(isinstance(mark, PrimitiveConstructorSpec) for mark in marks)
            yield flag_of(name), field_name, Any if whole else hint


def given(argv: Sequence[str]) -> list[str]:
    """The flags in ``argv``, as often and in the order in which they are given."""
    words = [word.partition("=")[0] for word in argv if word.startswith("--") and len(word) > 2]
    return [word.replace("_", "-") for word in words]


def value_of(flag: str, argv: Sequence[str]) -> str | None:
    """The first word given with ``flag``, None without the flag."""
    return next(iter(values_of(flag, argv)), None)


def values_of(flag: str, argv: Sequence[str]) -> list[str]:
    """The first word each time that ``flag`` is given."""
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
    """``argv`` with every ``flag`` and the word that follows it left out."""
    kept: list[str] = []
    words = iter(argv)
    for word in words:
        if word == flag:
            next(words, None)
        elif not word.startswith(f"{flag}="):
            kept.append(word)
    return kept


def with_flag(message: str, known: Sequence[str], prefix: str = "") -> str:
    """A message that starts with "field = ", "field: " or "field is " with the flag in place of the field."""
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
            raise BadInputError(f"{name} is not a field of {prog!r}; {suggestion(name, list(known), prog)}")
        if count > 1 and not known[name]:
            raise BadInputError(f"{name} is given {count} times; allowed: once")
        if negation(name) in counts:
            raise BadInputError(f"{name} is given beside {negation(name)}; allowed: one of both")


def suggestion(name: str, known: Sequence[str], prog: str) -> str:
    """What may have been meant by a flag that is not known."""
    if not name.startswith("--no-"):
        known = [flag for flag in known if flag not in {negation(other) for other in known}]
    close = close_names(name, known)
    # A field may be asked for without its group: --nodes means --planner.nodes.
    close += [flag for flag in known if flag.rpartition(".")[2] == name.lstrip("-") and flag not in close]
    if close:
        return f"did you mean {' or '.join(close)}? (`{prog} --help` lists all)"
    group = f"{name.partition('.')[0]}."
    if members := [flag for flag in known if flag.startswith(group)]:
        return f"allowed: {', '.join(members)}"
    return f"allowed: {', '.join(dict.fromkeys(re.sub(r'[.].*', '.*', flag) for flag in known))}"


def _check_finite(value: Any, name: str) -> None:
    if dataclasses.is_dataclass(value):
        for entry in dataclasses.fields(value):
            _check_finite(getattr(value, entry.name), f"{name}.{entry.name}".strip("."))
    elif isinstance(value, (tuple, list)):
        for item in value:
            _check_finite(item, name)
    elif isinstance(value, float) and not math.isfinite(value):
        raise BadInputError(f"--{name.replace('_', '-')} = {value}; allowed: finite numbers")


def _one_line(box: str, argv: Sequence[str], known: Mapping[str, bool], prefixes: Sequence[str]) -> str:
    """What tyro says in a box of several lines."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", box)
    lines = [line.strip("│╭╮╰╯ ") for line in plain.splitlines()[1:]]  # the first is a heading
    if lines and not lines[0].strip("-"):
        del lines[0]  # where a terminal has no lines to draw with, a rule is under the heading
    rule = next((k for k, line in enumerate(lines) if line and not line.strip("─-")), len(lines))
    message = re.sub(r"\bgroup[_-](\d+)\b[.]?", lambda k: f"{prefixes[int(k[1])]}.".lstrip("."), " ".join(lines[:rule]))
    if found := re.match(r"Error parsing (--\S+): ", message):
        heading = next((k for k in range(rule, len(lines)) if lines[k].startswith(f"{found[1]} ")), rule)
        kinds = "".join(lines[heading : heading + 1]).partition(" ")[2].strip("{}")
        if len(kinds.split()) > 1:  # of several values the help says what each is
            told = " ".join(lines[heading + 1 :]).replace(" (", ";").partition(";")[0]
            kinds = f"{len(kinds.split())} values: {told} ({kinds})"
        return _wrong(found[1], argv, kinds)
    if found := re.match(r"Error parsing ([\w.]*): (.*)", message):
        return with_flag(found[2], list(known), found[1].strip("."))
    if found := re.match(r"Missing value for argument '(--\S+?)'. Expected (\d+) values", message):
        return _wrong(found[1], argv, f"{found[2]} value{'s' * (found[2] != '1')}")
    if found := re.match(r"invalid choice '(.*)' for argument '(\S+)'. Expected one of \((.*)\)", message):
        choices = sorted({choice.strip(" '") for choice in found[3].split(",")} - {"", "None"})
        return f"{found[2]} = {found[1]}; allowed: {', '.join(choices)}"
    if found := re.match(r"Missing from [^:]*: (\S+) (.*) \(required\)", message):
        return f"{found[1]} is missing; allowed: {found[2]}"
    if found := re.match(r"Unrecognized options: (.*)", message):
        return f"{found[1]}: nothing is known to do with this; allowed: flags, each followed by its values"
    return message


def _wrong(flag: str, argv: Sequence[str], allowed: str) -> str:
    values = _values(flag, argv)
    return f"{flag} = {values}; allowed: {allowed}" if values else f"{flag}: its value is missing; allowed: {allowed}"


def _values(flag: str, argv: Sequence[str]) -> str:
    """What ``argv`` gives for a flag, where it last does."""
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
    return " ".join(words)
