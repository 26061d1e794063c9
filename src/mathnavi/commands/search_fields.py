"""``--over FIELD=LOW..HIGH``: from words to the space of a search, and from values of its fields to a trial.

A field is named like its flag; one component of a field that holds several values is named by its index, ``start[2]``
or ``uncharted[0][1]``, and the field itself must be given. ``seed`` is the seed of the mission.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.commands.arguments import given, suggestion, values_of
from mathnavi.commands.command_line import CommandLine
from mathnavi.commands.errors import BadInputError
from mathnavi.commands.variations import Variation, field_values, names_by_flag
from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.interfaces.field_table import flag_of
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.search.rare import REDRAW
from mathnavi.sim.search.space import Choice, Dimension, Range, Values
from mathnavi.sim.sweep.trial import Trial, Uniform

OVER = "--over"
FORMS = "allowed: FIELD=LOW..HIGH, FIELD=LOW..HIGH,log or FIELD=V1,V2,..."
SEED = "seed"
LOG = ",log"
_PLACES = re.compile(r"(?P<name>[^\[\]]+)(?P<places>(\[\d+\])*)")


@dataclass(frozen=True)
class SearchFields:
    """Fields that a search varies, and the specification whose other fields stay unchanged."""

    spec: RunSpec
    space: tuple[Dimension, ...]

    def make(self, values: Values) -> Trial:
        """Return the trial at these values of the fields; FieldError if the configuration refuses them."""
        whole: dict[str, Any] = {}
        for name, value in values.items():
            if name != SEED:
                field, numbers = _split(name)
                whole[field] = _with_place(whole.get(field, self.spec[field]), numbers, value)
        return Trial(self.spec.with_seed(values.get(SEED, self.spec.seed)).with_fields(whole))


def read_space(argv: Sequence[str], line: CommandLine) -> SearchFields:
    """Return the space of every ``--over`` of ``argv``; BadInputError for one that cannot be searched."""
    dimensions: list[Dimension] = []
    for text in values_of(OVER, argv):
        name, equals, values = text.partition("=")
        name = name.strip().lstrip("-").replace("-", "_")
        if not (equals and values and _PLACES.fullmatch(name)):
            raise BadInputError(f"{OVER} = {text!r}; {FORMS}")
        if name in {each.name for each in dimensions}:
            raise BadInputError(f"{OVER} {text}: this field is searched over twice; allowed: once")
        dimensions.append(_dimension(name, values, line, argv))
    return SearchFields(line.spec, tuple(dimensions))


def _dimension(name: str, values: str, line: CommandLine, argv: Sequence[str]) -> Dimension:
    log = values.endswith(LOG)
    variation = Variation(flag_of(name), values.removesuffix(LOG), OVER)
    field, numbers = _split(name)
    flag, names = flag_of(field), names_by_flag(line)
    if name == SEED:
        return _range(variation, *_numbers(variation, whole=True, low=0, high=LARGEST_SEED), log)
    if flag not in names or field == REDRAW:
        known = tuple(flag for flag in names if flag != flag_of(REDRAW))
        hint = suggestion(flag, (*known, flag_of(SEED)), line.prog)
        raise variation.wrong(f"this is not one of the fields of {line.prog!r} that can be searched over; {hint}")
    if numbers:
        held = line.spec[field]
        for number in numbers:
            if not isinstance(held, tuple) or number >= len(held):
                raise variation.wrong(f"{field} = {line.spec[field]!r} has no such place; allowed: its own")
            held = held[number]
        if not isinstance(held, (int, float)) or isinstance(held, bool):
            raise variation.wrong(f"there is {held!r}, which is not a number; allowed: places of numbers")
        return _range(variation, *_numbers(variation, whole=isinstance(held, int)), log)
    if flag in given(argv):
        raise variation.wrong(f"{flag} is given as well; allowed: one of both")
    read = field_values(line, names[flag], variation)
    if isinstance(read, Uniform):
        return _range(variation, read.low, read.high, log)
    if log:
        raise variation.wrong(f"listed values have no scale; {FORMS}")
    return Choice(name, tuple(read))


def _range(variation: Variation, low: float, high: float, log: bool) -> Range:
    try:
        return Range(variation.name, low, high, log)
    except ValueError as error:
        raise variation.wrong(str(error).partition(" = ")[2]) from None


def _numbers(variation: Variation, *, whole: bool, low: float = -1e300, high: float = 1e300) -> tuple[float, float]:
    """Return LOW and HIGH of a range that no flag reads."""
    ends = variation.text.split("..")
    try:
        first, last = (int(end) if whole else float(end) for end in ends)
    except ValueError:
        raise variation.wrong(f"not two {'whole ' * whole}numbers; {FORMS}") from None
    if not low <= first <= last <= high:
        raise variation.wrong(f"allowed: {low:g} <= LOW <= HIGH <= {high:g}")
    return first, last


def _split(name: str) -> tuple[str, tuple[int, ...]]:
    """Return the field and the places within it."""
    field, _, rest = name.partition("[")
    return field, tuple(int(number) for number in re.findall(r"\d+", rest))


def _with_place(held: Any, numbers: Sequence[int], value: Any) -> Any:
    """Return the content of a field with a value in one of its places; the value itself without a place."""
    if not numbers:
        return value
    first, *rest = numbers
    return (*held[:first], _with_place(held[first], rest, value), *held[first + 1 :])
