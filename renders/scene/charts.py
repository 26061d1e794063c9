"""Charts of a run from its log, under the names of its signals: states and estimates, errors, readings, inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from mathnavi.interfaces.signal_names import name_and_unit, numbered
from mathnavi.interfaces.signals import Array
from mathnavi.renders.generic.run_data import GenericRun, RecordedEstimates, estimates
from mathnavi.renders.palette import COLOURS, Colour, SceneElement, vehicle_colour
from mathnavi.renders.scene.elements import Chart, Series
from mathnavi.sim.records.event_kinds import is_alarm, with_origin
from mathnavi.sim.records.figure_names import label
from mathnavi.sim.records.log_arrays import ESTIMATED, SAMPLED
from mathnavi.sim.records.run_folder import described
from mathnavi.sim.records.timing import read_timing, slow_components

MOST_POINTS = 1200  # of a curve
MOST_FACTS = 8
DEVIATIONS = 2.0  # half the height of the band about an estimate, in standard deviations of its covariance
ESTIMATED_WORD = "estimate"
LEFT_OUT, RAISED = "left_out", 0.8  # name of the flags of channels, and rise of the line of one that is left out
PLACES = "beacons"  # name of the places of beacons, as an estimator among unknown ones has them
LEFT_OUT_TITLE = "left out while raised"
_NOT_FURTHER = ("t", "x", "unused", "deviation", "covariance")  # arrays of an estimate that are not figures besides it
TRUTH, ESTIMATE = COLOURS[SceneElement.TRUE_PATH], COLOURS[SceneElement.ESTIMATE]


def curve(
    name: str,
    colour: Colour,
    t: Array,
    y: Array,
    *,
    step: bool = False,
    dashed: bool = False,
    band: Array | None = None,
) -> Series:
    """Curve y (n,) over t (n,) [s] with ``MOST_POINTS`` points at most, and the half height (n,) of a band about it.

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
        t, y, band = t[chosen], y[chosen], None if band is None else band[chosen]
    return Series(name, colour, t, y, step, int(dashed), band)


def grouped(names: Sequence[str], groups: Mapping[str, Sequence[str]]) -> list[tuple[str, str, list[tuple[int, str]]]]:
    """Return title and unit of each chart of these "name [unit]", and the indices in it with what the lines are called.

    Names of one group and unit are in one chart; numbers without a unit, as quaternions are, come last.
    """
    titles = {name: title for title, own in groups.items() for name in own}
    charts: dict[tuple[str, str], list[int]] = {}
    for k, words in enumerate(names):
        unit = name_and_unit(words)[1]
        title = titles.get(words.partition(" [")[0])
        charts.setdefault((title or f"\0{k}", unit), []).append(k)
    found = []
    for (title, unit), columns in charts.items():
        plain = [name_and_unit(names[k])[0] for k in columns]
        if len(columns) == 1:
            found.append((plain[0], unit, [(columns[0], "")]))
        else:
            found.append((title, unit, list(zip(columns, _apart(plain), strict=True))))
    return [*(each for each in found if each[1]), *(each for each in found if not each[1])]


def _apart(names: Sequence[str]) -> list[str]:
    """Return names without the words with which all of them begin."""
    words = [name.split(" ") for name in names]
    common = 0
    while all(len(each) > common + 1 and each[common] == words[0][common] for each in words):
        common += 1
    return [" ".join(each[common:]) for each in words]


def state_charts(run: GenericRun) -> list[Chart]:
    """Charts of the states: truth and estimate, or the vehicles of a fleet."""
    name, log = next(iter(run.vehicles.items()))
    if len(run.vehicles) > 1:
        return [
            Chart(
                *name_and_unit(words),
                [
                    curve(vehicle, vehicle_colour(number), each.t, each.x[:, k])
                    for number, (vehicle, each) in enumerate(run.vehicles.items())
                    if k < each.x.shape[1]
                ],
            )
            for k, words in enumerate(run.states[name])
        ]
    found, names, x = estimates(log, run.signals[name]), run.states[name], log.x
    if found is not None and not found.whole:
        if run.is_log:  # the numbers of a reference are drawn with those of the estimate that have their names
            kept = [k for k, words in enumerate(names) if words not in found.names]
            names, x = tuple(names[k] for k in kept), x[:, kept]
        found = None
    return [
        Chart(title, unit, _lines(columns, log.t, x, found, run.truth_word))
        for title, unit, columns in grouped(names, run.signals[name].groups)
    ]


def estimate_charts(run: GenericRun) -> list[Chart]:
    """Charts of an estimate that is not of the whole state, with the truth where it is known, of a single vehicle."""
    name, log = next(iter(run.vehicles.items()))
    found = estimates(log, run.signals[name]) if len(run.vehicles) == 1 else None
    if found is None or found.whole:
        return []
    return [
        Chart(title, unit, _lines(columns, log.t, found.truth, found, run.truth_word))
        for title, unit, columns in grouped(found.names, run.signals[name].groups)
    ]


def figure_charts(run: GenericRun) -> list[Chart]:
    """Charts of the further figures of an estimate, of a single vehicle: first of what it left out."""
    name, log = next(iter(run.vehicles.items()))
    t = log.arrays.get(f"{ESTIMATED}t") if len(run.vehicles) == 1 else None
    if t is None:
        return []
    charts = []
    for array in sorted(log.arrays, key=lambda each: (each != f"{ESTIMATED}{LEFT_OUT}", each)):
        values, own = log.arrays[array], array.removeprefix(ESTIMATED)
        named = run.signals[name].figures.get(own, ())
        if not array.startswith(ESTIMATED) or own in _NOT_FURTHER or not _is_drawn(values, named, len(t)):
            continue
        columns = values.reshape(len(t), -1)
        if len(named) == columns.shape[1]:
            if own == PLACES:  # those of beacons at known places never change
                low, high = np.nanmin(columns, axis=0, initial=np.inf), np.nanmax(columns, axis=0, initial=-np.inf)
                moving = np.flatnonzero(high > low).tolist()
                named, columns = tuple(named[k] for k in moving), columns[:, moving]
            charts += _left_out(named, t, columns) if own == LEFT_OUT else _named(named, t, columns)
            continue
        lines = [
            curve(str(k + 1) if columns.shape[1] > 1 else "", _colour(k, columns.shape[1]), t, columns[:, k])
            for k in range(columns.shape[1])
        ]
        charts.append(Chart(f"{own.replace('_', ' ')}, estimated", "", lines))
    return charts


def _named(names: Sequence[str], t: Array, columns: Array) -> list[Chart]:
    """A chart for each of the numbers (k, m) that is known at some time, for they may be of different sizes."""
    return [
        Chart(*name_and_unit(words), [curve(ESTIMATED_WORD, ESTIMATE, t, values)])
        for words, values in zip(names, columns.T, strict=True)
        if np.isfinite(values).any()
    ]


def _left_out(names: Sequence[str], t: Array, columns: Array) -> list[Chart]:
    """A chart of the channels that were left out at some time, in which the line of each rises while it is: flags
    (k, l), 1 while a channel is left out; none if all were always used.
    """
    ever = np.flatnonzero((columns > 0.0).any(axis=0)).tolist()
    heights: Array = np.arange(columns.shape[1], dtype=np.float64) + np.where(columns > 0.0, RAISED, 0.0)
    lines = [curve(names[k], vehicle_colour(number), t, heights[:, k], step=True) for number, k in enumerate(ever)]
    return [Chart(LEFT_OUT_TITLE, "", lines)] if lines else []


def _is_drawn(values: Array, names: Sequence[str], count: int) -> bool:
    """True for a number or a vector at each of ``count`` times, or for as many numbers as there are names; not for
    numbers that are never known.
    """
    drawn = values.size in (count, 3 * count) or (len(names) > 0 and values.shape == (count, len(names)))
    return drawn and bool(np.isfinite(values).any())


def _lines(
    columns: Sequence[tuple[int, str]], t: Array, truth: Array, found: RecordedEstimates | None, word: str
) -> list[Series]:
    """Truth (n, nx) at ``t`` (n,), called ``word``, and estimate of the numbers of one chart, with a band of two
    deviations about it.
    """
    several, series = len(columns) > 1, []
    for number, (k, called) in enumerate(columns):
        if np.isfinite(truth[:, k]).any():
            name = called if several else "" if found is None else word
            series.append(curve(name, vehicle_colour(number) if several else TRUTH, t, truth[:, k]))
    for number, (k, called) in enumerate(columns):
        if found is not None:
            band = None if found.deviation is None else DEVIATIONS * found.deviation[:, k]
            words = f"{called} {ESTIMATED_WORD}" if several else ESTIMATED_WORD
            colour = vehicle_colour(number) if several else ESTIMATE
            series.append(curve(words, colour, found.t, found.x[:, k], dashed=several, band=band))
    return series


def error_charts(run: GenericRun) -> list[Chart]:
    """The norm of estimate less truth over the numbers of one unit, by vehicle."""
    by_unit: dict[str, list[Series]] = {}
    for number, (name, log) in enumerate(run.vehicles.items()):
        found = estimates(log, run.signals[name])
        if found is None:
            continue
        units = [name_and_unit(words)[1] for words in found.names]
        several = len(run.vehicles) > 1
        for unit in dict.fromkeys(units):
            columns = [k for k, each in enumerate(units) if each == unit and np.isfinite(found.error[:, k]).any()]
            if columns:
                error = np.linalg.norm(found.error[:, columns], axis=1)
                colour = vehicle_colour(number) if several else ESTIMATE
                by_unit.setdefault(unit, []).append(curve(name if several else "", colour, found.t, error))
    return [Chart("estimate error", unit, series) for unit, series in by_unit.items()]


def difference_charts(run: GenericRun) -> list[Chart]:
    """Charts of estimate less truth, number by number, by vehicle, with a band of two deviations about it."""
    charts: dict[tuple[str, str], list[Series]] = {}
    several = len(run.vehicles) > 1
    for vehicle_number, (name, log) in enumerate(run.vehicles.items()):
        found = estimates(log, run.signals[name])
        if found is None:
            continue
        for title, unit, columns in grouped(found.names, {} if several else run.signals[name].groups):
            for number, (k, called) in enumerate(columns):
                if not np.isfinite(found.error[:, k]).any():
                    continue
                colour = vehicle_colour(vehicle_number if several else number)
                if not several and len(columns) == 1:
                    colour = ESTIMATE
                band = None if found.deviation is None else DEVIATIONS * found.deviation[:, k]
                line = curve(name if several else called, colour, found.t, found.error[:, k], band=band)
                charts.setdefault((title, unit), []).append(line)
    return [Chart(title, unit, series) for (title, unit), series in charts.items()]


def reading_charts(run: GenericRun) -> list[Chart]:
    """A chart for the readings of each sensor of a single vehicle."""
    name, log = next(iter(run.vehicles.items()))
    charts = []
    for array in sorted(each for each in log.arrays if each.startswith(SAMPLED)) if len(run.vehicles) == 1 else ():
        sensor, values = array.removeprefix(SAMPLED), log.arrays[array][: len(log.t)]
        read = np.isfinite(values).any(axis=1)
        if not read.any():
            continue
        size = values.shape[1]
        names = run.signals[name].readings.get(sensor, ())
        names = names if len(names) == size else numbered(sensor, size)
        units = {name_and_unit(words)[1] for words in names}
        lines = []
        for k, words in enumerate(names):
            called = "" if size == 1 else name_and_unit(words)[0] if len(units) == 1 else words
            rows = np.flatnonzero(read)
            known = np.isfinite(values[rows, k])
            if not (known[1:] & known[:-1]).any():  # of beacons read one after the other there is no line otherwise
                rows = rows[known]
            lines.append(curve(called, _colour(k, size), log.t[rows], values[rows, k]))
        charts.append(Chart(sensor.replace("_", " "), next(iter(units)) if len(units) == 1 else "", lines))
    return charts


def input_charts(run: GenericRun) -> list[Chart]:
    """Charts of the inputs, by vehicle; those of single vehicles that belong together in one."""
    name, log = next(iter(run.vehicles.items()))
    if len(run.vehicles) == 1:
        return [
            Chart(
                title, unit,
                [
                    curve(called, _colour(number, len(columns)), log.t, log.u[:, k], step=True)
                    for number, (k, called) in enumerate(columns)
                ],
            )
            for title, unit, columns in grouped(_inputs(run, name), run.signals[name].groups)
        ]  # fmt: skip
    charts: dict[tuple[str, str], list[Series]] = {}
    for number, (vehicle, each) in enumerate(run.vehicles.items()):
        for k, words in enumerate(_inputs(run, vehicle)):
            line = curve(vehicle, vehicle_colour(number), each.t, each.u[:, k], step=True)
            charts.setdefault(name_and_unit(words), []).append(line)
    return [Chart(*named, series) for named, series in charts.items()]


def _inputs(run: GenericRun, vehicle: str) -> tuple[str, ...]:
    """Names of the inputs of a vehicle; numbers where they have none."""
    size, names = run.vehicles[vehicle].u.shape[1], run.signals[vehicle].inputs
    return names if len(names) == size else tuple(f"input {k + 1}" for k in range(size))


def _colour(k: int, count: int) -> Colour:
    """Colour of the k-th of some lines."""
    return vehicle_colour(k) if count > 1 else TRUTH


def events_of(run: GenericRun) -> Sequence[tuple[float, str, bool]]:
    """Times of events, in words, and whether each is an alarm."""
    several = len(run.vehicles) > 1
    found = []
    for event, origin in with_origin(run.events, run.config):
        kind, details = described(event)
        words = f"{kind}: {details}" if details else kind
        words = f"{origin}: {words}" if origin else words
        found.append((event.t, f"{event.agent}: {words}" if several and event.agent else words, is_alarm(event)))
    return found


def facts_of(run: GenericRun) -> Sequence[tuple[str, str]]:
    """The first figures of the summary, with units, and the components that were slower than real time."""
    from mathnavi.renders.page import quantity

    numbers = [(key, value) for key, value in run.summary.items() if isinstance(value, bool | int | float)]
    facts = [(label(key)[0], quantity(key, value)) for key, value in numbers if key != "version"][:MOST_FACTS]
    timing = read_timing(run.directory)
    return facts if timing is None else [*facts, *slow_components(timing).items()]
