"""Figure of a solution: the primal variables on the left, the dual ones on the right.

A row for each state (its costate next to it), each control (next to it H_u, and the multiplier of its bounds) and each
path constraint (its multiplier), then the Hamiltonian and the error of each interval over the mesh. Dots are nodes,
dotted lines are limits, and the background is tinted where a limit is active. Beside the Hamiltonian stands what
``check_pontryagin`` says of it.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Protocol

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from mathnavi.controllers.ocp.multipliers import NamedValues
from mathnavi.controllers.ocp.optimality_conditions import PontryaginCheck
from mathnavi.controllers.ocp.problem_functions import Interval
from mathnavi.controllers.ocp.solution_view import SolutionView
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.figure_style import BOUND, GRID, INK, SERIES, STYLE
from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.stretches import stretches

WIDTH, ROW, COMPACT_ROW = 9.4, 1.35, 0.95  # [inches]
MANY_ROWS = 9  # from which on rows are compact
DENSE = 1200  # points of a curve, at least two an interval
ACTIVE = 1e-3  # share of the largest multiplier from which on a limit counts as holding back
MUCH = 0.05  # share of the whole effect of a limit, for example where a costate jumps
LEAST_IMPULSE = 1e-6  # of a limit that holds back at all
NEAR = 0.6  # of the range of a curve: how far from it a limit is still drawn
ENDINGS = (".png", ".svg", ".pdf")
LEAST, MOST = 1e-16, 1e3  # that an axis of errors shows
_BEFORE = 1.0 - 1e-9  # of an interval: just before a node, where a control may jump
STATE, CONTROL, CONSTRAINT, DUAL = SERIES[0], SERIES[1], SERIES[4], SERIES[2]


class JudgedSolution(SolutionView, Protocol):
    """Interface of a solution as a figure needs it: with the verdict on Pontryagin's conditions."""

    @property
    def conditions(self) -> PontryaginCheck | None: ...


def solution_figure(solution: JudgedSolution, names: Sequence[str] = ()) -> Figure:
    """Draw states, controls, path constraints with their multipliers, the Hamiltonian, and the errors over the mesh.

    ``names`` are the states, controls and path constraints that are drawn; empty means all of them.
    """
    problem, m = solution.problem, solution.multipliers
    t = dense_times(solution.t)
    x, u = solution.state(t), solution.control(t)
    times, costates = solution.point_times, m.dynamics.values
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    d = np.array(problem.path.map(len(t))(x.T, u.T, t[None, :], p).full()).T if m.path.names else np.empty((len(t), 0))
    kinds = (
        (problem.states, x, problem.state_bounds, m.states, STATE),
        (problem.controls, u, problem.control_bounds, m.controls, CONTROL),
        (m.path.names, d, problem.path_bounds, m.path, CONSTRAINT),
    )
    chosen = [(kind, k) for kind in kinds for k, name in enumerate(kind[0]) if not names or name in names]
    height = ROW if len(chosen) < MANY_ROWS else COMPACT_ROW
    with matplotlib.rc_context(STYLE | {"axes.titlesize": 9.0, "font.size": 8.5}):
        figure = Figure(figsize=(WIDTH, 0.75 + height * len(chosen) + 1.25 * ROW), layout="constrained")
        figure.get_layout_engine().set(h_pad=0.03, hspace=0.0)  # type: ignore[union-attr, call-arg]
        ratios = [height] * len(chosen) + [1.25 * ROW]
        panels = figure.subplots(len(chosen) + 1, 2, sharex=True, squeeze=False, height_ratios=ratios)
        for (left, right), (kind, k) in zip(panels, chosen, strict=False):
            kind_names, values, limits, multipliers, colour = kind
            _curve(left, t, values[:, k], colour, kind_names[k])
            _nodes(left, solution, t, values[:, k], colour)
            _limits(left, limits, k, values[:, k])
            if kind is kinds[0]:
                _curve(right, times.ravel(), costates[..., k].ravel(), DUAL, f"costate of {kind_names[k]}")
            else:
                subject = "the bounds of " if kind is kinds[1] else ""
                _multiplier(right, times, limits, multipliers, k, subject)
            least = ACTIVE * float(np.abs(costates[..., k]).max()) if kind is kinds[0] else LEAST_IMPULSE
            impulses = _impulses(solution, multipliers, k, least)
            for axes in (left, right):
                _held(axes, solution, multipliers.values[..., k], impulses)
            if kind is kinds[0] and impulses.any():  # by as much the costate jumps or bends
                total = float((multipliers.values[..., k] * solution.point_shares).sum())
                _note(right, f"bound: ∫ μ dt = {total:.4g}", BOUND)
        _hamiltonian(panels[-1, 0], solution)
        _mesh(panels[-1, 1], solution)
        for axes in panels[-1]:
            axes.set(xlabel="time [s]", xlim=(0.0, solution.duration))
        violated = [] if solution.conditions is None else solution.conditions.violated
        title = "; ".join([solution.headline, *(str(each) for each in violated)])
        figure.suptitle(title, x=0.01, ha="left", fontsize=10.5, weight="bold")
    figure.set_facecolor("white")
    return figure


def written(figure: Figure, ending: str) -> bytes:
    """Content of the file of a figure; FieldError for an ending that is not one of a picture."""
    if ending not in ENDINGS:
        raise FieldError(f"file ending {ending!r}; allowed: {', '.join(ENDINGS)}")
    content = io.BytesIO()
    figure.savefig(content, format=ending.removeprefix("."), dpi=150)
    return content.getvalue()


def dense_times(nodes: Array) -> Array:
    """Times (k,) of the points of curves: from each of the nodes (N,) up to just before the next, and the last node."""
    parts = max(2, -(-DENSE // (len(nodes) - 1)))
    inside = np.linspace(0.0, _BEFORE, parts)
    times = (nodes[:-1, None] + inside * np.diff(nodes)[:, None]).ravel()
    return np.append(times, nodes[-1])


def _curve(axes: Axes, t: Array, values: Array, colour: str, title: str) -> None:
    axes.plot(t, values, color=colour, solid_joinstyle="round")
    axes.set_title(title)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    least = 1e-9 * max(1.0, float(np.abs(values).max(initial=0.0)))
    if np.ptp(values) < least:  # a constant: no magnified rounding
        axes.set_ylim(values[0] - 0.5 * max(1.0, abs(values[0])), values[0] + 0.5 * max(1.0, abs(values[0])))


def _nodes(axes: Axes, solution: JudgedSolution, t: Array, values: Array, colour: str) -> None:
    places = np.searchsorted(t, solution.t)
    size = float(np.clip(60.0 / len(places), 1.6, 3.2))
    axes.plot(solution.t, values[places], "o", ms=size, mew=0.0, color=colour, clip_on=False, zorder=3)


def _limits(axes: Axes, limits: Interval, k: int, values: Array) -> None:
    """Draw dotted lines at the limits that are near the curve."""
    low, high = float(values.min()), float(values.max())
    reach = NEAR * max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-12)
    for limit in {float(limits.lower[k]), float(limits.upper[k])}:
        if low - reach <= limit <= high + reach:
            axes.axhline(limit, color=BOUND, ls=(0, (1.0, 1.6)), lw=1.1, zorder=1)


def _impulses(solution: JudgedSolution, multipliers: NamedValues, k: int, least: float) -> Array:
    """Integral (N - 1,) of |μ| over every interval; zero where its total is not more than ``least``."""
    impulses: Array = (np.abs(multipliers.values[..., k]) * solution.point_shares).sum(axis=1)
    return impulses if impulses.sum() > least else 0.0 * impulses


def _held(axes: Axes, solution: JudgedSolution, multipliers: Array, impulses: Array) -> None:
    """Tint the intervals over which a limit is active: at most of their points, or with a large part of its effect."""
    strong = np.abs(multipliers) > ACTIVE * float(np.abs(multipliers).max(initial=0.0))
    held = ((strong.mean(axis=1) > 0.5) | (impulses > MUCH * impulses.sum())) & (impulses > 0.0)
    for first, last in stretches(held):
        axes.axvspan(solution.t[first], solution.t[last], color=BOUND, alpha=0.07, lw=0.0, zorder=0)


def _note(axes: Axes, text: str, colour: str = INK) -> None:
    """Write a note at the right, above the panel."""
    axes.annotate(
        text, (1.0, 1.0), (0, 4), xycoords="axes fraction", textcoords="offset points", ha="right", va="bottom",
        fontsize=7.5, color=colour,
    )  # fmt: skip


def _multiplier(axes: Axes, times: Array, limits: Interval, multipliers: NamedValues, k: int, subject: str) -> None:
    values = multipliers.values[..., k]
    if not (np.isfinite(limits.lower[k]) or np.isfinite(limits.upper[k])):
        axes.set_axis_off()
        axes.annotate(f"{multipliers.names[k]} has no bounds", (0.5, 0.5), xycoords="axes fraction", ha="center")
        return
    _curve(axes, times.ravel(), values.ravel(), DUAL, f"multiplier of {subject}{multipliers.names[k]}")
    axes.fill_between(times.ravel(), 0.0, values.ravel(), color=DUAL, alpha=0.18, lw=0.0)


def _hamiltonian(axes: Axes, solution: JudgedSolution) -> None:
    values, times = solution.hamiltonian, solution.point_times
    _curve(axes, times.ravel(), values.ravel(), INK, "Hamiltonian")
    middle, spread = float(np.median(values)), float(np.ptp(values))
    terms = np.abs(solution.multipliers.dynamics.values * solution.rates).sum(axis=2)
    least = 0.02 * max(abs(middle), float(terms.max()))
    if spread < least:
        axes.set_ylim(middle - least, middle + least)
    judged = [] if solution.conditions is None else solution.conditions.conditions
    found = [str(each) for each in judged if each.name in ("Hamiltonian", "duration")]
    _note(axes, "; ".join([f"{middle:.6g}", *found]))


def _mesh(axes: Axes, solution: JudgedSolution) -> None:
    """Draw the error of each interval on a log scale, and the nodes below."""
    t = solution.t
    errors = solution.interval_errors
    if errors is None:
        axes.set_title(f"mesh: {len(t)} nodes")
        axes.set_yticks([])
        axes.set_ylim(0.0, 1.0)
        low = 0.0
    else:
        shown = np.clip(errors, LEAST, MOST)
        axes.stairs(shown, t, color=SERIES[5], lw=1.2, baseline=None)
        axes.stairs(shown, t, color=SERIES[5], alpha=0.22, fill=True, baseline=shown.min() / 30.0)
        axes.set_yscale("log")
        axes.set_ylim(shown.min() / 30.0, shown.max() * 3.0)
        axes.yaxis.set_major_locator(LogLocator(numticks=5))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_title("error of each interval")
        counts = np.count_nonzero(solution.point_shares, axis=1)
        points = f"{counts.min()} to {counts.max()}" if np.ptp(counts) else str(counts[0])
        _note(axes, f"{len(t)} nodes, {points} points in each interval, largest {errors.max():.1g}")
        low = shown.min() / 30.0
    axes.plot(t, np.full(len(t), low), "|", ms=9.0, mew=0.8, color=INK, clip_on=False, zorder=4)
    axes.grid(axis="y", color=GRID)
