"""Plan of a recorded log: paths by the reference and by the estimate, walls and beacons of the estimator's mission.

A position is the first two numbers in metres of a reference or an estimate, as in ``sim.records.reference_figures``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signal_names import SignalNames, name_and_unit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.wall import Wall
from mathnavi.renders.figures import STYLE, canvas, colour_of, thinned
from mathnavi.renders.generic.run_data import GenericRun, estimates, usable
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.plan import Found, draw_beacons, draw_end, draw_found, draw_line, draw_wall
from mathnavi.sim.records.missions import read_mission
from mathnavi.sim.records.plan_record import PlanRecord
from mathnavi.sim.records.run_folder import RunLog, last_at

REFERENCE, ESTIMATE = SceneElement.TRUE_PATH, SceneElement.ESTIMATE
WIDTH, HEIGHT = 9.4, (3.4, 7.2)  # [inches] of a figure, least and most of its height
JUMP = 0.05  # of the plan's diagonal, over which no path is drawn
_PLACES = (("estimate.beacons", 2), ("estimate.beacon_places", 3))  # arrays of places, and numbers of each


@dataclass(frozen=True, eq=False)
class LogPlan:
    """A log as seen from above."""

    t: Array  # (n,) [s]
    reference: Array  # (n, 2) [m]; (n, 0) without
    t_estimate: Array  # (k,) [s]
    estimate: Array  # (k, 2) [m], NaN where it may not be used
    wall: Wall | None
    beacons: Mapping[int, Array]  # known places (2,) [m] by their numbers
    places: Array  # (k, b, 2) [m] of the beacons as the estimator has them, NaN until one is found; (k, 0, 2) without
    covariances: Array  # (k, b, 2, 2) [m^2]

    def found(self, k: int) -> Found:
        """Places and covariances that estimate ``k`` has of the beacons whose places were not given."""
        return {
            i: (self.places[k, i], self.covariances[k, i])
            for i in range(self.places.shape[1])
            if i not in self.beacons and np.isfinite(self.places[k, i]).all()
        }

    @cached_property
    def last_found(self) -> Found:
        """Places of beacons at the end of the log."""
        return self.found(len(self.t_estimate) - 1) if len(self.t_estimate) else {}

    @cached_property
    def points(self) -> Array:
        """Points (m, 2) [m] that are drawn."""
        found = [place for place, _ in self.last_found.values()]
        parts = [
            *([] if self.wall is None else self.wall.outlines),
            *map(np.atleast_2d, [*self.beacons.values(), *found]),
        ]
        parts += [self.estimate, *([self.reference] if self.reference.shape[1] else [])]
        points: Array = np.vstack(parts)
        return points[np.isfinite(points).all(axis=1)]

    @cached_property
    def jump(self) -> float:
        """Distance [m] between two places of a path over which it is not drawn."""
        return JUMP * float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @property
    def path(self) -> Array:
        """(n, 2) [m] that of the reference; that of the estimate where there is none."""
        return self.reference if self.reference.shape[1] else self.estimate


def log_plan(run: GenericRun) -> LogPlan | None:
    """The plan of a recorded log; None of any other run, and of a log without two positions that differ."""
    if not run.is_log:
        return None
    ((name, log),) = run.vehicles.items()
    try:
        record = read_mission(PlanRecord, run.config.get("mission", {}))
        wall = record.wall()
    except ValueError as error:
        raise RunFolderError(
            f"{str(run.directory)!r}: config.json does not describe walls and beacons: {error}"
        ) from None
    position = _position(run.states[name])
    reference = log.x[:, position] if position else np.empty((len(log.t), 0))
    t, estimate = _estimated(log, run.signals[name])
    places, covariances = _places(log, len(record.beacons), len(t))
    known = {i: np.array(each) for i, each in enumerate(record.beacons) if each is not None}
    plan = LogPlan(log.t, reference, t, estimate, wall, known, places, covariances)
    return plan if len(np.unique(plan.path[np.isfinite(plan.path).all(axis=1)], axis=0)) > 1 else None


def _position(names: Sequence[str]) -> list[int]:
    """Columns of a position among numbers called "name [unit]": of two lengths, or of x and y without a unit, which are
    in SI units; none otherwise.
    """
    columns = [k for k, name in enumerate(names) if name_and_unit(name)[1] == "m"][:2]
    if not columns:
        columns = [names.index(axis) for axis in ("x", "y") if axis in names]
    return columns if len(columns) == 2 else []


def _estimated(log: RunLog, signals: SignalNames) -> tuple[Array, Array]:
    """Times (k,) [s] and positions (k, 2) [m], NaN where the estimate may not be used; none without a position."""
    found = estimates(log, signals)
    position = [] if found is None else _position(found.names)
    if found is None or not position:
        return np.empty(0), np.empty((0, 2))
    return found.t, np.where(usable(log, found.t)[:, None], found.x[:, position], np.nan)


def _places(log: RunLog, count: int, rows: int) -> tuple[Array, Array]:
    """Places (k, b, 2) and covariances (k, b, 2, 2) of ``count`` beacons in the plane; none if not logged."""
    for array, size in _PLACES:
        places, P = log.arrays.get(array), log.arrays.get(f"{array}_covariance")
        if places is None or P is None or places.size != rows * count * size:
            continue
        if P.size == rows * (count * size) ** 2:  # of all beacons together
            whole = P.reshape(rows, count, size, count, size)
            P = np.stack([whole[:, i, :, i] for i in range(count)], axis=1)
        if P.size == rows * count * size * size:
            return places.reshape(rows, count, size)[..., :2], P.reshape(rows, count, size, size)[..., :2, :2]
    return np.empty((rows, 0, 2)), np.empty((rows, 0, 2, 2))


class MovingPlan:
    """The plan on axes, with marks where reference and estimate are at a time."""

    def __init__(self, axes: Axes, plan: LogPlan, *, brief: bool = False) -> None:
        self.axes, self._plan = axes, plan
        draw_plan(axes, plan, brief=brief)
        self.markers = [
            axes.plot([], [], "o", ms=size, color=colour_of(part), mec="white", mew=1.2, zorder=7)[0]
            for part, size in ((REFERENCE, 11.0), (ESTIMATE, 8.0))
        ]

    def show(self, t: float) -> None:
        """Move the marks to where both are at ``t`` [s]; neither is shown where it is not known."""
        plan = self._plan
        paths = ((plan.t, plan.reference), (plan.t_estimate, plan.estimate))
        for marker, (times, places) in zip(self.markers, paths, strict=True):
            k = last_at(times, t)
            known = k >= 0 and places.shape[1] == 2
            marker.set_data(*(places[k : k + 1].T if known else ((), ())))


def plan_figure(plan: LogPlan) -> Figure:
    """The plan on a figure of its own."""
    with matplotlib.rc_context(STYLE):
        wide, tall = np.maximum(np.ptp(plan.points, axis=0), 1e-9)
        figure = canvas(WIDTH, float(np.clip(1.2 + 0.9 * WIDTH * tall / wide, *HEIGHT)))
        draw_plan(figure.add_subplot(), plan)
    return figure


def draw_plan(axes: Axes, plan: LogPlan, *, brief: bool = False) -> None:
    """Draw the plan; a ``brief`` one, for large letters in a small picture, without legend and the ends of the path."""
    if plan.wall is not None:
        draw_wall(axes, plan.wall)
    if plan.reference.shape[1]:
        rows = thinned(len(plan.t), 0)
        draw_line(axes, plan.reference[rows], plan.jump, color=colour_of(REFERENCE), lw=2.2, label="reference")
    if np.isfinite(plan.estimate).any():
        draw_line(axes, plan.estimate, plan.jump, color=colour_of(ESTIMATE), lw=1.3, label="estimate")
    draw_beacons(axes, plan.beacons)
    draw_found(axes, plan.last_found, named=True)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.margins(0.12 if brief else 0.06)
    if brief:
        return
    known = np.flatnonzero(np.isfinite(plan.path).all(axis=1))
    draw_end(axes, "start", plan.path[known[0]], filled=False)
    draw_end(axes, "end", plan.path[known[-1]], filled=True)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, borderaxespad=0.2)
