"""The check of a log, or of the first readings of an observer that is stepped, by the kind of its mission."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import singledispatch
from typing import Any

import numpy as np

from mathnavi.estimators.plausibility import base_imu, beacons, flights, imu_alone, inertial, positions
from mathnavi.estimators.plausibility import odometry as odometry_check
from mathnavi.estimators.plausibility.motion import RecordedMotion
from mathnavi.interfaces.joint_states import QuaternionOrder
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.inertial_mission import InertialMission
from mathnavi.models.manifold.mission import POSITION, LagrangianMission
from mathnavi.models.mechanism.floating_base import FEET, IMU, JOINT_POSITIONS, JOINTS
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.unicycle.beacons import BeaconFieldMission, BeaconMission
from mathnavi.models.unicycle.mission import RangingMission

Check = Generator[None, None, str]
"""check in steps of some milliseconds, which returns what is wrong, or "" """

_SAMPLES = (128, 512)  # readings after which those of a stepped observer are checked
_END = object()  # of a check


@dataclass(frozen=True, eq=False)
class Recording:
    """Readings by sensor, and inputs."""

    t: Array  # (n,) [s]
    readings: Mapping[str, Array]  # (n, m), NaN where there was none
    inputs: Array  # (n, nu) from each time to the next
    quaternions: QuaternionOrder = "wxyz"  # order in which they came; here the scalar is first
    columns: Mapping[str, Sequence[str]] = field(default_factory=dict)  # names of those of a sensor, where known


@singledispatch
def misread(mission: Any, recording: Recording) -> Check:
    """Return the only other way in which the readings fit the mission; "" if they fit unchanged, or not at all."""
    yield from ()
    return ""


@misread.register
def _(mission: LagrangianMission, recording: Recording) -> Check:
    t, readings, u = recording.t, recording.readings, recording.inputs
    said = ""
    if POSITION in readings:
        motion = RecordedMotion(t, readings[POSITION], u)
        said = yield from positions.misread(mission, motion, recording.quaternions)
    if JOINTS in readings:
        pose = np.tile(mission.system.manifold.origin[: JOINT_POSITIONS.start], (len(t), 1))
        motion = RecordedMotion(t, np.hstack([pose, readings[JOINTS]]), u, JOINTS, JOINT_POSITIONS.start)
        said = yield from positions.misread(mission, motion, recording.quaternions)
    if {IMU, FEET} <= readings.keys() and isinstance(mission.system, MechanismSystem):
        base = mission.system.floating_base
        said = said or base_imu.misread(base, mission.start_state, t, readings[IMU], readings[FEET])
    return said


@misread.register
def _(mission: QuadrotorMission, recording: Recording) -> Check:
    if not {"imu", "position"} <= recording.readings.keys():
        return ""
    imu, fixes = recording.readings["imu"], recording.readings["position"]
    said = yield from inertial.misread(mission, recording.t, imu, fixes)
    return said


@misread.register
def _(mission: FlightMission, recording: Recording) -> Check:
    yield from ()
    return flights.misread(mission, recording.t, recording.readings)


@misread.register
def _(mission: InertialMission, recording: Recording) -> Check:
    yield from ()
    return imu_alone.misread(recording.t, recording.readings[IMU], mission.gravity)


@misread.register
def _(mission: RangingMission, recording: Recording) -> Check:
    if not {"ranges", "odometry"} <= recording.readings.keys():
        return ""
    ranges, odometry = recording.readings["ranges"], recording.readings["odometry"]
    said = yield from odometry_check.misread(mission, recording.t, ranges, odometry)
    return said


@misread.register
def _(mission: BeaconMission, recording: Recording) -> Check:
    yield from ()
    return beacons.misread(mission, recording.t, recording.readings, recording.inputs, recording.columns)


@misread.register
def _(mission: BeaconFieldMission, recording: Recording) -> Check:
    said = yield from misread(mission.beacon_mission, recording)
    if not said and {"ranges", "odometry"} <= recording.readings.keys():
        said = yield from odometry_check.misread(
            mission, recording.t, recording.readings["ranges"], recording.readings["odometry"]
        )
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
        self._checks = 0  # that have begun
        self._steps: _Steps | None = None  # of the last one
        self._running: Iterator[None] = iter(())

    def judged(self, estimate: Estimate, t: float, readings: Mapping[str, Array], u: Array) -> Estimate:
        """Return an estimate, lost once its readings are found wrong; the other arguments are those of ``misread``."""
        said = self.misread(t, readings, u)
        return replace(estimate, status=Status.LOST, message=f"finds that {said}") if said else estimate

    def misread(self, t: float, readings: Mapping[str, Array], u: Array) -> str:
        """Say what is wrong with the readings up to now, "" for nothing; u (nu,) was held until t [s].

        ``readings`` (m,) by sensor are rows of NaN where there was none.
        """
        if len(self._t) < _SAMPLES[-1] and not (self._t and t <= self._t[-1]):
            self._t.append(t)
            self._inputs.append(u)
            for name, value in readings.items():
                self._readings.setdefault(name, []).append(value)
        running = self._steps is not None and next(self._running, _END) is not _END
        if not running and self._checks < len(_SAMPLES) and len(self._t) >= _SAMPLES[self._checks] and not self._found:
            self._checks += 1
            self._steps = _Steps(misread(self._mission, self._recording()))
            self._running = iter(self._steps)
        return self._found

    @property
    def _found(self) -> str:
        return "" if self._steps is None else self._steps.found

    def _recording(self) -> Recording:
        inputs = np.array([*self._inputs[1:], self._inputs[-1]])
        readings = {name: np.array(each) for name, each in self._readings.items()}
        return Recording(np.array(self._t), readings, inputs, self._quaternions)
