"""Truth and estimate as paths in a curved space, and the geodesic between them, up to any moment."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mathnavi.interfaces.signals import Array
from mathnavi.renders.lagrangian.charts import MapProjection
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.views import RECENT
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal

TRUTH, ESTIMATE, REFERENCE, GEODESIC = (
    hexadecimal(COLOURS[part])
    for part in (SceneElement.TRUE_PATH, SceneElement.ESTIMATE, SceneElement.REFERENCE, SceneElement.GEODESIC)
)

MOST_POINTS, ON_GEODESIC = 1200, 25
FAR = 0.45  # opacity on the far side of a sphere, of that on the near one


class PathDrawing:
    """Draws the paths into one set of axes, which has no ticks."""

    def __init__(self, run: LagrangianRun, axes: Axes, chart: MapProjection, scale: float = 1.0) -> None:
        """``scale`` is of the width of lines."""
        self._run, self._chart = run, chart
        axes.set_axis_off()
        chart.prepare(axes)
        styles = {
            "reference": (REFERENCE, 1.4, 0.9),
            "past": (TRUTH, 1.0, 0.35),
            "truth": (TRUTH, 2.6, 1.0),
            "estimate": (ESTIMATE, 1.3, 0.9),
            "geodesic": (GEODESIC, 3.0, 1.0),
        }
        self._lines = {
            (name, near): axes.plot(
                [], [], color=colour, lw=scale * width, alpha=opacity if near else FAR * opacity,
                solid_capstyle="round", zorder=3.0 + near,
            )[0]
            for near in (False, True)
            for name, (colour, width, opacity) in styles.items()
        }  # fmt: skip
        self._dots = {
            name: axes.plot([], [], "o", ms=scale * size, mfc=colour, mec="white", mew=scale, zorder=5.0)[0]
            for name, colour, size in (("reference", REFERENCE, 6), ("estimate", ESTIMATE, 7), ("truth", TRUTH, 7))
        }

    @property
    def moving(self) -> list[Artist]:
        """Artists that change with time."""
        return [*self._lines.values(), *self._dots.values()]

    def show(self, t: float) -> None:
        """Show everything up to ``t`` [s]."""
        run, n, now = self._run, self._run.manifold.size, self._run.index(t)
        recent = run.index(t - RECENT)
        self._draw("past", run.log.x[_thinned(0, recent), :n])
        self._draw("truth", run.log.x[_thinned(recent, now), :n])
        self._mark("truth", run.log.x[now, :n])
        first, k = max(run.belief(t - RECENT), 0), run.belief(t)
        if k < 0:
            self._draw("estimate", np.empty((0, n)))
            self._draw("geodesic", np.empty((0, n)))
        else:
            known = [j for j in _thinned(first, k) if run.errors.found[j] > 0.0]
            self._draw("estimate", np.array([run.drawn(j) for j in known]))
            self._draw("geodesic", np.array([run.towards(k, float(s)) for s in np.linspace(0.0, 1.0, ON_GEODESIC)]))
        self._mark("estimate", None if k < 0 else run.drawn(k))
        targets = [p for s in np.linspace(max(t - RECENT, 0.0), t, 60) if (p := run.reference(float(s))) is not None]
        self._draw("reference", np.array(targets).reshape(-1, n))
        self._mark("reference", targets[-1] if targets else None)

    def _draw(self, name: str, points: Array) -> None:
        place, is_near = self._chart.project(points)
        for near in (False, True):
            line: Line2D = self._lines[name, near]
            line.set_data(*np.where((is_near == near)[:, None], place, np.nan).T)

    def _mark(self, name: str, point: Array | None) -> None:
        dot: Line2D = self._dots[name]
        if point is None:
            dot.set_data([], [])
            return
        place, near = self._chart.project(point[None])
        dot.set_data(*place.T)
        dot.set_alpha(1.0 if near[0] else FAR)


def _thinned(first: int, last: int) -> list[int]:
    """Indices from the first to the last one, not too many."""
    count = min(last - first + 1, MOST_POINTS)
    chosen: list[int] = np.unique(np.linspace(first, last, max(count, 1)).astype(int)).tolist()
    return chosen
