"""What trials say, as tables to read: rates with their limits, medians with their bands, what went wrong."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from renders.sweep_data import PATH_RATIO, Sweep, format_value
from sim.metrics import label
from sim.statistics import Band, Rate
from sim.store import Record

# What there is room for in 120 columns: of a flight these, of another scenario what comes first.
FLIGHT_EVENTS = ("success", "any ground contacts", "below h_min", "late or not arrived", "recorded failure")
FIGURES = (
    PATH_RATIO, "arrival_time_s", "min_clearance_m", "control_effort",
    "miss_m", "aspect_error_deg", "impact_speed_m_s", "cost",
    "solve_ms_mean",
)  # fmt: skip
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


def _rates(sweep: Sweep) -> Table:
    shown = [name for name in FLIGHT_EVENTS if name in sweep.events]
    if len(shown) < len(FLIGHT_EVENTS):  # no flight
        shown = list(sweep.events)[:MOST_COLUMNS]
    columns = {"trials": [str(len(group.records)) for group in sweep.groups]}
    for name in shown:
        rates = [group.rate(sweep.events[name]) for group in sweep.groups]
        columns[f"{name.removeprefix('any ')} [%]"] = [_rate(rate) if rate else "-" for rate in rates]
    return _table("rates with 95 % limits (Clopper-Pearson)", sweep, columns)


def _medians(sweep: Sweep) -> Iterator[Table]:
    known = [*sweep.figures, *sweep.timings]
    columns = {}
    for key in [key for key in FIGURES if key in known] or known[:MOST_COLUMNS]:
        name, unit = label(key)
        bands = [group.band(key) for group in sweep.groups]
        columns[f"{name} [{unit}]" if unit else name] = [_band(band) if band else "-" for band in bands]
    if columns:
        yield _table("medians with 95 % bands (bootstrap)", sweep, columns)


def _faults(records: Sequence[Record]) -> Iterator[Table]:
    """What was raised, or how processes died: the most frequent first, with a seed to see it again."""
    seen: dict[tuple[str, str], list[int]] = {}
    for record in records:
        if record.error is not None:
            lines = record.error.strip().splitlines()
            message = lines[-1 if record.status == "raised" else 0] if lines else ""
            seen.setdefault((record.status, message), []).append(record.seed)
    if not seen:
        return
    table = _empty("recorded failures", ("status", "trials", "seed", "message"))
    most = sorted(seen.items(), key=lambda item: -len(item[1]))
    for (status, message), seeds in most[:MOST_FAULTS]:
        table.add_row(status.replace("-", " "), str(len(seeds)), str(min(seeds)), Text(message))
    if len(most) > MOST_FAULTS:
        table.add_row(f"{len(most) - MOST_FAULTS} more", "", "", "")
    yield table


def _table(heading: str, sweep: Sweep, columns: Mapping[str, Sequence[str]]) -> Table:
    """One row for each group of the sweep."""
    table = _empty(heading, sweep.listed)
    for name in columns:
        table.add_column(Text(name), justify="right")
    for group, *cells in zip(sweep.groups, *columns.values(), strict=True):
        table.add_row(*map(format_value, group.values), *cells)
    return table


def _empty(heading: str, columns: Sequence[str]) -> Table:
    table = Table(title=heading, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _rate(rate: Rate) -> str:
    value, low, high, upper = (f"{100.0 * p:.3g}" for p in (rate.value, rate.low, rate.high, rate.upper))
    return f"{value} [{low}, {high}]" if rate.events else f"0 (<= {upper})"


def _band(band: Band) -> str:
    """On two lines, so that there is room for several."""
    if math.isnan(band.low):
        return _number(band.median)
    return f"{_number(band.median)}\n[{_number(band.low)}, {_number(band.high)}]"


def _number(value: float) -> str:
    if not math.isfinite(value):
        return f"{value:g}"
    digits = 3 - math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{max(digits, 0)}f}"
