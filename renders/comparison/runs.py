"""Two runs of one scenario beside each other: fields, figures of the summary, and their states over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.renders.comparison.comparison import LEFT, RIGHT, Comparison, Drawn, differences, differing_fields
from mathnavi.renders.page import number
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.fields import flattened
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.figure_names import SHORTFALL, SUMMARY_GROUPS, is_wall_clock, label
from mathnavi.sim.records.run_log import RunLog, read_fleet, read_json, read_log

COLUMNS = ("group", "figure", LEFT, RIGHT, "difference", "ratio")
UNTOLD = ("seed", "version", SHORTFALL)  # among the fields, or in the sentence


@dataclass(frozen=True, eq=False)
class Track:
    """What one vehicle did, and what was estimated of it."""

    t: Array  # (n,) [s]
    x: Array  # (n, nx) the true state
    t_estimate: Array  # (m,) [s]
    estimate: Array  # (m, nx), with no row where an estimate is not of the state

    @property
    def error(self) -> Array:
        """(m, nx) of the estimate; the truth is linear between the looks of the loop."""
        true = np.column_stack([np.interp(self.t_estimate, self.t, column) for column in self.x.T])
        error: Array = self.estimate - true
        return error


@dataclass(frozen=True, eq=False)
class Run:
    """A finished run as far as it is compared."""

    folder: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    states: tuple[str, ...]  # (nx,) names with units
    tracks: Mapping[str, Track]  # by vehicle

    @property
    def fields(self) -> dict[str, Any]:
        """All that was asked for by the names of the command line, and over what and with which versions it was."""
        named: dict[str, Any] = {"seed": self.config["seed"], **flattened(self.config.get("fields", {}))}
        for part, prefix in (("controller", "planner."), ("estimator", "estimator.")):
            entry = self.config.get(part, {})
            named |= {part: entry.get("name"), **flattened(entry.get("fields", {}), prefix)}
        terrain = {"terrain's digest": self.config["terrain"]["digest"]} if "terrain" in self.config else {}
        return named | terrain | flattened(self.config.get("versions", {}), "version of ")


def read_run(folder: Path) -> Run:
    """The run in a folder; FileNotFoundError where something is missing, ValueError where something is broken."""
    states = read_json(folder / "log.json").get("states", {})
    logs = read_fleet(folder).vehicles if len(states) > 1 else {"": read_log(folder, may_diverge=True)}
    with np.load(folder / "log.npz", allow_pickle=False) as arrays:
        tracks = {name: _track(log, arrays, f"{name}." if name else "") for name, log in logs.items()}
    any_log, names = next(iter(logs.values())), next(iter(states.values()), ())
    return Run(folder, any_log.config, any_log.summary, tuple(names), tracks)


def _track(log: RunLog, arrays: Mapping[str, Array], prefix: str) -> Track:
    t, estimate = np.empty(0), np.empty((0, log.x.shape[1]))
    if f"{prefix}estimate.x" in arrays:
        found = arrays[f"{prefix}estimate.x"]
        if found.shape[1:] == log.x.shape[1:]:
            t, estimate = arrays[f"{prefix}estimate.t"], found
            seen = t <= log.t[-1]  # the truth may have ended as no number
            t, estimate = t[seen], estimate[seen]
    return Track(log.t, log.x, t, estimate)


def compare_runs(left: Path, right: Path) -> Comparison:
    """Two runs; errors as of ``read_run``, and ValueError for runs of different scenarios."""
    one, other = read_run(left), read_run(right)
    scenarios = one.config["scenario"], other.config["scenario"]
    if scenarios[0] != scenarios[1]:
        raise ValueError(f"{left} is a run of {scenarios[0]} and {right} of {scenarios[1]}; allowed: one scenario")

    def draw() -> Sequence[Drawn]:
        from mathnavi.renders.comparison.figures import run_figures  # imports what maps are drawn with

        return run_figures(one, other)

    return Comparison(
        f"{scenarios[0]}: two runs",
        _verdict(one, other),
        str(left),
        str(right),
        [differing_fields(one.fields, other.fields), _summaries(one.summary, other.summary)],
        draw,
    )


def _verdict(one: Run, other: Run) -> str:
    ends = [run.summary.get(SHORTFALL) for run in (one, other)]
    if ends == [None, None]:
        return "Both missions did what they should."
    told = [
        f"the {side} one did not ({why})" if why else f"the {side} one did what it should"
        for side, why in zip((LEFT, RIGHT), ends, strict=True)
    ]
    return f"Of the missions {told[0]}, {told[1]}."


def _summaries(left: Mapping[str, Any], right: Mapping[str, Any]) -> Table:
    """The figures of the summaries in their groups; what a clock measured is apart, as the machine's doing."""
    grouped = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    keys = [key for key in dict.fromkeys([*left, *right]) if key not in UNTOLD]
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
