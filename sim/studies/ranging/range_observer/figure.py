"""The picture of the study ``range-observer``: Figures C.3 to C.8 again, as printed and with feed-forward."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator, NullFormatter

from mathnavi.estimators.ranging.observer import FeedForward
from mathnavi.renders.figures import GRID, INK, STYLE
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.renders.ranging.shapes import outline
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.ranging import POSITION
from mathnavi.sim.studies.framework.heat_map import readable_on
from mathnavi.sim.studies.ranging.observability.maps import STANDARD
from mathnavi.sim.studies.ranging.range_observer.claims import LockResults, locked, median
from mathnavi.sim.studies.ranging.range_observer.observer_run import ObserverRun
from mathnavi.sim.studies.ranging.range_observer.runs import MOTIONS, START

TRUTH = hexadecimal(COLOURS[SceneElement.DRIVEN])
COLOUR: Mapping[FeedForward, str] = {
    "none": hexadecimal(COLOURS[SceneElement.HYPOTHESIS]),
    "s": hexadecimal(COLOURS[SceneElement.ESTIMATE]),
    "rho_dot": hexadecimal(COLOURS[SceneElement.RAY]),
    "manifold": "#101824",
}
NAMES: Mapping[FeedForward, str] = {"none": "as printed", "s": "s", "rho_dot": "rho_dot", "manifold": "manifold"}
SET_COLOURS = dict(zip(("2s", "2t", "3", "4"), ("#0d5fa8", "#c2183b", "#e07b00", "#0f9472"), strict=True))
SHARES = LinearSegmentedColormap.from_list("share", ("#b3202f", "#f0a07c", "#f4f1ea", "#6fb0dc", "#0d5fa8"))
LEAST = 1e-15  # of an error that is drawn
PARTS = ("$s_1$", "$s_2$", "φ")
PAIR: tuple[FeedForward, FeedForward] = ("none", "s")
"""what is drawn where all would be too many"""


@dataclass(frozen=True, eq=False)
class ShownRuns:
    """Runs that are drawn, by feed-forward: all without noise; as printed and one other with it."""

    exact: Mapping[FeedForward, ObserverRun]
    noisy: Mapping[FeedForward, ObserverRun]


def range_observer_figure(drawn: ShownRuns, e: LockResults) -> Figure:
    """Draw the figure of the study, a row after the other."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(12.4, 16.0), layout=ConstrainedLayoutEngine(w_pad=0.09, h_pad=0.07))
        rows = np.array(figure.subfigures(5, 1, height_ratios=(0.85, 1.1, 0.95, 1.1, 1.1), hspace=0.03))
        _components(rows[0].subplots(1, 3), drawn.exact)
        field, in_x = rows[1].subplots(1, 2, width_ratios=(1.75, 1.0))
        _field(field, drawn.exact, noisy=False)
        _errors(in_x, drawn.exact, "position", "(c) error of the position [m] (C.6)")
        in_z, value, plane = rows[2].subplots(1, 3)
        _errors(in_z, drawn.exact, "in_z", "(d) error of a component of z [rad] (C.4)")
        _values(value, drawn.exact)
        _plane(plane, drawn.noisy)
        field, noise = rows[3].subplots(1, 2, width_ratios=(1.75, 1.0))
        _field(field, drawn.noisy, noisy=True)
        _noise(noise, drawn.noisy)
        shares, gains = rows[4].subplots(1, 2)
        _shares(shares, e)
        _by_gain(gains, e)
    return figure


# ---- without noise


def _components(panels: Sequence[Axes], runs: Mapping[FeedForward, ObserverRun]) -> None:
    for k, (axes, name) in enumerate(zip(panels, PARTS, strict=True)):
        for feedforward, width in zip(PAIR, (1.6, 2.6), strict=True):
            run = runs[feedforward]
            axes.plot(run.t, run.z[:, k], color=COLOUR[feedforward], lw=width)
        run = runs["s"]
        axes.plot(run.t, run.z_true[:, k], color=TRUTH, lw=1.4, ls=(0, (4, 2)))
        axes.set(xlabel="time [s]", xlim=(0.0, run.t[-1]))
        axes.set_title(f"(a) {name} [rad] (C.3)" if k == 0 else f"{name} [rad]")
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.16 * (high - low))
    _legend(panels[0], columns=3)


def _legend(axes: Axes, columns: int) -> None:
    kinds = (("truth", TRUTH, (0, (4, 2))), ("as printed", COLOUR["none"], "-"), ("feed-forward s", COLOUR["s"], "-"))
    for name, colour, style in kinds:
        axes.plot([], [], color=colour, ls=style, lw=2.0, label=name)
    axes.legend(fontsize=8, ncols=columns, loc="upper left", columnspacing=1.0, handlelength=1.8, borderaxespad=0.1)


def _field(axes: Axes, runs: Mapping[FeedForward, ObserverRun], *, noisy: bool) -> None:
    wall = STANDARD.polyline
    axes.fill(*wall.T, color=GRID, alpha=0.22, lw=0)
    axes.plot(*wall.T, color=INK, lw=1.8)
    first = next(iter(runs.values()))
    alpha = first.run.mission.alpha
    for end in STANDARD.points(STANDARD.ranges(START, alpha)[1]):
        axes.plot([START[0], end[0]], [START[1], end[1]], color=hexadecimal(COLOURS[SceneElement.RAY]), lw=0.9)
    for feedforward, width in zip(PAIR, (1.1, 1.5), strict=True):
        run = runs[feedforward]
        axes.plot(run.x[:, 0], run.x[:, 1], color=COLOUR[feedforward], lw=width, zorder=3)
        axes.plot(*run.x[0, :2], "o", ms=4.5, color=COLOUR[feedforward], zorder=5)
    axes.plot(first.truth[:, 0], first.truth[:, 1], color=TRUTH, lw=1.8, ls=(0, (4, 2)), zorder=4)
    axes.fill(*outline(START).T, facecolor="white", edgecolor=INK, lw=1.1, zorder=6)
    least = first.truth[np.argmin(first.truth[:, 0])]
    astray = runs["none"].x[np.argmax(runs["none"].position)]
    halo = [patheffects.withStroke(linewidth=2.6, foreground="#f3f5f6")]
    labels = [
        ("truth, and around it s" if noisy else "truth, and on it s", least, (-8, 0), "right", INK),
        ("as printed", astray, (-4, 12), "right", COLOUR["none"]),
    ]
    if not noisy:
        labels.append(("first estimate", runs["s"].x[0], (-2, 12), "center", COLOUR["s"]))
    for text, place, offset, side, colour in labels:
        axes.annotate(text, (place[0], place[1]), offset, textcoords="offset points", ha=side, va="center",
                      color=colour, fontsize=8.5, zorder=7, path_effects=halo)  # fmt: skip
    title = "(g) in X, with 5 % range noise (C.8)" if noisy else "(b) in X, without noise (C.5)"
    axes.set(aspect="equal", title=title)
    low, high = wall.min(axis=0), wall.max(axis=0)
    axes.set(xlim=(low[0] - 0.1, high[0] + 0.1), ylim=(low[1] - 0.1, high[1] + 0.1))
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set(xticks=[], yticks=[])
    bar = low[0] + 0.1
    axes.plot([bar, bar + 1.0], [low[1] + 0.06] * 2, color=INK, lw=2.4, solid_capstyle="butt")
    axes.annotate("1 m", (bar + 0.5, low[1] + 0.06), (0, 4), textcoords="offset points", ha="center", fontsize=8)


def _errors(axes: Axes, runs: Mapping[FeedForward, ObserverRun], name: str, title: str) -> None:
    errors = {feedforward: np.maximum(getattr(run, name), LEAST) for feedforward, run in runs.items()}
    t = runs["s"].t
    for feedforward, error in errors.items():
        axes.plot(t, error, color=COLOUR[feedforward], lw=1.5)
    _log(axes, (1e-15, 30.0))
    _at_the_end(axes, errors, t)
    axes.set(xlabel="time [s]", title=title)


def _at_the_end(axes: Axes, errors: Mapping[FeedForward, Array], t: Array) -> None:
    """Write each line's name beside its end, no two on top of each other."""
    axes.set_xlim(0.0, t[-1])
    order = sorted(errors, key=lambda f: -float(np.median(errors[f][-len(t) // 8 :])))
    least, last = 1.2, np.inf  # decades between two names
    for feedforward in order:
        level = min(float(np.log10(np.median(errors[feedforward][-len(t) // 8 :]))), last - least)
        axes.annotate(NAMES[feedforward], (1.0, 10.0**level), (4, 0), xycoords=("axes fraction", "data"), va="center",
                      textcoords="offset points", color=COLOUR[feedforward], annotation_clip=False)  # fmt: skip
        last = level


def _log(axes: Axes, limits: tuple[float, float]) -> None:
    axes.set_yscale("log")
    axes.set_ylim(*limits)
    axes.yaxis.set_major_locator(LogLocator(numticks=9))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _values(axes: Axes, runs: Mapping[FeedForward, ObserverRun]) -> None:
    for feedforward in PAIR:
        run = runs[feedforward]
        V, Q = run.value[:, 0], np.sqrt(2.0 * run.value[:, 1])
        axes.plot(run.t, np.maximum(V, LEAST), color=COLOUR[feedforward], lw=1.5)
        axes.plot(run.t, np.maximum(Q, LEAST), color=COLOUR[feedforward], lw=1.1, ls=":")
    for label, style in (("$V_\\rho$ [m²]", "-"), ("|Q| [m²/s]", ":")):
        axes.plot([], [], color=INK, ls=style, lw=1.4, label=label)
    _log(axes, (1e-15, 1e4))
    t = runs["s"].t
    _at_the_end(axes, {name: np.sqrt(2.0 * runs[name].value[:, 1]) for name in PAIR}, t)
    axes.set(xlabel="time [s]", title="(e) what it descends on")
    axes.legend(fontsize=8, loc="upper left", ncols=2)


# ---- with noise


def _plane(axes: Axes, runs: Mapping[FeedForward, ObserverRun]) -> None:
    for feedforward in PAIR:
        run = runs[feedforward]
        axes.plot(run.z[:, 0], run.z[:, 1], color=COLOUR[feedforward], lw=1.2)
        axes.plot(*run.z[0, :2], "o", ms=4.5, color=COLOUR[feedforward])
    truth = runs["s"].z_true
    axes.plot(truth[:, 0], truth[:, 1], color=TRUTH, lw=1.6, ls=(0, (4, 2)))
    axes.plot(*truth[0, :2], "o", ms=4.5, color=TRUTH)
    axes.set(xlabel="$s_1$ [rad]", ylabel="$s_2$ [rad]", title="(f) in Z, with 5 % range noise (C.7)")
    _legend(axes, columns=1)


def _noise(axes: Axes, runs: Mapping[FeedForward, ObserverRun]) -> None:
    for feedforward, run in runs.items():
        axes.plot(run.t, run.position, color=COLOUR[feedforward], lw=1.5)
        axes.plot(run.t, np.abs(run.error[:, 2]), color=COLOUR[feedforward], lw=0.9, ls=":")
    for label, style in (("position [m]", "-"), ("heading [rad]", ":")):
        axes.plot([], [], color=INK, ls=style, lw=1.4, label=label)
    _log(axes, (1e-4, 30.0))
    _at_the_end(axes, {f: run.position for f, run in runs.items()}, runs["s"].t)
    axes.set(xlabel="time [s]", title="(h) errors with 5 % range noise")
    axes.legend(fontsize=8, loc="upper right", ncols=2)


# ---- over many runs


def _shares(axes: Axes, e: LockResults) -> None:
    """Share of runs that keep lock, by input and feed-forward, with the median error."""
    for i, motion in enumerate(MOTIONS):
        for j, feedforward in enumerate(NAMES):
            errors = e.thesis[motion, feedforward]
            share = locked(errors) / len(errors)
            colour = to_rgb(SHARES(share))
            axes.fill([j, j + 1, j + 1, j], [i, i, i + 1, i + 1], facecolor=colour, edgecolor="white", lw=1.4)
            axes.text(j + 0.5, i + 0.5, f"{share:.0%}\n{median(errors):.2g} m", ha="center", va="center", fontsize=8,
                      color=readable_on(colour))  # fmt: skip
    axes.set(xlim=(0, len(NAMES)), ylim=(len(MOTIONS), 0))
    axes.set_xticks(np.arange(len(NAMES)) + 0.5, list(NAMES.values()))
    axes.set_yticks(np.arange(len(MOTIONS)) + 0.5, list(MOTIONS))
    axes.tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_title("(i) lock kept from the thesis' start, and RMS error")


def _by_gain(axes: Axes, e: LockResults) -> None:
    for sensors, colour in SET_COLOURS.items():
        runs = {k: errors for (name, drive, k), errors in e.drawn.items() if (name, drive) == (sensors, "standard")}
        found = {k: median(errors) for k, errors in runs.items()}
        axes.plot(list(found), list(found.values()), "o-", color=colour, ms=4)
        fast = {k: median(errors) for (name, k), errors in e.fast.items() if name == sensors}
        axes.plot(list(fast), list(fast.values()), "o--", color=colour, ms=4.5, mfc="white", lw=1.1)
        x, y = (list(fast.items()) or list(found.items()))[-1]
        axes.annotate(sensors, (x, y), (8, {"3": 7, "4": -9}.get(sensors, 0)), va="center",
                      textcoords="offset points", color=colour, weight="bold")  # fmt: skip
    for label, face, style in (("100 readings a second", INK, "-"), ("1000", "white", "--")):
        axes.plot([], [], f"o{style}", color=INK, mfc=face, ms=4, lw=1.1, label=label)
    axes.legend(fontsize=8, loc="lower left")
    axes.axhline(POSITION, color=INK, ls=":", lw=1.1)
    axes.annotate("above, lock is lost", (3e5, POSITION), (0, 4), textcoords="offset points", ha="right", fontsize=8)
    k = np.array([3.0, 300.0])
    axes.plot(k, 0.03 / k, color=INK, lw=0.9)
    axes.annotate("1/k", (k[0], 0.03 / k[0]), (-3, -4), textcoords="offset points", ha="right", va="top")
    axes.set(xscale="log", xlabel="gain k = $k_V$ = $k_Q$", ylabel="position error, median RMS [m]",
             title="(j) as printed, by its gain, from the truth")  # fmt: skip
    axes.set_xlim(0.6, 4e5)
    axes.set_yscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
