"""The part of the study of integrity among beacons: a robot that reads four, one after the other, and its odometry.

Times are longer than within a wall, for each beacon is read once a second. The start of the robot is known.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import chndtr

from mathnavi.estimators.beacons.filter import BeaconBankConfig, BeaconFilter
from mathnavi.estimators.beacons.separation import WRONG
from mathnavi.estimators.beacons.witness import RobotBeaconWitness
from mathnavi.estimators.integrity.guard import alone
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.beacon_names import RANGES
from mathnavi.models.unicycle.beacons import BeaconMission, BeaconQuality, exact_readings
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.ranging.integrity_detection import LARGER, by_windows, from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

ESTIMATORS = ("beacon_bank", "beacon_certified")
PLACES = np.array([(-30.0, -25.0), (35.0, -20.0), (30.0, 30.0), (-25.0, 35.0)])  # [m]
PERIOD, EVERY, FINE = 0.125, 2, 5  # [s] of odometry, updates between two readings, and steps of the truth in each
DURATION, ONSET, END = 150.0, 40.0, 80.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 10.0)
NOISE, ODOMETRY, SCALE = 0.3, (0.05, 0.02), 0.02  # [m], [m/s, rad/s], [-] of ranges and of the odometry
UNSURE = (0.3, 0.3, 0.1)  # [m, m, rad] of the start
SPEED, TURN, AREA = 1.2, 0.6, 25.0  # [m/s], [rad/s]; [m] half the side of the square of places to drive to
CARRIED, LATE = 8.0, 0.5  # [m], [s]
AWAY = "carried away 8 m"
SETTING = (
    f"{' and '.join(ESTIMATORS)} drive for {DURATION:g} s among {len(PLACES)} beacons, one of which is read every "
    f"{EVERY * PERIOD:g} s with a deviation of {NOISE:g} m, the fault from {ONSET:g} to {END:g} s."
)


@dataclass(frozen=True, eq=False)
class BeaconDrive:
    """A drive of n updates whose sensors read m beacons without a fault; NaN where one is not read."""

    truth: Array  # (n, 3) [m, m, rad]
    fine: Array  # (FINE n + 1, 3) from 0 s on
    ranges: Array  # (n, m) [m]
    noise: Array  # (n, m) [m] in them
    odometry: Array  # (n, 2) [m/s, rad/s]
    commands: Array  # (n, 2)
    scale: float  # of the ranges


Fault = Callable[[BeaconDrive, slice, np.random.Generator], None]
"""change of the readings of a drive, in place, in the updates of a slice"""


def _one(rng: np.random.Generator) -> int:
    return int(rng.integers(len(PLACES)))


def _none(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
    pass


def _offset(metres: float) -> Fault:
    def fault(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
        drive.ranges[during, _one(rng)] += metres

    return fault


def _scaled(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during, _one(rng)] *= 1.1


def _stuck(count: int) -> Fault:
    def fault(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
        for i in rng.permutation(len(PLACES))[:count]:
            own = drive.ranges[during, i]
            read = np.isfinite(own)
            own[read] = own[read][0]

    return fault


def _drift(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
    speed = rng.choice((-1.0, 1.0)) * rng.uniform(0.05, 0.2)  # [m/s]
    drive.ranges[during, _one(rng)] += speed * PERIOD * np.arange(during.stop - during.start)


def _no_odometry(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
    drive.odometry[during.start : during.start + round(5.0 / PERIOD)] = np.nan


def _fast_odometry(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
    drive.odometry[during] *= 1.15


def _noisy(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during] += 2.0 * drive.noise[during]


def _doubled(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
    """Every second reading of a beacon is the one before, with a later time stamp."""
    for i in range(len(PLACES)):
        own = drive.ranges[during, i]
        read = np.flatnonzero(np.isfinite(own))
        count = len(read) // 2
        own[read[1::2]] = own[read[: 2 * count : 2]]


def _late(drive: BeaconDrive, during: slice, rng: np.random.Generator) -> None:
    """Ranges of ``LATE`` ago with the stamp of now."""
    for k in range(during.start, during.stop):
        ago = drive.fine[round(FINE * ((k + 1) - LATE / PERIOD))]
        read = np.isfinite(drive.ranges[k])
        drive.ranges[k, read] = ((1.0 + drive.scale) * exact_readings(PLACES, 0, ago) + drive.noise[k])[read]


FAULTS: dict[str, Fault] = {
    "none": _none,
    "a beacon 1 m too long": _offset(1.0),
    "a beacon 3 m too short": _offset(-3.0),
    "a beacon times 1.1": _scaled,
    "a beacon stuck": _stuck(1),
    "two beacons stuck": _stuck(2),
    "a beacon drifts": _drift,
    "no odometry for 5 s": _no_odometry,
    "odometry times 1.15": _fast_odometry,
    AWAY: _none,  # the robot itself, not its readings
    "noise times 3": _noisy,
    "every reading twice": _doubled,
    "ranges 0.5 s late": _late,
}


def driven(rng: np.random.Generator, *, carried: bool = False) -> BeaconDrive:
    """Drive from place to place, without a fault but for a robot that is ``carried`` away at ONSET."""
    mission, x = _mission(None), np.array([*rng.uniform(-AREA, AREA, 2), rng.uniform(-math.pi, math.pi)])
    place, fine, commands, n = rng.uniform(-AREA, AREA, 2), [x], [], round(DURATION / PERIOD)
    for k in range(n):
        if carried and k == round(ONSET / PERIOD):
            angle = rng.uniform(-math.pi, math.pi)
            x = x + np.array([CARRIED * math.cos(angle), CARRIED * math.sin(angle), 0.0])
        while math.dist(place, x[:2]) < 2.0:
            place = rng.uniform(-AREA, AREA, 2)
        turn = math.remainder(math.atan2(place[1] - x[1], place[0] - x[0]) - x[2], 2.0 * math.pi)
        u = np.array([SPEED * max(0.3, math.cos(turn)), min(max(turn, -TURN), TURN)])
        commands.append(u)
        for _ in range(FINE):
            x = mission.flow(x, u, PERIOD / FINE)
            fine.append(x)
    truth, scale, bias = np.array(fine)[FINE::FINE], SCALE * rng.standard_normal(), SCALE * rng.standard_normal(2)
    noise = NOISE * rng.standard_normal((n, len(PLACES)))
    ranges = (1.0 + scale) * np.array([exact_readings(PLACES, 0, pose) for pose in truth]) + noise
    turns = np.arange(n)
    read = (turns % EVERY == 0)[:, None] & ((turns // EVERY % len(PLACES))[:, None] == np.arange(len(PLACES)))
    ranges[~read] = np.nan
    odometry = (1.0 + bias) * np.array(commands) + ODOMETRY * rng.standard_normal((n, 2))
    return BeaconDrive(truth, np.array(fine), ranges, noise, odometry, np.array(commands), float(scale))


def _mission(start: KnownStart | None) -> BeaconMission:
    return BeaconMission(
        tuple((x, y) for x, y in PLACES.tolist()), ranges=BeaconQuality(NOISE), range_scale=SCALE,
        odometry=OdometryQuality(ODOMETRY, SCALE), start=start, interval=EVERY * PERIOD, speed_max=2.0 * SPEED,
        turn_rate_max=2.0 * TURN, period=PERIOD,
    )  # fmt: skip


def _updates(drive: BeaconDrive) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    for k, (rho, u, command) in enumerate(zip(drive.ranges, drive.odometry, drive.commands, strict=True)):
        t = PERIOD * (k + 1)
        yield t, (Measurement(RANGES, t, rho), Measurement("odometry", t, u)), command


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the estimator under a fault; the seed determines drive and fault."""
    rng = np.random.default_rng(run.seed)
    drive = driven(rng, carried=run.fault == AWAY)
    begins, told = drive.fine[0], drive.fine[0] + UNSURE * rng.standard_normal(3)
    during, noise = slice(round(ONSET / PERIOD), round(END / PERIOD)), drive.noise
    quiet = dataclasses.replace(
        drive, ranges=(drive.ranges - noise) / (1.0 + drive.scale), noise=np.zeros_like(noise),
        odometry=drive.commands.copy(), scale=0.0,
    )  # fmt: skip
    FAULTS[run.fault](quiet, during, copy.deepcopy(rng))
    FAULTS[run.fault](drive, during, rng)
    plugin = load("estimators", run.estimator)
    estimator = plugin.build(plugin.Config(), _mission(_known(told)))
    estimates = [(estimator if run.monitored else alone(estimator)).update(*update) for update in _updates(drive)]
    spread = 9.0 if run.fault == "noise times 3" else 1.0
    found = findable(_mission(_known(begins)), quiet, during, spread)
    return judged(estimates, drive.truth, found, TIMING, persists=run.fault == AWAY)


def _known(pose: Array) -> KnownStart:
    return KnownStart((float(pose[0]), float(pose[1]), float(pose[2])), UNSURE)


def findable(mission: BeaconMission, drive: BeaconDrive, during: slice, spread: float) -> Flags:
    """True (n,) from the update on at which the fault of a drive without noise can be found; as within a wall, by the
    tests of single beacons, of all together, and of separations.

    ``spread`` is the variance of the noise ``during`` the fault, over the declared one.
    """
    estimator = BeaconFilter(BeaconBankConfig(), mission)
    known, n = RobotBeaconWitness(estimator.model).windows.thresholds, len(drive.truth)
    e, separation = np.full((n, len(PLACES)), np.nan), np.zeros(n)
    for k, update in enumerate(_updates(drive)):
        extra = estimator.update(*update).extra
        e[k] = extra["innovations"] / extra["innovation_std"]
        separation[k] = extra["separation"].max()
    rho = np.ones(n)
    rho[during] = spread if spread > LARGER else 1.0
    chance = np.maximum(1.0 - chndtr(WRONG, 3, separation), by_windows(e, rho, known))
    return from_onset(chance, during.start)
