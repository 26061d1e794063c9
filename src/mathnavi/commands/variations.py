"""``--vary FIELD=V1,V2,...`` and ``--vary FIELD=LOW..HIGH``: from words to trials.

Listed values make a full factorial, and every combination flies the same seeds, so that it is compared with the others
mission by mission. A drawn value is uniform, new for every trial, from a generator seeded by the trial's seed and the
field's name: it does not depend on what else is varied, or in which order.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from mathnavi.commands.arguments import fields_by_flag, given, parse, suggestion, values_of
from mathnavi.commands.errors import BadInputError
from mathnavi.commands.run_request import RunRequest, read_request
from mathnavi.interfaces.fields import leaf, leaf_type, with_fields
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.sweep.trial import Trial
from mathnavi.sim.sweep.uniform import Uniform

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


@dataclass(frozen=True)
class FieldPlaces:
    """Places of the fields of a request: the configuration in which each lies, and its name there."""

    request: RunRequest

    @cached_property
    def by_flag(self) -> dict[str, tuple[str, str]]:
        """Prefix of the configuration, and the dotted name in it, by flag."""
        return {
            flag: (group.prefix, name)
            for group in self.request.fields
            for flag, name in fields_by_flag(group.schema, group.prefix).items()
        }

    def values(self, variation: Variation) -> Uniform | list[Any]:
        """Return the distribution that a field is drawn from, or its listed values, as the command line reads them.

        BadInputError if they cannot be read, or are given twice.
        """
        prefix, name = self.by_flag[variation.flag]
        group = next(group for group in self.request.fields if group.prefix == prefix)
        if leaf_type(group.default, name) in (int, float) and ".." in variation.text:
            if "..." in variation.text:
                raise variation.wrong(f"three dots are 0..2 or 0..0.2; {FORMS}")
            low, high = (self._parsed(variation, text) for text in variation.text.split("..", 1))
            if low > high:
                raise variation.wrong(f"{low!r} > {high!r}; allowed: LOW <= HIGH")
            return Uniform(variation.name, low, high)
        values = [self._parsed(variation, text) for text in variation.listed]
        if twice := [value for k, value in enumerate(values) if value in values[:k]]:
            raise variation.wrong(f"{twice[0]!r} is given twice; allowed: each value once")
        return values

    def _parsed(self, variation: Variation, text: str) -> Any:
        prefix, name = self.by_flag[variation.flag]
        group = next(group for group in self.request.fields if group.prefix == prefix)
        if leaf_type(group.default, name) is bool:
            if text.lower() not in TRUTH:
                raise variation.wrong(f"{text!r}; allowed: true, false")
            return TRUTH[text.lower()]
        words = text.split()
        if not words or any(word == "-h" or word.startswith("--") for word in words):
            raise variation.wrong(f"{text!r} is not a value; {FORMS}")
        argv = [f"{variation.flag}={words[0]}"] if len(words) == 1 else [variation.flag, *words]
        (config,) = parse(argv, self.request.prog, "", group)
        return leaf(config, name)


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


def read_requests(argv: Sequence[str], options: type, variations: Sequence[Variation]) -> list[RunRequest]:
    """Return the request for each combination of the listed controllers and estimators.

    Raises BadInputError for a variation of an unknown field, or of a field that is given as well.
    """
    plugins = [variation for variation in variations if variation.flag in PLUGINS]
    for variation in plugins:
        if len(set(variation.listed)) < len(variation.listed):
            raise variation.wrong("a plug-in is given twice; allowed: each once")
    names = [variation.name for variation in plugins]
    combinations = itertools.product(*(variation.listed for variation in plugins))
    requests = [
        read_request("sweep", argv, options, chosen=dict(zip(names, values, strict=True))) for values in combinations
    ]
    for request, variation in itertools.product(requests, variations):
        known = (*FieldPlaces(request).by_flag, *PLUGINS)
        if variation.flag not in known:
            hint = suggestion(variation.flag, known, request.prog)
            raise variation.wrong(f"this is not one of the fields of {request.prog!r} that can be varied; {hint}")
        if variation.flag in given(argv):
            raise variation.wrong(f"{variation.flag} is given as well; allowed: one of both")
    return requests


def trials(request: RunRequest, variations: Sequence[Variation], count: int) -> tuple[list[list[Trial]], list[str]]:
    """Return trials of all combinations of listed values with ``count`` seeds, and the names of the drawn fields."""
    places = FieldPlaces(request)
    variations = [variation for variation in variations if variation.flag not in PLUGINS]
    listed: dict[str, list[Any]] = {}
    drawn: dict[str, Uniform] = {}
    for variation in variations:
        values = places.values(variation)
        if isinstance(values, Uniform):
            drawn[variation.flag] = values
        else:
            listed[variation.flag] = values
    combinations = [dict(zip(listed, values, strict=True)) for values in itertools.product(*listed.values())]
    with request.bad_input():
        bases = [set_fields(request, places, combination) for combination in combinations]
        by_seed: list[list[Trial]] = []
        for seed in range(request.common.seed, request.common.seed + count):
            drawn_now = {flag: uniform.draw(seed) for flag, uniform in drawn.items()}
            by_seed.append([trial_of(set_fields(base, places, drawn_now), seed) for base in bases])
        return by_seed, [uniform.name for uniform in drawn.values()]


def listed_combinations(request: RunRequest, variations: Sequence[Variation]) -> int:
    """Return the number of combinations of the listed values of fields."""
    places = FieldPlaces(request)
    values = [places.values(variation) for variation in variations if variation.flag not in PLUGINS]
    return math.prod(len(listed) for listed in values if isinstance(listed, list))


def set_fields(request: RunRequest, places: FieldPlaces, values: Mapping[str, Any]) -> RunRequest:
    """Return the request with some flags set."""
    if not values:
        return request
    fields: dict[str, dict[str, Any]] = {"": {}, "planner": {}, "estimator": {}}
    for flag, value in values.items():
        prefix, name = places.by_flag[flag]
        fields[prefix][name] = value
    return replace(
        request,
        config=with_fields(request.config, fields[""]),
        controller=PluginSpec(
            request.controller.plugin, with_fields(request.controller.config, fields["planner"], "planner")
        ),
        estimator=PluginSpec(
            request.estimator.plugin, with_fields(request.estimator.config, fields["estimator"], "estimator")
        ),
    )


def trial_of(request: RunRequest, seed: int) -> Trial:
    """Return the trial of a request with one seed."""
    return Trial(
        request.name,
        request.config,
        seed,
        request.common.controller,
        request.controller.config,
        request.common.estimator,
        request.estimator.config,
    )
