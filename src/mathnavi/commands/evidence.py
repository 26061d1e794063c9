"""Tables of trials for the terminal: rates with their limits, medians with their bands, failures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mathnavi.interfaces.short_tables import counted
from mathnavi.sim.records.figure_names import label
from mathnavi.sim.records.statistics import Band, Proportion
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import PATH_RATIO, Sweep, TrialGroup, format_numbers, format_value, planned_by_none

# Shown first: of a flight these, of another scenario those that come first.
FLIGHT_EVENTS = ("success", "any ground contacts", "below h_min", "late or not arrived", "no result")
FIGURES = (
    PATH_RATIO, "arrival_time_s", "min_clearance_m", "control_effort",
    "miss_m", "aspect_error_deg", "impact_speed_m_s", "cost",
    "solve_ms_mean",
)  # fmt: skip
MOST_COLUMNS = 5
MOST_FAILURES = 5  # kinds of failures
GAP = 2  # [characters] between columns


@dataclass(frozen=True)
class Column:
    """Column of a table: cells of one or two lines under a name that may be broken between its words."""

    name: str
    cells: Sequence[str]

    @property
    def width(self) -> int:
        """Least width [characters]."""
        lines = [line for cell in self.cells for line in cell.splitlines()]
        return max(map(len, [*lines, *self.name.split()]), default=0)


def print_evidence(console: Console, records: Sequence[Record], varied: Sequence[str]) -> None:
    """Print the tables of a set of trials.

    They have a row for each combination of the listed values of the fields that were varied, and one for each bin of a
    continuous field.
    """
    sweep = Sweep(records, varied)
    named = [name.rpartition(".")[2].replace("_", " ") for name in sweep.listed]
    values = zip(*(group.values for group in sweep.groups), strict=True)
    lead = [Column(name, [*map(format_value, cells)]) for name, cells in zip(named, values, strict=False)]
    _print_groups(console, sweep, sweep.groups, lead)
    for name in sweep.continuous:
        bins = sweep.bins(name)
        if len(bins) > 1:
            _print_groups(console, sweep, bins, [Column(name, [part.name.partition(" (")[0] for part in bins])])
    for table in _failures(records):
        console.print()
        console.print(table)


def verdict(records: Sequence[Record]) -> str:
    """Return a sentence: the number of trials, and how they ended."""
    statuses = Counter(record.status for record in records)
    successes = sum(record.success is True for record in records)
    ends = [f"{count} {status.replace('-', ' ')}" for status, count in sorted(statuses.items()) if status != "ok"]
    alone = sum(map(planned_by_none, records))
    planners = [f"{alone} flown without the planner"] if alone else []
    return f"{counted(len(records), 'trial')}: {', '.join([f'{successes} succeeded', *planners, *ends])}"


def _print_groups(console: Console, sweep: Sweep, groups: Sequence[TrialGroup], lead: Sequence[Column]) -> None:
    lead = [*lead, Column("trials", [str(len(group.records)) for group in groups])]
    _print_table(console, "rates, with 95 % confidence limits (Clopper-Pearson)", lead, _rates(sweep, groups))
    if medians := _medians(sweep, groups):
        _print_table(console, "medians, with 95 % confidence intervals from six trials on (bootstrap)", lead, medians)


def _print_table(console: Console, heading: str, lead: Sequence[Column], columns: Sequence[Column]) -> None:
    """Print the leading columns and as many others as there is room for, and name the rest."""
    everything = [*lead, *columns]
    ends = np.cumsum([column.width + GAP for column in everything])
    count = max(int(np.searchsorted(ends, console.width, side="right")), len(lead) + 1)
    room = max(console.width - int(ends[:count][-1]), 0)
    table = Table(box=None, padding=(0, GAP, 0, 0))
    for k, column in enumerate(everything[:count]):
        wider = min(max(len(column.name) - column.width, 0), room)
        room -= wider
        table.add_column(Text(column.name), justify="left" if k < len(lead) else "right", width=column.width + wider)
    for cells in zip(*(column.cells for column in everything[:count]), strict=True):
        table.add_row(*map(Text, cells))
    console.print()
    console.print(heading, style="bold", highlight=False)
    console.print(table)
    if rest := [column.name for column in everything[count:]]:
        console.print(Text(f"no room for: {', '.join(rest)}", style="dim"))


def _rates(sweep: Sweep, groups: Sequence[TrialGroup]) -> list[Column]:
    shown = [name for name in FLIGHT_EVENTS if name in sweep.events]
    if len(shown) < len(FLIGHT_EVENTS):  # no flight
        shown = list(sweep.events)[:MOST_COLUMNS]
    columns = []
    for name in shown:
        rates = [group.rate(sweep.events[name]) for group in groups]
        columns.append(Column(f"{name.removeprefix('any ')} [%]", [_rate(rate) if rate else "-" for rate in rates]))
    return columns


def _medians(sweep: Sweep, groups: Sequence[TrialGroup]) -> list[Column]:
    known = [*sweep.figures, *sweep.timings]
    columns = []
    for key in [key for key in FIGURES if key in known] or known[:MOST_COLUMNS]:
        name, unit = label(key)
        bands = [group.band(key) for group in groups]
        columns.append(Column(f"{name} [{unit}]" if unit else name, [_band(band) if band else "-" for band in bands]))
    return columns


def _failures(records: Sequence[Record]) -> Iterator[Table]:
    """Print a table of exceptions and crashed processes: the most frequent first, with a seed that reproduces it."""
    seen: dict[tuple[str, str], list[int]] = {}
    for record in records:
        if record.error is not None:
            lines = record.error.strip().splitlines()
            message = lines[-1 if record.status == "raised" else 0] if lines else ""
            seen.setdefault((record.status, message), []).append(record.seed)
    if not seen:
        return
    title = "trials without a result"
    table = Table(title=title, title_justify="left", title_style="bold", box=None, padding=(0, GAP, 0, 0))
    for name in ("status", "trials", "seed"):
        table.add_column(name, no_wrap=True)
    table.add_column("message", overflow="fold")
    most = sorted(seen.items(), key=lambda item: -len(item[1]))
    for (status, message), seeds in most[:MOST_FAILURES]:
        table.add_row(status.replace("-", " "), str(len(seeds)), str(min(seeds)), Text(message))
    if len(most) > MOST_FAILURES:
        table.add_row(f"{len(most) - MOST_FAILURES} more", "", "", "")
    yield table


def _rate(rate: Proportion) -> str:
    value, low, high, upper = (f"{100.0 * p:.3g}" for p in (rate.value, rate.low, rate.high, rate.upper))
    return f"{value}\n[{low}, {high}]" if rate.events else f"0\n(<= {upper})"


def _band(band: Band) -> str:
    if math.isnan(band.low):
        return format_numbers(band.median)[0]
    median, low, high = format_numbers(band.median, band.low, band.high)
    return f"{median}\n[{low}, {high}]"
