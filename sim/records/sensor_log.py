"""Estimators over your own log: times, readings and inputs as arrays, or from a CSV file; without scenario and run.

log = SensorLog.from_csv("robot.csv", time="t", readings={"ranges": ["front", "left"], "odometry": ["v", "w"]})
found = estimate("feasible_set_bank", mission, log)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mathnavi.estimators.plausibility.checks import Recording, finished, misread
from mathnavi.estimators.stagewise.recorded_smoother import RecordedSmoother, SmootherConfig, Smoothing
from mathnavi.interfaces.boundary import Unusable, usable_estimate
from mathnavi.interfaces.errors import FieldError, LogError, PluginError
from mathnavi.interfaces.failures import raising
from mathnavi.interfaces.fields import configured
from mathnavi.interfaces.joint_states import UNIT, QuaternionOrder, check_quaternion_order, scalar_first
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading.table_format import TableFormat
from mathnavi.interfaces.reading_counts import Unused, unused_in, unused_text
from mathnavi.interfaces.short_tables import html_table, short_table, vector_text
from mathnavi.interfaces.signal_names import figure_names
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.beacon_names import SENSORS
from mathnavi.sim.plugin.registry import (
    LOGGED,
    PluginSpec,
    called,
    check_class,
    checked_estimator,
    checked_sensors,
    load,
    of_stranger,
)
from mathnavi.sim.records.log_columns import read_log_columns
from mathnavi.sim.records.log_times import PER_SECOND

_PERIOD_FACTOR = 2.0  # between the period that an estimator is built for and the steps of a log


@dataclass(frozen=True, eq=False, repr=False)
class SensorLog:
    """Log of a vehicle: at t[k] the sensors were read, and from then until t[k + 1] the input was inputs[k].

    ``t`` (n,) [s] increases. ``readings`` are arrays (n, m) by the name of the sensor, (n,) for m = 1, in its unit and
    frame; a row of NaN marks a time at which it was not read. ``inputs`` (n, nu) are zero if not given. ``quaternions``
    is the order in which those of the readings come: (w, x, y, z) with the scalar first, or "xyzw".

    Raises FieldError for another order, LogError for times that are not finite or do not increase, for arrays of
    another length, and for an input that is not finite, with the place in the array.
    """

    t: Array
    readings: Mapping[str, Array]
    inputs: Array | None = None
    source: str = field(default="log")  # named in messages
    start: Decimal = Decimal(0)
    """time that was subtracted from those of a file, exactly [s]; since 1970 for dates"""
    notes: tuple[str, ...] = ()
    """conversions and omissions when a file was read, a sentence each"""
    quaternions: QuaternionOrder = "wxyz"
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """names (m,) of the columns of a sensor in its file, for messages; none if they are not known"""

    def __post_init__(self) -> None:
        check_quaternion_order(self.quaternions)
        t = _array(self.t, f"{self.source}: t", 1)
        if not len(t):
            raise LogError(f"{self.source}: t is empty; allowed: one time or more")
        if (bad := np.flatnonzero(~np.isfinite(t))).size:
            raise LogError(f"{self.source}: t[{bad[0]}] = {t[bad[0]]}; allowed: finite times [s]")
        if (bad := np.flatnonzero(np.diff(t) <= 0.0)).size:
            k = int(bad[0])
            raise LogError(
                f"{self.source}: t[{k + 1}] = {t[k + 1]:.9g} s comes after t[{k}] = {t[k]:.9g} s; allowed: times that "
                "increase"
            )
        readings = {name: self._rows(values, name, len(t)) for name, values in self.readings.items()}
        inputs = None if self.inputs is None else self._rows(self.inputs, "inputs", len(t))
        if inputs is not None and (places := np.argwhere(~np.isfinite(inputs))).size:
            row, column = places[0]
            where = f"inputs[{row}, {column}] = {inputs[row, column]} at {t[row]:.9g} s"
            raise LogError(f"{self.source}: {where}; allowed: finite inputs")
        for name, value in (("t", t), ("readings", readings), ("inputs", inputs)):
            object.__setattr__(self, name, value)

    @staticmethod
    def from_csv(
        path: str | Path,
        *,
        time: str = "t",
        readings: Mapping[str, Sequence[str]],
        inputs: Sequence[str] = (),
        time_unit: str | None = None,
        units: Mapping[str, str] | None = None,
        quaternions: QuaternionOrder = "wxyz",
        sep: str = ",",
        decimal: str = ".",
        thousands: str | None = None,
        encoding: str | None = None,
        comment: str | None = None,
        skiprows: int = 0,
        names: Sequence[str] | None = None,
        na_values: Sequence[str] = (),
    ) -> SensorLog:
        """Read a log from a text file with a table, whose first line names its columns.

        ``time`` names that of the times, ``readings`` those of each sensor and ``inputs`` those of the input, by the
        whole name or by what stands before a unit in brackets. An empty cell is a value that was not read.

        Numbers are converted from ``units``, "deg" by the name of the column, or from the unit in brackets, "q1 [deg]",
        or in a row of units; without any they are in SI units. ``time_unit`` is "s", "ms", "us" or "ns", or "iso" for
        dates of ISO 8601. Times since an epoch are counted from the first, which is ``start``. ``quaternions`` is the
        order in which those of the readings come.

        ``sep``, ``decimal``, ``thousands``, ``encoding``, ``comment``, ``skiprows``, ``names`` and ``na_values`` are
        those of ``pandas.read_csv``.

        Raises LogError for a missing column and for a cell that is not a number, with its line and column, FieldError
        for an argument out of its range, FileNotFoundError for a missing file.
        """
        _check_lists(**{f"readings[{name!r}]": each for name, each in readings.items()})
        _check_lists(inputs=inputs, names=names or (), na_values=na_values)
        named = None if names is None else tuple(names)
        form = TableFormat(sep, decimal, thousands, encoding, comment, skiprows, named, tuple(na_values))
        wanted = [*(name for each in readings.values() for name in each), *inputs]
        found = read_log_columns(Path(path), time, wanted, time_unit, units or {}, form)
        parts, columns, first = {}, {}, 0
        for name, each in readings.items():
            place = slice(first, first + len(each))
            parts[name], columns[name], first = found.values[:, place], found.names[place], place.stop
        given = found.values[:, first:] if inputs else None
        if given is not None and (places := np.argwhere(~np.isfinite(given))).size:
            row, column = places[0]
            where = f"{path} line {found.lines[row]}, column {found.names[first + column]!r}: {given[row, column]}"
            raise LogError(f"{where}; allowed: finite inputs")
        return SensorLog(found.t, parts, given, str(path), found.start, found.notes, quaternions, columns)

    def _rows(self, values: ArrayLike, name: str, count: int) -> Array:
        rows = _array(values, f"{self.source}: {name}", 2)
        if len(rows) != count:
            raise LogError(f"{self.source}: {name} has {len(rows)} rows; allowed: {count}, as t has")
        return rows

    def __repr__(self) -> str:
        read = {name: _count(values) for name, values in self.readings.items()}
        rows = [(name, f"{count} x {self.readings[name].shape[1]}", "") for name, count in read.items()]
        rows += [] if self.inputs is None else [("inputs", f"{len(self.t)} x {self.inputs.shape[1]}", "")]
        table = short_table(f"{self.source}: {len(self.t)} times from {self.t[0]:.6g} to {self.t[-1]:.6g} s", rows)
        return "\n".join([table, *(f"  {note}" for note in self.notes)])


@dataclass(frozen=True, eq=False, repr=False)
class EstimateHistory:
    """Estimates at the times of a log."""

    method: str
    t: Array  # (n,) [s]
    x: Array  # (n, nx) states, as the estimator's ``update`` documents them
    covariance: Array  # (n, nx, nx); NaN where there is none
    status: tuple[Status, ...]  # (n,)
    message: tuple[str, ...]  # (n,) details behind the status: what an estimator that is INITIALISING waits for
    extra: Mapping[str, Array]  # (n, ...) other outputs of the estimator, by name
    unread: Mapping[str, int]  # number of readings in the log of each sensor that the estimator does not read
    names: tuple[str, ...] = ()  # (nx,) "name [unit]" of the states; none if they are not known
    figures: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # names of the numbers of some of ``extra``

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Return True (n,) where the estimate is as good as declared."""
        return np.array([status is Status.OK for status in self.status])

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Return True (n,) where the estimate may be used with its covariance: ``ok``, or DEGRADED."""
        return np.array([status.usable for status in self.status])

    @property
    def unused(self) -> Mapping[str, int]:
        """Return the number of readings that were not used, by reason; those of sensors that are not read among them.

        Of an estimator that does not count, only the latter.
        """
        counts = unused_in(self._last_extra) or {}
        unknown = Unused.UNKNOWN_SENSOR.value
        unread = counts.get(unknown, 0) + sum(self.unread.values())
        return counts | ({unknown: unread} if unread else {})

    @property
    def deviation(self) -> Array:
        """Return the standard deviations (n, nx) of the states; NaN for estimates without a covariance."""
        deviations: Array = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        return deviations

    @property
    def _last_extra(self) -> dict[str, Array]:
        return {key: values[-1] for key, values in self.extra.items()}

    def _table(self) -> tuple[str, list[tuple[str, str, str]]]:
        rows = [
            ("ok", f"{int(self.ok.sum())} of {len(self.t)}", ""),
            ("last status", self.status[-1].value, ""),
            *([("it", self.message[-1], "")] if self.message[-1] else []),
            ("last x", vector_text(self.x[-1]), ""),
        ]
        if np.isfinite(self.deviation[-1]).all():
            rows.append(("last deviation", vector_text(self.deviation[-1], 2), ""))
        if counts := unused_in(self._last_extra):
            rows.append(("readings not used", unused_text(counts), ""))
        if self.unread:
            rows.append(("not read", ", ".join(f"{count} of {name}" for name, count in self.unread.items()), ""))
        return f"{self.method} from {self.t[0]:.6g} to {self.t[-1]:.6g} s", rows

    def __repr__(self) -> str:
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        return html_table(*self._table())


def estimate(
    method: str | PluginSpec | type[Any], mission: Any, log: SensorLog, *, trust_units: bool = False, **fields: Any
) -> EstimateHistory:
    """Run an estimator over a log.

    ``method`` is any plug-in of ``mathnavi list estimators``, its class, ``plugin(NAME, ...)``, or ``smoother(NAME)``
    of a Kalman filter, which uses all readings at once, and ``fields`` are its fields. ``mission`` describes the
    vehicle and its sensors, as ``RangingMission(wall, angles, ...)`` does; its period must be about that of the log.
    Readings that fit the mission only in another unit, with another sign or in another order of quaternions are
    refused, unless ``trust_units`` says that they are right and the mission is not.

    Raises PluginError for a method that is unknown, does not fit the mission or fails, FieldError for a field or a
    value that is not allowed, and LogError for a log without readings that the method needs, with malformed ones, or
    with some that fit the mission only in another unit, with another sign or in another order of quaternions.
    """
    spec = _spec(method)
    spec = PluginSpec(spec.plugin, configured(spec.config, fields))
    with raising(FieldError):
        estimator = checked_estimator(spec, mission)
        sensors = checked_sensors(spec, mission, LOGGED)
    past = estimator if isinstance(estimator, RecordedSmoother) else None
    name = method if isinstance(method, str) else "smoother" if past else called("estimators", spec.name)
    for sensor in sensors:
        _check_readings(log, sensor, name)
    readings = {sensor.name: _well_formed(log, sensor) for sensor in sensors}
    commands = _commands(log, mission)
    if len(log.t) > 1:
        _check_period(log, float(estimator.period), name)
    from_each = np.vstack([commands[1:], commands[-1:]])
    check = misread(mission, Recording(log.t, readings, from_each, log.quaternions, log.columns))
    if not trust_units and (said := finished(check)):
        raise LogError(f"{log.source}: {said}; trust_units=True takes them as they are")
    if past is not None:
        filtered = spec.plugin.plugin if isinstance(spec.plugin, Smoothing) else spec.plugin
        with raising(LogError), of_stranger(filtered, f"estimators: {name!r}: its filter failed over the log:"):
            past.smooth((t, _read(readings, k, t), commands[k]) for k, t in enumerate(log.t.tolist()))
    found_at: list[Estimate] = []
    for k, t in enumerate(log.t.tolist()):
        read = _read(readings, k, t)
        with of_stranger(spec.plugin, f"estimators: {name!r}: update() at {t:g} s failed:"):
            answer = estimator.update(t, read, commands[k])
        judged = usable_estimate(answer, t, found_at[-1] if found_at else None)
        if isinstance(judged, Unusable) and not (isinstance(answer, Estimate) and not answer.status.usable):
            raise PluginError(f"estimators: {name!r}: update() at {t:g} s: {judged.reason}")
        found_at.append(answer if isinstance(judged, Unusable) else judged)
    read_by = {sensor.name for sensor in sensors}
    unread = {each: _count(rows) for each, rows in log.readings.items() if each not in read_by}
    names = _state_names(estimator, mission, len(found_at[0].x))
    return _history(name, found_at, unread, names, figure_names(estimator))


def smoother(
    filter: str | PluginSpec | type[Any],
    *,
    method: Literal["rts", "batch"] = "rts",
    gate: float = SmootherConfig().gate,
) -> PluginSpec:
    """Return the smoother of a Kalman filter, for ``estimate``: its sensors and its model, but all readings at once.

    ``filter`` is the name of an estimator, its class, or ``plugin(NAME, ...)``. ``method`` is that of Rauch, Tung and
    Striebel, or batch least squares; ``gate`` the probability that a good component of a reading is refused.

    Raises PluginError for an unknown filter, FieldError for one that is not a Kalman filter, and for another method or
    a gate that is not a probability.
    """
    spec = _spec(filter)
    return PluginSpec.with_fields(Smoothing(spec.plugin, spec.config), method=method, gate=gate)


def _spec(given: str | PluginSpec | type[Any]) -> PluginSpec:
    """The plug-in of a name, with its default fields; of a class, or as given."""
    found = load("estimators", given) if isinstance(given, str) else given
    if isinstance(found, PluginSpec):
        return found
    check_class("estimators", found, getattr(found, "__qualname__", repr(found)))
    return PluginSpec.with_fields(found)


def _read(readings: Mapping[str, Array], k: int, t: float) -> tuple[Measurement, ...]:
    """Readings in row ``k`` at ``t`` [s]: those of a row that is not NaN throughout."""
    rows = ((each, values[k]) for each, values in readings.items())
    return tuple(Measurement(each, t, row.copy()) for each, row in rows if not np.isnan(row).all())


def _count(rows: Array) -> int:
    """Number of readings among rows (n, m), NaN where none exists."""
    return int((~np.isnan(rows).all(axis=1)).sum())


def _state_names(estimator: Any, mission: Any, size: int) -> tuple[str, ...]:
    """Names of the numbers (size,) of an estimate: the estimator's own, or those of the states of the mission."""
    system = getattr(mission, "system", None)
    declared = (
        getattr(part, name, ()) for part, name in ((estimator, "numbers"), (mission, "state_names"), (system, "states"))
    )
    return next((tuple(map(str, names)) for names in declared if names and len(names) == size), ())


def _history(
    name: str,
    estimates: Sequence[Estimate],
    unread: Mapping[str, int],
    names: tuple[str, ...],
    figures: Mapping[str, tuple[str, ...]],
) -> EstimateHistory:
    n = len(estimates[0].x)
    unknown = np.full((n, n), np.nan)
    return EstimateHistory(
        name,
        np.array([each.t for each in estimates]),
        np.array([each.x for each in estimates]),
        np.array([unknown if each.covariance is None else each.covariance for each in estimates]),
        tuple(each.status for each in estimates),
        tuple(each.message for each in estimates),
        {key: np.array([each.extra[key] for each in estimates]) for key in estimates[-1].extra},
        unread,
        names,
        figures,
    )


def _check_readings(log: SensorLog, sensor: Sensor, method: str) -> None:
    if sensor.name not in log.readings:
        raise LogError(
            f"{log.source} has no readings {sensor.name!r}, which {method} reads; it has "
            f"{', '.join(log.readings) or 'none'}; allowed: {sensor.size} columns, NaN where there is no reading"
        )
    values = log.readings[sensor.name]
    if values.shape[1] != sensor.size:
        beacons = ", as many as the beacons of the mission have" if sensor.name in SENSORS.values() else ""
        raise LogError(f"{log.source}: {sensor.name} has {values.shape[1]} columns; allowed: {sensor.size}{beacons}")
    if getattr(sensor, "partial", False):
        return
    missing = np.isnan(values).all(axis=1)
    places = np.argwhere(~np.isfinite(values) & ~missing.reshape(-1, 1))
    if places.size:
        row, column = places[0]
        raise LogError(
            f"{log.source}: {sensor.name}[{row}, {column}] = {values[row, column]} at {log.t[row]:.9g} s; allowed: a "
            "finite number, or a row of NaN where there is no reading"
        )


def _well_formed(log: SensorLog, sensor: Sensor) -> Array:
    """Return the readings (n, m) of a sensor, with (w, x, y, z) in their quaternions; LogError for malformed ones."""
    parts: tuple[slice, ...] = getattr(sensor, "quaternions", ())
    values = log.readings[sensor.name]
    for part in parts:
        length = np.linalg.norm(values[:, part], axis=1)
        off = np.flatnonzero(np.abs(length - 1.0) > UNIT)
        if off.size:
            k = int(off[0])
            place = f"{sensor.name}[{k}, {part.start}:{part.stop}] = {vector_text(values[k, part])} at {log.t[k]:.9g} s"
            raise LogError(
                f"{log.source}: {place} is a quaternion of length {length[k]:.7g}, one of {off.size} such; allowed: a "
                f"length of 1 +- {UNIT:g}, or a row of NaN where there is no reading"
            )
    values = scalar_first(values, parts, log.quaternions)
    check: Any = getattr(sensor, "check", None)
    for k in () if check is None else np.flatnonzero(np.isfinite(values).all(axis=1)).tolist():
        try:
            check(values[k])
        except ValueError as error:
            raise LogError(f"{log.source}: {sensor.name}[{k}] at {log.t[k]:.9g} s: {error}") from None
    return values


def _commands(log: SensorLog, mission: Any) -> Array:
    """Return the input (n, nu) held until each time, zero before the first.

    Without inputs in the log it is zero throughout, and of no length if the mission has no ``input_size`` either.
    """
    count: int | None = getattr(mission, "input_size", None)
    if log.inputs is None:
        return np.zeros((len(log.t), count or 0))
    if count is not None and log.inputs.shape[1] != count:
        raise LogError(f"{log.source}: inputs has {log.inputs.shape[1]} columns; allowed: {count}")
    commands: Array = np.vstack([np.zeros((1, log.inputs.shape[1])), log.inputs[:-1]])
    return commands


def _check_period(log: SensorLog, period: float, method: str) -> None:
    step = float(np.median(np.diff(log.t)))
    low, high = period / _PERIOD_FACTOR, period * _PERIOD_FACTOR
    if not low <= step <= high:
        unit = next((name for name, per_second in PER_SECOND.items() if low <= step / per_second <= high), "")
        advice = f", or read the log with time_unit={unit!r}" if unit else ""
        raise LogError(
            f"{log.source}: the median step is {step:.6g} s and the period of {method} is {period:.6g} s; allowed: "
            f"within a factor of {_PERIOD_FACTOR:g}: set the mission's period to that of the log{advice}"
        )


def _check_lists(**lists: Sequence[str]) -> None:
    """Raise FieldError for a text in place of a list of columns."""
    for name, given in lists.items():
        if isinstance(given, str):
            raise FieldError(f"{name} = {given!r}; allowed: a list, [{given!r}]")


def _array(values: ArrayLike, name: str, dimension: int) -> Array:
    """Return a copy of numbers with this number of dimensions."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise LogError(f"{name} holds values that are not numbers; allowed: numbers") from None
    if dimension == 2 and array.ndim == 1:
        array = array[:, None]
    if array.ndim != dimension:
        raise LogError(f"{name} has the shape {array.shape}; allowed: {dimension} dimension{'s' * (dimension > 1)}")
    return array
