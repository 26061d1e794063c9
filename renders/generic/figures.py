"""Charts of a run from its log alone: states, inputs, readings, estimates and their errors, under the names and units
of the log.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.interfaces.signals import Array
from mathnavi.renders.figures import STYLE, canvas, colour_of, thinned
from mathnavi.renders.generic.run_data import GenericRun, estimates
from mathnavi.renders.palette import SceneElement, hexadecimal, vehicle_colour

MOST_ROWS = 12  # of charts in a figure; of more states the first ones are drawn
MOST_NUMBERED = 4  # lines of a chart that are numbered beside it
READING_PREFIX, ESTIMATE_PREFIX = "measurement.", "estimate."  # of the names of arrays
WIDTH, ROW = 9.4, 1.25  # [inches]
TRUTH, ESTIMATE = colour_of(SceneElement.TRUE_PATH), colour_of(SceneElement.ESTIMATE)


def states_figure(run: GenericRun, most: int = MOST_ROWS) -> Figure:
    """Every state over time, and its estimate."""
    name, log = next(iter(run.vehicles.items()))
    labels = run.states[name][:most]
    with matplotlib.rc_context(STYLE):
        figure, panels = _panels(len(labels))
        rows, found = thinned(len(log.t), 0), None if len(run.vehicles) > 1 else estimates(log)
        for k, (axes, label) in enumerate(zip(panels, labels, strict=True)):
            for number, (vehicle, each) in enumerate(run.vehicles.items()):
                colour = TRUTH if len(run.vehicles) == 1 else hexadecimal(vehicle_colour(number))
                legend = "truth" if len(run.vehicles) == 1 else vehicle
                axes.plot(each.t[rows], each.x[rows, k], color=colour, lw=2.2 if found else 1.4, label=legend)
            if found is not None:
                shown = thinned(len(found.t), 0)
                axes.plot(found.t[shown], found.x[shown, k], color=ESTIMATE, lw=1.1, label="estimate")
            drawn = [each.x[:, k] for each in run.vehicles.values()]
            believed = [] if found is None else [np.nanpercentile(found.x[:, k], (1.0, 99.0))]
            _ends(axes, label, _within(np.concatenate([*drawn, *believed])))
        if found is not None or len(run.vehicles) > 1:
            panels[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=8, borderaxespad=0.1)
        panels[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def inputs_figure(run: GenericRun) -> Figure | None:
    """Draw every input over time; None without inputs."""
    count = min(max(log.u.shape[1] for log in run.vehicles.values()), MOST_ROWS)
    if count == 0:
        return None
    with matplotlib.rc_context(STYLE):
        figure, panels = _panels(count)
        for number, (vehicle, log) in enumerate(run.vehicles.items()):
            rows = thinned(len(log.t), 0)
            colour = TRUTH if len(run.vehicles) == 1 else hexadecimal(vehicle_colour(number))
            for k, axes in enumerate(panels[: log.u.shape[1]]):
                axes.plot(log.t[rows], log.u[rows, k], color=colour, lw=1.2, label=vehicle, drawstyle="steps-post")
                axes.set_ylabel(f"input {k + 1}")
        if len(run.vehicles) > 1:
            panels[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=8, borderaxespad=0.1)
        panels[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def errors_figure(run: GenericRun) -> Figure | None:
    """Estimate less truth of every state; None where no estimator estimates the state."""
    known = {name: found for name, log in run.vehicles.items() if (found := estimates(log)) is not None}
    if not known:
        return None
    labels = run.states[next(iter(known))][:MOST_ROWS]
    with matplotlib.rc_context(STYLE):
        figure, panels = _panels(len(labels))
        for number, found in enumerate(known.values()):
            rows = thinned(len(found.t), 0)
            colour = ESTIMATE if len(known) == 1 else hexadecimal(vehicle_colour(number))
            for k, (axes, label) in enumerate(zip(panels, labels, strict=True)):
                axes.plot(found.t[rows], found.error[rows, k], color=colour, lw=1.1)
                _ends(axes, label, _within(found.error[:, k]))
        panels[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def estimates_figure(run: GenericRun) -> Figure | None:
    """Draw the estimate of a vehicle whose estimator estimates something else than its state, with what it says
    besides; None without one.
    """
    log = next(iter(run.vehicles.values()))
    t, x = log.arrays.get("estimate.t"), log.arrays.get("estimate.x")
    if t is None or x is None or x.ndim != 2 or not len(t) or estimates(log) is not None:
        return None
    further = {name.removeprefix(ESTIMATE_PREFIX): log.arrays[name] for name in sorted(log.arrays)}
    further = {
        name: values.reshape(len(t), -1)
        for name, values in further.items()
        if f"{ESTIMATE_PREFIX}{name}" in log.arrays and name not in ("t", "x", "unused") and values.size == len(t)
    }
    columns = {**{f"estimate {k + 1}": x[:, [k]] for k in range(x.shape[1])}, **further}
    return _columns_figure({name: (t, values) for name, values in list(columns.items())[:MOST_ROWS]}, run.duration)


def readings_figure(run: GenericRun) -> Figure | None:
    """Draw the readings of each sensor of a vehicle over time, a line for each component; None without readings."""
    log = next(iter(run.vehicles.values()))
    columns = {}
    for name in sorted(name for name in log.arrays if name.startswith(READING_PREFIX)):
        values = log.arrays[name].reshape(len(log.t), -1)
        read = np.isfinite(values).any(axis=1)
        if read.any():
            columns[name.removeprefix(READING_PREFIX)] = log.t[read], values[read]
    return _columns_figure(dict(list(columns.items())[:MOST_ROWS]), run.duration) if columns else None


def _columns_figure(columns: Mapping[str, tuple[Array, Array]], duration: float) -> Figure:
    """One panel for each name, with a line for each column of its values (k, m) at the times (k,) [s]."""
    with matplotlib.rc_context(STYLE):
        figure, panels = _panels(len(columns))
        for axes, (name, (t, values)) in zip(panels, columns.items(), strict=True):
            rows = thinned(len(t), 0)
            several = values.shape[1] > 1
            for k in range(values.shape[1]):
                colour = hexadecimal(vehicle_colour(k)) if several else ESTIMATE
                axes.plot(t[rows], values[rows, k], color=colour, lw=1.1, label=str(k + 1))
            if 1 < values.shape[1] <= MOST_NUMBERED:
                axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=8, borderaxespad=0.1)
            _ends(axes, name, _within(values))
        panels[-1].set(xlabel="time [s]", xlim=(0.0, duration))
    return figure


def _panels(count: int) -> tuple[Figure, Sequence[Axes]]:
    figure = canvas(WIDTH, 0.5 + ROW * count)
    panels = np.atleast_1d(figure.subplots(count, 1, sharex=True))
    return figure, list(panels)


def _ends(axes: Axes, label: str, limits: tuple[float, float] | None) -> None:
    axes.set_ylabel(label.replace("_", " ").replace(" [", "\n[").removesuffix("\n[-]"))
    if limits is not None:
        axes.set_ylim(*limits)


def _within(values: Array) -> tuple[float, float] | None:
    """Limits of an axis; None where there is no finite value."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return None
    low, high = float(finite.min()), float(finite.max())
    margin = 0.08 * (high - low) or 0.5 * max(abs(high), 1e-6)
    return low - margin, high + margin
