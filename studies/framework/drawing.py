"""Parts of figures that several studies share."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.figures import draw_map
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.studies.framework.study import VEHICLE, ends

RADAR = "#c2183b"
THINNEST, WIDER = 1.2, 1.3  # [points] the last path, and how much wider each before it is


def paths_on_map(axes: Axes, terrain: HeightField, flights: Mapping[str, tuple[RunResult, str]], title: str) -> None:
    """The hill-shaded map with the path of each flight (its name: outcome and colour), radars, start and target.

    Each path is wider than the next, so that it is seen on both sides of those that run along it.
    """
    draw_map(axes, terrain)
    paths = {name: outcome.recording.truths[VEHICLE] / 1e3 for name, (outcome, _) in flights.items()}
    widths = [THINNEST + WIDER * k for k in reversed(range(len(flights)))]
    for p, width in zip(paths.values(), widths, strict=True):
        axes.plot(p[:, 0], p[:, 1], color="white", lw=width + WIDER, alpha=0.8)
    for (name, (_, colour)), width in zip(flights.items(), widths, strict=True):
        axes.plot(paths[name][:, 0], paths[name][:, 1], color=colour, lw=width, label=name)
    first = next(iter(flights.values()))[0]
    for radar in first.config["mission"]["radars"]:
        centre = (radar["x"] / 1e3, radar["y"] / 1e3)
        axes.add_patch(Circle(centre, radar["radius"] / 1e3, facecolor=RADAR, alpha=0.2, edgecolor=RADAR))
    for (name, place), face in zip(ends(first).items(), ("white", "#ffd90d"), strict=True):
        axes.plot(place[0] / 1e3, place[1] / 1e3, "o", ms=6, mfc=face, mec="#101824", zorder=4)
        axes.annotate(
            name, (place[0] / 1e3, place[1] / 1e3), (0, 7), textcoords="offset points", ha="center", color="white",
            fontsize=7.5, path_effects=[patheffects.withStroke(linewidth=2.0, foreground="#101824")],
        )  # fmt: skip
    axes.set_title(title)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3 if len(flights) == 3 else 2, fontsize=8)
