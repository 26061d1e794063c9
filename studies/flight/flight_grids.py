"""Papers A and B combined: benefit of unevenly spaced nodes in the prediction horizon of the flight planner.

The thesis leaves it open whether the planner of Paper A gains by the node distribution of Paper B. Here the arcs of the
horizon are stretched, h_{i+1} = r h_i, so that N = 13 nodes reach T_p = 40 s: they are dense over the part that is
flown before the next plan, and sparse over the part that is planned again. The same missions are flown on uniform grids
of T_p = 20 and 40 s and on stretched ones, all with a plan every 5/3 s. The cost of a mission is the planner's
objective over the whole flight, sum h |a|^2 + beta times the time.

A certificate examines arcs of any length, so the guarantees must hold on a stretched grid as on a uniform one: no
mission below h_min or on the ground, every arrival by gamma V_0, with failing solvers, corrupted or late plans, noise
and gusts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.renders.statistics_figures import rates_figure_on
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult, ends, median, track

PERIOD = 5.0 / 3.0  # [s]
NEAR = 4.0  # [%] the axis of costs is linear within, logarithmic beyond
COST_TICKS = (-4.0, -2.0, 0.0, 2.0, 4.0, 10.0, 20.0, 40.0)


@dataclass(frozen=True)
class HorizonGrid:
    """Prediction horizon and the spacing of its nodes."""

    nodes: int
    horizon: float  # [s]
    stretch: float
    colour: str

    @property
    def name(self) -> str:
        spread = "uniform" if self.stretch == 1.0 else f"r = {self.stretch:g}"
        return f"{self.horizon:g} s, N = {self.nodes}, {spread}"

    @property
    def fields(self) -> dict[str, Any]:
        """Fields of the planner, named as on the command line."""
        wanted = {"nodes": self.nodes, "horizon": self.horizon, "stretch": self.stretch, "period": PERIOD}
        return {f"planner.{name}": value for name, value in wanted.items()}

    @property
    def lengths(self) -> tuple[float, ...]:
        """Lengths [s] of the arcs."""
        return FlightConfig(nodes=self.nodes, horizon=self.horizon, stretch=self.stretch).lengths


UNIFORM = HorizonGrid(13, 20.0, 1.0, "#2166ac")
COARSE = HorizonGrid(13, 40.0, 1.0, "#5a6876")
DENSE = HorizonGrid(25, 40.0, 1.0, "#1b2733")
STRETCHED = HorizonGrid(13, 40.0, 1.1, "#c2183b")
GRIDS = (
    UNIFORM,
    COARSE,
    DENSE,
    STRETCHED,
    HorizonGrid(13, 40.0, 1.2, "#e08214"),
    HorizonGrid(13, 40.0, 1.35, "#b8860b"),
)
ROUGH = {"noise.position": 5.0, "noise.position_rate": 10.0, "faults.gust_rms": 1.5}
MODERATE_FAULTS = {"faults.solver_failure_rate": 0.3, "faults.corrupted_plan_rate": 0.1, "faults.late_plan_rate": 0.1}
FAULTS: dict[str, dict[str, Any]] = {
    "30 % of the solves fail": {"fields": {"faults.solver_failure_rate": 0.3}},
    "90 % of the solves fail": {"fields": {"faults.solver_failure_rate": 0.9}},
    "corrupted and late plans": {"fields": {"faults.corrupted_plan_rate": 0.3, "faults.late_plan_rate": 0.3}},
    "kalman, gusts": {"estimator": "kalman", "fields": ROUGH},
    "everything": {"estimator": "kalman", "fields": ROUGH | MODERATE_FAULTS},
}


@configuration
class FlightGridsConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 20
    """number of missions on each grid, the same for all"""
    faulted: Count = 40
    """number of missions with each kind of fault, on the stretched grid"""


class FlightGrids:
    """Benefit of a stretched grid for the flight planner, which keeps every guarantee (A with B)."""

    Config = FlightGridsConfig
    quick = FlightGridsConfig(seeds=2, faulted=1)
    title = "A stretched grid in the prediction horizon: twice as far with as many nodes"

    @staticmethod
    def run(config: FlightGridsConfig, setup: Setup) -> StudyResult:
        clean = {(grid, seed): setup.trial(seed, fields=grid.fields) for seed in range(config.seeds) for grid in GRIDS}
        faulted = {
            (kind, seed): setup.trial(
                k * config.faulted + seed, **{**named, "fields": named["fields"] | STRETCHED.fields}
            )
            for k, (kind, named) in enumerate(FAULTS.items())  # each kind has missions of its own
            for seed in range(config.faulted)
        }
        flown = setup.fly_each(clean | faulted)
        by_condition = {grid: [flown[grid, seed] for seed in range(config.seeds)] for grid in GRIDS}
        rows = {grid: _row(grid, by_condition[grid], by_condition[UNIFORM]) for grid in GRIDS}
        kinds = {kind: _kept(kind, [flown[kind, seed] for seed in range(config.faulted)]) for kind in FAULTS}
        dearer, most = rows[STRETCHED]["over_uniform_percent"], sum(kept["missions"] for kept in kinds.values())
        broken = sum(kept["broken"] for kept in kinds.values())
        shown = setup.flown({grid: clean[grid, 0] for grid in (UNIFORM, STRETCHED)})
        return StudyResult(
            summary=(_summary(config, setup, rows),),
            rows=[*rows.values(), *kinds.values()],
            tables=(_costs(rows.values()), _faults(kinds.values())),
            figure=_figure(rows, by_condition, kinds),
            caption="The arcs of each horizon; what each mission costs on it over what it costs on the uniform grid of "
            "20 s (dots), and the mean cost over that of the uniform grid (diamonds); share of the faulted missions on "
            "the stretched grid that broke a guarantee (below h_min, on the ground or late), with 95 % intervals.",
            claims=(
                Claim(
                    "flight.stretched", "target",
                    f"A stretched grid (r = {STRETCHED.stretch:g}, T_p = {STRETCHED.horizon:g} s, N = "
                    f"{STRETCHED.nodes}, a plan every 5/3 s) costs no more than the uniform one of T_p = "
                    f"{UNIFORM.horizon:g} s, and breaks no guarantee.",
                    "A.8/B.5, future work: A interwoven with B",
                    f"mean cost of {config.seeds} missions at most that of the uniform grid; no guarantee broken in "
                    f"{most} faulted missions",
                    f"{rows[STRETCHED]['cost']:,.0f} against {rows[UNIFORM]['cost']:,.0f} ({dearer:+.1f} %); broken "
                    f"{rate(broken, most).text()}",
                    dearer <= 0.0 and broken == 0,
                ),
            ),
            tracks=[track(grid.name, shown[grid], grid.colour) for grid in shown],
            places=ends(shown[UNIFORM]),
        )  # fmt: skip


def _cost(records: Sequence[Record]) -> np.ndarray:
    """Return the cost (n,) of missions, sum h |a|^2 + beta times the time of flight."""
    return figures(records, "control_effort") + FlightConfig().beta * figures(records, "flight_time_s")


def _row(grid: HorizonGrid, records: Sequence[Record], uniform: Sequence[Record]) -> dict[str, Any]:
    cost, reference = _cost(records), _cost(uniform)
    band = median(100.0 * (cost / reference - 1.0))
    return {
        "grid": grid.name,
        "T_p_s": grid.horizon,
        "N": grid.nodes,
        "stretch": grid.stretch,
        "period_s": PERIOD,
        "first_arc_s": grid.lengths[0],
        "last_arc_s": grid.lengths[-1],
        "missions": len(records),
        "cost": float(cost.mean()),
        "over_uniform_percent": float(100.0 * (cost.mean() / reference.mean() - 1.0)),
        "median_over_uniform_percent": band.median,
        "median_low_percent": band.low,
        "median_high_percent": band.high,
        "path_m": float(figures(records, "path_length_m").mean()),
        "effort": float(figures(records, "control_effort").mean()),
        "arrival_s": float(figures(records, "flight_time_s").mean()),
        "plans_rejected": int(figures(records, "plans_rejected").sum()),
        "replans": int(figures(records, "replans").sum()),
        "solve_ms_mean": float(figures(records, "solve_ms_mean").mean()),
        "solve_ms_p99": float(np.median(figures(records, "solve_ms_p99"))),
    }


def _kept(kind: str, records: Sequence[Record]) -> dict[str, Any]:
    """Count the missions in which the guarantees were kept."""
    least = np.array([record.parameters["config"]["clearance_min"] for record in records])
    share = figures(records, "flight_time_s") / figures(records, "deadline_s")
    low = (figures(records, "min_clearance_m") < least) | (figures(records, "ground_contacts") > 0)
    late = (figures(records, "arrived") == 0) | (share > 1.0)
    return {
        "faults": kind,
        "missions": len(records),
        "broken": int((low | late).sum()),
        "low": int(low.sum()),
        "late": int(late.sum()),
        "least_m": float(figures(records, "min_clearance_m").min()),
        "latest": float(share.max()),
        "breaches": int(figures(records, "tracking_breaches").sum()),
        "not_flown": int((figures(records, "replans") - figures(records, "plans_adopted")).sum()),
        "replans": int(figures(records, "replans").sum()),
    }


def _summary(config: FlightGridsConfig, setup: Setup, rows: Mapping[HorizonGrid, Mapping[str, Any]]) -> str:
    far, near, coarse, dense = (rows[grid] for grid in (STRETCHED, UNIFORM, COARSE, DENSE))
    return (
        f"{config.seeds} missions over {setup.ground.name} on each of {len(GRIDS)} grids, a plan every 5/3 s on all of "
        f"them. Looking {far['T_p_s']:g} s ahead instead of {near['T_p_s']:g} s, the vehicle arrives "
        f"{near['arrival_s'] - far['arrival_s']:.1f} s sooner for {far['effort'] / near['effort'] - 1.0:+.0%} effort; "
        f"{far['N']} stretched nodes cost {far['cost']:,.0f}; over the same horizon {coarse['N']} uniform ones cost "
        f"{coarse['cost']:,.0f}, and {dense['N']} cost {dense['cost']:,.0f}. Faults were flown on the stretched grid "
        f"with r = {far['stretch']:g}, {config.faulted} missions of each kind."
    )


def _costs(rows: Iterable[Mapping[str, Any]]) -> Table:
    def arcs(r: Mapping[str, Any]) -> str:
        return f"{r['first_arc_s']:.2f}" + ("" if r["stretch"] == 1.0 else f" to {r['last_arc_s']:.2f}")

    return Table.of("Whole missions", rows, (
        ("grid", "grid"), ("arcs [s]", arcs), ("mean cost", "{cost:,.0f}"),
        ("over uniform 20 s", "{over_uniform_percent:+.2f} %"),
        ("median over it",
         "{median_over_uniform_percent:+.2f} [{median_low_percent:+.2f}, {median_high_percent:+.2f}] %"),
        ("path [m]", "{path_m:,.0f}"), ("effort", "{effort:,.0f}"), ("arrival [s]", "{arrival_s:.1f}"),
        ("refused", lambda r: f"{r['plans_rejected'] / r['replans']:.2%}"),
        ("mean CPU [ms]", "{solve_ms_mean:.3f}"), ("p99 CPU [ms]", "{solve_ms_p99:.2f}"),
    ))  # fmt: skip


def _faults(rows: Iterable[Mapping[str, Any]]) -> Table:
    return Table.of(f"Faulted missions, {STRETCHED.name}", rows, (
        ("faults", "faults"), ("guarantees broken", lambda r: rate(r["broken"], r["missions"]).text()),
        ("below h_min or on the ground", "low"), ("late", "late"), ("least clearance", "{least_m:.1f} m"),
        ("latest / deadline", "{latest:.3f}"), ("breaches", "breaches"),
        ("plans not flown", lambda r: f"{r['not_flown'] / r['replans']:.1%}"),
    ))  # fmt: skip


def _figure(
    rows: Mapping[HorizonGrid, Mapping[str, Any]],
    by_condition: Mapping[HorizonGrid, Sequence[Record]],
    kinds: Mapping[str, Mapping[str, Any]],
) -> Figure:
    with styled_figure((9.4, 3.9)) as figure:
        arcs, cost, kept = figure.subplots(1, 3, width_ratios=(1.1, 1.1, 0.9))
        _draw_arcs(arcs)
        _draw_costs(cost, rows, by_condition)
        rates_figure_on(kept, list(kinds), [rate(r["broken"], r["missions"]) for r in kinds.values()])
        kept.set_title("Guarantees broken")
    return figure


def _draw_arcs(axes: Axes) -> None:
    """Draw each horizon as a line, with its nodes."""
    for row, grid in enumerate(GRIDS):
        nodes = np.concatenate([[0.0], np.cumsum(grid.lengths)])
        axes.plot(nodes, np.full(len(nodes), row), "-|", color=grid.colour, lw=1.6, ms=9.0, mew=1.6)
        annotate(axes, grid.name, (0.0, row), (0, 8), fontsize=8.0)
    axes.set(xlabel="time ahead [s]", title="Arcs of the horizon", ylim=(len(GRIDS) - 0.6, -0.75), yticks=[])
    axes.grid(False, axis="y")


def _draw_costs(
    axes: Axes, rows: Mapping[HorizonGrid, Mapping[str, Any]], by_condition: Mapping[HorizonGrid, Sequence[Record]]
) -> None:
    """Draw the cost of every mission over that on the uniform grid, and the ratio of the mean costs."""
    reference = _cost(by_condition[UNIFORM])
    axes.axvline(0.0, color=UNIFORM.colour, lw=1.0, ls=":")
    for row, grid in enumerate(GRIDS):
        over = 100.0 * (_cost(by_condition[grid]) / reference - 1.0)
        axes.plot(over, np.full(len(over), row), "o", ms=4.0, color=grid.colour, alpha=0.35, mew=0.0)
        mean = rows[grid]["over_uniform_percent"]
        axes.plot(mean, row, "D", ms=6.0, color=grid.colour, mec="white", mew=0.8)
        if grid is not UNIFORM:
            annotate(axes, f"{mean:+.1f} %", (mean, row), (0, 8), fontsize=8.0, ha="center")
    axes.set_xscale("symlog", linthresh=NEAR)
    axes.set_xticks(COST_TICKS, [f"{tick:g}" for tick in COST_TICKS])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.margins(x=0.12)
    axes.set(xlabel="cost over uniform, 20 s [%]", title="Cost of a mission", ylim=(len(GRIDS) - 0.6, -0.75), yticks=[])
    axes.grid(False, axis="y")
