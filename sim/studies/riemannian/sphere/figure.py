"""The picture of the study ``sphere``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.renders.figures import INK, STYLE
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.statistics import Band

COLOURS = {"printed": "#c2183b", "repaired": "#0d5fa8"}
COMPONENTS = ("#0d5fa8", "#e07b00", "#0f9472")
_TITLES = {"S^3": "$S^3$", "H^2": "$H^2$", "cart and pendulum": "cart and pendulum, flat"}
_HALO = [patheffects.withStroke(linewidth=3.0, foreground="white")]
_LEAST = 1e-7  # that is drawn
_LEAST_ERROR = 1e-4  # [rad/s] where the bars of (i) begin
_LONGEST = 10.0  # [s] of (a) to (f)
_SHOWN = 4.0  # [s] of (g) and (h)


@dataclass(frozen=True)
class SphereFigureData:
    """Data of the figure."""

    runs: Mapping[tuple[str, str], Mapping[str, Array]]
    noise: Mapping[str, Band]
    residuals: Mapping[str, float]


def figure(shown: SphereFigureData) -> Figure:
    """Draw the figure of the study."""
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(13.0, 10.5), layout="constrained")
        axes = page.subplots(3, 3)
        for column, space in enumerate(_TITLES):
            runs = {gains: shown.runs[space, gains] for gains in COLOURS}
            _draw_errors(axes[0, column], runs, "theta", f"({'abc'[column]}) {_TITLES[space]}: position")
            _draw_errors(axes[1, column], runs, "speed_error", f"({'def'[column]}) {_TITLES[space]}: velocity")
        axes[0, 0].set_ylabel(r"dist$(x, \xi)$")
        axes[1, 0].set_ylabel(r"$|v - \hat v|_g$")
        _draw_components(axes[2, 0], shown)
        _draw_lyapunov(axes[2, 1], shown.runs["S^3", "repaired"])
        _draw_noise(axes[2, 2], shown.noise)
    return page


def _draw_errors(axes: Axes, runs: Mapping[str, Mapping[str, Array]], name: str, title: str) -> None:
    axes.set_title(title)
    for gains, run in runs.items():
        values = np.maximum(run[name], _LEAST)
        axes.plot(run["t"], values, color=COLOURS[gains], lw=1.8)
        early = run["t"] <= _LONGEST
        k = int((0.65 if gains == "printed" else 0.25) * (early.sum() - 1))
        axes.annotate(
            gains, (run["t"][k], values[k]), (6, -13 if gains == "printed" else 2), textcoords="offset points",
            color=COLOURS[gains], weight="bold", path_effects=_HALO, ha="left",
        )  # fmt: skip
    if name == "speed_error":
        axes.axhline(0.01 * runs["printed"][name][0], color=INK, lw=0.8, ls=(0, (4, 3)))
    axes.set_yscale("log")
    axes.set_xlabel("time [s]")
    axes.set_xlim(0.0, min(_LONGEST, max(float(run["t"][-1]) for run in runs.values())))
    axes.set_ylim(0.3 * _LEAST, None)


def _draw_components(axes: Axes, shown: SphereFigureData) -> None:
    axes.set_title("(g) $v$ on $S^3$, and $\\hat v$")
    truth = shown.runs["S^3", "repaired"]
    early = truth["t"] <= _SHOWN
    for k, colour in enumerate(COMPONENTS):
        axes.plot(truth["t"][early], truth["v"][early, k], color=colour, lw=2.2, alpha=0.45)
        axes.plot(truth["t"][early], truth["v_hat"][early, k], color=colour, lw=1.2)
        printed = shown.runs["S^3", "printed"]
        soon = printed["t"] <= _SHOWN
        axes.plot(printed["t"][soon], printed["v_hat"][soon, k], color=colour, lw=1.0, ls=(0, (2, 2)))
    axes.set_xlabel("time [s]; pale: $v$, solid: repaired, dotted: printed")
    axes.set_xlim(0.0, _SHOWN)


def _draw_lyapunov(axes: Axes, run: Mapping[str, Array]) -> None:
    axes.set_title("(h) Lyapunov functions, repaired")
    B = 3.0
    kinetic, S, product = run["lyapunov"].T
    V, W = kinetic + B * S, kinetic + 3.0 * B * S - np.sqrt(B) * product
    early = run["t"] <= _SHOWN
    for name, values, colour, at in (("$V$", V, "#e07b00", 100), ("$W$", W, "#0d5fa8", 250)):
        axes.plot(run["t"][early], values[early], color=colour, lw=1.8)
        at = min(at, int(early.sum()) - 1)
        axes.annotate(
            name, (run["t"][early][at], values[early][at]), (6, 6), textcoords="offset points", color=colour,
            weight="bold", size=11.0,
        )  # fmt: skip
    axes.set_yscale("log")
    axes.set_xlabel("time [s]")
    axes.set_xlim(0.0, _SHOWN)


def _draw_noise(axes: Axes, noise: Mapping[str, Band]) -> None:
    axes.set_title("(i) noisy attitudes at 1 kHz: body rate")
    names = list(noise)[::-1]
    for k, name in enumerate(names):
        band, colour = noise[name], "#0d5fa8" if name.startswith("observer") else "#6b7a8c"
        axes.plot([_LEAST_ERROR, band.median], [k, k], color=colour, lw=7.0, solid_capstyle="butt", alpha=0.85)
        axes.annotate(
            f"{band.median:.3g} rad/s", (band.median, k), (6, 0), textcoords="offset points", va="center",
            color=colour, weight="bold",
        )  # fmt: skip
    axes.set_yticks(range(len(names)), names)
    axes.set_xscale("log")
    axes.set_xlim(_LEAST_ERROR, 100.0 * max(band.median for band in noise.values()))
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("root mean square error [rad/s]")
