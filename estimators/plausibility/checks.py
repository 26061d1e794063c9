"""The check of a log, or of the first readings of an observer that is stepped, by the kind of its mission."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np

from mathnavi.estimators.plausibility import inertial, positions
from mathnavi.estimators.plausibility import odometry as odometry_check
from mathnavi.interfaces.joint_states import QuaternionOrder
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import POSITION, LagrangianMission
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.unicycle.mission import RangingMission

Check = Generator[None, None, str]
"""check in steps of some milliseconds, which returns what is wrong, or "" """

_SAMPLES = (64, 256, 1024)  # readings after which those of a stepped observer are checked


@dataclass(frozen=True, eq=False)
class Recording:
    """Readings by sensor, and inputs."""

    t: Array  # (n,) [s]
    readings: Mapping[str, Array]  # (n, m), NaN where there was none
    inputs: Array  # (n, nu) from each time to the next
    quaternions: QuaternionOrder = "wxyz"  # order in which they came; here the scalar is first


@singledispatch
def misread(mission: Any, recording: Recording) -> Check:
    """Say in which other way alone the readings fit the mission; "" if they fit as they are, or in no way."""
    yield from ()
    return ""


@misread.register
def _(mission: LagrangianMission, recording: Recording) -> Check:
    if POSITION not in recording.readings:
        return ""
    t, y, u = recording.t, recording.readings[POSITION], recording.inputs
    said = yield from positions.misread(mission, t, y, u, recording.quaternions)
    return said


@misread.register
def _(mission: QuadrotorMission, recording: Recording) -> Check:
    if not {"imu", "position"} <= recording.readings.keys():
        return ""
    imu, fixes = recording.readings["imu"], recording.readings["position"]
    said = yield from inertial.misread(mission, recording.t, imu, fixes)
    return said


@misread.register
def _(mission: RangingMission, recording: Recording) -> Check:
    if not {"ranges", "odometry"} <= recording.readings.keys():
        return ""
    ranges, odometry = recording.readings["ranges"], recording.readings["odometry"]
    said = yield from odometry_check.misread(mission, recording.t, ranges, odometry)
    return said


def finished(check: Check) -> str:
    """Run a check to its end, and return what it found."""
    steps = _Steps(check)
    for _ in steps:
        pass
    return steps.found


class _Steps:
    """Steps of a check, and what it has found at their end."""

    def __init__(self, check: Check) -> None:
        self._check = check
        self.found = ""

    def __iter__(self) -> Iterator[None]:
        self.found = yield from self._check


class FirstReadings:
    """Check of the first readings of an observer that is stepped: a little of it at every step."""

    def __init__(self, mission: Any, quaternions: QuaternionOrder = "wxyz") -> None:
        self._mission, self._quaternions = mission, quaternions
        self._t: list[float] = []
        self._readings: dict[str, list[Array]] = {}
        self._inputs: list[Array] = []
        self._steps: _Steps | None = None
        self._running: Iterator[None] = iter(())

    def misread(self, t: float, readings: Mapping[str, Array], u: Array) -> str:
        """Say what is wrong with the readings up to now, "" for nothing; u (nu,) was held until t [s].

        ``readings`` (m,) by sensor are rows of NaN where there was none.
        """
        if len(self._t) < _SAMPLES[-1]:
            self._t.append(t)
            self._inputs.append(u)
            for name, value in readings.items():
                self._readings.setdefault(name, []).append(value)
            if len(self._t) in _SAMPLES:
                self._steps = _Steps(misread(self._mission, self._recording()))
                self._running = iter(self._steps)
        next(self._running, None)
        return "" if self._steps is None else self._steps.found

    def _recording(self) -> Recording:
        inputs = np.array([*self._inputs[1:], self._inputs[-1]])
        readings = {name: np.array(each) for name, each in self._readings.items()}
        return Recording(np.array(self._t), readings, inputs, self._quaternions)
