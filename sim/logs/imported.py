"""Folder of a run from a recorded log, and back: what it read, what was commanded, and a reference in place of a truth.

The folder has the files of any run (``mathnavi.sim.records.run_folder``); its scenario is called ``recorded-log``. The
samples are the times at which anything was read, or commanded. The reference, what another system found, is
interpolated between its readings linearly, angles along the shorter way; samples before its first and after its last
reading are left out. The disorder of the log is in the summary and, channel by channel, in the events.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import LogError, RunFolderError
from mathnavi.interfaces.fields import plain
from mathnavi.interfaces.reading_counts import COUNTS, unused_text
from mathnavi.interfaces.short_tables import counted
from mathnavi.interfaces.signal_names import SignalNames, name_and_unit
from mathnavi.interfaces.signals import Array, Estimate, Event
from mathnavi.interfaces.units import si_unit
from mathnavi.models.angles import wrapped
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.logs.recorded_log import Channel, Disorder, RecordedLog
from mathnavi.sim.records.attitude_figures import continued, is_quaternion
from mathnavi.sim.records.documents import LOG_SCENARIO
from mathnavi.sim.records.figure_names import SUMMARY_GROUPS, UNUSED_READINGS, UNUSED_REASONS
from mathnavi.sim.records.log_arrays import SAMPLED
from mathnavi.sim.records.plan_record import plan_record
from mathnavi.sim.records.reference_figures import reference_figures, usable_figures
from mathnavi.sim.records.run_folder import read_log, read_record, read_signal_names
from mathnavi.sim.records.sensor_log import EstimateHistory, SensorLog

VEHICLE = "vehicle"
_GAP, _NOTE = "log-gap", "log-note"  # kinds of events
_NOT_KEPT = ("version", UNUSED_READINGS, UNUSED_REASONS)  # figures of a simulated run that are of its estimator


@dataclass(frozen=True)
class Selection:
    """Signals of a log that are imported; the names are those of ``RecordedLog.sensor_log``."""

    readings: Mapping[str, Sequence[str]]  # of each sensor
    inputs: Sequence[str] = ()
    reference: Sequence[str] = ()
    names: Sequence[str] = ()  # "name [unit]" of the reference; those of the log if not given
    units: Mapping[str, str] = field(default_factory=dict)
    disorder: Disorder = "refuse"


@dataclass(frozen=True, eq=False)
class ImportedLog:
    """Content of a run's folder."""

    config: dict[str, Any]
    summary: dict[str, Any]
    recording: Recording


def imported(log: RecordedLog, selection: Selection, digest: str) -> ImportedLog:
    """Make the content of a run's folder from a recorded log.

    Args:
        log: the log.
        selection: signals that are taken.
        digest: SHA-256 of the file, which config.json records.

    Raises LogError as ``RecordedLog.sensor_log`` does, for a reference that does not overlap the readings, and for
    fewer than two samples.
    """
    wanted = {"readings": selection.readings, "inputs": selection.inputs, "units": selection.units}
    own = log.sensor_log(**wanted, disorder=selection.disorder)  # type: ignore[arg-type]
    notes, t = list(own.notes), own.t
    kept: NDArray[np.bool_] = np.ones(len(t), dtype=bool)
    truth: Array = np.empty((len(t), 0))
    states: tuple[str, ...] = ()
    if selection.reference:
        found = log.sensor_log(
            readings={"reference": selection.reference}, units=selection.units, disorder=selection.disorder
        )
        states = tuple(selection.names) or _names(log, selection.reference, selection.units)
        if len(states) != found.readings["reference"].shape[1]:
            raise LogError(f"{log.source}: {len(states)} names of {found.readings['reference'].shape[1]} references")
        if not np.isfinite(found.readings["reference"]).all(axis=1).any():
            raise LogError(f"{log.source}: the reference has no reading; allowed: one or more")
        notes += [
            f"the reference {name!r} has no unit; an angle is compared as one if it is called {f'{name} [rad]'!r}"
            for name in states
            if not (name_and_unit(name)[1] or name.endswith("]"))
        ]
        truth, kept = _interpolated(found.t, found.readings["reference"], states, t)
        if (left := int(np.logical_not(kept).sum())) > 0:
            notes.append(f"{counted(left, 'sample')} before or after the reference left out")
        notes += [note for note in found.notes if note not in notes]
    if int(kept.sum()) < 2:
        raise LogError(f"{log.source}: {counted(int(kept.sum()), 'sample')} with readings; allowed: two or more")
    first = float(t[kept][0])
    count = int(kept.sum())
    inputs = np.zeros((count, 0)) if own.inputs is None else own.inputs[kept]
    named = [*selection.inputs, *selection.reference, *(each for own in selection.readings.values() for each in own)]
    used = list(dict.fromkeys(channel for channel, _ in log.places(named)))
    events = _events({name: log.channels[name] for name in used}, notes)
    agent = AgentRecorder(VEHICLE, events, inputs, {name: rows[kept] for name, rows in own.readings.items()})
    signals = SignalNames(
        states,
        _names(log, selection.inputs, selection.units) if len(selection.inputs) else (),
        {name: _names(log, each, selection.units) for name, each in selection.readings.items()},
    )
    since = t[kept] - first
    shown = [Event(min(max(each.t - first, 0.0), float(since[-1])), *_rest(each)) for each in events]
    recording = Recording(
        since, {VEHICLE: truth[kept]}, {VEHICLE: agent}, shown, {VEHICLE: states}, count, signals={VEHICLE: signals}
    )
    start = log.start + Decimal(repr(first))
    fields = {
        "file": log.source,
        "format": log.format,
        "clock": log.clock,
        "start": f"{start:f}",
        "readings": {name: list(each) for name, each in selection.readings.items()},
        "inputs": list(selection.inputs),
        "reference": list(selection.reference),
        "units": dict(selection.units),
        "disorder": selection.disorder,
        "facts": dict(log.facts),
        "notes": notes,
    }
    config = {"scenario": LOG_SCENARIO, "seed": 0, "fields": fields, "mission": {}, "inputs": {"file": digest}}
    timings = [log.channels[name].timing for name in used]
    summary = {
        "log_time_s": float(since[-1]),
        "samples": count,
        "stamps_late": sum(each.late for each in timings),
        "stamps_doubled": sum(each.doubled for each in timings),
        "readings_missing": sum(each.missing for each in timings),
        "longest_gap_s": max(each.longest_gap for each in timings),
    }
    return ImportedLog(config, summary, recording)


def _rest(event: Event) -> tuple[str, str, str]:
    return event.agent, event.kind, event.message


def _names(log: RecordedLog, wanted: Sequence[str], units: Mapping[str, str]) -> tuple[str, ...]:
    """Names of signals with their SI units, where known."""
    given = log.units_of(units)
    found = []
    for channel, k in log.places(wanted):
        name, unit = name_and_unit(log.channels[channel].signals[k])
        unit = given.get((channel, k), unit)
        si = si_unit(unit)
        found.append(f"{name} [{si}]" if si else name)
    return tuple(found)


def _interpolated(t: Array, rows: Array, names: Sequence[str], at: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Values (n, m) at times (n,) of rows (k, m) at t (k,), and True (n,) where they are known."""
    known = np.isfinite(rows).all(axis=1)
    t, rows = t[known], rows[known]
    if is_quaternion(names):
        between = np.column_stack([np.interp(at, t, column) for column in continued(rows).T])
        between /= np.linalg.norm(between, axis=1)[:, None]
        return between, (at >= t[0]) & (at <= t[-1])
    columns = []
    for name, column in zip(names, rows.T, strict=True):
        if name_and_unit(name)[1] == "rad":
            columns.append(wrapped(np.interp(at, t, np.unwrap(column))))
        else:
            columns.append(np.interp(at, t, column))
    return np.column_stack(columns), (at >= t[0]) & (at <= t[-1])


def _events(channels: Mapping[str, Channel], notes: Sequence[str]) -> list[Event]:
    """Events that name the gaps and the disorder of each channel, and what was left out."""
    events = []
    for name, channel in channels.items():
        timing = channel.timing
        if timing.gaps:
            longest = f"{counted(timing.gaps, 'gap')} with {counted(timing.missing, 'reading')} missing"
            message = f"{name}: {longest}, the longest {timing.longest_gap:.3g} s"
            events.append(Event(timing.longest_gap_at, VEHICLE, _GAP, message))
        if timing.first_late is not None:
            message = f"{name}: {counted(timing.late, 'stamp')} before an earlier one, the first is reading"
            at = float(channel.t[timing.first_late])
            events.append(Event(at, VEHICLE, "log-disorder", f"{message} {timing.first_late}"))
        if timing.doubled:
            message = f"{name}: {counted(timing.doubled, 'stamp')} that an earlier reading has"
            again = _first_doubled(channel.t)
            events.append(
                Event(float(channel.t[again]), VEHICLE, "log-disorder", f"{message}, the first is reading {again}")
            )
    events += [Event(-np.inf, VEHICLE, _NOTE, note) for note in notes]
    return sorted(events, key=lambda event: event.t)


def _first_doubled(t: Array) -> int:
    """Index of the first stamp of t (n,) that an earlier one equals; there is one."""
    _, firsts = np.unique(t, return_index=True)
    again = np.ones(len(t), dtype=bool)
    again[firsts] = False
    return int(np.argmax(again))


def is_imported(folder: Path) -> bool:
    """True for the folder of a run that was imported from a log."""
    config, _, _ = read_record(folder)
    return bool(config.get("scenario") == LOG_SCENARIO)


def sensor_log_of(folder: Path) -> SensorLog:
    """Return the log in the folder of a run, as estimators take it: its times, readings and inputs.

    Raises FileNotFoundError if a file is missing, RunFolderError if one is broken or the run has no readings.
    """
    log = read_log(folder)
    readings = {name.removeprefix(SAMPLED): rows for name, rows in log.arrays.items() if name.startswith(SAMPLED)}
    if not readings:
        raise RunFolderError(f"{folder} has no readings; allowed: a run with sensors")
    fields = log.config.get("fields", {})
    start = Decimal(str(fields.get("start", "0"))) if log.config.get("scenario") == LOG_SCENARIO else Decimal(0)
    inputs = log.u if log.u.shape[1] else None
    columns = {
        name: names for signals in read_signal_names(folder).values() for name, names in signals.readings.items()
    }
    return SensorLog(log.t, readings, inputs, str(folder), start, columns=columns)


def with_estimates(folder: Path, found: EstimateHistory, estimator: Mapping[str, Any], mission: Any) -> ImportedLog:
    """Return the content of the folder of a run with the estimates of another estimator over its log.

    ``estimator`` is its record in config.json; that of a recorded log has the walls and beacons of the ``mission`` too.
    The summary has its figures against the reference, if the log has one of as many numbers
    or of some of the same names (``mathnavi.sim.records.reference_figures``), and none of an estimator before it.
    """
    log = read_log(folder)
    ((vehicle, signals),) = read_signal_names(folder).items()
    readings = {name.removeprefix(SAMPLED): rows for name, rows in log.arrays.items() if name.startswith(SAMPLED)}
    events = [event for event in log.events if event.kind != "estimator-status"]
    own = SignalNames(figures=found.figures)
    if len(signals.states) != found.x.shape[1]:  # the reference, which is what it is compared with, has its own names
        own = replace(own, estimates=found.names)
    signals = own.over(signals)
    agent = AgentRecorder(vehicle, events, log.u, readings)
    for k, t in enumerate(found.t.tolist()):
        covariance = found.covariance[k] if np.isfinite(found.covariance[k]).all() else None
        extra = {name: rows[k] for name, rows in found.extra.items()}
        agent.estimate(Estimate(t, found.x[k], covariance, found.status[k], extra, found.message[k]))
    events.sort(key=lambda event: event.t)
    recording = Recording(
        log.t, {vehicle: log.x}, {vehicle: agent}, events, {vehicle: signals.states}, len(log.t),
        signals={vehicle: signals},
    )  # fmt: skip
    config = {key: value for key, value in log.config.items() if key not in ("versions", "machine")}
    summary = dict(log.summary)
    if config["scenario"] == LOG_SCENARIO:
        config["mission"] = plain(plan_record(mission))
        summary = {key: value for key, value in summary.items() if key in SUMMARY_GROUPS["log"]}
    compared = found if log.x.shape[1] == found.x.shape[1] else _part(found, signals.states)
    figures: dict[str, Any] = dict(usable_figures(found))
    if compared is not None:
        figures = dict(reference_figures(compared, log.t, log.x, signals.states))
    if COUNTS in found.extra or found.unused:
        figures[UNUSED_READINGS] = sum(found.unused.values())
    if found.unused:
        figures[UNUSED_REASONS] = unused_text(found.unused)
    rest = {key: value for key, value in summary.items() if key not in (*figures, *_NOT_KEPT)}
    summary = {**figures, **rest}
    return ImportedLog({**config, "estimator": dict(estimator), "recorded": str(folder)}, summary, recording)


def _part(found: EstimateHistory, names: Sequence[str]) -> EstimateHistory | None:
    """The numbers of estimates that have ``names``, those of a reference of fewer numbers; None if one is missing."""
    if not names or set(names) - set(found.names):
        return None
    columns = [found.names.index(name) for name in names]
    covariance = found.covariance[:, columns][:, :, columns]
    return replace(found, x=found.x[:, columns], covariance=covariance, names=tuple(names))
