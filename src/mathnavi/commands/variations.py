"""``--vary FIELD=V1,V2,...`` and ``--vary FIELD=LOW..HIGH``: from words to trials.

Listed values make a full factorial, and every combination flies the same seeds, so that it is compared with the others
mission by mission. A drawn value is uniform, new for every trial, from a generator seeded by the trial's seed and the
field's name: it does not depend on what else is varied, or in which order.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.commands.arguments import FlagGroup, fields_by_flag, given, parse, suggestion, values_of
from mathnavi.commands.command_line import CommandLine, read_command_line
from mathnavi.commands.errors import BadInputError
from mathnavi.interfaces.fields import leaf
from mathnavi.sim.records.field_names import joined, split
from mathnavi.sim.sweep.trial import Trial, Uniform

PLUGINS = ("--controller", "--estimator")
FORMS = "allowed: FIELD=V1,V2,... or FIELD=LOW..HIGH"
TRUTH = {"true": True, "false": False}


@dataclass(frozen=True)
class Variation:
    """Option ``--vary``, or another one of the same form."""

    flag: str
    text: str  # after the equals sign
    option: str = "--vary"

    @property
    def name(self) -> str:
        """Name of the field in ``Record.fields``."""
        return self.flag.removeprefix("--").replace("-", "_")

    @property
    def listed(self) -> list[str]:
        """Return the words of the list, not yet read as values."""
        return self.text.split(",")

    def wrong(self, why: str) -> BadInputError:
        """Return the error that names this flag, and why its values are not allowed."""
        return BadInputError(f"{self.option} {self.name}={self.text}: {why}")


def names_by_flag(line: CommandLine) -> dict[str, str]:
    """Return the names of the fields of the specification of a run by their flags."""
    return {
        flag: joined(prefix, name)
        for prefix, config in line.spec.parts.items()
        for flag, name in fields_by_flag(type(config), prefix).items()
    }


def field_values(line: CommandLine, name: str, variation: Variation) -> Uniform | list[Any]:
    """Return the distribution that a field is drawn from, or its listed values, as the command line reads them.

    BadInputError if they cannot be read, or are given twice.
    """
    if line.spec.type_of(name) in (int, float) and ".." in variation.text:
        if "..." in variation.text:
            raise variation.wrong(f"three dots are 0..2 or 0..0.2; {FORMS}")
        low, high = (_parsed(line, name, variation, text) for text in variation.text.split("..", 1))
        if low > high:
            raise variation.wrong(f"{low!r} > {high!r}; allowed: LOW <= HIGH")
        return Uniform(variation.name, low, high)
    values = [_parsed(line, name, variation, text) for text in variation.listed]
    if twice := [value for k, value in enumerate(values) if value in values[:k]]:
        raise variation.wrong(f"{twice[0]!r} is given twice; allowed: each value once")
    return values


def _parsed(line: CommandLine, name: str, variation: Variation, text: str) -> Any:
    if line.spec.type_of(name) is bool:
        if text.lower() not in TRUTH:
            raise variation.wrong(f"{text!r}; allowed: true, false")
        return TRUTH[text.lower()]
    words = text.split()
    if not words or any(word == "-h" or word.startswith("--") for word in words):
        raise variation.wrong(f"{text!r} is not a value; {FORMS}")
    argv = [f"{variation.flag}={words[0]}"] if len(words) == 1 else [variation.flag, *words]
    prefix, own = split(name)
    part = line.spec.parts[prefix]
    (config,) = parse(argv, line.prog, "", FlagGroup(type(part), prefix, part))
    return leaf(config, own)


def read_variations(argv: Sequence[str]) -> list[Variation]:
    """Return every ``--vary`` of ``argv``; BadInputError for another form, and for a field that is varied twice."""
    variations: list[Variation] = []
    for text in values_of("--vary", argv):
        field, equals, values = text.partition("=")
        variation = Variation(f"--{field.strip().lstrip('-').replace('_', '-')}", values)
        if not (equals and field.strip() and values):
            raise BadInputError(f"--vary = {text!r}; {FORMS}")
        if variation.flag in {other.flag for other in variations}:
            raise variation.wrong("this field is varied twice; allowed: once")
        variations.append(variation)
    return variations


def read_command_lines(argv: Sequence[str], options: type, variations: Sequence[Variation]) -> list[CommandLine]:
    """Return the command line for each combination of the listed controllers and estimators.

    Raises BadInputError for a variation of an unknown field, or of a field that is given as well.
    """
    plugins = [variation for variation in variations if variation.flag in PLUGINS]
    for variation in plugins:
        if len(set(variation.listed)) < len(variation.listed):
            raise variation.wrong("a plug-in is given twice; allowed: each once")
    names = [variation.name for variation in plugins]
    lines = [
        read_command_line("sweep", argv, options, chosen=dict(zip(names, values, strict=True)))
        for values in itertools.product(*(variation.listed for variation in plugins))
    ]
    for line, variation in itertools.product(lines, variations):
        known = (*names_by_flag(line), *PLUGINS)
        if variation.flag not in known:
            hint = suggestion(variation.flag, known, line.prog)
            raise variation.wrong(f"this is not one of the fields of {line.prog!r} that can be varied; {hint}")
        if variation.flag in given(argv):
            raise variation.wrong(f"{variation.flag} is given as well; allowed: one of both")
    return lines


def varied_fields(
    line: CommandLine, variations: Sequence[Variation]
) -> tuple[dict[str, list[Any]], dict[str, Uniform]]:
    """Return the listed values, and the distributions, of the fields that are varied, by the fields' names."""
    names = names_by_flag(line)
    values = {
        names[each.flag]: field_values(line, names[each.flag], each) for each in variations if each.flag not in PLUGINS
    }
    listed = {name: each for name, each in values.items() if isinstance(each, list)}
    return listed, {name: each for name, each in values.items() if isinstance(each, Uniform)}


def trials(line: CommandLine, variations: Sequence[Variation], count: int) -> tuple[list[list[Trial]], list[str]]:
    """Return trials of all combinations of listed values with ``count`` seeds, and the names of the drawn fields."""
    listed, drawn = varied_fields(line, variations)
    combinations = [dict(zip(listed, values, strict=True)) for values in itertools.product(*listed.values())]
    with line.bad_input():
        bases = [line.spec.with_fields(combination) for combination in combinations]
        by_seed: list[list[Trial]] = []
        for seed in range(line.spec.seed, line.spec.seed + count):
            drawn_now = {name: uniform.draw(seed) for name, uniform in drawn.items()}
            by_seed.append([Trial(base.with_seed(seed).with_fields(drawn_now)) for base in bases])
        return by_seed, [uniform.name for uniform in drawn.values()]


def listed_combinations(line: CommandLine, variations: Sequence[Variation]) -> int:
    """Return the number of combinations of the listed values of fields."""
    return math.prod(map(len, varied_fields(line, variations)[0].values()))
