"""Charts of a run from its log: states with their estimates, estimate errors, inputs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.generic.run_data import GenericRun, estimates
from mathnavi.renders.palette import COLOURS, Colour, SceneElement, vehicle_colour
from mathnavi.renders.scene.elements import Chart, Series
from mathnavi.sim.records.figure_names import label
from mathnavi.sim.records.run_folder import described
from mathnavi.sim.records.timing import read_timing, slow_components

MOST_POINTS = 1200  # of a curve
MOST_CHARTS = 8  # of a kind: of more states or inputs the first ones
MOST_FACTS = 8
TRUTH, ESTIMATE = COLOURS[SceneElement.TRUE_PATH], COLOURS[SceneElement.ESTIMATE]


def curve(name: str, colour: Colour, t: Array, y: Array, *, step: bool = False, dashed: bool = False) -> Series:
    """Curve y (n,) over t (n,) [s] with ``MOST_POINTS`` points at most.

    Of each stretch between them it keeps the least and the greatest value.
    """
    if len(t) > MOST_POINTS:
        edges = np.linspace(0, len(t), MOST_POINTS // 2 + 1).astype(np.int64)
        rows = set()
        for first, after in pairwise(edges.tolist()):
            part = y[first:after]
            known = np.flatnonzero(np.isfinite(part))
            rows |= (
                {first + known[np.argmin(part[known])], first + known[np.argmax(part[known])]}
                if len(known)
                else {first}
            )
        chosen = np.array(sorted({0, len(t) - 1, *rows}), dtype=np.int64)
        t, y = t[chosen], y[chosen]
    return Series(name, colour, t, y, step, dashed)


def state_charts(run: GenericRun) -> list[Chart]:
    """A chart for each state: truth and estimate, or the vehicles of a fleet."""
    name, log = next(iter(run.vehicles.items()))
    found, charts = None if len(run.vehicles) > 1 else estimates(log), []
    for k, words in enumerate(run.states[name][:MOST_CHARTS]):
        title, unit = named(words)
        if len(run.vehicles) > 1:
            series = [
                curve(vehicle, vehicle_colour(number), each.t, each.x[:, k])
                for number, (vehicle, each) in enumerate(run.vehicles.items())
            ]
        else:
            series = [curve("truth", TRUTH, log.t, log.x[:, k])]
            if found is not None:
                series.append(curve("estimate", ESTIMATE, found.t, found.x[:, k]))
        charts.append(Chart(title, unit, series))
    return charts


def error_charts(run: GenericRun) -> list[Chart]:
    """The norm of estimate less truth over the states of one unit, by vehicle."""
    by_unit: dict[str, list[Series]] = {}
    for number, (name, log) in enumerate(run.vehicles.items()):
        found = estimates(log)
        if found is None:
            continue
        units = [named(words)[1] for words in run.states[name]]
        several = len(run.vehicles) > 1
        for unit in dict.fromkeys(units):
            columns = [k for k, each in enumerate(units) if each == unit]
            error = np.linalg.norm(found.error[:, columns], axis=1)
            colour = vehicle_colour(number) if several else ESTIMATE
            by_unit.setdefault(unit, []).append(curve(name if several else "", colour, found.t, error))
    return [Chart("estimate error", unit, series) for unit, series in by_unit.items()]


def input_charts(run: GenericRun) -> list[Chart]:
    """A chart for each input."""
    count = min(max(log.u.shape[1] for log in run.vehicles.values()), MOST_CHARTS)
    several = len(run.vehicles) > 1
    shown = [
        (name if several else "", vehicle_colour(number) if several else TRUTH, log)
        for number, (name, log) in enumerate(run.vehicles.items())
    ]
    return [
        Chart(
            f"input {k + 1}", "",
            [curve(name, colour, log.t, log.u[:, k], step=True) for name, colour, log in shown if k < log.u.shape[1]],
        )
        for k in range(count)
    ]  # fmt: skip


def named(words: str) -> tuple[str, str]:
    """Name and unit of a state "name [unit]"."""
    name, _, unit = words.partition(" [")
    return name.replace("_", " "), unit.rstrip("]").replace("-", "") if unit == "-]" else unit.rstrip("]")


def events_of(run: GenericRun) -> Sequence[tuple[float, str]]:
    """Times of events, in words."""
    several = len(run.vehicles) > 1
    found = []
    for event in run.events:
        kind, details = described(event)
        words = f"{kind}: {details}" if details else kind
        found.append((event.t, f"{event.agent}: {words}" if several and event.agent else words))
    return found


def facts_of(run: GenericRun) -> Sequence[tuple[str, str]]:
    """The first figures of the summary, with units, and the components that were slower than real time."""
    from mathnavi.renders.page import quantity

    numbers = [(key, value) for key, value in run.summary.items() if isinstance(value, bool | int | float)]
    facts = [(label(key)[0], quantity(key, value)) for key, value in numbers if key != "version"][:MOST_FACTS]
    timing = read_timing(run.directory)
    return facts if timing is None else [*facts, *slow_components(timing).items()]
