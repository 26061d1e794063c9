"""A run of a Lagrangian system on one page: whether the velocity was found, pictures, errors and signals over time."""

from __future__ import annotations

import math

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.renders import page
from mathnavi.renders.figures import BOUND, INK, STYLE, canvas, thinned
from mathnavi.renders.lagrangian.drawing import amount, highlight, is_good, slow_until, subject, verdict
from mathnavi.renders.lagrangian.panel import symbol, with_unit
from mathnavi.renders.lagrangian.path_drawing import ESTIMATE, GEODESIC, REFERENCE, TRUTH, PathDrawing
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.views import chart_of
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.report import Headline, event_figures, innovation_figures, run_page, still_block, why

SMALLEST = 1e-12  # that a logarithmic axis shows
FIRST = 0.15  # of a run that is shown enlarged, where nothing is found at its start
DIPS = 0.02  # share of the components of the error that are below the axis
MOST_IN_A_ROW = 4  # names of a legend
PATH_LOOKS = 3  # moments at which a path is drawn
COMPONENTS = ("#0d6bf2", "#db1ab8", "#05947a", "#8a5a00", "#6b4fc8", "#c2183b", "#5b6b7a")
_LEGEND = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}


def report(run: LagrangianRun) -> Markup:
    """Return the report's HTML."""
    config = run.log.config
    title = f"{config['scenario']}, {run.space or run.mechanism}, seed {config['seed']}"
    errors = page.section("Errors", *page.figure_blocks(_errors(run)))
    signals = page.section("Signals", *page.figure_blocks(_signals(run)))
    return run_page(run, _headline(run, title), (*_pictures(run), errors), (signals,))


def _headline(run: LagrangianRun, title: str) -> Headline:
    summary, unit = run.log.summary, run.unit
    tiles: dict[str, object] = {
        f"velocity error, RMS once settled (allowed {run.tolerance:g})": _measured(summary.get("velocity_rms"), unit),
        "at the end": _measured(float(run.velocity_error[-1]), unit),
    }
    if summary.get("efficiency") is not None:
        tiles["over the Cramér-Rao bound"] = page.number(summary["efficiency"])
    if run.has_begun_wrong:
        tiles["at the start"] = _measured(float(run.velocity_error[0]), unit)
        tiles["found to one percent after"] = quantity("found_from_s", summary.get("found_from_s"))
    if "attitude_rms_rad" in summary:
        tiles["angle to the reference, RMS once settled"] = quantity("attitude_rms_rad", summary["attitude_rms_rad"])
        tiles["settled on the reference after"] = quantity("settled_at_s", summary.get("settled_at_s"))
    ending = verdict(run)
    sentence = f"{ending[0].upper()}{ending[1:]}{why(summary)}. What moves: {subject(run)}."
    return Headline(f"{title}: {ending}", sentence, is_good(run), tiles)


def _measured(value: float | None, unit: str) -> str:
    return page.UNKNOWN if value is None else f"{amount(float(value))} {unit}"


def _pictures(run: LagrangianRun) -> list[Markup]:
    moment = sum(highlight(run)) / 2.0
    drawn = f" The errors of its position are drawn {run.magnification:,.0f} times as large as they are."
    note = drawn if run.magnification > 1.0 else ""
    blocks = [
        still_block(
            run.directory, "panel", moment, f"What moves and its estimate, {moment:.2f} s after the start.",
            f"After {moment:.2f} s: truth and estimate, and the velocity up to then.{note}",
        )
    ]  # fmt: skip
    if run.space is not None:
        where = "in Poincaré's disc" if run.space == "hyperbolic-plane" else "on the sphere"
        words = f"Truth and estimate {where}, and the geodesic from one to the other.{note}"
        blocks.append(page.figure_block(path_figure(run), "path", words))
    return blocks


def _errors(run: LagrangianRun) -> list[Drawn]:
    words = "Each component of the velocity, true and estimated."
    drawn = [("velocity", velocity_figure(run), words)]
    words = "The error of the velocity, moved in parallel to where the system is, its components, and the distance."
    if run.space == "body":
        words += " The distance of attitudes is half the angle between them."
    drawn.append(("errors", errors_figure(run), words))
    B = run.lyapunov_gain
    if B is not None:
        words = (
            f"V = |Δv|²/2 + B S and W = |Δv|²/2 + 3/2 B |s|² − √B ⟨s, Δv⟩ with B = {B:g} 1/s²: with constant gains it "
            "is W that shows that the velocity converges too."
        )
        drawn.append(("lyapunov", lyapunov_figure(run, B), words))
    return drawn


def _signals(run: LagrangianRun) -> list[Drawn]:
    words = "What acted on it"
    if run.innovation is not None:
        words += ", and the distance between each reading and its prediction"
    drawn = [("signals", signals_figure(run), f"{words}."), *innovation_figures(run.log.arrays, run.duration)]
    return [*drawn, *event_figures(run, run.duration)]


def first_part(run: LagrangianRun) -> float:
    """Time [s] up to which the start of a run is shown."""
    return slow_until(run) or FIRST * run.duration


def path_figure(run: LagrangianRun) -> Figure:
    """The path in its space at three moments, the last one the end."""
    chart = chart_of(run)
    assert chart is not None
    begin = first_part(run)
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 3.4)
        drawn = figure.subplots(1, PATH_LOOKS)
        for axes, t in zip(drawn, (0.25 * begin, begin, run.duration), strict=True):
            PathDrawing(run, axes, chart).show(t)
            axes.set_title(f"after {t:.2g} s", loc="center")
    return figure


def velocity_figure(run: LagrangianRun) -> Figure:
    """Each component of the velocity, true and estimated: at the start, and over the whole run."""
    names = run.velocity_names
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 0.7 + 1.15 * len(names))
        drawn = figure.subplots(len(names), 2, sharex="col", squeeze=False, width_ratios=(1.0, 1.7))
        true, found = run.velocity
        for column, end in enumerate((first_part(run), run.duration)):
            i = _until(run, end)
            known = np.where(run.errors.found[i, None] > 0.0, found[i], np.nan)
            for row, name in enumerate(names):
                axes = drawn[row, column]
                axes.plot(run.t_estimate[i], true[i, row], color=TRUTH, lw=2.6, label="true")
                axes.plot(run.t_estimate[i], known[:, row], color=ESTIMATE, lw=1.2, label="estimated")
                axes.set_xlim(0.0, end)
                if not column:
                    axes.set_ylabel(with_unit(name))
            drawn[-1, column].set_xlabel("time [s]")
        drawn[0, 0].set_title("Velocity: at the start")
        drawn[0, 1].set_title("over the whole run")
        drawn[0, 1].legend(ncols=2, **_LEGEND)
        figure.align_ylabels(drawn[:, 0])
    return figure


def errors_figure(run: LagrangianRun) -> Figure:
    """The velocity error, its length and each component, and the distance of the positions, on logarithmic axes."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 5.4)
        drawn = figure.subplots(3, 2, sharex="col", sharey="row", width_ratios=(1.0, 1.7))
        names = run.states[-run.manifold.dimension :]
        for column, end in enumerate((first_part(run), run.duration)):
            length, parts, place = drawn[:, column]
            i = _until(run, end)
            t = run.t_estimate[i]
            _log(length, t, run.velocity_error[i], INK, 1.2, "error")
            if run.least_deviation is not None:
                _log(length, t, run.least_deviation[i], BOUND, 1.1, "σ of the Cramér-Rao bound")
            length.axhline(run.tolerance, color=BOUND, ls=":", lw=1.1)
            for k, name in enumerate(names):
                _log(
                    parts, t, np.abs(run.errors.components[i, k]), COMPONENTS[k % len(COMPONENTS)], 0.9, symbol(name)[0]
                )
            _log(place, t, run.errors.position[i], ESTIMATE, 1.2)
            place.set(xlabel="time [s]", xlim=(0.0, end))
        drawn[0, 0].set(title="Errors: at the start", ylabel=f"velocity\n[{run.unit}]")
        drawn[0, 1].set_title("over the whole run")
        drawn[1, 0].set_ylabel(f"components\n[{run.unit}]")
        drawn[2, 0].set_ylabel(f"distance of\npositions {distance_unit(run)}")
        small = np.abs(run.errors.components[run.errors.components != 0.0])
        if small.size:  # a component that changes its sign dips to nothing
            drawn[1, 0].set_ylim(bottom=max(float(np.quantile(small, DIPS)), SMALLEST))
        if run.least_deviation is not None:
            drawn[0, 1].legend(ncols=2, **_LEGEND)
        columns = len(names) if len(names) <= MOST_IN_A_ROW else math.ceil(len(names) / 2)
        drawn[1, 1].legend(ncols=columns, **_LEGEND, handlelength=1.2, columnspacing=1.0)
        drawn[0, 1].annotate("allowed", (1.0, run.tolerance), (-2, 3), ha="right", color=BOUND,
                             xycoords=("axes fraction", "data"), textcoords="offset points")  # fmt: skip
        figure.align_ylabels(drawn[:, 0])
    return figure


def distance_unit(run: LagrangianRun) -> str:
    """Unit of a distance: of attitudes it is half the angle, of a mechanism it is in its metric, of points a number."""
    return {"body": "[rad]", None: "[√(kg m²)]"}.get(run.space, "")


def lyapunov_figure(run: LagrangianRun, B: float) -> Figure:
    """V of Theorem D.2, and W."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 2.9)
        drawn = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 1.7))
        for axes, end in zip(drawn, (first_part(run), run.duration), strict=True):
            i = _until(run, end)
            for values, name, colour in ((run.errors.V(B), "V", INK), (run.errors.W(B), "W", GEODESIC)):
                _log(axes, run.t_estimate[i], values[i], colour, 1.2, name)
            axes.set(xlabel="time [s]", xlim=(0.0, end))
        drawn[0].set(title="Lyapunov functions: at the start", ylabel=f"[{_squared(run)}]")
        drawn[1].set_title("over the whole run")
        drawn[1].legend(ncols=2, **_LEGEND)
    return figure


def _squared(run: LagrangianRun) -> str:
    return "J" if run.space is None else "1/s²"


def signals_figure(run: LagrangianRun) -> Figure:
    """The inputs, and the distance of each reading from its prediction."""
    inputs = [with_unit(name) for name in run.inputs]
    with matplotlib.rc_context(STYLE):
        count = len(inputs) + (run.innovation is not None)
        figure = canvas(9.4, 0.7 + 1.05 * count)
        drawn = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
        i = thinned(len(run.t), 0)
        for axes, name, values in zip(drawn, inputs, run.log.u.T, strict=False):
            axes.step(run.t[i], values[i], where="post", color=REFERENCE, lw=1.2)
            axes.set_ylabel(name)
        if run.innovation is not None:
            k = thinned(len(run.t_estimate), 0)
            _log(drawn[-1], run.t_estimate[k], run.innovation[k], ESTIMATE, 0.8)
            drawn[-1].set_ylabel(f"innovation\n{distance_unit(run)}")
        drawn[0].set_title("Inputs, and the innovation" if run.innovation is not None else "Inputs")
        drawn[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
        figure.align_ylabels(drawn)
    return figure


def _until(run: LagrangianRun, end: float) -> Integers:
    """(m,) which estimates are drawn of those up to a time."""
    shown = np.flatnonzero(run.t_estimate <= end + 1e-9)
    chosen: Integers = shown[thinned(len(shown), 0)]
    return chosen


def _log(axes: Axes, t: Array, values: Array, colour: str, width: float, name: str = "") -> None:
    positive = np.where(np.isfinite(values) & (values > SMALLEST), values, np.nan)
    axes.plot(t, positive, color=colour, lw=width, label=name)
    if np.isfinite(positive).any():
        axes.set_yscale("log")
        axes.yaxis.set_minor_formatter(NullFormatter())
