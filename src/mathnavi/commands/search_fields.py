"""``--over FIELD=LOW..HIGH``: from words to the space of a search, and from values of its fields to a trial.

A field is named like its flag; one place of a field that holds several values is named by its index, ``start[2]`` or
``uncharted[0][1]``, and the field itself must be given. ``seed`` is the seed of the mission.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from mathnavi.commands.arguments import given, suggestion, values_of
from mathnavi.commands.errors import BadInputError
from mathnavi.commands.run_request import RunRequest
from mathnavi.commands.variations import FieldPlaces, Variation, set_fields, trial_of
from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.interfaces.fields import leaf
from mathnavi.sim.search.rare import REDRAW
from mathnavi.sim.search.space import Choice, Dimension, Range, Values
from mathnavi.sim.sweep.trial import Trial
from mathnavi.sim.sweep.uniform import Uniform

OVER = "--over"
FORMS = "allowed: FIELD=LOW..HIGH, FIELD=LOW..HIGH,log or FIELD=V1,V2,..."
SEED = "seed"
LOG = ",log"
_PLACES = re.compile(r"(?P<name>[^\[\]]+)(?P<places>(\[\d+\])*)")


@dataclass(frozen=True)
class SearchFields:
    """Fields that a search varies, and the request whose other fields stay unchanged."""

    request: RunRequest
    space: tuple[Dimension, ...]

    def make(self, values: Values) -> Trial:
        """Return the trial at these values of the fields; FieldError if the configuration refuses them."""
        request, places = self.request, FieldPlaces(self.request)
        whole: dict[str, Any] = {}
        for name, value in values.items():
            if name == SEED:
                request = replace(request, common=replace(request.common, seed=value))
                continue
            field, numbers = _split(name)
            flag = _flag(field)
            held = whole.get(flag, _held(self.request, places, flag))
            whole[flag] = _with_place(held, numbers, value)
        return trial_of(set_fields(request, places, whole), request.common.seed)


def read_space(argv: Sequence[str], request: RunRequest) -> SearchFields:
    """Return the space of every ``--over`` of ``argv``; BadInputError for one that cannot be searched."""
    dimensions: list[Dimension] = []
    for text in values_of(OVER, argv):
        name, equals, values = text.partition("=")
        name = name.strip().lstrip("-").replace("-", "_")
        if not (equals and values and _PLACES.fullmatch(name)):
            raise BadInputError(f"{OVER} = {text!r}; {FORMS}")
        if name in {each.name for each in dimensions}:
            raise BadInputError(f"{OVER} {text}: this field is searched over twice; allowed: once")
        dimensions.append(_dimension(name, values, request, argv))
    return SearchFields(request, tuple(dimensions))


def _dimension(name: str, values: str, request: RunRequest, argv: Sequence[str]) -> Dimension:
    log = values.endswith(LOG)
    variation = Variation(_flag(name), values.removesuffix(LOG), OVER)
    field, numbers = _split(name)
    flag, places = _flag(field), FieldPlaces(request)
    if name == SEED:
        return _range(variation, *_numbers(variation, whole=True, low=0, high=LARGEST_SEED), log)
    if flag not in places.by_flag or field == REDRAW:
        known = tuple(flag for flag in places.by_flag if flag != _flag(REDRAW))
        hint = suggestion(flag, (*known, _flag(SEED)), request.prog)
        raise variation.wrong(f"this is not one of the fields of {request.prog!r} that can be searched over; {hint}")
    if numbers:
        held = _held(request, places, flag)
        for number in numbers:
            if not isinstance(held, tuple) or number >= len(held):
                raise variation.wrong(f"{field} = {_held(request, places, flag)!r} has no such place; allowed: its own")
            held = held[number]
        if not isinstance(held, (int, float)) or isinstance(held, bool):
            raise variation.wrong(f"there is {held!r}, which is not a number; allowed: places of numbers")
        return _range(variation, *_numbers(variation, whole=isinstance(held, int)), log)
    if flag in given(argv):
        raise variation.wrong(f"{flag} is given as well; allowed: one of both")
    read = places.values(variation)
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


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _split(name: str) -> tuple[str, tuple[int, ...]]:
    """Return the field and the places within it."""
    field, _, rest = name.partition("[")
    return field, tuple(int(number) for number in re.findall(r"\d+", rest))


def _held(request: RunRequest, places: FieldPlaces, flag: str) -> Any:
    prefix, name = places.by_flag[flag]
    return leaf(
        {"": request.config, "planner": request.controller.config, "estimator": request.estimator.config}[prefix], name
    )


def _with_place(held: Any, numbers: Sequence[int], value: Any) -> Any:
    """Return the content of a field with a value in one of its places; the value itself without a place."""
    if not numbers:
        return value
    first, *rest = numbers
    return (*held[:first], _with_place(held[first], rest, value), *held[first + 1 :])
