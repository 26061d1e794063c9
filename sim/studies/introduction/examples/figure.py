"""The figure of the study of the Introduction's examples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from mathnavi.models.textbook.example_2_1 import EXAMPLE_2_1
from mathnavi.models.textbook.krener_isidori import KRENER_ISIDORI
from mathnavi.models.textbook.maps import of_numbers
from mathnavi.renders.figures import BOUND, INK, STYLE
from mathnavi.renders.textbook.panel import ESTIMATE, TRUTH
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.studies.introduction.examples.measures import estimates, predicted

STARTS = (-0.8, -0.3, 0.3, 0.8)  # x_2 of Example 2.1, beside x_1 = 0.2
SHADES = ("#08519c", "#3182bd", "#e6842a", "#b3361f")
NAMED = ((0.36, -26), (1.2, -24), (1.2, 12), (0.35, 18))  # (time [s], points up) of their names under u = 1
UNTIL = 1.5  # [s]
FLOOR = 1e-9  # of an error that is drawn


@dataclass(frozen=True, eq=False)
class IntroductionRuns:
    """Data of the figure."""

    gains: Array  # (n,) of alpha, and of beta
    exponents: Array  # (n, n) [1/s] measured, by alpha and beta
    escape: RunResult
    oscillation: RunResult
    forms: Mapping[str, Sequence[RunResult]]


def introduction_figure(shown: IntroductionRuns) -> Figure:
    """Five panels."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.4, 9.6), layout="constrained")
        parts = figure.subplot_mosaic(
            [["still", "driven", "map"], ["escape", "escape", "map"], ["plane", "linear", "signs"]],
            height_ratios=(1.0, 1.0, 1.25),
        )
        _indistinguishable(parts["still"], parts["driven"])
        _escape(parts["escape"], shown.escape)
        _map(figure, parts["map"], shown)
        _oscillation(parts["plane"], parts["linear"], shown.oscillation)
        _signs(parts["signs"], shown.forms)
    return figure


def _indistinguishable(still: Axes, driven: Axes) -> None:
    for k, (x_2, colour) in enumerate(zip(STARTS, SHADES, strict=True)):
        t, y = _output(x_2, 0.0, UNTIL)
        still.plot(t, y, color=colour, lw=5.2 - 1.3 * k)
        t, y = _output(x_2, 1.0, UNTIL)
        driven.plot(t, y, color=colour, lw=1.8)
        at, up = NAMED[k]
        i = min(int(np.searchsorted(t, at)), len(t) - 1)
        driven.annotate(f"$x_2(0) = {x_2:g}$", (t[i], y[i]), (0, up), ha="center", textcoords="offset points",
                        color=colour, size=8.0)  # fmt: skip
    still.set(xlabel="time [s]", ylabel="y", xlim=(0.0, UNTIL), ylim=(0.0, 0.25), title="(a) Example 2.1, u = 0")
    still.annotate("four starts, one output", (0.75, 0.12), (0, 10), textcoords="offset points", size=8.0)
    driven.set(xlabel="time [s]", ylabel="y", xlim=(0.0, UNTIL), ylim=(-1.3, 1.3), title="u = 1")


def _output(x_2: float, u: float, end: float) -> tuple[Array, Array]:
    """Times and outputs of Example 2.1, up to an escape."""
    x, t, y, held = np.array([0.2, x_2]), [0.0], [0.2], np.array([u])
    while t[-1] < end:
        x, reached = EXAMPLE_2_1.reach(x, held, 0.005)
        if reached < 0.005:
            break
        t.append(t[-1] + reached)
        y.append(x[0])
    return np.array(t), np.array(y)


def _escape(axes: Axes, outcome: RunResult) -> None:
    t, x_hat, x = estimates(outcome)
    for k in range(3):
        axes.plot(t, x_hat[:, k], color=ESTIMATE, lw=1.8)
        axes.plot(t, x[:, k], "--", color=TRUTH, lw=1.8)
    names = {0: (1.5, 8), 1: (2.42, 0), 2: (1.9, -12)}
    for k, (at, up) in names.items():
        i = int(np.searchsorted(t, at))
        axes.annotate(f"$x_{k + 1}$", (t[i], x[i, k]), (-12 if k == 1 else 0, up), textcoords="offset points")
    end = float(outcome.summary["escape_time_s"])
    axes.axvline(end, color=BOUND, ls=":", lw=1.3)
    axes.annotate(f"$x_2$ escapes at {end:.3f} s", (end, 0.0), (-4, 5), xycoords=("data", "axes fraction"),
                  textcoords="offset points", ha="right", color=BOUND)  # fmt: skip
    axes.set(xlabel="time [s]", xlim=(0.0, 1.02 * end), ylim=(-1.8, 5.0))
    axes.set_title("(b) Example 2.2, u = sin t: truth (dashed) and estimate")


def _map(figure: Figure, axes: Axes, shown: IntroductionRuns) -> None:
    gains, exponents = shown.gains, shown.exponents
    norm = TwoSlopeNorm(0.0, min(float(exponents.min()), -0.1), max(float(exponents.max()), 0.1))
    image = axes.pcolormesh(gains, gains, exponents.T, cmap="RdBu_r", norm=norm, shading="nearest")
    fine = np.linspace(gains[0], gains[-1], 241)
    alpha, beta = np.meshgrid(fine, fine)
    root = 0.5 * (-beta + np.sqrt(np.maximum(beta**2 - 4.0 * alpha, 0.0)))  # the real part of the slower one
    lines = axes.contour(fine, fine, root, [-2.0, -1.5, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0], colors=INK, linewidths=0.7)
    axes.clabel(lines, [level for level in lines.levels if level <= 0.25], fontsize=7.0)  # no room for the others
    corner = float(gains[-1])
    axes.plot([0.0, 0.0, corner], [corner, 0.0, 0.0], color=INK, lw=1.6)
    half = 0.5 * float(gains[1] - gains[0]) if len(gains) > 1 else 0.5
    ends = (float(gains[0]) - half, corner + half)
    axes.set(xlabel="α", ylabel="β", title="(c) Example 2.2: exponent [1/s]", xlim=ends, ylim=ends)
    axes.grid(False)
    figure.colorbar(image, ax=axes, orientation="horizontal", shrink=0.9, pad=0.02)


def _oscillation(plane: Axes, linear: Axes, outcome: RunResult) -> None:
    t, x_hat, x = estimates(outcome)
    plane.plot(x_hat[:, 0], x_hat[:, 1], color=ESTIMATE, lw=1.8, label="estimate")
    plane.plot(x[:, 0], x[:, 1], "--", color=TRUTH, lw=1.8, label="truth")
    plane.plot(*x_hat[0], "o", color=ESTIMATE, ms=5)
    plane.plot(*x[0], "o", color=TRUTH, ms=5)
    plane.legend(fontsize=8)
    plane.set(xlabel="$x_1$", ylabel="$x_2$", title="(d) van der Pol, y = sinh $x_1$")
    form = KRENER_ISIDORI.form
    assert form is not None
    T, poles = of_numbers(form.T_1, 2), tuple(outcome.config["estimator"]["fields"]["poles"])
    error = np.array([T(one) - T(other) for one, other in zip(x_hat, x, strict=True)])
    equation = predicted(t, error[0], form.A - form.gain(poles) @ form.C)
    for k, colour in enumerate((SHADES[1], SHADES[2])):
        linear.plot(t, error[:, k], color=colour, lw=3.0, alpha=0.55)
        linear.plot(t, equation[:, k], color=INK, lw=0.9, ls="--")
        i = int(np.argmax(np.abs(error[20:, k]))) + 20
        linear.annotate(f"$z_{k + 1} - \\tilde x_{k + 1}$", (t[i], error[i, k]), (26, -4) if k else (18, 14),
                        textcoords="offset points", color=colour)  # fmt: skip
    linear.set(xlabel="time [s]", xlim=(0.0, 4.0), title="its error, and (2.3) dashed")


def _signs(axes: Axes, forms: Mapping[str, Sequence[RunResult]]) -> None:
    for form, colour in (("printed", SHADES[3]), ("corrected", SHADES[0])):
        for outcome in forms[form]:
            t, x_hat, x = estimates(outcome)
            error = np.linalg.norm(x_hat - x, axis=1)
            axes.plot(t, np.maximum(error, FLOOR), color=colour, lw=1.5)
    axes.annotate("as printed", (3.0, 1.3), ha="center", color=SHADES[3])
    axes.annotate("with its sign\nput right", (0.1, 2e-4), color=SHADES[0])
    t = np.linspace(0.5, 4.5, 2)
    axes.plot(t, 0.6 * np.exp(-2.0 * t), color=INK, ls="--", lw=1.0)
    axes.annotate("$e^{-2t}$", (t[1], 0.6 * math.exp(-9.0)), (4, 6), textcoords="offset points")
    axes.set(xlabel="time [s]", ylabel="$|\\hat x - x|$", yscale="log", title="(e) equation (2.4)")
