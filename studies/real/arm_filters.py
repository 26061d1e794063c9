"""Velocities of the joints of a real arm: our observers against filters tuned on another log.

The arm is identified on one log (``mathnavi identify``), and every rival has the parameter of its grid that is best
there: Butterworth's low-pass of second order of differences, a Kalman filter of constant acceleration, and the momentum
observer with the identified arm. The default observer tunes itself while it runs. All of them get positions, and those
with a model the inputs, of the log on which they are compared.

**The reference** is not the truth: slopes of zero-phase polynomials of fifth degree around each reading, over 0.1 s on
either side. It uses future readings, and shares the noise of the readings with the filters, about 1e-3 rad/s for
positions that are rounded to 1e-4 rad at 100 Hz. Velocities in a log may be estimates by the arm's controller.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from scipy.signal import butter, lfilter

from mathnavi.estimators.identification.local_polynomials import smooth
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.input_files import InputFile
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.manifold.mission import POSITION, LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import MechanismPlace
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.logs.identification import identify
from mathnavi.sim.logs.lines import lines_of
from mathnavi.sim.logs.recorded_log import Channel, RecordedLog
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.table import Row
from mathnavi.studies.real.judging import row

CUTOFFS = (4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 30.0, 36.0, 42.0, 46.0)  # [Hz]
JERKS = (0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 4.0)  # [rad/s^2.5] square roots of densities
BANDWIDTHS = (15.0, 25.0, 35.0, 45.0, 55.0, 70.0, 90.0)  # [1/s]
HALF_WINDOW, DEGREE = 0.1, 5
SETTLED = 1.0  # [s] from the start of a log
NOISE = 4e-5  # [rad] of a position that the filters assume
BUTTERWORTH, KALMAN, MOMENTUM = "Butterworth of differences", "constant-acceleration Kalman", "momentum_observer"
DEFAULT = "riemannian_observer"
RIVALS = (BUTTERWORTH, KALMAN, MOMENTUM)
OWN = (DEFAULT, "high_gain", "lagrangian_ekf")
"""observers of this project as they come"""


@dataclass(frozen=True, eq=False)
class ArmLog:
    """Readings of a log and its reference."""

    t: Array  # (n,) [s]
    q: Array  # (n, nv)
    u: Array  # (n, nv)
    reference: Array  # (n, nv) NaN at the ends

    def error(self, v: Array) -> float:
        """Root mean square error [rad/s] of velocities (n, nv), over all joints."""
        judged = np.isfinite(self.reference[:, 0]) & (self.t >= self.t[0] + SETTLED)
        return float(np.sqrt(np.mean(np.square(v - self.reference)[judged])))


def arm_log(log: RecordedLog, position: Sequence[str], inputs: Sequence[str]) -> ArmLog:
    """Positions and inputs of a log, which have the same stamps."""
    own = log.sensor_log(readings={"q": position, "u": inputs})
    q, u = own.readings["q"], own.readings["u"]
    good = np.isfinite(q).all(axis=1) & np.isfinite(u).all(axis=1)
    t, q, u = own.t[good], q[good], u[good]
    return ArmLog(t, q, u, smooth(t, q, HALF_WINDOW, DEGREE).slope)


def low_pass(log: ArmLog, cutoff: float) -> Array:
    """Velocity by differences through Butterworth's filter of second order."""
    steps = np.diff(log.t)
    b, a = butter(2, cutoff, fs=1.0 / steps.mean())
    v: Array = lfilter(b, a, np.diff(log.q, axis=0) / steps[:, np.newaxis], axis=0)
    return np.vstack([np.zeros(log.q.shape[1]), v])


def constant_acceleration(log: ArmLog, jerk: float, noise: float) -> Array:
    """Velocity by a Kalman filter of (q, v, a) of each joint, a' being white with the square of ``jerk`` as density."""
    x = np.zeros((3, log.q.shape[1]))
    x[0] = log.q[0]
    P, v = np.diag([noise**2, 1.0, 10.0]), np.zeros_like(log.q)
    for k, h in enumerate(np.diff(log.t), start=1):
        F = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
        Q = jerk**2 * np.array([
            [h**5 / 20.0, h**4 / 8.0, h**3 / 6.0], [h**4 / 8.0, h**3 / 3.0, h**2 / 2.0], [h**3 / 6.0, h**2 / 2.0, h]
        ])  # fmt: skip
        x, P = F @ x, F @ P @ F.T + Q
        K = P[:, 0] / (P[0, 0] + noise**2)
        x = x + np.outer(K, log.q[k] - x[0])
        P = P - np.outer(K, P[0])
        v[k] = x[1]
    return v


@dataclass(frozen=True, eq=False)
class Observed:
    """Velocities of an observer, and what it says of them."""

    v: Array  # (n, nv) [rad/s]
    status: tuple[Status, ...]  # (n,)
    deviation: Array  # (n, nv) [rad/s] that it declares

    def judged(self, log: ArmLog) -> dict[str, float]:
        """NEES by the number of joints, and shares of the estimates that are usable and that are confident but wrong.

        A velocity is wrong if its error exceeds three of its declared standard deviations.
        """
        rows = np.isfinite(log.reference[:, 0]) & (log.t >= log.t[0] + SETTLED)
        error, deviation = (self.v - log.reference)[rows], self.deviation[rows]
        ok = np.array([each is Status.OK for each in self.status])[rows]
        usable = np.array([each.usable for each in self.status])[rows]
        joints, covariance = range(error.shape[1]), deviation[:, :, None] ** 2 * np.eye(error.shape[1])
        wrong = sure_and_wrong(log.t[rows], ok, error, covariance, [slice(k, k + 1) for k in joints]).any(axis=1)
        nees = np.square(error / deviation).mean(axis=1)[usable]
        return {
            "nees": float(nees.mean()) if usable.any() else math.nan,
            "usable_share": float(usable.mean()),
            "wrong_share": float(wrong.mean()),
        }


def observed(log: ArmLog, model: mujoco.MjModel, method: str, noise: float, **fields: float) -> Observed:
    """Velocity by an observer with the identified arm."""
    period = float(np.median(np.diff(log.t)))
    mission = LagrangianMission(MechanismSystem(model), PositionQuality(noise=noise), period, 20.0)
    plugin = load("estimators", method)
    estimator = plugin.build(plugin.Config(**fields), mission)
    found = []
    for k, t in enumerate(log.t):
        held = 0.5 * (log.u[max(k - 1, 0)] + log.u[k])
        found.append(estimator.update(float(t), [Measurement(POSITION, float(t), log.q[k])], held))
    return Observed(
        np.array([each.x[model.nq :] for each in found]),
        tuple(each.status for each in found),
        np.array([each.extra["deviation"][-model.nv :] for each in found]),
    )


def best(log: ArmLog, grid: tuple[float, ...], velocity: Callable[[ArmLog, float], Array]) -> float:
    """Parameter of a grid with the least error on a log."""
    return min(grid, key=lambda value: log.error(velocity(log, value)))


@dataclass(frozen=True)
class Filtered:
    """Velocities from an observer, with its status and its declared standard deviations."""

    parameter: str
    error: float
    update: float
    judged: Mapping[str, float]


def compare(
    tuned_on: RecordedLog,
    tests: Sequence[RecordedLog],
    mechanism: str,
    position: Sequence[str],
    inputs: Sequence[str],
    noise: float = NOISE,
) -> list[dict[str, Filtered]]:
    """Every filter by its name, for each of the logs ``tests``; ``noise`` [rad] is what they assume of a position."""
    tune = arm_log(tuned_on, position, inputs)
    model = identify(tuned_on, mechanism, position=position, inputs=inputs).model()
    cutoff = best(tune, CUTOFFS, low_pass)
    jerk = best(tune, JERKS, lambda log, value: constant_acceleration(log, value, noise))
    bandwidth = best(tune, BANDWIDTHS, lambda log, value: observed(log, model, MOMENTUM, noise, bandwidth=value).v)
    return [
        {
            BUTTERWORTH: _filtered(f"{cutoff:g} Hz", each, lambda log: low_pass(log, cutoff)),
            KALMAN: _filtered(f"{jerk:g} rad/s^2.5", each, lambda log: constant_acceleration(log, jerk, noise)),
            MOMENTUM: _filtered(
                f"{bandwidth:g} /s", each, lambda log: observed(log, model, MOMENTUM, noise, bandwidth=bandwidth)
            ),
            **{name: _filtered("as it comes", each, partial(_own, model, name, noise)) for name in OWN},
        }
        for each in (arm_log(test, position, inputs) for test in tests)
    ]


def _own(model: mujoco.MjModel, name: str, noise: float, log: ArmLog) -> Observed:
    return observed(log, model, name, noise)


def _filtered(parameter: str, log: ArmLog, run: Callable[[ArmLog], Array | Observed]) -> Filtered:
    begun = time.process_time()
    found = run(log)
    update = MeasuredTime(1e6 * (time.process_time() - begun) / len(log.t))
    v, judged = (found.v, found.judged(log)) if isinstance(found, Observed) else (found, {})
    return Filtered(parameter, log.error(v), update, judged)


JOINTS = 6
UR_POSITION = tuple(f"q{k}" for k in range(1, JOINTS + 1))
UR_TORQUE = tuple(f"torque{k}" for k in range(1, JOINTS + 1))
_UR_COLUMNS = 31  # t, positions, velocities, currents, desired currents and desired torques of six joints


def ur10e_log(file: str) -> RecordedLog:
    """Positions and desired torques of a log of the UR10e, a table without names of its columns."""
    rows = []
    for number, line in lines_of(Path(file)):
        words = line.split(",")
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) != _UR_COLUMNS:
            raise LogError(f"{file} line {number}: {line[:60]!r}; allowed: {_UR_COLUMNS} numbers")
        rows.append(values)
    table = np.array(rows)
    if not len(table):
        raise LogError(f"{file} has no line; allowed: lines of {_UR_COLUMNS} numbers")
    signals = (*(f"{name} [rad]" for name in UR_POSITION), *(f"{name} [N m]" for name in UR_TORQUE))
    columns = np.hstack([table[:, 1 : 1 + JOINTS], table[:, -JOINTS:]])
    return RecordedLog(file, "table", {"arm": Channel(table[:, 0] - table[0, 0], columns, signals)}, "first column")


@dataclass(frozen=True)
class ArmComparison:
    """An arm, the log that it is identified and the rivals are tuned on, and the logs on which they are compared."""

    tune: Annotated[str, InputFile()]
    tests: Annotated[tuple[str, ...], InputFile()]
    mechanism: MechanismPlace


def arm_rows(case: ArmComparison) -> list[Row]:
    """A job: rows of every filter over the logs of an arm."""
    tests = [ur10e_log(file) for file in case.tests]
    found = compare(ur10e_log(case.tune), tests, case.mechanism, UR_POSITION, UR_TORQUE)
    return [
        row(
            part="arm",
            log=Path(file).name.partition(".csv")[0],
            estimator=name,
            start="unknown",
            case=each.parameter,
            velocity_rms_rad_s=each.error,
            update_us=each.update,
            **each.judged,
        )
        for file, of_test in zip(case.tests, found, strict=True)
        for name, each in of_test.items()
    ]
