"""The part of the study of integrity within a wall: a robot by three rays and its odometry.

It drives between places that are drawn within a wall through five corners, 50 readings a second, and from ``ONSET`` to
``END`` a sensor is at fault. The wall may be wider than its map, too. The observer of Paper C, which bounds the
curvature of a wall, drives within an egg.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.integrity.guard import alone
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.field.curve import EGG, Curve
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.ranging.integrity_detection import findable
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

WALL = Curve(
    (
        (2.206, 0.0, 1.301, 0.0),
        (-1.931, 1.153, -0.913, -1.451),
        (-0.028, -0.028, -0.053, 0.104),
        (-0.039, 0.003, -0.149, 0.064),
        (0.004, -0.047, -0.081, -0.049),
        (-0.081, 0.018, 0.01, 0.042),
        (-0.028, -0.029, 0.005, -0.005),
        (-0.007, 0.032, -0.037, -0.012),
        (-0.011, -0.001, -0.007, -0.008),
    )
)
"""through (0, 0), (4, -0.2), (4.6, 2), (2.4, 3.2) and (0.2, 2.4) [m], but for its harmonics beyond the eighth"""
FARTHER_OUT = 0.1  # [m] by which a wall is farther out than on the map
GREATEST = 8.0  # [m] a reading without an echo
ANGLES = np.array([0.0, 0.5 * math.pi, -1.75])  # [rad] of the rays
PERIOD, FINE = 0.02, 0.01  # [s] of the readings and of the truth
DURATION, ONSET, END = 30.0, 8.0, 18.0  # [s] of a run, and of its fault
SETTLED = 3.0  # [s] until which a filter may be wrong by the start that it was told
NOISE, ODOMETRY, UNSURE = 0.02, (0.02, 0.02), 0.05  # [m], [m/s, rad/s]; [m, rad] deviation of a start that is known
SPEED, TURN, MARGIN = 0.25, 1.0, 0.5  # [m/s], [rad/s] at most; [m] between the places to drive to and the wall
CARRIED = 2.0  # [m]
FINDING = ("feasible_set_bank", "range_certified")  # estimators that are not told the start
ESTIMATORS = (
    "range_ekf", "feasible_set_bank", "range_ukf", "range_iekf", "range_certified", "moving_horizon", "range_particle",
    "range_observer",
)  # fmt: skip
OF_ITS_OWN = ("range_observer",)
"""estimators whose monitor is a part of them"""
SETTING = (
    f"of {DURATION:g} s each, the fault from {ONSET:g} to {END:g} s (the robot is carried away at {ONSET:g} s for "
    f"good); three rays, deviations {NOISE:g} m of a range and {ODOMETRY[0]:g} of the odometry, {1.0 / PERIOD:g} "
    f"readings a second. {' and '.join(FINDING)} are not told the start; {' and '.join(OF_ITS_OWN)} is within an egg. "
    "Ray and drift are drawn."
)


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive that its sensors read without a fault: n updates, of l rays."""

    wall: Curve
    truth: Array  # (n, 3) [m, m, rad] at the updates
    fine: Array  # (m, 3) every ``FINE`` seconds from 0 s on
    ranges: Array  # (n, l) [m]
    noise: Array  # (n, l) [m] in them
    odometry: Array  # (n, 2) [m/s, rad/s]
    commands: Array  # (n, 2)


Fault = Callable[[Drive, slice, np.random.Generator], None]
"""change of the readings of a drive, in place, in the updates of a slice"""


def _ray(rng: np.random.Generator) -> int:
    return int(rng.integers(len(ANGLES)))


def _none(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    pass


def _blocked(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    ray = _ray(rng)
    drive.ranges[during, ray] = 0.3 + drive.noise[during, ray]


def _stuck(drive: Drive, during: slice, rng: np.random.Generator, count: int = 1) -> None:
    for ray in rng.permutation(len(ANGLES))[:count]:
        drive.ranges[during, ray] = drive.ranges[during.start, ray]


def _two_stuck(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    _stuck(drive, during, rng, 2)


def _scaled(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during, _ray(rng)] *= 1.1


def _slightly_scaled(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during, _ray(rng)] *= 1.02


def _offset(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during, _ray(rng)] += 0.1


def _no_odometry(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.odometry[during.start : during.start + round(3.0 / PERIOD)] = np.nan


def _fast_odometry(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.odometry[during] *= 1.1


def _noisy(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during] += 2.0 * drive.noise[during]


def _drift(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    speed = rng.choice((-1.0, 1.0)) * rng.uniform(0.01, 0.05)  # [m/s]
    drive.ranges[during, _ray(rng)] += speed * PERIOD * np.arange(during.stop - during.start)


def _doubled(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    """Every second reading is the one before, with a new time stamp."""
    drive.ranges[during.start + 1 : during.stop : 2] = drive.ranges[during.start : during.stop - 1 : 2]


def _late(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    """Ranges of 50 ms ago with the stamp of now."""
    for k in range(during.start, during.stop):
        ago = drive.fine[round((PERIOD * (k + 1) - 0.05) / FINE)]
        drive.ranges[k] = drive.wall.ranges(ago, ANGLES)[0] + drive.noise[k]


def _wider(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    """The wall is 0.1 m farther out on either side than on the map."""
    wider = _wider_than(drive.wall)
    for k in range(during.start, during.stop):
        drive.ranges[k] = wider.ranges(drive.truth[k], ANGLES)[0] + drive.noise[k]


def _without_echo(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    """Three readings in ten are the greatest that the sensor has."""
    lost = rng.random(drive.ranges[during].shape) < 0.3
    drive.ranges[during][lost] = GREATEST


FAULTS: dict[str, Fault] = {
    "none": _none,
    "a ray reads 0.3 m": _blocked,
    "a ray stuck": _stuck,
    "two rays stuck": _two_stuck,
    "a ray times 1.1": _scaled,
    "a ray times 1.02": _slightly_scaled,
    "a ray 0.1 m too long": _offset,
    "no odometry for 3 s": _no_odometry,
    "odometry times 1.1": _fast_odometry,
    "carried away 2 m": _none,  # the robot itself, not its readings
    "noise times 3": _noisy,
    "a ray drifts": _drift,
    "every reading twice": _doubled,
    "ranges 50 ms late": _late,
    "wall 0.1 m wider": _wider,
    "readings of 8 m": _without_echo,
}
AWAY = "carried away 2 m"


def watched(run: Watched) -> Outcome:
    """A job: what becomes of an estimator under a fault; the seed determines drive and fault."""
    rng = np.random.default_rng(run.seed)
    drive = driven(rng, within(run.estimator), carried=run.fault == AWAY)
    first = drive.fine[0] + UNSURE * rng.standard_normal(3)
    during, noise = slice(round(ONSET / PERIOD), round(END / PERIOD)), drive.noise
    quiet = dataclasses.replace(
        drive, ranges=drive.ranges - noise, noise=np.zeros_like(noise), odometry=drive.commands.copy()
    )
    FAULTS[run.fault](quiet, during, copy.deepcopy(rng))
    FAULTS[run.fault](drive, during, rng)
    start = None if run.estimator in FINDING else KnownStart((first[0], first[1], first[2]), (UNSURE, UNSURE, UNSURE))
    plugin = load("estimators", run.estimator)
    estimator = plugin.build(plugin.Config(), _mission(start, drive.wall))
    estimator = estimator if run.monitored else alone(estimator)
    estimates = [estimator.update(*update) for update in _updates(drive)]
    spread = np.var((drive.ranges - quiet.ranges)[during], axis=0) / np.var(noise[during], axis=0)
    begins = KnownStart((drive.fine[0][0], drive.fine[0][1], drive.fine[0][2]), (UNSURE, UNSURE, UNSURE))
    found = findable(_mission(begins, drive.wall), list(_updates(quiet)), during, spread)
    return judged(estimates, drive.truth, found, Timing(PERIOD, ONSET, END, SETTLED), persists=run.fault == AWAY)


def within(estimator: str) -> Curve:
    """The wall within which the robot of an estimator drives."""
    return EGG if estimator in OF_ITS_OWN else WALL


def _wider_than(wall: Curve) -> Curve:
    """The wall that is ``FARTHER_OUT`` farther out on either side."""
    centre, (a, b, c, d), *rest = wall.coefficients
    farther = math.copysign(FARTHER_OUT, a)
    return Curve((centre, (a + farther, b, c, d), *rest))


def _mission(start: KnownStart | None, wall: Curve = WALL) -> RangingMission:
    quality, odometry = RangeQuality(absolute=NOISE), OdometryQuality(noise=ODOMETRY)
    return RangingMission(wall, tuple(ANGLES.tolist()), quality, odometry, start=start, period=PERIOD)


def _updates(drive: Drive) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    for k, (rho, u, command) in enumerate(zip(drive.ranges, drive.odometry, drive.commands, strict=True)):
        t = PERIOD * (k + 1)
        yield t, (Measurement("ranges", t, rho), Measurement("odometry", t, u)), command


def driven(rng: np.random.Generator, wall: Curve = WALL, *, carried: bool = False) -> Drive:
    """Drive from place to place within a wall, without a fault but for a robot that is ``carried`` away at ONSET."""
    mission, x = _mission(None, wall), np.array([*_place(rng, wall), rng.uniform(-math.pi, math.pi)])
    place, fine, commands = _place(rng, wall), [x], []
    ratio, u = round(PERIOD / FINE), np.zeros(2)
    for k in range(round(DURATION / FINE)):
        if carried and k == round(ONSET / FINE):
            x = _carried(x, rng, wall)
        if k % ratio == 0:
            while math.dist(place, x[:2]) < 0.3:
                place = _place(rng, wall)
            turn = math.remainder(math.atan2(place[1] - x[1], place[0] - x[0]) - x[2], 2.0 * math.pi)
            u = np.array([SPEED * max(0.2, math.cos(turn)), min(max(2.0 * turn, -TURN), TURN)])
            commands.append(u)
        x = mission.flow(x, u, FINE)
        fine.append(x)
    truth = np.array(fine)[ratio::ratio]
    noise = NOISE * rng.standard_normal((len(truth), len(ANGLES)))
    ranges = np.array([wall.ranges(pose, ANGLES)[0] for pose in truth]) + noise
    odometry = np.array(commands) + ODOMETRY * rng.standard_normal((len(truth), 2))
    return Drive(wall, truth, np.array(fine), ranges, noise, odometry, np.array(commands))


def _place(rng: np.random.Generator, wall: Curve) -> tuple[float, float]:
    """Draw a point [m] that is well within the wall."""
    low, high = wall.polyline.min(axis=0), wall.polyline.max(axis=0)
    while not wall.contains(point := rng.uniform(low, high), MARGIN):
        pass
    return float(point[0]), float(point[1])


def _carried(x: Array, rng: np.random.Generator, wall: Curve) -> Array:
    """Draw the pose (3,) of a robot that is carried 2 m away, or as far as the wall lets it."""
    for distance in np.arange(CARRIED, 0.0, -0.1):
        for angle in rng.uniform(-math.pi, math.pi, 100):
            to = x[:2] + distance * np.array([math.cos(angle), math.sin(angle)])
            if wall.contains(to, MARGIN):
                return np.array([*to, x[2]])
    raise AssertionError("no place within the wall")
