"""The picture of the study ``range-convergence``."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

from mathnavi.renders.figures import INK, STYLE
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.consistency import consistency
from mathnavi.sim.records.statistics import Proportion
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.studies.ranging.range_convergence.claims import (
    BEAN_WALL,
    BEYOND_EKF,
    DEGREES,
    DRIVEN,
    ELLIPSE,
    ConvergenceResults,
)
from mathnavi.sim.studies.ranging.range_convergence.costs import ALL_ALIVE, BANK_LOOP, EKF_LOOP, PARTICLE_LOOP
from mathnavi.sim.studies.ranging.range_convergence.runs import BANK, EKF, FLOOR, INSTANTS, PARTICLES, UKF

GREY = hexadecimal(COLOURS[SceneElement.IMAGE])
COLOUR: Mapping[str, str] = {
    BANK: hexadecimal(COLOURS[SceneElement.ESTIMATE]),
    EKF: hexadecimal(COLOURS[SceneElement.DRIVEN]),
    UKF: hexadecimal(COLOURS[SceneElement.RAY]),
    PARTICLES: hexadecimal(COLOURS[SceneElement.HYPOTHESIS]),
    FLOOR: GREY,
}
OBSERVER = "#101824"
MARKERS: Mapping[str, str] = {"2s": "o", "2t": "s", "3": "^", "4": "D"}
SHOWN = "2t"  # whose errors are drawn against time
LIKENED = (BANK, EKF, UKF, PARTICLES)
TIMES: Mapping[str, tuple[str, str]] = {  # name, colour of what is timed
    EKF_LOOP: ("one EKF of the bank", COLOUR[BANK]),
    BANK_LOOP: ("bank, as flown", COLOUR[BANK]),
    ALL_ALIVE: ("bank, all 16 alive", COLOUR[BANK]),
    PARTICLE_LOOP: ("1000 particles", COLOUR[PARTICLES]),
    "feasible_set_bank": ("bank, called", COLOUR[BANK]),
    "range_ekf": ("filterpy EKF, called", COLOUR[EKF]),
    "range_ukf": ("filterpy UKF, called", COLOUR[UKF]),
    "range_particle": ("AMCL, called", COLOUR[PARTICLES]),
}


def figure(e: ConvergenceResults, seconds: float) -> Figure:
    """Six panels."""
    with matplotlib.rc_context(STYLE):
        drawn = Figure(figsize=(12.4, 9.4), layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.08))
        parts = drawn.subplot_mosaic([["share", "error", "rms"], ["cost", "nees", "wheels"]])
        _shares(parts["share"], e)
        _errors(parts["error"], e, seconds)
        _rms(parts["rms"], e)
        _costs(parts["cost"], e)
        _nees(parts["nees"], e, seconds)
        _wheels(parts["wheels"], e)
    return drawn


def _shares(axes: Axes, e: ConvergenceResults) -> None:
    lines: list[tuple[str, str, Mapping[str, Proportion]]] = [("observer,\nno noise", OBSERVER, e.observed)]
    lines += [(_short(name), COLOUR[name], _sets(e, ELLIPSE, name)) for name in LIKENED]
    lines.insert(2, ("bank,\nin a bean", COLOUR[BANK], _sets(e, BEAN_WALL, BANK)))
    for k, (_, colour, rates) in enumerate(lines):
        for sensors, found in rates.items():
            y = k + 0.19 * (list(MARKERS).index(sensors) - 1.5)
            axes.plot([found.low, found.high], [y, y], color=colour, lw=1.6, alpha=0.45, solid_capstyle="round")
            axes.plot(found.value, y, MARKERS[sensors], color=colour, ms=5.0, mec="white", mew=0.7)
    for sensors, marker in MARKERS.items():
        axes.plot([], [], marker, color=GREY, ms=5.0, label=sensors)
    axes.legend(loc="lower center", fontsize=8, title="sensors", title_fontsize=8, handletextpad=0.1, ncols=4)
    axes.set_yticks(range(len(lines)), [name for name, _, _ in lines])
    axes.set(xlim=(0.0, 1.03), ylim=(len(lines) + 0.35, -0.55), xlabel="share of the runs")
    axes.set_title("(a) who finds the pose from anywhere")
    axes.grid(visible=False, axis="y")


def _sets(e: ConvergenceResults, wall: str, estimator: str) -> dict[str, Proportion]:
    return {sensors: e.share(wall, sensors, estimator) for sensors in BEYOND_EKF}


def _short(name: str) -> str:
    return name.replace("particle filter", "AMCL").replace("EKF from nearby", "EKF from\nnearby")


def _errors(axes: Axes, e: ConvergenceResults, seconds: float) -> None:
    t = np.linspace(0.0, seconds, INSTANTS)
    ends = []
    for name in (*LIKENED, FLOOR):
        errors = np.array([found.error for found in e.found[ELLIPSE, SHOWN, name]])
        middle: Array = np.median(errors, axis=0)
        axes.plot(t, middle, color=COLOUR[name], lw=2.0 if name == BANK else 1.4, ls="--" if name == FLOOR else "-")
        ends.append((name, float(np.exp(np.log(middle[-8:]).mean()))))
        if name == BANK:
            low, high = np.quantile(errors, (0.25, 0.75), axis=0)
            axes.fill_between(t, low, high, color=COLOUR[name], alpha=0.16, lw=0)
    axes.set_yscale("log")
    _metres(axes, "y", (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0))
    axes.set(xlim=(0.0, seconds), xlabel="t [s]", ylabel="position error [m]")
    for (name, _), y in zip(sorted(ends, key=lambda end: end[1]), _apart(sorted(y for _, y in ends)), strict=True):
        axes.annotate(
            _short(name), (seconds, y), (4, 0), textcoords="offset points", va="center", fontsize=8,
            color=COLOUR[name], annotation_clip=False, linespacing=0.9,
        )  # fmt: skip
    axes.set_title(f"(b) median error, sensors {SHOWN}")


def _apart(values: list[float]) -> list[float]:
    """Heights in a logarithmic scale, each far enough above the one before to be read."""
    placed: list[float] = []
    for value in values:
        placed.append(value if not placed else max(value, 1.6 * placed[-1]))
    return placed


def _rms(axes: Axes, e: ConvergenceResults) -> None:
    names = (FLOOR, *LIKENED)
    for k, name in enumerate(names):
        for j, sensors in enumerate(BEYOND_EKF):
            found = e.rms(ELLIPSE, sensors, name)
            if found is None:
                continue
            x = k + 0.22 * (j - 1)
            axes.plot([x, x], [found.low, found.high], color=COLOUR[name], lw=1.6, alpha=0.45)
            axes.plot(x, found.value, MARKERS[sensors], color=COLOUR[name], ms=5.5, mec="white", mew=0.7)
    axes.set_yscale("log")
    _metres(axes, "y", (0.003, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2))
    axes.set_xticks(range(len(names)), [_short(name) for name in names], fontsize=8.5)
    axes.set(xlim=(-0.5, len(names) - 0.5), ylabel="RMSE of the runs that converged [m]")
    axes.set_title("(c) how exactly, once found")
    axes.grid(visible=False, axis="x")


def _costs(axes: Axes, e: ConvergenceResults) -> None:
    cost = e.costs["4"]
    for k, (key, (_, colour)) in enumerate(TIMES.items()):
        taken = float(np.median(cost[key]))
        axes.barh(k, taken, color=colour, alpha=0.85 if k < 4 else 0.5, height=0.66)
        axes.annotate(
            f"{taken:.0f}" if taken >= 10.0 else f"{taken:.1f}",
            (taken, k),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    axes.axhline(3.5, color=INK, lw=0.8, ls=":")
    axes.set_xscale("log")
    axes.set_xlim(0.5, 5.0 * float(max(np.median(taken) for taken in cost.values())))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_yticks(range(len(TIMES)), [name for name, _ in TIMES.values()])
    axes.invert_yaxis()
    for y, words in ((-0.35, "compiled loops"), (3.65, "plug-ins")):
        axes.text(0.98, y, words, transform=axes.get_yaxis_transform(), ha="right", va="top", fontsize=8, color=GREY)
    axes.set(xlabel="CPU time of an update [µs]")
    axes.set_title("(d) what an update costs, 4 sensors")
    axes.grid(visible=False, axis="y")


def _nees(axes: Axes, e: ConvergenceResults, seconds: float) -> None:
    t = np.linspace(0.0, seconds, INSTANTS)[1:]
    styles = dict(zip(BEYOND_EKF, ("-", "--", ":"), strict=True))
    for sensors, style in styles.items():
        squares = np.array([found.nees for found in e.found[ELLIPSE, sensors, BANK] if found.converged])
        if not len(squares):
            continue
        axes.plot(t, squares.mean(axis=0)[1:], color=COLOUR[BANK], ls=style, lw=1.5, label=sensors)
        limits = consistency(squares[:, -1], DEGREES)
    if axes.lines:
        axes.axhspan(limits.low, limits.high, color=COLOURS[SceneElement.RAY], alpha=0.18, lw=0)
        axes.annotate(
            "95 % of consistent filters", (0.98, limits.low), (0, -3), xycoords=("axes fraction", "data"),
            textcoords="offset points", ha="right", va="top", fontsize=8, color=COLOUR[UKF],
        )  # fmt: skip
        axes.legend(loc="upper right", fontsize=8, title="sensors", title_fontsize=8, ncols=3)
    axes.set(xlim=(0.0, seconds), ylim=(0.0, 6.5), xlabel="t [s]", ylabel="average NEES, 3 degrees of freedom")
    axes.set_title("(e) does the bank know how good it is?")


def _wheels(axes: Axes, e: ConvergenceResults) -> None:
    rng = np.random.default_rng(0)
    frictions = sorted({friction for _, friction in e.drives})
    highest = max(1e3 * e.driven(sensors, frictions[-1]) for sensors in DRIVEN)
    for sensors, colour in zip(DRIVEN, (COLOUR[BANK], OBSERVER), strict=True):
        means = [1e3 * e.driven(sensors, friction) for friction in frictions]
        for k, friction in enumerate(frictions):
            own = 1e3 * figures(e.drives[sensors, friction], "position_rms_m")
            x = k + rng.uniform(-0.08, 0.08, len(own))
            axes.plot(x, own, MARKERS[sensors], color=colour, ms=3.5, alpha=0.4, mew=0)
        axes.plot(range(len(frictions)), means, color=colour, marker=MARKERS[sensors], mec="white", ms=6.0)
        axes.annotate(
            f"sensors {sensors}", (len(frictions) - 1, means[-1]), (9, 6 if means[-1] == highest else -6),
            textcoords="offset points", va="center", color=colour, fontsize=8.5, annotation_clip=False,
        )  # fmt: skip
        axes.axhline(1e3 * DRIVEN[sensors], color=colour, ls=":", lw=1.2)
        axes.annotate(
            f"asked of {sensors}: {1e3 * DRIVEN[sensors]:g} mm", (len(frictions) - 0.32, 1e3 * DRIVEN[sensors]), (0, 3),
            textcoords="offset points", ha="right", fontsize=8, color=colour,
        )  # fmt: skip
    axes.set_xticks(range(len(frictions)), [f"{friction:g}" for friction in frictions])
    axes.set(xlim=(-0.35, len(frictions) - 0.3), xlabel="friction of the wheels", ylabel="RMS position error [mm]")
    axes.set_ylim(0.0, 1.15e3 * max(DRIVEN.values()))
    axes.set_title("(f) on two driven wheels, in MuJoCo")
    axes.grid(visible=False, axis="x")


def _metres(axes: Axes, which: str, ticks: tuple[float, ...]) -> None:
    axis = axes.yaxis if which == "y" else axes.xaxis
    axis.set_major_locator(FixedLocator(list(ticks)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())
