"""Comparison of two sweeps of one scenario: rates with their limits, medians with their bands.

Trials of both sweeps with the same seed are the same mission, or nearly so, and not independent samples; if every
seed is in either sweep once at most, the trials are paired. Of b pairs in which an event happened on the left only and
c in which it did on the right only, b is binomial with probability 1/2 if neither is more likely: the sides differ if
the Clopper-Pearson limits of b / (b + c) exclude 1/2. Without pairs they differ if their own limits do not overlap,
which is sufficient but not necessary.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.renders.comparison.comparison import Comparison, Names, differences, differing_fields, names_of_two
from mathnavi.renders.page import UNKNOWN, Drawn
from mathnavi.renders.statistics_figures import medians_figure, rates_figure
from mathnavi.sim.records.figure_names import label
from mathnavi.sim.records.statistics import Band, Proportion, rate
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.records.sweep_data import Sweep, Test, TrialGroup, format_value, is_number
from mathnavi.sim.records.table import Table

MOST_PANELS = 6
MOST_VALUES = 4  # of a field that are listed
Pairs = Sequence[tuple[Record, Record]]


def read_sweep(path: Path) -> list[Record]:
    """Return the records of a store; ValueError for a file that is not a store, an empty one, or one of several
    scenarios.
    """
    with Store.existing(path) as store:
        records = store.records()
    scenarios = sorted({record.scenario for record in records})
    if len(scenarios) != 1:
        held = f"trials of {', '.join(scenarios)}" if scenarios else "no trials"
        raise ArgumentError(f"{path} holds {held}; allowed: the trials of one scenario")
    return records


def compare_sweeps(left: Path, right: Path) -> Comparison:
    """Two sweeps; errors as of ``read_sweep``, and ArgumentError for sweeps of different scenarios."""
    one, other = read_sweep(left), read_sweep(right)
    scenarios = one[0].scenario, other[0].scenario
    if scenarios[0] != scenarios[1]:
        raise ArgumentError(f"{left} is a sweep of {scenarios[0]} and {right} of {scenarios[1]}; allowed: one scenario")
    pairs = paired(one, other)
    names = names_of_two(left, right)
    groups = TrialGroup(names[0], (), one), TrialGroup(names[1], (), other)
    tests = {name: test for records in (one, other) for name, test in Sweep(records, ()).events.items()}
    known = {name: found for name, test in tests.items() if (found := _rates(groups, test)) is not None}
    verdicts = {name: differ(found, pairs, tests[name], names) for name, found in known.items()}
    together = Sweep([*one, *other], ())
    bands = {key: (groups[0].band(key), groups[1].band(key)) for key in (*together.figures, *together.timings)}
    clear = [name for name, verdict in verdicts.items() if verdict.startswith("yes")]

    def draw() -> Sequence[Drawn]:
        return list(_figures(names, known, {key: bands[key] for key in together.figures}))

    return Comparison(
        f"{scenarios[0]}: sweeps of {len(one):,} and {len(other):,} trials",
        f"Rates that differ: {', '.join(clear)}." if clear else "No rate differs clearly from the other side's.",
        names,
        str(left),
        str(right),
        [
            differing_fields(_fields(one), _fields(other), names),
            _rates_table(known, verdicts, len(pairs), names),
            _medians_table(bands, names),
        ],
        draw,
    )


def paired(left: Sequence[Record], right: Sequence[Record]) -> list[tuple[Record, Record]]:
    """The trials with the same seed; none where a seed is in a sweep twice."""
    by_seed = [{record.seed: record for record in records} for records in (left, right)]
    if any(len(trials) < len(records) for trials, records in zip(by_seed, (left, right), strict=True)):
        return []
    return [(record, by_seed[1][seed]) for seed, record in by_seed[0].items() if seed in by_seed[1]]


def differ(rates: tuple[Proportion, Proportion], pairs: Pairs, happened: Test, names: Names) -> str:
    """Text that says whether an event is more likely on one side."""
    known = [(one, other) for a, b in pairs if None not in (one := happened(a), other := happened(b))]
    if known:
        only_left = sum(bool(one) and not other for one, other in known)
        only_right = sum(bool(other) and not one for one, other in known)
        counts = f"{only_left} only in {names[0]}, {only_right} only in {names[1]}"
        share = rate(only_left, only_left + only_right) if only_left + only_right else None
        return f"{'yes' if share and not share.low <= 0.5 <= share.high else 'not shown'}: {counts}"
    (low, high), (other_low, other_high) = ((found.low, found.high) for found in rates)
    return "yes: limits apart" if high < other_low or other_high < low else "not shown: limits overlap"


def _rates(groups: tuple[TrialGroup, TrialGroup], happened: Test) -> tuple[Proportion, Proportion] | None:
    one, other = (group.rate(happened) for group in groups)
    return None if one is None or other is None else (one, other)


def _rates_table(
    known: Mapping[str, tuple[Proportion, Proportion]], verdicts: Mapping[str, str], pairs: int, names: Names
) -> Table:
    how = f"; trials paired by their seeds: {pairs:,}" if pairs else ""
    return Table(
        f"Rates with 95 % limits (Clopper-Pearson){how}",
        ("event", *names, "difference", "differ"),
        [
            (name, one.text(), other.text(), f"{100.0 * (other.value - one.value):+.1f} %", verdicts[name])
            for name, (one, other) in known.items()
        ],
    )


def _medians_table(bands: Mapping[str, tuple[Band | None, Band | None]], names: Names) -> Table:
    rows = []
    for key, (one, other) in bands.items():
        name, unit = label(key)
        medians = [band.median if band else math.nan for band in (one, other)]
        texts = [band.text() if band else UNKNOWN for band in (one, other)]
        rows.append((f"{name} [{unit}]" if unit else name, *texts, *differences(*medians), _apart(one, other)))
    heads = ("figure", *names, "difference", "ratio", "bands")
    return Table("Medians, with 95 % confidence intervals from six trials on (bootstrap)", heads, rows)


def _apart(one: Band | None, other: Band | None) -> str:
    ends = [end for band in (one, other) if band for end in (band.low, band.high)]
    if len(ends) < 4 or any(map(math.isnan, ends)):
        return UNKNOWN
    return "apart" if ends[1] < ends[2] or ends[3] < ends[0] else "overlap"


def _fields(records: Sequence[Record]) -> dict[str, Any]:
    """Value of each field of a sweep, or its values in short."""
    names = dict.fromkeys(name for record in records for name in record.fields)
    values: dict[str, Any] = {name: _values([record.fields.get(name) for record in records]) for name in names}
    seeds = sorted({record.seed for record in records})
    return {
        "seeds": f"{len(seeds):,} from {seeds[0]} to {seeds[-1]}",
        **values,
        "code": _values([r.code for r in records]),
    }


def _values(values: Sequence[Any]) -> Any:
    different = list({format_value(value): value for value in values}.values())
    if len(different) == 1:
        return different[0]
    if all(map(is_number, different)) and len(different) > MOST_VALUES:
        return f"{len(different):,} values from {min(different):.3g} to {max(different):.3g}"
    if len(different) > MOST_VALUES:
        return f"{len(different):,} values"
    return " or ".join(sorted(map(format_value, different)))


def _figures(
    names: Names,
    rates: Mapping[str, tuple[Proportion, Proportion]],
    bands: Mapping[str, tuple[Band | None, Band | None]],
) -> Iterator[Drawn]:
    undecided = {
        name: list(pair)
        for name, pair in rates.items()
        if 0 < sum(r.events for r in pair) < sum(r.trials for r in pair)
    }
    if undecided:
        yield "rates", rates_figure(names, undecided), "Rates with their 95 % limits (Clopper-Pearson)."
    both = [key for key, pair in bands.items() if None not in pair][:MOST_PANELS]
    if both:
        panels = {" ".join((name, f"[{unit}]" * bool(unit))): bands[key] for key in both for name, unit in [label(key)]}
        yield "medians", medians_figure(names, panels), "Medians with their 95 % bootstrap bands."
