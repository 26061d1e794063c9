"""The part of the study of integrity by a gyro and an accelerometer alone: a device in a hand.

It rests, then is turned about all axes and moved about a place. Nothing shows its heading, so its inclination is
judged: the turn about horizontal axes from the true vertical to the estimated one. There is no protection level.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.invariant.inclination import APART, InertialAttitude, InertialAttitudeConfig
from mathnavi.estimators.invariant.inclination_kernels import turned
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.inertial_mission import CALIBRATED, IMU, InertialMission
from mathnavi.models.quaternion import rotation
from mathnavi.studies.ranging.integrity_detection import by_windows, from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

ESTIMATOR = "inertial_attitude, IMU alone"
PERIOD = 0.01  # [s] of estimator and readings
DURATION, ONSET, END = 90.0, 15.0, 40.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 8.0)
REST, REACH, TURNS = 3.0, 0.15, np.array([2.0, 1.5, 1.0])  # [s], [m], [rad/s]
MISSION = InertialMission(CALIBRATED, period=PERIOD)
GYRO, FORCE = slice(0, 3), slice(3, 6)
BLOCKS = (slice(0, 2),)
"""blocks of a state: inclination"""
LATE, SHORT, LONG = 0.1, 0.3, 3.0  # [s]
PUSH, PUSHES = 5.0, 2.0  # [m/s^2] and [s] of an acceleration that lasts
NOISY, PUSHED, WIDE = "noise times 3", "accelerates for 2 s", "moves 10 times as far"
SETTING = (
    f"Nor by a gyro and an accelerometer: a device that is turned and moved in a hand for {DURATION:g} s reads them "
    f"{1.0 / PERIOD:g} times a second, the fault from {ONSET:g} to {END:g} s; its inclination is judged."
)


@dataclass(frozen=True, eq=False)
class Handled:
    """A device whose sensors have no fault, at n updates."""

    attitudes: Array  # (n, 3, 3) to the world, z up
    imu: Array  # (n, 6) [rad/s, m/s^2]; NaN where nothing is read
    noise: Array  # (n, 6) in them


Fault = Callable[[Handled, slice, np.random.Generator], None]
"""change of the readings of a device, in place, in the updates of a slice"""


def _none(device: Handled, during: slice, rng: np.random.Generator) -> None:
    pass


def _in_g(device: Handled, during: slice, rng: np.random.Generator) -> None:
    device.imu[during, FORCE] /= MISSION.gravity


def _off(which: slice, size: float) -> Fault:
    def fault(device: Handled, during: slice, rng: np.random.Generator) -> None:
        direction = rng.standard_normal(3)
        device.imu[during, which] += size * direction / np.linalg.norm(direction)

    return fault


def _stuck(which: slice) -> Fault:
    def fault(device: Handled, during: slice, rng: np.random.Generator) -> None:
        device.imu[during, which] = device.imu[during.start, which]

    return fault


def _silent(seconds: float) -> Fault:
    def fault(device: Handled, during: slice, rng: np.random.Generator) -> None:
        device.imu[during.start : during.start + round(seconds / PERIOD)] = np.nan

    return fault


def _late(device: Handled, during: slice, rng: np.random.Generator) -> None:
    """Readings of ``LATE`` ago with the stamp of now."""
    ago = round(LATE / PERIOD)
    device.imu[during] = device.imu[during.start - ago : during.stop - ago].copy()


def _noisy(device: Handled, during: slice, rng: np.random.Generator) -> None:
    device.imu[during] += 2.0 * device.noise[during]


def _doubled(device: Handled, during: slice, rng: np.random.Generator) -> None:
    """Every second reading is the one before, with a later time stamp."""
    own = device.imu[during]
    count = len(own) // 2
    own[1::2][:count] = own[: 2 * count : 2]


FAULTS: dict[str, Fault] = {
    "none": _none,
    "accelerometer in g": _in_g,
    "gyro bias 0.05 rad/s": _off(GYRO, 0.05),
    "accelerometer bias 1 m/s^2": _off(FORCE, 1.0),
    "gyro stuck": _stuck(GYRO),
    "accelerometer stuck": _stuck(FORCE),
    "IMU stuck": _stuck(slice(0, 6)),
    "IMU silent for 0.3 s": _silent(SHORT),
    "IMU silent for 3 s": _silent(LONG),
    NOISY: _noisy,
    "every reading twice": _doubled,
    "readings 0.1 s late": _late,
    PUSHED: _none,  # the motion itself, not the readings
    WIDE: _none,  # likewise
}


def handled(rng: np.random.Generator, fault: str) -> Handled:
    """A device whose readings have no fault: it is ``fault`` that moves it otherwise than is declared.

    The rate of turn is the same over each period, at whose end it is read.
    """
    n = round(DURATION / PERIOD)
    t = PERIOD * np.arange(n)
    phases, frequencies = rng.uniform(0.0, 2.0 * math.pi, (2, 3)), rng.uniform(3.0, 7.0, 3)
    q, bias = turned(np.array([1.0, 0.0, 0.0, 0.0]), rng.normal(0.0, 0.3, 3)), rng.standard_normal((2, 3))
    noise = np.repeat([CALIBRATED.gyro, CALIBRATED.accelerometer], 3) * rng.standard_normal((n, 6))
    moving, faulty = np.clip((t - REST) / 0.5, 0.0, 1.0)[:, None], (t >= ONSET) & (t < END)
    rates = moving * TURNS * np.sin(t[:, None] * np.array([1.1, 1.7, 2.3]) + phases[0])
    reach = np.where(faulty & (fault == WIDE), 10.0 * REACH, REACH)[:, None]
    acceleration = -moving * reach * frequencies**2 * np.sin(frequencies * t[:, None] + phases[1])
    if fault == PUSHED:
        acceleration[(t >= ONSET) & (t < ONSET + PUSHES), 0] += PUSH
    attitudes, imu = np.empty((n, 3, 3)), np.empty((n, 6))
    for k in range(n):
        q = turned(q, PERIOD * rates[k])
        attitudes[k] = rotation(q)
        imu[k, GYRO] = rates[k]
        imu[k, FORCE] = attitudes[k].T @ (acceleration[k] + np.array([0.0, 0.0, MISSION.gravity]))
    imu += np.append(CALIBRATED.gyro_bias * bias[0], CALIBRATED.accelerometer_bias * bias[1])
    return Handled(attitudes, imu + noise, noise)


def _updates(device: Handled) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    for k, y in enumerate(device.imu):
        t = PERIOD * k
        yield t, (Measurement(IMU, t, y),) if np.isfinite(y).all() else (), np.zeros(0)


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the estimator under a fault; the seed determines motion and fault."""
    rng = np.random.default_rng(run.seed)
    without = _quiet(handled(copy.deepcopy(rng), "none"))
    device = handled(rng, run.fault)
    during, faulty = slice(round(ONSET / PERIOD), round(END / PERIOD)), _quiet(device)
    FAULTS[run.fault](faulty, during, copy.deepcopy(rng))
    FAULTS[run.fault](device, during, rng)
    estimator = InertialAttitude(InertialAttitudeConfig(), MISSION, monitored=run.monitored)
    estimates = [
        _inclined(estimator.update(*update), R) for update, R in zip(_updates(device), device.attitudes, strict=True)
    ]
    found = findable(faulty, without, during)
    return judged(estimates, np.zeros((len(estimates), 2)), found, TIMING, blocks=BLOCKS)


def _quiet(device: Handled) -> Handled:
    return dataclasses.replace(device, imu=device.imu - device.noise, noise=np.zeros_like(device.noise))


def _inclined(estimate: Estimate, R: Array) -> Estimate:
    """The estimate with the turn (2,) [rad] about horizontal axes from the true vertical to its own as its state."""
    up = rotation(estimate.x) @ R[2]
    s, c = math.hypot(up[0], up[1]), float(up[2])
    turn = math.atan2(s, c) / max(s, 1e-12) * np.array([up[1], -up[0]])
    return dataclasses.replace(
        estimate, x=turn, covariance=np.diag(estimate.extra["attitude_deviation"][:2] ** 2)
    )  # fmt: skip


def findable(faulty: Handled, without: Handled, during: slice) -> Flags:
    """True (n,) from the update on at which a fault can be found, of a motion without noise, by what it makes of the
    velocities that are tested of the one ``without`` it; as of the other flights.
    """
    e = _innovations(faulty) - _innovations(without)
    chance, rho = np.zeros(len(e)), np.ones(len(e))
    read = np.flatnonzero(np.isfinite(e[:, 0]))
    interval = APART / MISSION.corner
    chance[read] = by_windows(e[read], rho[read], InnovationMonitor("velocities", 2, interval).thresholds)
    return from_onset(chance, during.start)


def _innovations(device: Handled) -> Array:
    """Velocities (n, 2) that are tested, each over its deviation; NaN in the updates without a test."""
    estimator = InertialAttitude(InertialAttitudeConfig(), MISSION, monitored=False)
    extras = [estimator.update(*update).extra for update in _updates(device)]
    return np.array([extra["innovations"] / extra["innovation_std"] for extra in extras])
