"""Plan of a robot or a flight, seen from above [m]: walls, paths, beacons with their numbers and deviations.

Simulated robots (``mathnavi.renders.ranging.field_figure``) and recorded logs (``mathnavi.renders.generic.log_plan``)
are drawn by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.wall import Wall
from mathnavi.renders.figures import GRID, INK, colour_of
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.ranging import shapes

DEVIATIONS = 3.0  # of an ellipse
NEAR, OFFSET = 0.1, 13.0  # of the extent of all beacons, within which numbers give way; [points] from a place
_ESTIMATE, _BEACON = colour_of(SceneElement.ESTIMATE), colour_of(SceneElement.BEACON)
Found = Mapping[int, tuple[Array, Array]]
"""place (2,) [m] and covariance (2, 2) [m^2] of each beacon that was found, by its number"""


def deviation(covariance: Array) -> float:
    """Standard deviation [m] of a place with a covariance (2, 2), of both coordinates together."""
    return float(np.sqrt(max(np.trace(covariance), 0.0)))


def draw_wall(axes: Axes, wall: Wall) -> None:
    """Fill what is within a wall, and draw its outlines."""
    corners = np.vstack(wall.outlines)
    codes = np.concatenate([[Path.MOVETO] + [Path.LINETO] * (len(each) - 1) for each in wall.outlines])
    axes.add_patch(PathPatch(Path(corners, codes), facecolor=GRID, alpha=0.22, lw=0))
    for outline in wall.outlines:
        axes.plot(*outline.T, color=INK, lw=2.2 if len(corners) < 2000 else 0.8)


def draw_line(axes: Axes, places: Array, jump: float, **style: Any) -> None:
    """A line through places (n, 2), but for jumps longer than ``jump`` [m] and what is not known."""
    jumps = np.flatnonzero(np.linalg.norm(np.diff(places, axis=0), axis=1) > jump) + 1
    axes.plot(*np.insert(places, jumps, np.nan, axis=0).T, **style)


def draw_beacons(axes: Axes, places: Mapping[int, Array]) -> None:
    """Beacons at places (2,) with their numbers."""
    if not places:
        return
    axes.plot(
        *np.array(list(places.values())).T, "D", ms=6, color=_BEACON, mec=INK, mew=0.6, ls="", label="beacon", zorder=4
    )
    for number, place in places.items():
        others = np.array([each for other, each in places.items() if other != number]).reshape(-1, 2)
        axes.annotate(
            str(number), tuple(place), _away(place, others), textcoords="offset points", ha="center", va="center",
            zorder=6,
        )  # fmt: skip


def _away(place: Array, others: Array) -> tuple[float, float]:
    """Offset [points] of a number: above its place (2,), or away from the nearest of the others (m, 2) that is near."""
    reach = float(np.linalg.norm(np.ptp(np.vstack([place, others]), axis=0))) * NEAR
    near = others[np.linalg.norm(others - place, axis=1) < reach] if len(others) else others
    if not len(near):
        return 0.0, OFFSET
    direction = place - near.mean(axis=0)
    length = float(np.linalg.norm(direction))
    return (0.0, OFFSET) if length < 0.05 * reach else tuple((OFFSET * direction / length).tolist())


def draw_found(axes: Axes, found: Found, *, named: bool) -> None:
    """Places of beacons that an estimator has found, with their ellipses; with their numbers and deviations, or not."""
    for place, P in found.values():
        ring = shapes.ellipse(place, *shapes.half_axes(P, DEVIATIONS))
        axes.fill(*ring.T, color=_ESTIMATE, alpha=0.18, lw=0)
        axes.plot(*ring.T, color=_ESTIMATE, lw=0.8)
    if found:
        label = "beacon, as found" if named else None
        places = np.array([place for place, _ in found.values()])
        axes.plot(*places.T, "+", ms=8, mew=1.6, color=_ESTIMATE, ls="", label=label, zorder=5)
    for number, (place, P) in found.items() if named else ():
        name_at(axes, f"{number}, σ {deviation(P):.2g} m", place)


def draw_end(axes: Axes, name: str, place: Array, *, filled: bool) -> None:
    """Start or end of a path, with its name."""
    axes.plot(*place, "o", ms=6, mfc=INK if filled else "none", mec=INK, mew=1.4, zorder=5)
    name_at(axes, name, place, below=True)


def name_at(axes: Axes, text: str, place: Array, *, below: bool = False) -> None:
    """Write a name above a place (2,), or below it."""
    axes.annotate(
        text, tuple(place), (0, -15 if below else 13), textcoords="offset points", ha="center", va="center", zorder=6
    )
