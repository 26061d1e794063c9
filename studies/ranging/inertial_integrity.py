"""The part of the study of integrity by inertial sensors: a quadrotor with an IMU and position fixes.

After two seconds of rest it swings about a place and turns about the vertical, under gusts that move it less than it
moves itself: the thrusts that the estimator is given do not know them. Position, velocity and attitude are judged each
by itself. There is no protection level.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.invariant.inertial import InertialIekf, InertialIekfConfig
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.quadrotor.dynamics import NOMINAL
from mathnavi.models.quadrotor.mission import InertialQuality, QuadrotorMission
from mathnavi.models.quaternion import rotation
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.studies.ranging.integrity_detection import by_windows, from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

ESTIMATOR = "inertial_iekf, IMU"
PERIOD, EVERY = 0.02, 5  # [s] of estimator and IMU, and periods between fixes
DURATION, ONSET, END = 90.0, 25.0, 50.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 5.0)
FROM_START = Timing(PERIOD, 0.0, 0.0, 5.0)
REST, BEGIN = 2.0, 3.0  # [s] at rest, and in which it begins to swing
FIX_NOISE, GUSTS, LAG = 1.0, DeclaredGusts(0.5), 0.5  # [m], [m/s^2]; [s] by which the gusts are smoothed
IMU = InertialQuality(gyro=0.005, accelerometer=0.05, gyro_bias=0.002, accelerometer_bias=0.05)
SWING, RATES = np.array([40.0, 40.0, 8.0]), np.array([0.3, 0.25, 0.5])  # [m], [rad/s]
NOD, TURNS = 2.0, 0.2  # [rad], [rad/s] of the nose
GYRO, FORCE = slice(0, 3), slice(3, 6)
BLOCKS = (slice(0, 3), slice(3, 6), slice(6, 9))
"""blocks of a state: position, velocity and attitude"""
MOVED, FAR, LATE, SILENT = 20.0, 20.0, 0.5, 3.0  # [m], [m], [s], [s]
AWAY, FAR_START, NOISY = "carried away 20 m", "first fix 20 m off the start", "noise of fixes times 3"
SHAKEN, SEEN = "noise of the IMU times 10", 0.5  # [s] of readings in which that is beyond chance
SETTING = (
    f"Nor is there one by an IMU and fixes: a quadrotor that swings and turns for {DURATION:g} s reads its IMU "
    f"{1.0 / PERIOD:g} times a second, with deviations of {IMU.gyro:g} rad/s and {IMU.accelerometer:g} m/s^2, and "
    f"fixes of {FIX_NOISE:g} m every {EVERY * PERIOD:g} s, the fault from {ONSET:g} to {END:g} s."
)


@dataclass(frozen=True, eq=False)
class ImuFlight:
    """A flight of n updates, whose sensors have no fault."""

    truth: Array  # (n, 6) [m, m/s]
    attitudes: Array  # (n, 3, 3)
    imu: Array  # (n, 6) [rad/s, m/s^2]; NaN where nothing is read
    noise: Array  # (n, 6) in them
    fixes: Array  # (n, 3) [m]; NaN in the updates without
    fix_noise: Array  # (n, 3) [m] in them
    commands: Array  # (n, 4) [N] held since the update before


Fault = Callable[[ImuFlight, slice, np.random.Generator], None]
"""change of the readings of a flight, in place, in the updates of a slice"""


def _none(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    pass


def _in_g(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    flight.imu[during, FORCE] /= 9.81


def _direction(rng: np.random.Generator) -> Array:
    direction = rng.standard_normal(3)
    return np.asarray(direction / np.linalg.norm(direction), np.float64)


def _bias(which: slice, size: float) -> Fault:
    def fault(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
        flight.imu[during, which] += size * _direction(rng)

    return fault


def _imu_stuck(which: slice) -> Fault:
    def fault(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
        flight.imu[during, which] = flight.imu[during.start, which]

    return fault


def _silent(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    flight.imu[during.start : during.start + round(SILENT / PERIOD)] = np.nan


def _off(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    flight.fixes[during] += 10.0 * _direction(rng)


def _stuck(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    own = flight.fixes[during]
    read = np.isfinite(own[:, 0])
    own[read] = own[read][0]


def _drift(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    grown = rng.uniform(0.2, 1.0) * PERIOD * np.arange(during.stop - during.start)
    flight.fixes[during] += grown[:, None] * _direction(rng)


def _late(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    """Fixes of ``LATE`` ago with the stamp of now."""
    ago = round(LATE / PERIOD)
    late = flight.truth[during.start - ago : during.stop - ago, :3] + flight.fix_noise[during]
    flight.fixes[during] = np.where(np.isfinite(flight.fixes[during]), late, np.nan)


def _noisy(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    flight.fixes[during] += 2.0 * flight.fix_noise[during]


def _shaken(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    flight.imu[during] += 9.0 * flight.noise[during]


def _doubled(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    """Every second fix is the one before, with a later time stamp."""
    own = flight.fixes[during]
    read = np.flatnonzero(np.isfinite(own[:, 0]))
    count = len(read) // 2
    own[read[1::2]] = own[read[: 2 * count : 2]]


FAULTS: dict[str, Fault] = {
    "none": _none,
    "accelerometer in g": _in_g,
    "gyro bias 0.01 rad/s": _bias(GYRO, 0.01),
    "accelerometer bias 0.3 m/s^2": _bias(FORCE, 0.3),
    "gyro stuck": _imu_stuck(GYRO),
    "accelerometer stuck": _imu_stuck(FORCE),
    "IMU silent for 3 s": _silent,
    "fixes 10 m off": _off,
    "fixes stuck": _stuck,
    "fixes drift": _drift,
    "fixes 0.5 s late": _late,
    NOISY: _noisy,
    SHAKEN: _shaken,
    "every fix twice": _doubled,
    AWAY: _none,  # the vehicle itself, not its readings
    FAR_START: _none,  # likewise, from the beginning
}


def flown(rng: np.random.Generator, mission: QuadrotorMission, fault: str) -> ImuFlight:
    """A flight whose readings have no fault: it is ``fault`` that is carried away at ONSET, or begins elsewhere."""
    n = round(DURATION / PERIOD)
    t: Array = PERIOD * np.arange(n + 2, dtype=np.float64)  # a period ahead of the first update, and behind the last
    place, velocity, acceleration = _swing(t, rng)
    gust = _gusts(t, rng)
    place += mission.start_state[:3]
    if fault == FAR_START:
        place += FAR * _direction(rng)
    if fault == AWAY:
        place[t >= ONSET - 0.5 * PERIOD] += MOVED * _direction(rng)
    vehicle = mission.vehicle
    R, thrusts = _flies(t, velocity, acceleration - gust, mission)
    turns = np.array(Rotation.from_matrix(np.swapaxes(R[:-1], 1, 2) @ R[1:]).as_rotvec()) / PERIOD
    rates = 0.5 * (turns[:-1] + turns[1:])
    felt = np.diff(velocity, axis=0)[:-1] / PERIOD + np.array([0.0, 0.0, vehicle.gravity])
    inertia, at = np.array(vehicle.inertia), slice(1, -1)
    noise = np.repeat([IMU.gyro, IMU.accelerometer], 3) * rng.standard_normal((n, 6))
    bias = np.repeat([IMU.gyro_bias, IMU.accelerometer_bias], 3) * rng.standard_normal(6)
    imu = np.hstack([rates, np.einsum("kji,kj->ki", R[at], felt)]) + bias + noise
    moments = inertia * np.gradient(rates, PERIOD, axis=0) + np.cross(rates, inertia * rates)
    commands = np.linalg.solve(vehicle.allocation, np.column_stack([thrusts[at], moments]).T).T
    fix_noise = FIX_NOISE * rng.standard_normal((n, 3))
    fixes = place[at] + fix_noise
    fixes[np.arange(n) % EVERY > 0] = np.nan
    return ImuFlight(np.hstack([place, velocity])[at], R[at], imu, noise, fixes, fix_noise, commands)


def _swing(t: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Place, velocity and acceleration (n, 3) at t (n,) [s] of a swing that begins from rest at the origin."""
    s = np.clip((t - REST) / BEGIN, 0.0, 1.0)
    rate = _begun(t)  # of the phase, which runs with t from REST + BEGIN on
    change = 30.0 * s * s * (1.0 - s) ** 2 / BEGIN
    phase = BEGIN * s**4 * (2.5 - 3.0 * s + s * s) + np.maximum(t - REST - BEGIN, 0.0)
    first = rng.uniform(0.0, 2.0 * math.pi, 3)
    angle = first + RATES * phase[:, None]
    along, across = SWING * np.cos(angle) * RATES, -SWING * np.sin(angle) * RATES**2
    place = SWING * (np.sin(angle) - np.sin(first))
    return place, along * rate[:, None], across * rate[:, None] ** 2 + along * change[:, None]


def _gusts(t: Array, rng: np.random.Generator) -> Array:
    """Gusts (n, 3) [m/s^2] of a first-order Gauss-Markov process, smoothed by a lag; none at rest."""
    keep, lag = math.exp(-PERIOD / GUSTS.time_constant), math.exp(-PERIOD / LAG)
    white = GUSTS.rms * math.sqrt(1.0 - keep**2) * rng.standard_normal((len(t), 3))
    smooth: Array = lfilter([1.0 - lag], [1.0, -lag], lfilter([1.0], [1.0, -keep], white, axis=0), axis=0)
    return smooth * _begun(t)[:, None]


def _begun(t: Array) -> Array:
    """Smooth rise (n,) at t (n,) [s] from 0 at rest to 1, with two continuous derivatives."""
    s = np.clip((t - REST) / BEGIN, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s * s), np.float64)


def _flies(t: Array, velocity: Array, acceleration: Array, mission: QuadrotorMission) -> tuple[Array, Array]:
    """Attitudes (n, 3, 3) and thrusts (n,) [N] under which the vehicle has these velocities and accelerations (n, 3),
    against its drag.
    """
    vehicle, start = mission.vehicle, rotation(mission.start_state[3:7])
    heading = math.atan2(start[1, 0], start[0, 0])
    nose = heading + _begun(t) * NOD * np.sin(TURNS * (t - REST))
    ahead = np.column_stack([np.cos(nose), np.sin(nose), np.zeros_like(t)])
    weight = vehicle.mass * (acceleration + np.array([0.0, 0.0, vehicle.gravity]))
    R = np.broadcast_to(np.eye(3), (len(t), 3, 3))
    for _ in range(8):  # a fixed point: the drag depends on the attitude
        drag = np.einsum("kij,j,klj,kl->ki", R, np.array(vehicle.drag), R, velocity)
        force = weight + drag
        up = force / np.linalg.norm(force, axis=1)[:, None]
        left = np.cross(up, ahead)
        left /= np.linalg.norm(left, axis=1)[:, None]
        R = np.stack([np.cross(left, up), left, up], axis=2)
    return R, np.linalg.norm(force, axis=1)


def _mission() -> QuadrotorMission:
    flight = FlightMission(
        HeightField(np.zeros((3, 3)), 500.0), (500.0, 500.0, 200.0), (900.0, 700.0, 200.0), speed_max=25.0,
        acceleration_max=8.0, gust=GUSTS, position_noise=FIX_NOISE, position_rate=1.0 / (EVERY * PERIOD),
        control_period=PERIOD,
    )  # fmt: skip
    return QuadrotorMission(flight, NOMINAL, IMU)


def _updates(flight: ImuFlight) -> Iterator[tuple[float, tuple[Measurement, ...], Array, tuple[Measurement, ...]]]:
    """Times [s], readings of the IMU, commands and fixes."""
    for k, (imu, fix, command) in enumerate(zip(flight.imu, flight.fixes, flight.commands, strict=True)):
        t = PERIOD * k
        yield t, _read("imu", t, imu), command, _read("position", t, fix)


def _read(name: str, t: float, value: Array) -> tuple[Measurement, ...]:
    return (Measurement(name, t, value),) if np.isfinite(value).all() else ()


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the estimator under a fault; the seed determines flight and fault."""
    rng, mission = np.random.default_rng(run.seed), _mission()
    flight = flown(rng, mission, run.fault)
    timing = FROM_START if run.fault == FAR_START else TIMING
    during = slice(round(timing.onset / PERIOD), round(END / PERIOD))
    quiet = dataclasses.replace(
        flight, imu=flight.imu - flight.noise, noise=np.zeros_like(flight.noise),
        fixes=flight.fixes - flight.fix_noise, fix_noise=np.zeros_like(flight.fix_noise),
    )  # fmt: skip
    faulty = copy.deepcopy(quiet)
    FAULTS[run.fault](faulty, during, copy.deepcopy(rng))
    FAULTS[run.fault](flight, during, rng)
    estimator = InertialIekf(InertialIekfConfig(), mission, monitored=run.monitored)
    estimates = []
    for (t, imu, command, fixes), R in zip(_updates(flight), flight.attitudes, strict=True):
        estimates.append(_with_attitude(estimator.update(t, (*imu, *fixes), command), R))
    found = findable(mission, faulty, quiet, during, run.fault)
    truth = np.hstack([flight.truth, np.zeros((len(estimates), 3))])
    return judged(estimates, truth, found, timing, persists=run.fault in (AWAY, FAR_START), blocks=BLOCKS)


def _with_attitude(estimate: Estimate, R: Array) -> Estimate:
    """The estimate with the turn (3,) [rad] from the true attitude R to its own as a part of the state."""
    P = np.zeros((9, 9))
    P[:6, :6] = estimate.covariance
    P[6:, 6:] = np.diag(estimate.extra["attitude_deviation"] ** 2)
    turn = Rotation.from_matrix(R.T @ rotation(estimate.extra["attitude"])).as_rotvec()
    return dataclasses.replace(estimate, x=np.concatenate([estimate.x, turn]), covariance=P)


def findable(mission: QuadrotorMission, faulty: ImuFlight, quiet: ImuFlight, during: slice, fault: str) -> Flags:
    """True (n,) from the update on at which a fault can be found in the fixes, of a flight without noise; as among
    the other flights. Noise of the IMU can be found in its own readings.
    """
    e = _innovations(mission, faulty)
    if fault not in (AWAY, FAR_START):  # of the truth itself, which has no flight without it
        e = e - _innovations(mission, quiet)
    rho, chance = np.ones(len(e)), np.zeros(len(e))
    rho[during] = 9.0 if fault == NOISY else 1.0  # the fixes are nearly all of the variance of an innovation
    read = np.flatnonzero(np.isfinite(e[:, 0]))
    chance[read] = by_windows(e[read], rho[read], InnovationMonitor("fixes", 3, EVERY * PERIOD).thresholds)
    if fault == SHAKEN:
        chance[during.start + round(SEEN / PERIOD) :] = 1.0
    return from_onset(chance, during.start)


def _innovations(mission: QuadrotorMission, flight: ImuFlight) -> Array:
    """Innovations (n, 3) of the fixes along the axes of the map, each over its deviation, of the filter without a
    monitor.
    """
    estimator, e = InertialIekf(InertialIekfConfig(), mission, monitored=False), np.full((len(flight.fixes), 3), np.nan)
    for k, (t, imu, command, fixes) in enumerate(_updates(flight)):
        before = estimator.update(t, imu, command)
        assert before.covariance is not None
        for fix in fixes:
            e[k] = (fix.value - before.x[:3]) / np.sqrt(np.diag(before.covariance)[:3] + FIX_NOISE**2)
            estimator.update(t, (fix,), command)
    return e
