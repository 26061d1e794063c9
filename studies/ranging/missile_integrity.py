"""The part of the study of integrity with readings of a whole state: a missile in space under gusts.

It flies ahead, swings to all sides and turns its nose about, which its thrusters can each by itself. Position,
velocity, attitude and rates are all read, and each is judged by itself. There is no protection level.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.missile_kalman import MissileKalman, MissileKalmanConfig
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.missile.coordinates import SPATIAL
from mathnavi.models.missile.dynamics import NOMINAL
from mathnavi.models.missile.mission import CASES, GustStrength, MissileMission, StateNoise, Target
from mathnavi.studies.ranging.integrity_detection import by_windows, from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

ESTIMATOR = "missile_kalman, whole state"
PERIOD = 0.02  # [s] of estimator and readings
DURATION, ONSET, END = 90.0, 10.0, 50.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 5.0)
NOISE = StateNoise(position=1.0, velocity=0.5, angle=0.01, rate=0.01)
GUSTS = GustStrength(force=200.0, moment=10.0)
SPEED, PUSH = 120.0, 3.0  # [m/s] ahead; [1/s] of the feedback
SWING, RATES = np.array([20.0, 40.0, 40.0, 0.15, 0.15]), np.array([0.2, 0.3, 0.25, 0.5, 0.4])  # [m, rad], [rad/s]
VELOCITY, RATE, ATTITUDE, POSITION = slice(0, 3), slice(3, 5), slice(5, 7), slice(7, 10)
BLOCKS = (POSITION, VELOCITY, ATTITUDE, RATE)
"""blocks of a state: position, velocity, attitude and rates"""
LATE, SHORT, LONG, THRUST, LARGER = 0.1, 0.4, 2.0, 0.8, 3.0  # [s], [s], [s]; thrust over the commanded one, gusts
GUSTY, NOISY, WEAK = "gusts times 3", "noise times 3", "thrust 20 % less"
SETTING = (
    f"Nor is there one by readings of the whole state: a missile of {SPEED:g} m/s that swings and turns for "
    f"{DURATION:g} s reads its position, velocity, attitude and rates {1.0 / PERIOD:g} times a second, with deviations "
    f"of {NOISE.position:g} m, {NOISE.velocity:g} m/s, {NOISE.angle:g} rad and {NOISE.rate:g} rad/s on each axis, "
    f"under gusts of {GUSTS.force:g} N and {GUSTS.moment:g} N m, the fault from {ONSET:g} to {END:g} s."
)


@dataclass(frozen=True, eq=False)
class StateFlight:
    """A flight of n updates, whose readings have no fault."""

    truth: Array  # (n, 10) [m/s, rad/s, rad, m]
    readings: Array  # (n, 10); NaN where nothing is read
    noise: Array  # (n, 10) in them
    commands: Array  # (n, 5) [N, N m] held since the update before

    @property
    def quiet(self) -> StateFlight:
        """This flight, read without noise."""
        return dataclasses.replace(self, readings=self.readings - self.noise, noise=np.zeros_like(self.noise))


Fault = Callable[[StateFlight, slice, np.random.Generator], None]
"""change of the readings of a flight, in place, in the updates of a slice"""


def _none(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
    pass


def _direction(block: slice, rng: np.random.Generator) -> Array:
    direction = rng.standard_normal(block.stop - block.start)
    return np.asarray(direction / np.linalg.norm(direction), np.float64)


def _off(block: slice, size: float) -> Fault:
    def fault(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
        flight.readings[during, block] += size * _direction(block, rng)

    return fault


def _stuck(block: slice) -> Fault:
    def fault(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
        flight.readings[during, block] = flight.readings[during.start, block]

    return fault


def _drift(block: slice, slowest: float, fastest: float) -> Fault:
    def fault(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
        grown = rng.uniform(slowest, fastest) * PERIOD * np.arange(during.stop - during.start)
        flight.readings[during, block] += grown[:, None] * _direction(block, rng)

    return fault


def _scaled(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
    flight.readings[during, VELOCITY] *= 1.1


def _noisy(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
    flight.readings[during] += 2.0 * flight.noise[during]


def _doubled(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
    """Every second reading is the one before, with a later time stamp."""
    own = flight.readings[during]
    count = len(own) // 2
    own[1::2][:count] = own[: 2 * count : 2]


def _late(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
    """Readings of ``LATE`` ago with the stamp of now."""
    ago = round(LATE / PERIOD)
    flight.readings[during] = flight.truth[during.start - ago : during.stop - ago] + flight.noise[during]


def _silent(seconds: float) -> Fault:
    def fault(flight: StateFlight, during: slice, rng: np.random.Generator) -> None:
        flight.readings[during.start : during.start + round(seconds / PERIOD)] = np.nan

    return fault


FAULTS: dict[str, Fault] = {
    "none": _none,
    "position 10 m off": _off(POSITION, 10.0),
    "position 3 m off": _off(POSITION, 3.0),
    "velocity 5 m/s off": _off(VELOCITY, 5.0),
    "attitude 0.1 rad off": _off(ATTITUDE, 0.1),
    "rates 0.1 rad/s off": _off(RATE, 0.1),
    "position stuck": _stuck(POSITION),
    "velocity stuck": _stuck(VELOCITY),
    "attitude stuck": _stuck(ATTITUDE),
    "rates stuck": _stuck(RATE),
    "all stuck": _stuck(slice(0, 10)),
    "position drifts": _drift(POSITION, 0.2, 1.0),
    "attitude drifts": _drift(ATTITUDE, 0.002, 0.01),
    "velocity times 1.1": _scaled,
    NOISY: _noisy,
    "every reading twice": _doubled,
    "readings 0.1 s late": _late,
    "silent for 0.4 s": _silent(SHORT),
    "silent for 2 s": _silent(LONG),
    GUSTY: _none,  # the air, not the readings
    WEAK: _none,  # the thrusters
}


def flown(rng: np.random.Generator, mission: MissileMission, fault: str) -> StateFlight:
    """A flight whose readings have no fault: it is the air or the thrusters that have one from ONSET to END."""
    coordinates, n = mission.coordinates, round(DURATION / PERIOD)
    keep = math.exp(-PERIOD / GUSTS.time_constant)
    phases, strength = rng.uniform(0.0, 2.0 * math.pi, 5), np.repeat([GUSTS.force, GUSTS.moment], (3, 2))
    white = strength * math.sqrt(1.0 - keep**2) * rng.standard_normal((n, 5))
    noise = NOISE.deviations(coordinates) * rng.standard_normal((n, 10))
    x, gust, u = mission.start_state, np.zeros(5), np.zeros(5)
    begin = coordinates.to_joints(x)[:5]
    truth, commands = np.empty((n, 10)), np.empty((n, 5))
    for k in range(n):
        t = k * PERIOD
        faulty = ONSET <= t < END
        truth[k], commands[k] = x, u
        joints, angle = coordinates.to_joints(x), RATES * t + phases
        place = begin + SWING * (np.sin(angle) - np.sin(phases)) + np.array([SPEED * t, 0.0, 0.0, 0.0, 0.0])
        moves = SWING * RATES * np.cos(angle) + np.array([SPEED, 0.0, 0.0, 0.0, 0.0])
        wanted = PUSH**2 * (place - joints[:5]) + 2.0 * PUSH * (moves - joints[5:]) - RATES**2 * SWING * np.sin(angle)
        u = coordinates.inverse_dynamics(x, wanted, mission.body)
        acting = u * np.repeat([THRUST if faulty and fault == WEAK else 1.0, 1.0], (3, 2))
        acting[:3] += _turned(x, LARGER * gust[:3] if faulty and fault == GUSTY else gust[:3])
        acting[3:] += LARGER * gust[3:] if faulty and fault == GUSTY else gust[3:]
        x = coordinates.flow(x, acting, PERIOD, mission.body)
        gust = keep * gust + white[k]
    return StateFlight(truth, truth + noise, noise, commands)


def _turned(x: Array, force: Array) -> Array:
    """R' f (3,) along the axes of the body of a force f (3,) of the Earth frame."""
    (s, c), (sin, cos) = ((math.sin(angle), math.cos(angle)) for angle in x[ATTITUDE].tolist())
    pitch = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    yaw = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray((pitch @ yaw).T @ force, np.float64)


def _mission() -> MissileMission:
    start = np.zeros(10)
    start[0], start[9] = SPEED, -1000.0
    return MissileMission(
        tuple(start.tolist()), Target((SPEED * DURATION, 0.0, 0.0)), CASES["SM"], SPATIAL, body=NOMINAL, noise=NOISE,
        gust=GUSTS, control_period=PERIOD,
    )  # fmt: skip


def _updates(flight: StateFlight) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    for k, (y, command) in enumerate(zip(flight.readings, flight.commands, strict=True)):
        t = PERIOD * k
        yield t, (Measurement("full_state", t, y),) if np.isfinite(y).all() else (), command


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the estimator under a fault; the seed determines flight and fault."""
    rng, mission = np.random.default_rng(run.seed), _mission()
    without = flown(copy.deepcopy(rng), mission, "none").quiet
    flight = flown(rng, mission, run.fault)
    during, faulty = slice(round(ONSET / PERIOD), round(END / PERIOD)), copy.deepcopy(flight.quiet)
    FAULTS[run.fault](faulty, during, copy.deepcopy(rng))
    FAULTS[run.fault](flight, during, rng)
    estimator = MissileKalman(MissileKalmanConfig(), mission, monitored=run.monitored)
    estimates = [estimator.update(*update) for update in _updates(flight)]
    return judged(estimates, flight.truth, findable(mission, faulty, without, during, run.fault), TIMING, blocks=BLOCKS)


def findable(mission: MissileMission, faulty: StateFlight, without: StateFlight, during: slice, fault: str) -> Flags:
    """True (n,) from the update on at which a fault can be found, of a flight without noise, by what it makes of the
    innovations of the flight ``without`` it; as of the other flights.
    """
    e = _innovations(mission, faulty, during.stop) - _innovations(mission, without, during.stop)
    rho, chance = np.ones(len(e)), np.zeros(len(faulty.truth))
    rho[during] = LARGER**2 if fault == NOISY else 1.0  # the noise is nearly all of the variance of an innovation
    read = np.flatnonzero(np.isfinite(e[:, 0]))
    chance[read] = by_windows(e[read], rho[read], InnovationMonitor("readings", 10, PERIOD).thresholds)
    return from_onset(chance, during.start)


def _innovations(mission: MissileMission, flight: StateFlight, updates: int) -> Array:
    """Innovations (n, 10) of the readings of the first ``updates``, each over its deviation, of the filter without a
    monitor.
    """
    estimator = MissileKalman(MissileKalmanConfig(), mission, monitored=False)
    extras = [estimator.update(*update).extra for update in islice(_updates(flight), updates)]
    return np.array([extra["innovations"] / extra["innovation_std"] for extra in extras])
