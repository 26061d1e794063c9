"""The path of a robot in its field and what it believed on the way, in the style of ``mathnavi.renders.figures``."""

from __future__ import annotations

import math

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.renders.figures import STYLE, canvas, colour_of, thinned
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.plan import DEVIATIONS, draw_beacons, draw_end, draw_found, draw_line, draw_wall, name_at
from mathnavi.renders.ranging import shapes
from mathnavi.renders.ranging.drawing import begun
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.sim.records.run_folder import last_at

DRIVEN, ESTIMATE, IMAGE = map(colour_of, (SceneElement.DRIVEN, SceneElement.ESTIMATE, SceneElement.IMAGE))
LOOKS = 9  # estimates marked along the path, the denser the earlier
CLOSE = 0.15  # of the run that is shown enlarged
CLOSE_LOOKS = 7
LEAST_VIEW = 0.25  # [m] side of the close view, at least
JUMP = 0.25  # [m] over which no path is drawn


def field_figure(run: RangingRun) -> Figure:
    """The whole field, and the end of the run closely."""
    with matplotlib.rc_context(STYLE):
        wide, tall = np.ptp(np.vstack([run.curve.polyline, run.beacons]), axis=0)
        figure = canvas(9.4, float(np.clip(1.0 + 5.9 * tall / wide, 3.1, 6.2)))
        field, close = figure.subplots(1, 2, width_ratios=(2.6, 1.0))
        _draw_field(field, run)
        _draw_close(close, run)
    return figure


def _draw_field(axes: Axes, run: RangingRun) -> None:
    draw_wall(axes, run.curve)
    _draw_paths(axes, run)
    if run.initialised.any():
        times = begun(run) + (run.duration - begun(run)) * np.linspace(0.0, 1.0, LOOKS) ** 3
        for number, t in enumerate(times):
            k = last_at(run.beliefs.t, float(t))
            _draw_belief(axes, run, k)
            if number == 0:
                name_at(axes, f"after {t:.2g} s", run.beliefs.x[k, :2])
    draw_beacons(axes, dict(enumerate(run.beacons)))
    draw_found(axes, run.beacons_believed(len(run.beliefs.t) - 1), named=False)
    draw_end(axes, "start", run.pose[0, :2], filled=False)
    draw_end(axes, "end", run.pose[-1, :2], filled=True)
    axes.set(xlabel="x₁ [m]", ylabel="x₂ [m]", aspect="equal", title="Path")
    handles, names = axes.get_legend_handles_labels()
    axes.legend(handles, names, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.2)


def _draw_close(axes: Axes, run: RangingRun) -> None:
    """The last part of the run, where the estimate is."""
    begin = (1.0 - CLOSE) * run.duration
    late = run.initialised & (run.beliefs.t >= begin)
    axes.set(title=f"The last {run.duration - begin:.1f} s", xlabel="x₁ [m]", aspect="equal")
    axes.locator_params(nbins=4)
    if not late.any():
        return
    axes.plot(*run.seen_as[late, :2].T, color=DRIVEN, lw=2.2)
    draw_line(axes, run.beliefs.x[late, :2], JUMP, color=ESTIMATE, lw=1.2)
    for k in np.flatnonzero(late)[np.linspace(0, late.sum() - 1, CLOSE_LOOKS).astype(int)]:
        _draw_belief(axes, run, int(k), outline=False)
    both = np.vstack([run.seen_as[late, :2], run.beliefs.x[late, :2]])
    middle = 0.5 * (both.min(axis=0) + both.max(axis=0))
    half = 0.5 * max(1.15 * float(np.ptp(both, axis=0).max()), LEAST_VIEW)
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))


def _draw_paths(axes: Axes, run: RangingRun) -> None:
    i = thinned(len(run.t), 0)
    axes.plot(*run.pose[i, :2].T, color=DRIVEN, lw=2.2, label="driven")
    if run.image:
        axes.plot(*run.mirrored[:, :2].T, color=IMAGE, lw=2.0, ls="--", label="indistinguishable from it")
    known = np.where(run.initialised[:, None], run.beliefs.x[:, :2], np.nan)
    draw_line(axes, known, JUMP, color=ESTIMATE, lw=1.3, label="estimate")
    if run.beliefs.covariance is not None:
        axes.plot([], [], "-", color=ESTIMATE, lw=6.0, alpha=0.3, label=f"{DEVIATIONS:g}σ")


def _draw_belief(axes: Axes, run: RangingRun, k: int, *, outline: bool = True) -> None:
    """The robot where estimate ``k`` has it, and what the estimate is unsure of."""
    x, P = run.beliefs.x[k], run.beliefs.covariance
    if outline:
        axes.plot(*shapes.outline(x).T, color=ESTIMATE, lw=0.9)
    if P is not None and np.isfinite(P[k]).all():
        ring = shapes.ellipse(x[:2], *shapes.half_axes(P[k], DEVIATIONS))
        axes.fill(*ring.T, color=ESTIMATE, alpha=0.18, lw=0)
        axes.plot(*ring.T, color=ESTIMATE, lw=0.8)
    elif not outline:
        reach = 0.03 * np.array([math.cos(x[2]), math.sin(x[2])])
        axes.plot([x[0], x[0] + reach[0]], [x[1], x[1] + reach[1]], ".-", color=ESTIMATE, markevery=[0])
