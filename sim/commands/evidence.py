"""What trials say, as tables to read: rates with their limits, medians with their bands, what went wrong."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from renders.sweep_data import Group, Sweep, Test, figures, is_number, said
from sim.metrics import label
from sim.signals import Array
from sim.statistics import Band, Rate, median_band
from sim.store import Record

PATH, STRAIGHT = "path_length_m", "straight_line_m"
CLEARANCE, CLEARANCE_MIN = "min_clearance_m", "clearance_min"
# What there is room for in 120 columns: of a flight these, of another scenario what comes first.
FLIGHT_FIGURES = ("arrival_time_s", CLEARANCE, "control_effort", "solve_ms_mean")
MOST_COLUMNS = 5
MOST_FAULTS = 5  # kinds of what went wrong


def print_evidence(console: Console, records: Sequence[Record], varied: Sequence[str]) -> None:
    """The tables of a set of trials, one row for each combination of the values of the fields that were varied."""
    sweep = Sweep(records, varied)
    for table in (_rates(sweep), *_medians(sweep), *_faults(records)):
        console.print()
        console.print(table)


def verdict(records: Sequence[Record]) -> str:
    """How many trials there are, and how they ended."""
    statuses = Counter(record.status for record in records)
    successes = sum(record.success is True for record in records)
    ends = [f"{count} {status.replace('-', ' ')}" for status, count in sorted(statuses.items()) if status != "ok"]
    return f"{len(records)} trials: {', '.join([f'{successes} did what they should', *ends])}"


def path_ratio(records: Sequence[Record]) -> Array:
    """(n,) How much longer each path is than the straight line; NaN where a record does not tell."""
    return figures(records, PATH) / figures(records, STRAIGHT)


def _rates(sweep: Sweep) -> Table:
    events: dict[str, Test] = {
        "success": sweep.events["success"],
        "ground contact": _on_the_ground,
        "below h_min": _too_low,
        "late or not arrived": _late,
        "recorded failure": sweep.events["recorded failure"],
    }
    if all(_on_the_ground(record) is None for record in sweep.records):  # no flight
        events = dict(list(sweep.events.items())[:MOST_COLUMNS])
    columns = {"trials": [str(len(group.records)) for group in sweep.groups]}
    for name, happened in events.items():
        rates = [group.rate(happened) for group in sweep.groups]
        if any(rates):
            columns[f"{name} [%]"] = [_rate(rate) if rate else "-" for rate in rates]
    return _table("rates with 95 % limits (Clopper-Pearson)", sweep, columns)


def _medians(sweep: Sweep) -> Iterator[Table]:
    found = [{**record.summary, **record.timings} for record in sweep.records]
    known = dict.fromkeys(key for values in found for key, value in values.items() if is_number(value))
    columns = {}
    if PATH in known and STRAIGHT in known:
        columns["path / straight line"] = [_median_ratio(group) for group in sweep.groups]
    for key in [key for key in FLIGHT_FIGURES if key in known] or list(known)[:MOST_COLUMNS]:
        name, unit = label(key)
        columns[f"{name} [{unit}]" if unit else name] = [group.band(key) for group in sweep.groups]
    if columns:
        cells = {name: [_band(band) if band else "-" for band in bands] for name, bands in columns.items()}
        yield _table("medians with 95 % bands (bootstrap)", sweep, cells)


def _faults(records: Sequence[Record]) -> Iterator[Table]:
    """What was raised, or how processes died: the most frequent first, with a seed to see it again."""
    seen: dict[tuple[str, str], list[int]] = {}
    for record in records:
        if record.error is not None:
            lines = record.error.strip().splitlines()
            told = lines[-1 if record.status == "raised" else 0] if lines else ""
            seen.setdefault((record.status, told), []).append(record.seed)
    if not seen:
        return
    table = _empty("recorded failures", ("status", "trials", "seed", "what was told"))
    most = sorted(seen.items(), key=lambda item: -len(item[1]))
    for (status, told), seeds in most[:MOST_FAULTS]:
        table.add_row(status.replace("-", " "), str(len(seeds)), str(min(seeds)), Text(told))
    if len(most) > MOST_FAULTS:
        table.add_row(f"{len(most) - MOST_FAULTS} more", "", "", "")
    yield table


def _table(heading: str, sweep: Sweep, columns: Mapping[str, Sequence[str]]) -> Table:
    """One row for each group of the sweep."""
    table = _empty(heading, sweep.listed)
    for name in columns:
        table.add_column(Text(name), justify="right")
    for group, *cells in zip(sweep.groups, *columns.values(), strict=True):
        table.add_row(*map(said, group.values), *cells)
    return table


def _empty(heading: str, columns: Sequence[str]) -> Table:
    table = Table(title=heading, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _on_the_ground(record: Record) -> bool | None:
    contacts = record.summary.get("ground_contacts")
    return None if contacts is None else bool(contacts > 0)


def _too_low(record: Record) -> bool | None:
    least = record.fields.get(CLEARANCE_MIN)
    if least is None or CLEARANCE not in record.summary:
        return None
    clearance = record.summary[CLEARANCE]
    return clearance is None or bool(clearance < least)  # what is no number is no proof of a clearance


def _late(record: Record) -> bool | None:
    if not {"arrived", "arrival_time_s", "deadline_s"} <= record.summary.keys():
        return None
    return not record.summary["arrived"] or bool(record.summary["arrival_time_s"] > record.summary["deadline_s"])


def _median_ratio(group: Group) -> Band | None:
    ratio = path_ratio(group.records)
    known = ratio[np.isfinite(ratio)]
    return median_band(known, np.random.default_rng(0)) if len(known) else None


def _rate(rate: Rate) -> str:
    value, low, high, upper = (f"{100.0 * p:.3g}" for p in (rate.value, rate.low, rate.high, rate.upper))
    return f"{value} [{low}, {high}]" if rate.events else f"0 (<= {upper})"


def _band(band: Band) -> str:
    """On two lines, so that there is room for several."""
    if math.isnan(band.low):
        return _number(band.median)
    return f"{_number(band.median)}\n[{_number(band.low)}, {_number(band.high)}]"


def _number(value: float) -> str:
    digits = 3 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{max(digits, 0)}f}"
