"""Comparison of two runs of one scenario: fields, figures of the summary, and their states over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.renders.comparison.comparison import LEFT, RIGHT, Comparison, differences, differing_fields
from mathnavi.renders.comparison.figures import run_figures
from mathnavi.renders.comparison.run_data import ComparedRun, read_run
from mathnavi.renders.page import number
from mathnavi.sim.records.figure_names import SHORTFALL, SUMMARY_GROUPS, is_wall_clock, label
from mathnavi.sim.records.table import Table

COLUMNS = ("group", "figure", LEFT, RIGHT, "difference", "ratio")
LEFT_OUT = ("seed", "version", SHORTFALL)  # among the fields, or in the sentence


def compare_runs(left: Path, right: Path) -> Comparison:
    """Compare two runs; errors as of ``read_run``, and ArgumentError for runs of different scenarios."""
    one, other = read_run(left), read_run(right)
    scenarios = one.config["scenario"], other.config["scenario"]
    if scenarios[0] != scenarios[1]:
        raise ArgumentError(f"{left} is a run of {scenarios[0]} and {right} of {scenarios[1]}; allowed: one scenario")

    return Comparison(
        f"{scenarios[0]}: two runs",
        _verdict(one, other),
        str(left),
        str(right),
        [differing_fields(one.fields, other.fields), _summaries(one.summary, other.summary)],
        lambda: run_figures(one, other),
    )


def _verdict(one: ComparedRun, other: ComparedRun) -> str:
    ends = [run.summary.get(SHORTFALL) for run in (one, other)]
    if ends == [None, None]:
        return "Both missions succeeded."
    outcomes = [
        f"the {side} one failed ({why})" if why else f"the {side} one succeeded"
        for side, why in zip((LEFT, RIGHT), ends, strict=True)
    ]
    return f"Of the missions {outcomes[0]}, {outcomes[1]}."


def _summaries(left: Mapping[str, Any], right: Mapping[str, Any]) -> Table:
    """Return figures of the summaries in their groups; wall-clock times, which depend on the machine, are separate."""
    grouped = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    left_out = {*LEFT_OUT, "efficiency_basis"}
    if left.get("efficiency") is right.get("efficiency") is None:
        left_out.add("efficiency")
    keys = [key for key in dict.fromkeys([*left, *right]) if key not in left_out]
    by_clock = [key for key in keys if is_wall_clock(key)]
    groups = {**SUMMARY_GROUPS, "other": [key for key in keys if key not in grouped]}
    chosen = {name: [key for key in group if key in keys and key not in by_clock] for name, group in groups.items()}
    rows: list[tuple[str, ...]] = []
    for name, group in {**chosen, "by a clock": by_clock}.items():
        for k, key in enumerate(group):
            one, other = left.get(key), right.get(key)
            rows.append((name * (k == 0), _named(key), number(one), number(other), *differences(one, other)))
    return Table("Summary", COLUMNS, rows)


def _named(key: str) -> str:
    name, unit = label(key)
    return f"{name} [{unit}]" if unit else name
