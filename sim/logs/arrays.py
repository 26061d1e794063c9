"""Arrays in NumPy and MATLAB files as logs: an array of one or two dimensions is a channel, a row is a reading."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import FieldError, LogError
from mathnavi.interfaces.field_table import TOGETHER
from mathnavi.interfaces.reading.arrays import MOST_BYTES, read_npz
from mathnavi.interfaces.reading.matlab import read_mat
from mathnavi.interfaces.signals import Array
from mathnavi.sim.logs.recorded_log import Channel, RecordedLog
from mathnavi.sim.records.log_times import PER_SECOND, epoch_of

_TIMES = ("t", "time", "times", "timestamp", "timestamps", "stamp", "stamps")  # names that mean times


@configuration
class ArraysConfig:
    """Place of the times: one of the first four fields, or none of them if an array is called t or time."""

    time: str | None = None
    """array with the times of all arrays with as many rows"""
    time_column: Annotated[int | None, Ge(0)] = None
    """column of each array that holds its times, the first is 0"""
    rate: Positive | None = None
    """readings per second, of arrays without times [Hz]"""
    rate_array: str | None = None
    """array of one number, the readings per second of arrays without times [Hz]"""
    time_unit: str = "s"
    """unit of the times, s, ms, us or ns"""
    arrays: Annotated[tuple[str, ...], TOGETHER] = ()
    """names of the arrays that are read; all if not given"""

    def __post_init__(self) -> None:
        if sum(each is not None for each in (self.time, self.time_column, self.rate, self.rate_array)) > 1:
            raise FieldError("time, time_column, rate and rate_array exclude each other; allowed: one of them")
        if self.time_unit not in PER_SECOND:
            raise FieldError(f"time_unit = {self.time_unit!r}; allowed: {', '.join(PER_SECOND)}")


class NumpyLog:
    """Log in a NumPy archive (.npz)."""

    Config = ArraysConfig

    @staticmethod
    def accepts(path: Path) -> bool:
        """True for a name that ends in .npz."""
        return path.suffix.lower() == ".npz"

    @staticmethod
    def read(path: Path, config: ArraysConfig) -> RecordedLog:
        """Read a log; LogError for a file that is no archive of numbers, and for times that are not there."""
        return _log(path, "NumPy archive", read_npz(path, LogError), {}, [], config)


class MatlabLog:
    """Log in a MATLAB file (.mat), of a version up to 7.2."""

    Config = ArraysConfig

    @staticmethod
    def accepts(path: Path) -> bool:
        """True for a name that ends in .mat."""
        return path.suffix.lower() == ".mat"

    @staticmethod
    def read(path: Path, config: ArraysConfig) -> RecordedLog:
        """Read a log; LogError for a file that is no MATLAB file of this version, and for times that are not there."""
        arrays, facts, others = read_mat(path, LogError, MOST_BYTES)
        notes = [f"{name} not read, which is no array of numbers" for name in others]
        return _log(path, "MATLAB file", arrays, facts, notes, config)


def _log(
    path: Path, kind: str, arrays: Mapping[str, Array], facts: Mapping[str, str], notes: list[str], config: ArraysConfig
) -> RecordedLog:
    facts, tables = dict(facts), {}
    if config.rate_array is not None:
        config = replace(config, rate=_rate(path, arrays, config.rate_array), rate_array=None)
    if unknown := [name for name in config.arrays if name not in arrays]:
        raise LogError(f"{path}: there is no array {unknown[0]!r}; {allowed_for(unknown[0], list(arrays))}")
    if config.arrays and (others := [name for name in arrays if name not in {*config.arrays, config.time}]):
        notes = [*notes, f"{', '.join(others)} not read, which arrays does not name"]
    for name, array in arrays.items():
        if array.size == 1:
            facts[name] = f"{float(array.ravel()[0]):.17g}"
        elif array.ndim > 2 or not array.size:
            notes = [*notes, f"{name} of shape {array.shape} not read; allowed: one or two dimensions"]
        elif not config.arrays or name in {*config.arrays, config.time}:  # a vector is a column, however it lies
            vector = array.ndim == 1 or 1 in array.shape
            tables[name] = array.reshape(-1, 1 if vector else array.shape[1])
    clock, times = _times(path, tables, config)
    if short := [name for name in tables if name not in times and name != clock]:
        notes = [*notes, f"{', '.join(short)} not read, which have no times"]
    factor = PER_SECOND[config.time_unit] if config.rate is None else 1
    for name, t in times.items():
        if (bad := np.flatnonzero(~np.isfinite(t))).size:
            raise LogError(f"{path}: {name}: time {bad[0]} is {t[bad[0]]}; allowed: finite times")
    start = 0 if config.rate is not None else min((_epoch(t, config.time_unit) for t in times.values()), default=0)
    channels: dict[str, Channel] = {}
    for name, t in times.items():
        columns = [k for k in range(tables[name].shape[1]) if k != config.time_column]
        signals = (name,) if len(columns) == 1 else tuple(f"{name} {k}" for k in columns)
        whole = t.dtype.kind in "iu"  # these lose nothing while they are whole numbers
        since = t if not start else t.astype(np.int64) - int(start) if whole else t - float(start)
        channels[name] = Channel(since / factor, tables[name][:, columns].astype(np.float64), signals)
    if not channels:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "none"
        raise LogError(f"{path}: no array has times; the arrays are {shapes}; allowed: time, time_column or rate")
    described = f"array {clock!r}" if clock in arrays else clock
    return RecordedLog(str(path), kind, channels, described, Decimal(start) / factor, facts, tuple(notes))


def _rate(path: Path, arrays: Mapping[str, Array], name: str) -> float:
    """Readings per second that an array of one number says."""
    if name not in arrays:
        raise LogError(f"{path}: there is no array {name!r}; {allowed_for(name, list(arrays))}")
    value = float(arrays[name].ravel()[0]) if arrays[name].size == 1 else math.nan
    if not (math.isfinite(value) and value > 0.0):
        shape = arrays[name].shape
        raise LogError(f"{path}: rate_array = {name!r} of shape {shape} is no rate; allowed: one number > 0 [Hz]")
    return value


def _epoch(t: Array, unit: str) -> int:
    """Whole units to subtract from stamps (n,) since an epoch, at most the least of them; 0 for other stamps."""
    return math.floor(t.min().item()) if epoch_of(t.astype(np.float64), unit) else 0


def _times(path: Path, tables: Mapping[str, Array], config: ArraysConfig) -> tuple[str, dict[str, Array]]:
    """Clock, by the name of an array or in words, and times (n,) of each array in the file's unit."""
    if config.time_column is not None:
        k = config.time_column
        return f"column {k} of each array", {
            name: table[:, k] for name, table in tables.items() if table.shape[1] > max(k, 1)
        }
    if config.rate is not None:
        rate = config.rate
        return f"rate of {rate:g} Hz", {name: np.arange(len(table)) / rate for name, table in tables.items()}
    name = config.time
    if name is None:
        name = next((each for each in tables if each.lower() in _TIMES), None)
    if name is None or name not in tables:
        shapes = ", ".join(f"{each} {table.shape}" for each, table in tables.items()) or "none"
        missing = "" if name is None else f" called {name!r}"
        raise LogError(
            f"{path}: there is no array of times{missing}; the arrays are {shapes}; allowed: time, time_column or rate"
        )
    if tables[name].shape[1] != 1:
        raise LogError(f"{path}: time = {name!r} has the shape {tables[name].shape}; allowed: one column")
    t = tables[name][:, 0]
    return name, {each: t for each, table in tables.items() if each != name and len(table) == len(t)}
