"""Result of a run for the terminal: the verdict, the summary as a table, and how long its components' answers took."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mathnavi.interfaces.short_tables import value_text
from mathnavi.interfaces.signals import Event
from mathnavi.sim.records.figure_names import PLANNER_STATUS, SHORTFALL, SUMMARY_GROUPS, label, rest_heading
from mathnavi.sim.records.timing import Timing, slow_components, timing_table

if TYPE_CHECKING:
    from mathnavi.sim.scenarios.closed_loop import RunData

SHOWN_ELSEWHERE = ("seed", "version", "efficiency_basis", SHORTFALL, PLANNER_STATUS)


def verdict(result: RunData, subject: str = "mission") -> str:
    """Return a sentence: the mission, or another subject, succeeded, or why it failed."""
    why, status = result.summary.get(SHORTFALL), result.summary.get(PLANNER_STATUS)
    unflown = f"; BUT THE PLANNER {status}" if status else ""
    if result.success:
        return f"{subject} succeeded{unflown}"
    return f"{subject} FAILED{f': {why}' if why else ''}{unflown}"


def summary_table(summary: Mapping[str, Any], events: Sequence[Event]) -> Table:
    """Return a table with one row for each figure, in groups; keys of no group come last.

    Of each kind of events the first is shown. How the Cramér-Rao bound is averaged, and why none exists, is in
    summary.json and in the report.
    """
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="dim")
    table.add_column()
    table.add_column(justify="right")
    table.add_column()
    grouped = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    rest = tuple(key for key in summary if key not in grouped and key not in SHOWN_ELSEWHERE)
    for group, keys in {**SUMMARY_GROUPS, rest_heading(summary): rest}.items():
        heading = group
        for key in keys:
            if key in summary and key not in SHOWN_ELSEWHERE and not (key == "efficiency" and summary[key] is None):
                name, unit = label(key)
                table.add_row(heading, name, value_text(summary[key]), unit)
                heading = ""
    kinds: dict[str, list[Event]] = {}
    for event in events:
        kinds.setdefault(event.kind, []).append(event)
    heading = "events"
    for kind, same in sorted(kinds.items(), key=lambda item: (item[1][0].t, item[0])):
        table.add_row(heading, kind.replace("-", " "), str(len(same)), Text(_first(same), overflow="fold"))
        heading = ""
    return table


def print_timing(console: Console, timing: Timing | None) -> None:
    """Print how long the answers of a run's components took, and which were slower than real time."""
    if timing is None:
        return
    (first, *columns), rows = timing_table(timing)
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column(first)
    for column in columns:
        table.add_column(column, justify="left" if column == "vehicle" else "right")
    for row in rows:
        table.add_row(*map(Text, row))
    console.print(table)
    for component, words in slow_components(timing).items():
        console.print(f"{component}: {words}", style="bold", highlight=False, soft_wrap=True)


def _first(events: Sequence[Event]) -> str:
    event = events[0]
    text = f"at {event.t:.1f} s, {event.agent}" + f": {event.message}" * bool(event.message)
    return f"first {text}" if len(events) > 1 else text
