"""Comparison of two runs of one scenario: fields, figures of the summary, and their states over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.figure import Figure

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.fields import flattened
from mathnavi.interfaces.signal_names import UNNAMED, SignalNames
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.comparison.comparison import Comparison, Names, differences, differing_fields, names_of_two
from mathnavi.renders.figures import STYLE, canvas, draw_map, thinned
from mathnavi.renders.generic.run_data import estimates
from mathnavi.renders.page import Drawn, number
from mathnavi.renders.statistics_figures import SERIES
from mathnavi.sim.records.documents import LOG_SCENARIO
from mathnavi.sim.records.field_names import recorded_fields
from mathnavi.sim.records.figure_names import SHORTFALL, SUMMARY_GROUPS, is_wall_clock, label, rest_heading
from mathnavi.sim.records.run_folder import RunLog, read_fleet, read_log, read_signal_names
from mathnavi.sim.records.table import Table

LEFT_OUT = ("seed", "version", SHORTFALL)  # among the fields, or in the sentence
COLOURS, STYLES = (SERIES[1], SERIES[0]), ("-", "--")  # of the left run and the right one
WIDTHS = (1.8, 1.2)  # the right one is drawn over the left one
ACROSS, HEIGHT, WIDTH = 3, 1.9, 9.4  # panels in a row; [inches] of a row and of a figure
MOST_PANELS = 18


def compare_runs(left: Path, right: Path) -> Comparison:
    """Compare two runs; errors as of ``read_run``, and ArgumentError for runs of different scenarios."""
    one, other, names = read_run(left), read_run(right), names_of_two(left, right)
    scenarios = one.config["scenario"], other.config["scenario"]
    if scenarios[0] != scenarios[1]:
        raise ArgumentError(f"{left} is a run of {scenarios[0]} and {right} of {scenarios[1]}; allowed: one scenario")

    return Comparison(
        f"{scenarios[0]}: two runs",
        _verdict(one, other, names),
        names,
        str(left),
        str(right),
        [differing_fields(one.fields, other.fields, names), _summaries(one.summary, other.summary, names)],
        lambda: run_figures(one, other, names),
    )


def _verdict(one: ComparedRun, other: ComparedRun, names: Names) -> str:
    if one.config["scenario"] == LOG_SCENARIO:
        return f"{names[0]} and {names[1]} are recorded logs: no mission was flown."
    ends = [run.summary.get(SHORTFALL) for run in (one, other)]
    if ends == [None, None]:
        return "Both missions succeeded."
    outcomes = [f"{name} failed ({why})" if why else f"{name} succeeded" for name, why in zip(names, ends, strict=True)]
    return f"Of the missions {outcomes[0]}, {outcomes[1]}."


def _summaries(left: Mapping[str, Any], right: Mapping[str, Any], names: Names) -> Table:
    """Return figures of the summaries in their groups; wall-clock times, which depend on the machine, are separate."""
    grouped = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    left_out = {*LEFT_OUT, "efficiency_basis"}
    if left.get("efficiency") is right.get("efficiency") is None:
        left_out.add("efficiency")
    keys = [key for key in dict.fromkeys([*left, *right]) if key not in left_out]
    by_clock = [key for key in keys if is_wall_clock(key)]
    groups = {**SUMMARY_GROUPS, rest_heading(left): [key for key in keys if key not in grouped]}
    chosen = {name: [key for key in group if key in keys and key not in by_clock] for name, group in groups.items()}
    rows: list[tuple[str, ...]] = []
    for name, group in {**chosen, "by a clock": by_clock}.items():
        for k, key in enumerate(group):
            one, other = left.get(key), right.get(key)
            rows.append((name * (k == 0), _named(key), number(one), number(other), *differences(one, other)))
    return Table("Summary", ("group", "figure", *names, "difference", "ratio"), rows)


def _named(key: str) -> str:
    name, unit = label(key)
    return f"{name} [{unit}]" if unit else name


@dataclass(frozen=True, eq=False)
class StateHistory:
    """True states of one vehicle over time, and the errors of its estimates."""

    t: Array  # (n,) [s]
    x: Array  # (n, nx) the true state
    t_estimate: Array  # (m,) [s]
    error: Array  # (m, k) of each number of the estimate whose true value is known; no row without an estimate
    estimated: tuple[str, ...]  # (k,) names with units of these numbers


Curve = Callable[[StateHistory], tuple[Array, Array]]  # times (n,) [s] and values (n, nx)


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """Data of a finished run for a comparison."""

    folder: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    states: tuple[str, ...]  # (nx,) names with units
    histories: Mapping[str, StateHistory]  # by vehicle

    @property
    def fields(self) -> dict[str, Any]:
        """Return all requested fields by their names on the command line, with digests of what was read and run."""
        terrain = {"terrain's digest": self.config["terrain"]["digest"]} if "terrain" in self.config else {}
        return (
            {"seed": self.config["seed"]}
            | recorded_fields(self.config)
            | terrain
            | flattened(self.config.get("inputs", {}), "digest of ")
            | {"code": self.config.get("code", "")}
            | flattened(self.config.get("versions", {}), "version of ")
            | flattened(self.config.get("machine", {}))
        )


def read_run(folder: Path) -> ComparedRun:
    """The run in a folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    signals = read_signal_names(folder)
    logs = read_fleet(folder).vehicles if len(signals) > 1 else {"": read_log(folder, may_diverge=True)}
    first = next(iter(signals.values()), UNNAMED)
    histories = {name: _history(log, signals.get(name, first)) for name, log in logs.items()}
    any_log = next(iter(logs.values()))
    return ComparedRun(folder, any_log.config, any_log.summary, first.states, histories)


def _history(log: RunLog, signals: SignalNames) -> StateHistory:
    found = estimates(log, signals)
    if found is None:
        return StateHistory(log.t, log.x, np.empty(0), np.empty((0, 0)), ())
    seen = found.t <= log.t[-1]  # the truth may have ended as no number
    t, error = found.t[seen], found.error[seen]
    if found.whole:  # the truth is linear between samples
        error = found.x[seen] - np.column_stack([np.interp(t, log.t, column) for column in log.x.T])
    known = np.flatnonzero(np.isfinite(error).any(axis=0)).tolist()
    return StateHistory(log.t, log.x, t, error[:, known], tuple(found.names[k] for k in known))


def run_figures(left: ComparedRun, right: ComparedRun, called: Names) -> list[Drawn]:
    """Figures of both runs in one: paths, states and errors."""
    drawn: list[Drawn] = []
    ground = _ground(left, right)
    if ground is not None:
        drawn.append(
            ("map", _map(ground, left, right, called), "The paths over the part of the terrain where they are.")
        )
    if left.states != right.states or not left.states:
        return drawn
    names = left.states[:MOST_PANELS]
    more = len(left.states) - len(names)
    rest = f" The first {len(names)} of {len(left.states)} are shown." if more else ""
    states = _panels((left, right), called, names, lambda history: (history.t, history.x))
    drawn.append(("states", states, f"The true state over time, component by component.{rest}"))
    histories = [history for run in (left, right) for history in run.histories.values()]
    estimated = {history.estimated for history in histories if history.estimated}
    if len(estimated) == 1 and any(history.error.any() for history in histories):  # not of a reading of the truth
        (found,) = estimated
        shown = found[:MOST_PANELS]
        rest = f" The first {len(shown)} of {len(found)} are shown." if len(found) > len(shown) else ""
        errors = _panels(
            (left, right), called, shown, lambda history: (history.t_estimate, _wrapped(history.error, found))
        )
        drawn.append(("errors", errors, f"The error of the estimate, component by component.{rest}"))
    return drawn


def _ground(left: ComparedRun, right: ComparedRun) -> HeightField | None:
    """Return the terrain of both runs, if it is the same and still exists."""
    one, other = (run.config.get("terrain", {}) for run in (left, right))
    if not {"path", "digest"} <= one.keys() or one["digest"] != other.get("digest"):
        return None
    try:
        ground = load_terrain(one["path"])
    except (OSError, ValueError):
        return None
    return ground if ground.digest == one["digest"] else None


def _map(ground: HeightField, left: ComparedRun, right: ComparedRun, called: Names) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = canvas(7.6, 7.2)
        axes = figure.add_subplot()
        flown = [history.x[:, :2] for run in (left, right) for history in run.histories.values()]
        draw_map(axes, ground, np.vstack(flown))
        outline = [patheffects.withStroke(linewidth=3.6, foreground="white", alpha=0.85)]
        for run, name, colour in zip((left, right), called, COLOURS, strict=True):
            for k, history in enumerate(run.histories.values()):
                i = thinned(len(history.t), 0)
                x, y = history.x[i, :2].T / 1e3
                axes.plot(x, y, color=colour, lw=2.0, label="" if k else name, path_effects=outline)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=2)
    return figure


def _panels(runs: Sequence[ComparedRun], called: Names, names: Sequence[str], curve: Curve) -> Figure:
    """Draw a panel for each component of the state, with the curves of both runs and of every vehicle."""
    rows = math.ceil(len(names) / ACROSS)
    with matplotlib.rc_context(STYLE):
        figure = canvas(WIDTH, 0.4 + HEIGHT * rows)
        cells = figure.subplots(rows, min(len(names), ACROSS), sharex=True, squeeze=False)
        for cell in cells.ravel()[len(names) :]:
            cell.remove()
        for run, own, colour, style, width in zip(runs, called, COLOURS, STYLES, WIDTHS, strict=True):
            for number, history in enumerate(run.histories.values()):
                t, values = curve(history)
                if values.shape[1] < len(names):  # a run without estimates
                    continue
                i = thinned(len(t), 0) if len(t) else np.empty(0, dtype=np.int64)
                for k, axes in enumerate(cells.ravel()[: len(names)]):
                    axes.plot(t[i], values[i, k], style, color=colour, lw=width, label="" if number else own)
        for k, (axes, name) in enumerate(zip(cells.ravel(), names, strict=False)):
            axes.set_title(_readable(name), fontsize=9.0, weight="normal")
            if k + ACROSS >= len(names):
                axes.set_xlabel("time [s]")
                axes.tick_params(labelbottom=True)
        figure.legend(*cells[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def _wrapped(error: Array, states: Sequence[str]) -> Array:
    """Errors with angles between -pi and pi."""
    angles = [name.endswith("[rad]") for name in states]
    wrapped: Array = np.where(angles, np.mod(error + math.pi, 2.0 * math.pi) - math.pi, error)
    return wrapped


def _readable(name: str) -> str:
    return name.replace("_", " ")
