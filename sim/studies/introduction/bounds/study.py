"""Distance of estimators to the posterior Cramér-Rao bound, and the price of an update."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

from mathnavi.renders.figures import BOUND, STYLE
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.studies.framework.jobs import Jobs
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.introduction.bounds.runs import (
    DECLARED,
    SCENARIOS,
    SLOW_ERRORS,
    BoundErrors,
    BoundRun,
    compared,
)

NEAR = 1.15  # times the bound, which counts as reached
CHANCE = 3.0  # standard errors
FEWEST = 5  # runs that a standard error needs
COLOURS = ("#0d5fa8", "#e07b00", "#0f9472", "#7a4fb5", "#8a6d1f", "#6b7a8c")
UNITS = {"mechanism": "rad/s"}  # of the errors; else m
DISTURBED = ("ranges", "flight", "missile")  # scenarios with process noise


@configuration
class BoundsConfig:
    """Sample sizes: runs."""

    seeds: Count = 10
    """of each scenario; of one whose errors change slowly several times as many"""
    scenarios: Count = len(SCENARIOS)
    """at most"""
    shortened: Count = 1
    """times that a run is shorter"""


@dataclass(frozen=True)
class Efficiency:
    """An estimator over all runs of a scenario."""

    scenario: str
    estimator: str
    value: float  # root of the sum of squared errors over that of their bounds
    standard_error: float  # of the efficiency, by the jackknife over runs; infinite of too few
    ok: float  # share of the estimates with the status OK
    cost: float  # [us] an update
    t: Array  # (m,) [s] middles of the pieces of a run
    course: Array  # (m,) root mean square error over each, of all runs
    least: Array  # (m,) and the bound on it


class Bounds:
    """Every estimator on every scenario against the posterior Cramér-Rao bound."""

    Config = BoundsConfig
    quick = BoundsConfig(seeds=2, shortened=2)
    title = "Estimators at the posterior Cramér-Rao bound"
    on_terrain = False

    @staticmethod
    def run(config: BoundsConfig, setup: Setup) -> StudyResult:
        """Run the study."""
        jobs = Jobs()
        for name in list(SCENARIOS)[: config.scenarios]:
            seconds, runs = SCENARIOS[name][2] / config.shortened, config.seeds * SLOW_ERRORS.get(name, 1)
            jobs.add(name, compared, [BoundRun(name, seed, seconds) for seed in range(runs)])
        found = efficiencies(jobs.done(setup))
        return StudyResult(
            summary=(
                "Every system moves with the very noise that is declared. Efficiency: the root of the sum of squared "
                "errors over that of the posterior Cramér-Rao bounds, over the second half of every run: of the "
                "position, and of the mechanism's joint velocities. Estimators have their standard fields; "
                f"{DECLARED} has the gusts and the exact start that are declared, without a reserve for a wrong mass. "
                "On the mechanism no noise acts, so that its bound is that of "
                "its start as a parameter, to which an estimator that allows for errors of its model cannot come.",
            ),
            rows=[
                {"scenario": e.scenario, "estimator": e.estimator, "efficiency": e.value,
                 "standard_error": e.standard_error, "ok": e.ok, "update_us_wall_s": e.cost}
                for e in found
            ],
            tables=(_table(found),),
            figure=_figure(found),
            caption="Left: root mean square error over its posterior Cramér-Rao bound, against the CPU time of an "
            "update. Right: root mean square errors of all runs over time; in the mean of very many runs none is in "
            "what is shaded, below the bound.",
            claims=claims(found),
        )  # fmt: skip


def efficiencies(found: Mapping[str, Sequence[Sequence[BoundErrors]]]) -> list[Efficiency]:
    """Efficiency of each estimator on each scenario, of its errors run by run."""
    made = []
    for scenario, runs in found.items():
        for errors in zip(*runs, strict=True):
            squares, bounds = np.array([e.squares for e in errors]), np.array([e.bounds for e in errors])
            value = math.sqrt(squares.sum() / bounds.sum())
            n, spread = len(errors), math.inf
            if n >= FEWEST:
                without = np.sqrt((squares.sum() - squares) / (bounds.sum() - bounds))
                spread = float(np.sqrt((n - 1) * np.mean(np.square(without - without.mean()))))
            ok, cost = float(np.mean([e.ok for e in errors])), float(np.median([e.cost for e in errors]))
            course, least = (
                np.sqrt(np.mean(part, axis=0)) for part in zip(*((e.course, e.least) for e in errors), strict=True)
            )
            name, t = errors[0].estimator, np.array(errors[0].t)
            made.append(Efficiency(scenario, name, value, spread, ok, cost, t, course, least))
    return made


def claims(found: Sequence[Efficiency]) -> list[Claim]:
    """Evaluate the claims of the study."""
    best = [
        min((e for e in found if e.scenario == name), key=lambda e: e.value)
        for name in dict.fromkeys(e.scenario for e in found)
    ]
    far = [e for e in best if e.scenario in DISTURBED and e.value > NEAR]
    below = [e for e in found if e.value + CHANCE * e.standard_error < 1.0]
    least = min(found, key=lambda e: e.value)
    return [
        Claim(
            "bounds.efficiency", "target", "Estimators reach the posterior Cramér-Rao bound.", "C.5",
            f"where process noise acts the best estimator's error is at most {NEAR:g} times the bound",
            ", ".join(f"{e.scenario}: {e.value:.2f} ({e.estimator})" for e in best),
            not far,
        ),
        Claim(
            "bounds.valid", "target", "No estimator beats the bound.", "C.5",
            f"no efficiency is below 1 by more than {CHANCE:g} standard errors",
            f"the least is {least.value:.2f} ± {least.standard_error:.2f} ({least.estimator}, {least.scenario})",
            not below,
        ),
    ]  # fmt: skip


def _table(found: Sequence[Efficiency]) -> Table:
    rows = [
        (e.scenario, e.estimator, f"{e.value:.3g} ± {e.standard_error:.2g}", f"{100.0 * e.ok:.1f}%", f"{e.cost:.0f}")
        for e in found
    ]
    return Table("Error over the bound", ("scenario", "estimator", "efficiency", "OK", "µs an update"), rows)


def _figure(found: Sequence[Efficiency]) -> Figure:
    names = list(dict.fromkeys(e.scenario for e in found))
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(12.0, 3.1 * len(names)), layout="constrained")
        drawn = page.subplots(len(names), 2, squeeze=False, width_ratios=(1.0, 1.5))
        for (against_cost, over_time), name in zip(drawn, names, strict=True):
            of_scenario = [e for e in found if e.scenario == name]
            _draw_efficiency(against_cost, of_scenario)
            _draw_course(over_time, of_scenario)
            against_cost.set_title(name)
        drawn[-1, 0].set_xlabel("CPU time of an update [µs]")
        drawn[-1, 1].set_xlabel("time [s]")
    return page


def _draw_efficiency(axes: Axes, found: Sequence[Efficiency]) -> None:
    axes.axhline(1.0, color=BOUND, ls=":", lw=1.2)
    for k, e in enumerate(found):
        spread = e.standard_error if math.isfinite(e.standard_error) else 0.0
        axes.errorbar(
            e.cost, e.value, min(spread, 0.9 * e.value), fmt="o", ms=6, capsize=3, color=COLOURS[k % len(COLOURS)]
        )
    axes.set(xscale="log", yscale="log", ylabel="error / bound")
    axes.margins(x=0.2, y=0.2)
    lowest, highest = axes.get_ylim()
    axes.yaxis.set_major_locator(MaxNLocator(5) if highest < 10.0 * lowest else LogLocator())
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())


def _draw_course(axes: Axes, found: Sequence[Efficiency]) -> None:
    bound = found[0]
    axes.fill_between(bound.t, bound.least, 1e-12, color=BOUND, alpha=0.12, lw=0.0)
    axes.plot(bound.t, bound.least, color=BOUND, lw=2.4, label="Cramér-Rao bound")
    for k, e in enumerate(found):
        axes.plot(e.t, e.course, color=COLOURS[k % len(COLOURS)], lw=1.4, label=e.estimator)
    finite = bound.least[np.isfinite(bound.least) & (bound.least > 0.0)]
    if len(finite):
        axes.set_ylim(bottom=0.3 * float(finite.min()))
    unit = UNITS.get(bound.scenario, "m")
    axes.set(yscale="log", xlim=(bound.t[0], bound.t[-1]), ylabel=f"RMS error [{unit}]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
