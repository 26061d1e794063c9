"""Check of an estimator over a log: what `mathnavi estimate` refuses, found with a log that has no readings yet.

Over a log the sensors are only described: of each the name and the size of its readings. The estimator is built for the
mission and updated without readings, and then with readings of zeros, which any sensor may give.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from mathnavi.commands.check_findings import CheckResult, split_joined
from mathnavi.commands.errors import BadInputError
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.failures import raising
from mathnavi.sim.plugin.named_object import named_object
from mathnavi.sim.plugin.registry import LOGGED, MOUNTED, PluginSpec, checked_estimator, checked_sensors
from mathnavi.sim.records.sensor_log import SensorLog, estimate

TIMES = 5  # of the log


def check_over_log(spec: PluginSpec, place: str, result: CheckResult) -> None:
    """Check an estimator over a log of the mission at a place; BadInputError if there is no such mission."""
    try:
        mission = named_object(place)
    except PluginError as error:
        raise BadInputError(f"--mission = {error}") from error
    shown = _as_file(place)
    try:
        with raising(PluginError):
            period = float(checked_estimator(spec, mission).period)
            sensors = checked_sensors(spec, mission, LOGGED)
            _estimated(spec, mission, period, [(sensor, np.nan) for sensor in sensors])
    except ValueError as error:
        result.refused(" ".join(str(error).split()))
        result.command = ""
        return
    result.fact("over a log", [f"of {shown}, every {period:g} s"])
    result.fact("readings", [split_joined([f"{sensor.name} ({sensor.size})" for sensor in sensors]) or "none"])
    lacking = {sensor.name: [each for each in MOUNTED if not hasattr(sensor, each)] for sensor in sensors}
    for name, missing in lacking.items():
        if missing:
            result.note(f"sensor {name} has no {' and no '.join(missing)}: a log needs none, a scenario does", "")
    try:
        _estimated(spec, mission, period, [(sensor, np.nan if _is_formed(sensor) else 0.0) for sensor in sensors])
    except ValueError as error:
        result.note(f"with readings of zeros: {' '.join(str(error).split())}", "")
    if result.fits and not result.command:
        columns = " ".join(f"{sensor.name}={','.join(_columns(sensor))}" for sensor in sensors)
        result.command = f"mathnavi estimate {result.subject} LOG.csv --mission {shown} --readings {columns}"


def _estimated(spec: PluginSpec, mission: Any, period: float, values: Sequence[tuple[Any, float]]) -> None:
    """Run the estimator over a log with the same number in all readings of a sensor; NaN for no reading."""
    readings = {sensor.name: np.full((TIMES, sensor.size), value) for sensor, value in values}
    estimate(spec, mission, SensorLog(period * np.arange(TIMES, dtype=np.float64), readings), trust_units=True)


def _is_formed(sensor: Any) -> bool:
    """True for a sensor whose readings have a form of their own, which zeros have not."""
    return hasattr(sensor, "quaternions") or hasattr(sensor, "check")


def _columns(sensor: Any) -> list[str]:
    return ["COLUMN"] if sensor.size == 1 else [f"COLUMN{k + 1}" for k in range(sensor.size)]


def _as_file(place: str) -> str:
    """Return "package.module:NAME" with the file of the module, if that is in the current folder or below."""
    origin, _, name = place.rpartition(":")
    file = getattr(sys.modules.get(origin), "__file__", None)
    relative = os.path.relpath(file) if file else os.pardir
    return place if relative.startswith(os.pardir) else f"{relative}:{name}"
