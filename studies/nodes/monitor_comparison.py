"""Comparison of monitor functions (B.3): accuracy of a solution with the same number of nodes.

Problems are solved on N nodes, by the Hermite-Simpson scheme and by Radau collocation of order 5, after one and three
redistributions of the uniform solution, without the replay gate. Two figures are reported as ratios to the uniform
solution by the same scheme at the same N: the control error, the relative L2 distance of the controls over their scales
to a solution on many nodes, and the miss of the replay in the true dynamics. The thesis claims that the arclength is
the most efficient monitor function.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import matplotlib
import numpy as np
from annotated_types import Interval
from matplotlib.figure import Figure

from mathnavi.controllers.ocp.methods.adaptation import HERMITE_SIMPSON, redistribute, redistributed, solve
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, UNIFORM, Monitor
from mathnavi.controllers.ocp.problems.library import MISSILES, PROBLEMS, KnownOptimum
from mathnavi.controllers.ocp.residual import RESIDUAL
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.renders.figures import STYLE, canvas
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import heat_map
from mathnavi.studies.framework.study import Setup, StudyResult
from mathnavi.studies.nodes.missile_nodes import control_error

ROUNDS = (1, 3)
RADAU = RadauIIA(3)
SCHEMES: tuple[Scheme, ...] = (HERMITE_SIMPSON, RADAU)
LEAST_MISS = 1e-9  # scaled: where the uniform solution replays better than this, there is no ratio to speak of
FAILED, NO_MISS = "failed", "no miss"  # what stands where there is no ratio
BOOKS = PROBLEMS | MISSILES
NAMES = (
    "missile, FAST", "missile, SM2", "hypersensitive, short", "Bryson-Denham", "van der Pol", "cart-pole",
    "brachistochrone", "Goddard",
)  # fmt: skip


def _raw_arclength(solution: Solution, tau: Array, epsilon: float) -> Array:
    """Return w = sqrt(ε + |x'|^2) with the states in SI units."""
    rates = solution.scaled_derivative(tau, 1) * solution.problem.state_scale
    w: Array = np.sqrt(epsilon + (rates**2).sum(axis=1))
    return w


def _control_arclength(solution: Solution, tau: Array, epsilon: float) -> Array:
    """Return w = sqrt(ε + |u~'|^2), u~ = u over its scale: a user's function that resolves the control."""
    step = 1e-4
    ends = [np.clip(tau + side * step, 0.0, 1.0) for side in (-0.5, 0.5)]
    u_0, u_1 = (solution.control(end * solution.duration) / solution.problem.control_scale for end in ends)
    w: Array = np.sqrt(epsilon + (((u_1 - u_0) / (ends[1] - ends[0])[:, None]) ** 2).sum(axis=1))
    return w


MONITORS = (
    ARCLENGTH,
    Monitor("arclength, SI units", _raw_arclength, None, epsilon=0.01),
    CURVATURE,
    LOCAL_ERROR,
    RESIDUAL,
    Monitor("arclength of the control", _control_arclength, None, epsilon=0.01),
    UNIFORM,
)


@configuration
class MonitorsConfig:
    """Sample sizes: problems and grids that are solved."""

    nodes: Annotated[int, Interval(ge=4, le=400)] = 20
    """number of nodes"""
    reference_nodes: Annotated[int, Interval(ge=20, le=4000)] = 301
    """number of nodes of the reference solution of the controls"""
    problems: Annotated[int, Interval(ge=1, le=len(NAMES))] = len(NAMES)
    """number of problems"""

    def __post_init__(self) -> None:
        if self.reference_nodes < 5 * self.nodes:
            raise FieldError(f"reference_nodes = {self.reference_nodes}; allowed: at least five times the nodes")


class Monitors:
    """Monitor functions on the missile and on problems of the literature (B.3)."""

    Config = MonitorsConfig
    quick = MonitorsConfig(reference_nodes=151)
    title = "Monitor functions"
    on_terrain = False

    @staticmethod
    def run(config: MonitorsConfig, setup: Setup) -> StudyResult:
        names = NAMES[: config.problems]
        solved = setup.compute(monitor_rows, names, nodes=config.nodes, reference_nodes=config.reference_nodes)
        rows = [row for of_problem in solved for row in of_problem]
        return StudyResult(
            summary=(
                f"N = {config.nodes}, by {' and by '.join(scheme.name for scheme in SCHEMES)}; after one and after "
                "three redistributions, without the replay gate. Ratios to the uniform solution by the same scheme at "
                f"the same N; the reference of the controls, by {HERMITE_SIMPSON.name}, has {config.reference_nodes} "
                "nodes. 'Arclength of the control' is a monitor function that is given from "
                "outside, in the few lines that a user would write.",
            ),
            rows=rows,
            tables=tuple(_table(rows, scheme) for scheme in SCHEMES),
            figure=_figure(rows, names, config.nodes),
            caption="Errors over those of the uniform grid with as many nodes: blue is better, red is worse. Grey: the "
            "solve failed, or there is no miss to compare with, as the dynamics are linear.",
            claims=(_claim(rows, names), _claim_of_schemes(rows)),
        )


def monitor_rows(name: str, nodes: int, reference_nodes: int) -> list[dict[str, Any]]:
    """A job: a row for each scheme, monitor function and number of redistributions, uniform grids first."""
    known: KnownOptimum = BOOKS[name]
    problem = known.problem()
    evens = [solve(problem, nodes, scheme=scheme) for scheme in SCHEMES]
    reference = redistribute(problem, reference_nodes, LOCAL_ERROR, rounds=3, guess=evens[0])
    rows = []
    for scheme, even in zip(SCHEMES, evens, strict=True):
        rows.append(_row(name, "uniform grid", 0, even, even, reference))
        for monitor in MONITORS:
            current = even
            for done in range(1, max(ROUNDS) + 1):
                if current.solved:
                    grid = redistributed(current, nodes, monitor)
                    current = solve(problem, grid, scheme=scheme, guess=current)
                if done in ROUNDS:
                    rows.append(_row(name, monitor.name, done, current, even, reference))
    return rows


def _row(
    name: str, monitor: str, rounds: int, solution: Solution, even: Solution, reference: Solution
) -> dict[str, Any]:
    error, error_even = (control_error(s, reference) if s.solved else math.nan for s in (solution, even))
    miss, miss_even = (s.replay.miss if s.solved and s.replay is not None else math.nan for s in (solution, even))
    return {
        "problem": name,
        "transcription": solution.scheme.name,
        "monitor": monitor,
        "redistributions": rounds,
        "status": solution.status.name.lower(),
        "control_error": error,
        "control_error_ratio": error / error_even,
        "replay_miss": miss,
        "replay_miss_ratio": miss / miss_even if miss_even > LEAST_MISS else math.nan,
        "cost_error": BOOKS[name].error(solution.cost),
        "reference_status": reference.status.name.lower(),
        "widest_over_narrowest": float(solution.grid.widths.max() / solution.grid.widths.min()),
    }


def _figure_of_problems(
    rows: Sequence[Mapping[str, Any]], monitor: str, rounds: int, figure: str, scheme: Scheme = HERMITE_SIMPSON
) -> Array:
    """Return a figure (n,) of every problem, in order."""
    wanted = (scheme.name, monitor, rounds)
    return np.array(
        [row[figure] for row in rows if (row["transcription"], row["monitor"], row["redistributions"]) == wanted]
    )


def _mean(ratios: Array) -> float:
    """Return the geometric mean; infinite if a solve failed."""
    return float(np.exp(np.log(ratios).mean())) if np.isfinite(ratios).all() else math.inf


def _means(rows: Sequence[Mapping[str, Any]], scheme: Scheme) -> dict[str, float]:
    """Return the geometric mean of the control error's ratio to uniform after all rounds, by monitor function."""
    others = [monitor.name for monitor in MONITORS if monitor is not UNIFORM]
    return {name: _mean(_figure_of_problems(rows, name, max(ROUNDS), "control_error_ratio", scheme)) for name in others}


def _claim(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> Claim:
    others = [monitor for monitor in MONITORS if monitor is not UNIFORM]
    every = np.array([_figure_of_problems(rows, m.name, max(ROUNDS), "control_error_ratio") for m in others])
    ranked = np.nan_to_num(every, nan=np.inf)
    first = int(((ranked.argmin(axis=0) == 0) & np.isfinite(ranked[0])).sum())
    by_monitor = ", ".join(f"{name} {mean:.2f}" for name, mean in _means(rows, HERMITE_SIMPSON).items())
    return Claim(
        "B.arclength-best-problems", "printed",
        "The arclength monitor function is the most efficient among all choices.", "B.3",
        f"the least control error of {len(others)} monitor functions on each of {len(names)} problems",
        f"the least on {first} of {len(names)}; geometric mean of the ratio to uniform after {max(ROUNDS)} "
        f"redistributions: {by_monitor}",
        first == len(names),
    )  # fmt: skip


def _claim_of_schemes(rows: Sequence[Mapping[str, Any]]) -> Claim:
    means = {scheme: _means(rows, scheme) for scheme in SCHEMES}
    best = {scheme: min(own, key=lambda name: own[name]) for scheme, own in means.items()}
    by_monitor = ", ".join(f"{name} {mean:.2f}" for name, mean in means[RADAU].items())
    return Claim(
        "ocp.monitors-radau", "target",
        "The monitor function that is the best by Hermite-Simpson's scheme is the best on Radau grids too.", "B.3",
        f"the same has the least geometric mean, over the problems, of the control error's ratio to uniform after "
        f"{max(ROUNDS)} redistributions",
        f"{best[HERMITE_SIMPSON]} by {HERMITE_SIMPSON.name}; {best[RADAU]} by {RADAU.name}: {by_monitor}",
        len(set(best.values())) == 1 and all(math.isfinite(means[scheme][name]) for scheme, name in best.items()),
    )  # fmt: skip


def _table(rows: Sequence[Mapping[str, Any]], scheme: Scheme) -> Table:
    columns = ("monitor function", "redistributions", "control error", "largest", "replay miss", "largest")
    cells = []
    for monitor in MONITORS:
        for rounds in ROUNDS:
            error = _figure_of_problems(rows, monitor.name, rounds, "control_error_ratio", scheme)
            miss = _figure_of_problems(rows, monitor.name, rounds, "replay_miss_ratio", scheme)
            miss = miss[np.isfinite(miss)]
            shown = [_mean(error), float(np.nan_to_num(error, nan=np.inf).max())]
            shown += [_mean(miss), float(miss.max())] if len(miss) else [math.nan, math.nan]
            cells.append((monitor.name, str(rounds), *(f"{value:.3g}" for value in shown)))
    title = f"{scheme.name}, ratios to uniform nodes: geometric means over the problems, and the largest"
    return Table(title, columns, cells)


def _figure(rows: Sequence[Mapping[str, Any]], names: Sequence[str], nodes: int) -> Figure:
    monitors = [monitor.name for monitor in MONITORS if monitor is not UNIFORM]
    shown = [("control error", "control_error_ratio"), ("replay miss", "replay_miss_ratio")]
    panels = {}
    of_panels: list[tuple[Scheme, tuple[str, str], int]] = [
        (HERMITE_SIMPSON, *each) for each in itertools.product(shown, ROUNDS)
    ]
    of_panels += [(RADAU, each, max(ROUNDS)) for each in shown]
    for letter, (scheme, (what, key), rounds) in zip("abcdef", of_panels, strict=True):
        values, errors = (
            np.array([_figure_of_problems(rows, monitor, rounds, name, scheme) for monitor in monitors]).T
            for name in (key, "control_error_ratio")
        )
        texts = [
            [
                _ratio(value) if math.isfinite(value) else NO_MISS if math.isfinite(error) else FAILED
                for value, error in row
            ]
            for row in np.stack([values, errors], axis=-1)
        ]
        by = "Radau, " if scheme is RADAU else ""
        panels[f"({letter}) {by}{what}, {rounds} redistribution{'s' * (rounds > 1)}"] = values, texts
    with matplotlib.rc_context(STYLE):
        figure = canvas(10.2, 3.2 + 0.9 * len(names))
        figure.suptitle(
            f"What each monitor function makes of {nodes} nodes: errors over those of uniform nodes", x=0.01, ha="left",
            size=11.0, weight="bold",
        )  # fmt: skip
        cells = figure.subplots(3, 2, sharex=True, sharey=True)
        for axes, (title, (values, texts)) in zip(cells.ravel(), panels.items(), strict=True):
            colours = heat_map(axes, values, names, monitors, texts, decades=(2.0, 2.0))
            axes.set_title(title)
        bar = figure.colorbar(colours, ax=cells, shrink=0.6, pad=0.015, aspect=32, extend="both")
        bar.set_ticks([-2, -1, 0, 1, 2], labels=["0.01", "0.1", "1", "10", "100"])
        bar.set_label(f"ratio to uniform nodes, N = {nodes}")
        bar.outline.set_visible(False)
        words = (
            f"(a) to (d): {HERMITE_SIMPSON.name}; (e), (f): {RADAU.name}. Blue: better than uniform nodes, red: worse\n"
            f"{NO_MISS}: none to compare with, as the dynamics are linear"
        )
        figure.supxlabel(words, size=8.5)
    return figure


def _ratio(value: float) -> str:
    return f"{value:.2g}" if value < 100.0 else f"{value:.0f}"
