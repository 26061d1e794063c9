"""The summary of a run as a table to read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rich.table import Table

from sim.metrics import SUMMARY_GROUPS, label

UNTOLD = ("seed", "version")  # stand elsewhere


def summary_table(summary: Mapping[str, Any], events: Mapping[str, int]) -> Table:
    """One row a figure, in groups; keys of no group come last."""
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="dim")
    table.add_column()
    table.add_column(justify="right")
    table.add_column()
    grouped = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    rest = tuple(key for key in summary if key not in grouped and key not in UNTOLD)
    for group, keys in {**SUMMARY_GROUPS, "other": rest}.items():
        heading = group
        for key in keys:
            if key in summary:
                name, unit = label(key)
                table.add_row(heading, name, _figure(summary[key]), unit)
                heading = ""
    heading = "events"
    for kind, count in sorted(events.items()):
        table.add_row(heading, kind.replace("-", " "), str(count), "")
        heading = ""
    return table


def _figure(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:,.1f}" if abs(value) >= 10.0 else f"{value:.3g}"
    return str(value)
