"""The picture of the study ``observability``: feasible states, what separates them, and how the map decides."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import NullFormatter

from mathnavi.estimators.observability.feasible_set import feasible_set
from mathnavi.estimators.observability.output_flow import mismatch
from mathnavi.estimators.observability.range_outputs import RangeOutputs, motion_under, pose_difference
from mathnavi.models.field.curve import Curve
from mathnavi.renders.figures import INK, STYLE
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.statistics import Proportion

APART, ALIKE = "#0d5fa8", "#c2183b"
COLOURS = LinearSegmentedColormap.from_list("flow", (ALIKE, "#f0a07c", "#8fc3e6", APART))
SHARES = LinearSegmentedColormap.from_list("share", ("#b3202f", "#f0a07c", "#f4f1ea", "#6fb0dc", "#0d5fa8"))
FAINTEST, STRONGEST = 1e-2, 1.0  # [m] of mismatch over which the colours vary
AHEAD = 0.3  # [s] over which output flows are compared
INPUTS: dict[str, tuple[float, float]] = {
    "straight on": (0.5, 0.0),
    "left turn": (0.5, 0.8),
    "right turn": (0.5, -0.8),
    "on the spot": (0.0, 0.8),
}
INPUT_COLOURS = dict(zip(INPUTS, ("#101824", "#0d5fa8", "#e07b00", "#0f9472"), strict=True))
SHOWN = "left turn"  # by which the feasible set is coloured
ESTIMATOR_COLOURS = {"observer": "#0d5fa8", "EKF": "#e07b00"}


@dataclass(frozen=True)
class MeasuredSeries:
    """A line of a family: shares, one for each of its walls."""

    label: str
    colour: str
    dashed: bool
    rates: Sequence[Proportion]


@dataclass(frozen=True)
class Family:
    """A panel: shares over a family of walls."""

    title: str
    xlabel: str
    series: Sequence[MeasuredSeries]
    walls: Sequence[Curve]
    ticks: Sequence[str]  # what the walls are called
    rays: Sequence[Sequence[float]]  # [deg] drawn in each wall


@dataclass(frozen=True)
class Region:
    """A map of shares over the places of the first estimate."""

    title: str
    curve: Curve
    start: Array  # (3,)
    places: Array  # (n, 2)
    shares: Array  # (n,)
    spacing: float  # [m] of the places
    path: Array  # (m, 2)


def figure(outputs: RangeOutputs, x_0: Array, families: Sequence[Family], regions: Sequence[Region]) -> Figure:
    """Draw the figure of the study; ``x_0`` is the state whose feasible set is shown."""
    with matplotlib.rc_context(STYLE):
        drawn = Figure(figsize=(11.8, 10.6), layout="constrained")
        top, middle, bottom = np.array(drawn.subfigures(3, 1, height_ratios=(1.2, 1.0, 0.62)))
        field, flow = top.subplots(1, 2, width_ratios=(1.9, 1.0))
        _feasible(field, flow, outputs, x_0)
        for axes, family in zip(middle.subplots(1, len(families), sharey=True), families, strict=True):
            _family(axes, family, first=family is families[0])
        panels = bottom.subplots(1, len(regions))
        for axes, region in zip(np.atleast_1d(panels), regions, strict=True):
            _region(axes, region)
        bar = bottom.colorbar(ScalarMappable(Normalize(0.0, 1.0), SHARES), ax=panels, pad=0.01, shrink=0.8)
        bar.set_label("share of the first headings")
        bar.outline.set_visible(False)
    return drawn


# ---- the feasible set


def _feasible(field: Axes, flow: Axes, outputs: RangeOutputs, x_0: Array) -> None:
    motions = {name: _held(u) for name, u in INPUTS.items()}
    curves = [curve.points for curve in feasible_set(outputs, outputs.at(x_0)[0]).curves]
    _wall(field, outputs.curve)
    norm = LogNorm(FAINTEST, STRONGEST)
    for points in curves:
        mismatches = np.array([mismatch(outputs, x, x_0, motions[SHOWN]) for x in points])
        pieces = np.stack([points[:-1, :2], points[1:, :2]], axis=1)
        colours = COLOURS(norm(np.clip(0.5 * (mismatches[1:] + mismatches[:-1]), FAINTEST, STRONGEST)))
        field.add_collection(LineCollection(list(pieces), colors=colours, lw=3.2, capstyle="round", zorder=3))
        for x in points[10::24]:
            tip = x[:2] + 0.2 * np.array([math.cos(x[2]), math.sin(x[2])])
            field.plot([x[0], tip[0]], [x[1], tip[1]], color=INK, lw=0.7, zorder=4)
    for x, face in ((x_0, "#101824"), (outputs.curve.images(x_0)[-1], "white")):
        for end in outputs.curve.points(outputs.curve.ranges(x, outputs.alpha)[1]):
            field.plot([x[0], end[0]], [x[1], end[1]], color="#6b7785", lw=0.8, ls=(0, (4, 3)), zorder=2)
        _robot(field, x, face)
    bar = field.figure.colorbar(
        ScalarMappable(norm, COLOURS), ax=field, location="bottom", pad=0.02, shrink=0.5, aspect=45
    )
    bar.set_label(f"by how much the ranges change otherwise within {AHEAD:g} s of a {SHOWN} [m]")
    bar.outline.set_visible(False)
    field.set_title("(a) all that reads what the robot at its start reads")
    image = outputs.curve.images(x_0)[-1]
    for text, x, offset in (("true start", x_0, (14, -13)), ("its image: indistinguishable", image, (12, 2))):
        field.annotate(text, (x[0], x[1]), offset, textcoords="offset points", fontsize=8.5)
    own = min(curves, key=lambda points: float(np.linalg.norm(pose_difference(points, x_0), axis=1).min()))
    _along(flow, outputs, x_0, own, motions)


def _held(u: tuple[float, float]) -> Array:
    return motion_under(lambda t: u, AHEAD)


def _along(flow: Axes, outputs: RangeOutputs, x_0: Array, points: Array, motions: Mapping[str, Array]) -> None:
    """The mismatch along the curve through the true state."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    along -= along[np.argmin(np.linalg.norm(pose_difference(points, x_0), axis=1))]
    for name, motion in motions.items():
        mismatches = np.array([mismatch(outputs, x, x_0, motion) for x in points])
        mismatches[~np.isfinite(mismatches)] = np.nan  # the robot would drive into the wall
        flow.plot(along, np.maximum(mismatches, 0.1 * FAINTEST), color=INPUT_COLOURS[name], lw=1.6, label=name)
    flow.set_yscale("log")
    flow.yaxis.set_minor_formatter(NullFormatter())
    flow.set_ylim(0.1 * FAINTEST, 20.0)
    flow.text(
        0.98, 0.02, "standing still: nought all along", transform=flow.transAxes, ha="right", fontsize=8.5, color=ALIKE
    )
    flow.set(
        xlabel="along the feasible curve, from the true start [m, rad]",
        ylabel=f"difference of the output flow in {AHEAD:g} s [m]",
        title="(b) any motion distinguishes them",
    )
    flow.legend(fontsize=8.5, loc="upper center", ncols=2, columnspacing=1.2, handlelength=1.4)


def _wall(axes: Axes, curve: Curve, *, ground: str = "#f6f3ec") -> None:
    axes.add_patch(Polygon(curve.polyline, closed=True, facecolor=ground, edgecolor=INK, lw=1.6, zorder=1))
    low, high = curve.polyline.min(axis=0), curve.polyline.max(axis=0)
    room = 0.03 * float((high - low).max())
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_xticks([])
    axes.set_yticks([])


def _robot(axes: Axes, x: Array, face: str, size: float = 0.13) -> None:
    c, s = math.cos(x[2]), math.sin(x[2])
    shape = size * np.array([[1.5, 0.0], [-0.9, 0.85], [-0.45, 0.0], [-0.9, -0.85]])
    axes.add_patch(
        Polygon(x[:2] + shape @ np.array([[c, s], [-s, c]]), facecolor=face, edgecolor=INK, lw=1.1, zorder=6)
    )


# ---- how the map decides


def _family(axes: Axes, family: Family, *, first: bool) -> None:
    x = np.arange(len(family.walls))
    for series in family.series:
        low, high = (np.array([getattr(rate, side) for rate in series.rates]) for side in ("low", "high"))
        axes.fill_between(x, low, high, color=series.colour, alpha=0.13, lw=0)
        axes.plot(x, [rate.value for rate in series.rates], color=series.colour, ls="--" if series.dashed else "-",
                  marker="o", ms=3.6, label=series.label)  # fmt: skip
    axes.set(title=family.title, xlabel=family.xlabel, ylim=(0.0, 1.28), xlim=(-0.4, len(x) - 0.6))
    axes.set_yticks(np.linspace(0.0, 1.0, 6))
    axes.set_xticks(x, family.ticks)
    axes.grid(visible=False, axis="x")
    if first:
        axes.set_ylabel("share of starts that find the true state")
        axes.legend(fontsize=7.5, loc="lower center", ncols=2, columnspacing=1.0, handlelength=1.5)
    for k, (curve, rays) in enumerate(zip(family.walls, family.rays, strict=True)):
        box = axes.inset_axes((k - 0.45, 1.03, 0.9, 0.22), transform=axes.transData)
        p = curve.polyline - 0.5 * (curve.polyline.max(axis=0) + curve.polyline.min(axis=0))
        box.fill(p[:, 0], p[:, 1], facecolor="#f6f3ec", edgecolor=INK, lw=0.8)
        for angle in rays:
            end = curve.ranges(np.zeros(3), np.radians([angle]))[0] * np.exp(1j * math.radians(angle))
            box.plot([0.0, end[0].real], [0.0, end[0].imag], color=ALIKE, lw=0.8)
        box.set(xlim=(-4.7, 4.7), ylim=(-4.7, 4.7), aspect="equal")
        box.axis("off")


def _region(axes: Axes, region: Region) -> None:
    _wall(axes, region.curve, ground="white")
    half = 0.5 * region.spacing
    inside = Polygon(region.curve.polyline, closed=True, transform=axes.transData)
    for place, share in zip(region.places, region.shares, strict=True):
        cell = Polygon(
            place + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), facecolor=SHARES(share), lw=0, zorder=2
        )
        axes.add_patch(cell)
        cell.set_clip_path(inside)
    axes.add_patch(Polygon(region.curve.polyline, closed=True, fill=False, edgecolor=INK, lw=1.6, zorder=5))
    axes.plot(*region.path.T, color="#101824", lw=0.9, zorder=5)
    _robot(axes, region.start, "#101824", size=0.17)
    axes.set_title(f"{region.title}: {region.shares.mean():.0%}")
