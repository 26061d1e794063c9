"""Figure A.4: run-time against the number of nodes, and the strip of useful prediction horizons.

(a) Mean and largest time of one replan against N, over a range of horizons, each the median over the missions.
(b) Each pair (N, T_p), h = T_p / (N - 1), falls into one of the thesis' four areas:

    A  infeasible: two sampling instants lie further apart than d_max, d = max |p_k - p_(k-1)| > d_max (A.8);
    B  feasible, not optimal: a smaller T_p in C at the same N has a lower cost;
    C  the strip to choose from;
    D  infeasible: h is less than the mean run-time.

The thesis leaves d_max open; here it is 750 m, three quarters of what a vehicle at v_max covers in 10/3 s. The cost of
a mission is what the planner minimises, sum h |a|^2 + beta times the time of flight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.interfaces.bounds import Count, Within, configuration
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import SPACING, Setup, StudyResult, falls, median

NODES = (4, 7, 10, 13, 16, 19)
HORIZONS = (5.0, 10.0, 15.0, 20.0, 30.0)  # [s]
FURTHEST = 750.0  # [m] d_max
AREAS = {"A": ("#d9d9d9", "too far between instants"), "B": ("#fdd49e", "a shorter horizon is better"),
         "C": ("#a1d99b", "to choose from"), "D": ("#969696", "h below the mean run-time")}  # fmt: skip
# Table A.1 gives four points of Figure A.4(a): mean and largest CPU time [s] by N, at h = 5/3 s
PRINTED = {4: (0.17, 0.37), 7: (0.35, 0.74), 10: (0.62, 1.07), 13: (1.01, 1.51)}
MOST_RATIO = 3.0  # of the target


@configuration
class RunTimeConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 6
    """number of missions for each pair of nodes and horizon, the same for all"""
    nodes: Annotated[Count, Within(Interval(ge=4, le=len(NODES)))] = len(NODES)
    """number of node counts, of N = 4, 7, 10, 13, 16, 19"""
    horizons: Annotated[Count, Within(Interval(ge=4, le=len(HORIZONS)))] = len(HORIZONS)
    """number of horizons, of T_p = 5, 10, 15, 20, 30 s"""


class RunTime:
    """Run-time against the number of nodes, and useful prediction horizons (Figure A.4)."""

    Config = RunTimeConfig
    quick = RunTimeConfig(seeds=1)
    title = "Computational load and the strip of useful horizons"

    @staticmethod
    def run(config: RunTimeConfig, setup: Setup) -> StudyResult:
        nodes, horizons = NODES[: config.nodes], HORIZONS[: config.horizons]
        trials = {
            (n, horizon, seed): setup.trial(
                seed, measure=SPACING, fields={"planner.nodes": n, "planner.horizon": horizon}
            )
            for seed in range(
                config.seeds
            )  # all pairs of a mission one after the other, at the same load of the machine
            for n in nodes
            for horizon in horizons
        }
        records = setup.fly_each(trials)
        cells = {
            (n, horizon): _cell(n, horizon, [records[n, horizon, seed] for seed in range(config.seeds)])
            for n in nodes
            for horizon in horizons
        }
        for (n, horizon), cell in cells.items():  # from the shortest horizon on
            shorter = [cells[n, other] for other in horizons if other < horizon]
            cell["area"] = _area(cell, [other for other in shorter if other["area"] == "C"])
        load = {n: _load([cells[n, horizon] for horizon in horizons]) for n in nodes}
        means = [load[n]["mean_ms"] for n in nodes]
        largest = [load[n]["max_ms"] for n in nodes]
        ratio = cells[13, 20.0]["mean_ms"] / cells[4, 5.0]["mean_ms"]
        return StudyResult(
            summary=(
                f"{config.seeds} missions over {setup.ground.name} for each of {len(cells)} pairs of N and T_p. "
                "Times are thread CPU times of one replan; the thesis' are seconds of a 2.8 GHz Xeon in 2006, NPOPT "
                "under MATLAB.",
            ),
            rows=[*cells.values()],
            tables=(_loads(load), _strip(cells)),
            figure=_figure(load, cells),
            caption="(a) Mean and largest time of one replan, bars over the horizons. (b) The area of each pair.",
            claims=(
                Claim(
                    "A.runtime-grows", "printed", "Mean and largest run-time increase with the number of nodes.",
                    "Figure A.4(a), A.6", "both grow from each N to the next",
                    "mean " + ", ".join(f"{t:.2f}" for t in means) + " ms; largest "
                    + ", ".join(f"{t:.1f}" for t in largest) + " ms (medians over the missions) at "
                    f"N = {', '.join(map(str, nodes))}",
                    falls(means[::-1]) and falls(largest[::-1]),
                ),
                Claim(
                    "flight.cpu-ratio", "target", "The mean run-time grows slowly with the number of nodes.",
                    "Table A.1 (print: 1.01 / 0.17 = 5.9)", f"N = 13 over N = 4 at h = 5/3 s at most {MOST_RATIO:g}",
                    f"{ratio:.2f}", ratio <= MOST_RATIO,
                ),
            ),
        )  # fmt: skip


def _cell(n: int, horizon: float, records: Sequence[Record]) -> dict[str, Any]:
    h = horizon / (n - 1)
    cost = figures(records, "control_effort") + FlightConfig().beta * figures(records, "flight_time_s")
    return {
        "N": n,
        "T_p_s": horizon,
        "h_s": h,
        "mean_ms": median(figures(records, "solve_ms_mean")).median,
        "max_ms": median(figures(records, "solve_ms_max")).median,
        "spacing_m": float(figures(records, "node_spacing_m").max()),
        "cost": float(cost.mean()),
        "arrived": int(figures(records, "arrived").sum()),
        "missions": len(records),
    }


def _area(cell: Mapping[str, Any], useful: Sequence[Mapping[str, Any]]) -> str:
    """Return the area of a pair, given the shorter horizons in C at the same N."""
    if 1e3 * cell["h_s"] < cell["mean_ms"]:
        return "D"
    if cell["spacing_m"] > FURTHEST:
        return "A"
    return "B" if any(other["cost"] < cell["cost"] for other in useful) else "C"


def _load(cells: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    means, largest = np.array([cell["mean_ms"] for cell in cells]), np.array([cell["max_ms"] for cell in cells])
    figures = means.mean(), means.std(), largest.mean(), largest.std()
    return dict(zip(("mean_ms", "mean_std_ms", "max_ms", "max_std_ms"), map(float, figures), strict=True))


def _loads(load: Mapping[int, Mapping[str, float]]) -> Table:
    columns = ("N", "mean [ms]", "printed [s]", "largest [ms]", "printed [s]")
    cells = [
        (
            str(n), f"{row['mean_ms']:.3f} ± {row['mean_std_ms']:.3f}", f"{PRINTED[n][0]}" if n in PRINTED else "–",
            f"{row['max_ms']:.2f} ± {row['max_std_ms']:.2f}", f"{PRINTED[n][1]}" if n in PRINTED else "–",
        )
        for n, row in load.items()
    ]  # fmt: skip
    return Table("Figure A.4(a): one replan, mean and deviation over the horizons", columns, cells)


def _axes(cells: Mapping[tuple[int, float], Any]) -> tuple[list[int], list[float]]:
    """Return the numbers of nodes and the horizons [s] of the pairs."""
    return list(dict.fromkeys(n for n, _ in cells)), list(dict.fromkeys(horizon for _, horizon in cells))


def _strip(cells: Mapping[tuple[int, float], Mapping[str, Any]]) -> Table:
    nodes, horizons = _axes(cells)
    columns = ("N", *(f"T_p = {horizon:g} s" for horizon in horizons))
    rows = [
        (str(n), *(f"{cells[n, horizon]['area']}   {cells[n, horizon]['cost']:,.0f}" for horizon in horizons))
        for n in nodes
    ]
    return Table("Figure A.4(b): area, and mean cost of a mission", columns, rows)


def _figure(load: Mapping[int, Mapping[str, float]], cells: Mapping[tuple[int, float], Mapping[str, Any]]) -> Figure:
    with styled_figure((9.4, 3.6)) as figure:
        time, strip = figure.subplots(1, 2)
        nodes, horizons = _axes(cells)
        for key, name, style in (("max", "largest", "s--"), ("mean", "mean", "o-")):
            time.errorbar(
                nodes, [load[n][f"{key}_ms"] for n in nodes], [load[n][f"{key}_std_ms"] for n in nodes],
                fmt=style, capsize=3, label=name,
            )  # fmt: skip
        time.set_yscale("log")
        time.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        time.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        time.yaxis.set_minor_formatter(NullFormatter())
        time.set(xlabel="N", ylabel="CPU time [ms]", title="(a) run-time of one replan")
        time.legend()
        for (n, horizon), cell in cells.items():
            k, m = nodes.index(n), horizons.index(horizon)
            strip.fill(
                [k - 0.5, k + 0.5, k + 0.5, k - 0.5], [m - 0.5, m - 0.5, m + 0.5, m + 0.5], color=AREAS[cell["area"]][0]
            )
            strip.text(k, m, cell["area"], ha="center", va="center", color="#1b2733", weight="bold")
        strip.set_xticks(range(len(nodes)), [str(n) for n in nodes])
        strip.set_yticks(range(len(horizons)), [f"{horizon:g}" for horizon in horizons])
        strip.set(xlabel="N", ylabel="T_p [s]", title="(b) useful horizons")
        strip.grid(False)
        handles = [Patch(color=colour, label=f"{area}: {meaning}") for area, (colour, meaning) in AREAS.items()]
        strip.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=8)
    return figure
