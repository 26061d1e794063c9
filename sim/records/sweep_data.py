"""Data for the report of a sweep: its records in groups, with a rate for each kind of event and a median for each
figure, for any scenario.

Trials are grouped by the values of the fields that were varied. A field with many numeric values, or with another one
for every seed, is continuous: it makes bins instead of groups. Of a summary, truth values become rates and numbers
medians; ``min_clearance_m`` of a flight is the clearance and ``clearance_min`` is h_min, its lower limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby
from typing import Any, TypeGuard

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.figure_names import PLANNER_STATUS, SUMMARY_GROUPS, label
from mathnavi.sim.records.statistics import Band, Proportion, rate, supported_band
from mathnavi.sim.records.store import Record

MOST_LISTED = 12  # values of a numeric field that still make groups
MOST_BINS, LEAST_IN_BIN = 8, 10  # bins of a continuous field, and trials in each of several
SMALL = 1e-3  # numbers below it have a power of ten
ROUNDING = 1e-10  # of the largest number, by which numbers that are computed to be the same may differ
CLEARANCE, CLEARANCE_BOUND = "min_clearance_m", "clearance_min"
PATH, STRAIGHT, PATH_RATIO = "path_length_m", "straight_line_m", "path_over_straight_line"
# The most important first; the rest of a summary follows in its own order.
KEY_FIGURES = (
    CLEARANCE, "spread_s", "separation_min_m", "arrival_time_s", PATH_RATIO, "control_effort",
    "miss_m", "aspect_error_deg", "impact_speed_m_s", "cost",
    "radar_exposure_s", "fallback_steps", "tracking_error_max_m",
)  # fmt: skip

Test = Callable[[Record], bool | None]  # whether an event happened in a trial; None if that is not known


@dataclass(frozen=True)
class TrialGroup:
    """Group of records with the same values of the varied fields."""

    name: str
    values: tuple[object, ...]  # of the fields that make the groups
    records: Sequence[Record]

    def rate(self, happened: Test) -> Proportion | None:
        """Return the proportion of an event among the trials where it is known; None without any."""
        known = [event for record in self.records if (event := happened(record)) is not None]
        return rate(sum(known), len(known)) if known else None

    def band(self, key: str) -> Band | None:
        """Return median and band of a figure among the trials that have it, from fixed resamples; None without any.

        An infinite value, such as the clearance of a vehicle that has left the map, is a value.
        """
        known = figures(self.records, key)
        known = known[~np.isnan(known)]
        return supported_band(known, np.random.default_rng(0)) if len(known) else None


@dataclass(frozen=True, eq=False)
class Sweep:
    """Records of a sweep, and the names of the fields that were varied, as in ``Record.fields``.

    Raises ValueError if there are no records, and for a field that no record has.
    """

    records: Sequence[Record]
    varied: Sequence[str]

    def __post_init__(self) -> None:
        if not self.records:
            raise ArgumentError("records: none; allowed: at least one")
        known = {name for record in self.records for name in record.fields}
        if unknown := [name for name in self.varied if name not in known]:
            raise ArgumentError(f"varied = {unknown[0]!r}; allowed: {', '.join(sorted(known))}")

    @cached_property
    def continuous(self) -> list[str]:
        """Return varied fields that make no groups: numbers with many values, or with another value for every seed."""
        return [name for name in self.varied if _all(values := self.values(name)) and self._is_spread(values)]

    @cached_property
    def listed(self) -> list[str]:
        """Return the varied fields that make groups."""
        return [name for name in self.varied if name not in self.continuous]

    @cached_property
    def groups(self) -> list[TrialGroup]:
        """Return the groups by the values of ``listed``, in order; a single one without such a field."""
        return grouped(self.records, self.listed) if self.listed else [TrialGroup("all trials", (), self.records)]

    @cached_property
    def events(self) -> dict[str, Test]:
        """Return the kinds of events that have rates, by name."""
        tests: dict[str, Test] = {
            "success": lambda record: record.success is True,
            "no result": lambda record: record.status != "ok",
        }
        flights: dict[str, Test] = {
            "below h_min": _too_low, "nearer to each other than allowed": _too_near, "late or not arrived": _late,
        }  # fmt: skip
        tests |= {kind: happened for kind, happened in flights.items() if any(map(_can_say(happened), self.records))}
        if any(map(planned_by_none, self.records)):
            tests["planner without a part"] = planned_by_none
        for key in self._keys:
            values = [record.summary[key] for record in self.records if record.summary.get(key) is not None]
            if not values:
                continue
            if all(isinstance(value, bool) for value in values):
                tests[label(key)[0]] = partial(_positive, key)
            elif key in SUMMARY_GROUPS["safety"] and all(isinstance(value, int) for value in values):
                tests[f"any {label(key)[0]}"] = partial(_positive, key)
        return tests

    @cached_property
    def figures(self) -> list[str]:
        """Return the keys of the summary's numbers that are not the same everywhere, the most important first."""
        order = dict.fromkeys([*KEY_FIGURES, *(key for keys in SUMMARY_GROUPS.values() for key in keys), *self._keys])
        found = []
        for key in order:
            values = {_hashable(record.summary.get(key)) for record in self.records} - {None}
            if (len(values) > 1 and _all(values)) or (key == PATH_RATIO and {PATH, STRAIGHT} <= set(self._keys)):
                found.append(key)
        return found

    @cached_property
    def timings(self) -> list[str]:
        """Return the keys of the measured times."""
        return list(dict.fromkeys(key for record in self.records for key in record.timings))

    def values(self, name: str) -> list[Any]:
        """Return the values of a field, one for each record."""
        return [_hashable(record.fields.get(name)) for record in self.records]

    def bins(self, name: str) -> list[TrialGroup]:
        """Return the records in bins of a continuous field, in order, with equally many in each as far as equal values
        allow.

        A bin's ``values`` are the least and the greatest of the field in it.
        """
        ordered = sorted(self.records, key=lambda record: record.fields[name])
        size = max(LEAST_IN_BIN, math.ceil(len(ordered) / MOST_BINS))
        parts: list[list[Record]] = [[]]
        for _, same in groupby(ordered, key=lambda record: record.fields[name]):
            if len(parts[-1]) >= size:
                parts.append([])
            parts[-1] += same
        if len(parts) > 1 and len(parts[-1]) < LEAST_IN_BIN:
            rest = parts.pop()
            parts[-1] += rest
        found = []
        for part in parts:
            low, high = part[0].fields[name], part[-1].fields[name]
            title = f"{low:.3g} to {high:.3g}" if low < high else f"{low:.3g}"
            found.append(TrialGroup(f"{title} (n = {len(part)})", (low, high), part))
        return found

    def _is_spread(self, values: Sequence[float]) -> bool:
        seeds: dict[float, set[int]] = {}
        for value, record in zip(values, self.records, strict=True):
            seeds.setdefault(value, set()).add(record.seed)
        # A listed value is flown with the seeds of the others, a drawn one with its own seed.
        alone = [min(values) for values in seeds.values() if len(values) == 1]
        drawn = 2 * len(alone) > len(seeds) > 1 and len(set(alone)) == len(alone)
        return drawn or len(seeds) > MOST_LISTED

    @cached_property
    def _keys(self) -> list[str]:
        return list(dict.fromkeys(key for record in self.records for key in record.summary))


def planned_by_none(record: Record) -> bool:
    """Return True if a trial was flown without the planner, though the mission may have succeeded."""
    return PLANNER_STATUS in record.summary


def grouped(records: Iterable[Record], names: Sequence[str]) -> list[TrialGroup]:
    """Group records by the values of fields, in order of these."""
    found: dict[tuple[Any, ...], list[Record]] = {}
    for record in records:
        found.setdefault(tuple(_hashable(record.fields.get(name)) for name in names), []).append(record)
    ordered = sorted(found.items(), key=lambda item: [_order(value) for value in item[0]])
    short = [name.rpartition(".")[2].replace("_", " ") for name in names]
    return [
        TrialGroup(
            ", ".join(f"{name} {format_value(value)}" for name, value in zip(short, values, strict=True)),
            values,
            members,
        )
        for values, members in ordered
    ]


def figures(records: Sequence[Record], key: str) -> Array:
    """Return a figure (n,) of each record, from its summary or its timings, or the ratio of two; NaN where it is
    missing.
    """
    if key == PATH_RATIO:
        ratio: Array = figures(records, PATH) / figures(records, STRAIGHT)
        return ratio
    found = (record.timings.get(key) if key in record.timings else record.summary.get(key) for record in records)
    return np.array([np.nan if value is None else float(value) for value in found])


def format_value(value: object) -> str:
    """Return the value of a field as readable text."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, (tuple, list)):
        return f"({', '.join(map(format_value, value))})"
    return str(value)


def format_numbers(*values: float) -> list[str]:
    """Format numbers of one kind: four digits of the largest and enough to distinguish them; whole ones unchanged.

    Those that differ by no more than rounding, 1e-10 of the largest, are not distinguished.
    """
    finite = [value for value in values if math.isfinite(value)]
    largest = max(map(abs, finite), default=0.0)
    if 0.0 < largest < SMALL:
        return [f"{value:.3g}" for value in values]
    spread = max(finite, default=0.0) - min(finite, default=0.0)
    digits = [3 - math.floor(math.log10(largest))] if largest else [0]
    digits += [1 - math.floor(math.log10(spread))] if spread > ROUNDING * largest else []
    decimals = max(0, *digits)
    whole = [math.isfinite(value) and abs(value - round(value)) <= ROUNDING * largest for value in values]
    return [f"{value:,.{0 if alone else decimals}f}" for value, alone in zip(values, whole, strict=True)]


def is_number(value: object) -> TypeGuard[float]:
    """Return True if a value is a number; a truth value is not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def shared(records: Sequence[Record]) -> Mapping[str, Any]:
    """Return the fields that are the same in all records."""
    first = records[0].fields
    return {name: value for name, value in first.items() if all(r.fields.get(name) == value for r in records)}


def _all(values: Iterable[object]) -> bool:
    return all(is_number(value) for value in values)


def _positive(key: str, record: Record) -> bool | None:
    value = record.summary.get(key)
    return value > 0 if is_number(value) or isinstance(value, bool) else None


def _too_low(record: Record) -> bool | None:
    bound = record.fields.get(CLEARANCE_BOUND)
    if not is_number(bound) or CLEARANCE not in record.summary:
        return None
    clearance = record.summary[CLEARANCE]
    return clearance is None or bool(clearance < bound)  # without a number a clearance is not proven


def _too_near(record: Record) -> bool | None:
    least, allowed = record.summary.get("separation_min_m"), record.summary.get("separation_allowed_m")
    return bool(least < allowed) if is_number(least) and is_number(allowed) else None


def _late(record: Record) -> bool | None:
    if not {"arrived", "arrival_time_s", "deadline_s"} <= record.summary.keys():
        return None
    arrival, deadline = record.summary["arrival_time_s"], record.summary["deadline_s"]
    if not record.summary["arrived"]:
        return True
    return bool(arrival > deadline) if is_number(arrival) and is_number(deadline) else None


def _can_say(happened: Test) -> Callable[[Record], bool]:
    return lambda record: happened(record) is not None


def _hashable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return tuple((name, _hashable(item)) for name, item in value.items())
    return tuple(map(_hashable, value)) if isinstance(value, (list, tuple)) else value


def _order(value: object) -> tuple[bool, float, str]:
    """Return a sort key: numbers before words."""
    return (not is_number(value), float(value) if is_number(value) else 0.0, str(value))
