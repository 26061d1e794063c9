"""The part of the study of integrity in flight: a point mass under gusts, by fixes of its position or among beacons.

It swings about a place, a kilometre to each side, over a plain. Six beacons stand at different heights. By fixes alone
an estimator has no protection level: while a fault of theirs cannot be found nothing else tells the position.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from mathnavi.estimators.beacons.flight import FlightBeaconFilter
from mathnavi.estimators.beacons.flight_witness import BeaconWitness
from mathnavi.estimators.flight_model import AxisModel, KalmanConfig
from mathnavi.estimators.integrity.guard import alone
from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.aerial.beacons import FlightBeacons, slant_ranges
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.beacon_names import RANGES
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.ranging.integrity_detection import by_windows, from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

ESTIMATORS = ("kalman, fixes", "moving_horizon, fixes", "kalman, beacons")
PLACES = (
    (0.0, 0.0, 50.0), (6000.0, 0.0, 900.0), (0.0, 6000.0, 300.0), (6000.0, 6000.0, 10.0), (3000.0, 3000.0, 1200.0),
    (3000.0, 500.0, 0.0),
)  # fmt: skip
"""[m]"""
PERIOD, EVERY = 1.0 / 30.0, 3  # [s] of the estimators, and periods between readings
DURATION, ONSET, END = 90.0, 25.0, 50.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 5.0)
RANGE_NOISE, FIX_NOISE, GUSTS = 1.0, 2.0, DeclaredGusts(1.0)  # [m], [m], [m/s^2]
SWING, RATES = np.array([900.0, 900.0, 120.0]), np.array([0.05, 0.04, 0.08])  # [m], [rad/s]
BLOCKS = (slice(0, 3), slice(3, 6))
"""blocks of a state: position and velocity"""
MOVED, LATE = 50.0, 0.5  # [m], [s]
AWAY, GUSTY, NOISY = "moved 50 m", "gusts times 3", "noise times 3"
INSEPARABLE = ESTIMATORS[:2]
"""estimators whose monitor is a part of them"""
SETTING = (
    f"Flights of {DURATION:g} s under gusts of {GUSTS.rms:g} m/s^2 read fixes of {FIX_NOISE:g} m, or ranges of "
    f"{RANGE_NOISE:g} m to {len(PLACES)} beacons, ten times a second, the fault from {ONSET:g} to {END:g} s; by fixes "
    "alone there is no protection level."
)


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight of n updates, with readings of m numbers without a fault; NaN in the updates without."""

    truth: Array  # (n, 6) [m, m/s]
    readings: Array  # (n, m) [m]
    noise: Array  # (n, m) [m] in them
    commands: Array  # (n, 3) [m/s^2] held since the update before

    @property
    def among_beacons(self) -> bool:
        """Whether ranges are read, and no fixes."""
        return len(self.readings[0]) == len(PLACES)


Fault = Callable[[Flight, slice, np.random.Generator], None]
"""change of the readings of a flight, in place, in the updates of a slice"""


def _none(flight: Flight, during: slice, rng: np.random.Generator) -> None:
    pass


def _off(flight: Flight, rng: np.random.Generator) -> Array:
    """The numbers (m,) that are off, by one in length: of a beacon, or of a fix in any direction."""
    m = flight.readings.shape[1]
    if flight.among_beacons:
        one: Array = np.eye(m)[int(rng.integers(m))]
        return one
    direction = rng.standard_normal(m)
    return np.asarray(direction / np.linalg.norm(direction), np.float64)


def _offset(metres: float) -> Fault:
    def fault(flight: Flight, during: slice, rng: np.random.Generator) -> None:
        flight.readings[during] += metres * _off(flight, rng)

    return fault


def _stuck(count: int) -> Fault:
    """``count`` beacons, or all numbers of a fix."""

    def fault(flight: Flight, during: slice, rng: np.random.Generator) -> None:
        m = flight.readings.shape[1]
        for i in rng.permutation(m)[:count] if flight.among_beacons else range(m):
            own = flight.readings[during, i]
            read = np.isfinite(own)
            own[read] = own[read][0]

    return fault


def _scaled(flight: Flight, during: slice, rng: np.random.Generator) -> None:
    flight.readings[during] *= 1.0 + 0.01 * _off(flight, rng)


def _drift(flight: Flight, during: slice, rng: np.random.Generator) -> None:
    speed = rng.choice((-1.0, 1.0)) * rng.uniform(0.2, 1.0)  # [m/s]
    grown = speed * PERIOD * np.arange(during.stop - during.start)
    flight.readings[during] += grown[:, None] * _off(flight, rng)


def _noisy(flight: Flight, during: slice, rng: np.random.Generator) -> None:
    flight.readings[during] += 2.0 * flight.noise[during]


def _doubled(flight: Flight, during: slice, rng: np.random.Generator) -> None:
    """Every second reading is the one before, with a later time stamp."""
    own = flight.readings[during]
    read = np.flatnonzero(np.isfinite(own[:, 0]))
    count = len(read) // 2
    own[read[1::2]] = own[read[: 2 * count : 2]]


def _late(flight: Flight, during: slice, rng: np.random.Generator) -> None:
    """Readings of ``LATE`` ago with the stamp of now."""
    ago = round(LATE / PERIOD)
    late = _exact(flight.truth[during.start - ago : during.stop - ago], flight.among_beacons)
    read = np.isfinite(flight.readings[during])
    flight.readings[during] = np.where(read, late + flight.noise[during], np.nan)


OF_BOTH: dict[str, Fault] = {
    "none": _none,
    AWAY: _none,  # the vehicle itself, not its readings
    GUSTY: _none,
    NOISY: _noisy,
    "every reading twice": _doubled,
    "readings 0.5 s late": _late,
}
FAULTS: dict[str, dict[str, Fault]] = {
    "fixes": OF_BOTH | {"fixes 10 m off": _offset(10.0), "fixes stuck": _stuck(3), "fixes drift": _drift},
    "beacons": OF_BOTH
    | {
        "a beacon 4 m too long": _offset(4.0),
        "a beacon 20 m too short": _offset(-20.0),
        "a beacon times 1.01": _scaled,
        "a beacon stuck": _stuck(1),
        "two beacons stuck": _stuck(2),
        "a beacon drifts": _drift,
    },
}


def faults_of(estimator: str) -> dict[str, Fault]:
    """Faults of the readings of an estimator."""
    return FAULTS[estimator.split(", ")[1]]


def _exact(truth: Array, among_beacons: bool) -> Array:
    """Readings (n, m) without noise at states (n, 6)."""
    if not among_beacons:
        return truth[:, :3].copy()
    places = np.array(PLACES)
    return np.array([slant_ranges(places, x[:3])[0] for x in truth])


def flown(rng: np.random.Generator, mission: FlightMission, fault: str) -> Flight:
    """A flight whose readings have no fault: it is ``fault`` that is moved at ONSET, or has larger gusts until END."""
    n, keep = round(DURATION / PERIOD), math.exp(-PERIOD / GUSTS.time_constant)
    phases, x, g, u = rng.uniform(0.0, 2.0 * math.pi, 3), mission.start_state, np.zeros(3), np.zeros(3)
    truth, commands = np.empty((n, 6)), np.empty((n, 3))
    for k in range(n):
        t = k * PERIOD
        if fault == AWAY and k == round(ONSET / PERIOD):
            away = rng.standard_normal(3)
            x = x + np.append(MOVED * away / np.linalg.norm(away), np.zeros(3))
        truth[k], commands[k] = x, u
        aim = mission.start + SWING * (np.sin(RATES * t + phases) - np.sin(phases))
        u = np.clip(0.3 * (aim - x[:3]) - x[3:], -20.0, 20.0)
        larger = 3.0 if fault == GUSTY and ONSET <= t < END else 1.0
        limit = min(1.0, GUSTS.limit / max(float(np.linalg.norm(g)), 1e-9))
        x = flow(x, u + larger * limit * g, PERIOD)
        g = keep * g + GUSTS.rms * math.sqrt(1.0 - keep**2) * rng.standard_normal(3)
    std = RANGE_NOISE if mission.beacons is not None else FIX_NOISE
    exact = _exact(truth, mission.beacons is not None)
    noise = std * rng.standard_normal(exact.shape)
    readings = exact + noise
    readings[np.arange(n) % EVERY > 0] = np.nan
    return Flight(truth, readings, noise, commands)


def _mission(rng: np.random.Generator, *, among_beacons: bool) -> FlightMission:
    x, y = rng.uniform(1500.0, 4500.0, 2).tolist()
    beacons = FlightBeacons(PLACES, noise=RANGE_NOISE) if among_beacons else None
    return FlightMission(
        HeightField(np.zeros((3, 3)), 3000.0), (x, y, 400.0 + 50.0 * float(rng.uniform(-1.0, 1.0))),
        (5000.0, 5000.0, 500.0), gust=GUSTS, beacons=beacons, position_noise=FIX_NOISE, control_period=PERIOD,
    )  # fmt: skip


def _updates(flight: Flight) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    name = RANGES if flight.among_beacons else "position"
    for k, (y, command) in enumerate(zip(flight.readings, flight.commands, strict=True)):
        t = PERIOD * k
        yield t, (Measurement(name, t, y),) if np.isfinite(y).any() else (), command


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the estimator under a fault; the seed determines flight and fault."""
    rng, name = np.random.default_rng(run.seed), run.estimator.split(", ")[0]
    mission = _mission(rng, among_beacons=run.estimator.endswith("beacons"))
    flight = flown(rng, mission, run.fault)
    during = slice(round(ONSET / PERIOD), round(END / PERIOD))
    quiet = dataclasses.replace(flight, readings=flight.readings - flight.noise, noise=np.zeros_like(flight.noise))
    faulty, fault = copy.deepcopy(quiet), faults_of(run.estimator)[run.fault]
    fault(faulty, during, copy.deepcopy(rng))
    fault(flight, during, rng)
    plugin = load("estimators", name)
    estimator: Estimator = plugin.build(plugin.Config(), mission)
    estimates = [(estimator if run.monitored else alone(estimator)).update(*update) for update in _updates(flight)]
    found = findable(mission, faulty, quiet, during, run.fault)
    return judged(estimates, flight.truth, found, TIMING, persists=run.fault == AWAY, blocks=BLOCKS)


def findable(mission: FlightMission, faulty: Flight, quiet: Flight, during: slice, fault: str) -> Flags:
    """True (n,) from the update on at which a fault can be found, of a flight without noise; as within a wall, by the
    tests of single numbers and of all together.

    What gusts as declared do to the innovations of the ``quiet`` flight, without the fault, is not part of its shift.
    """
    among = mission.beacons is not None
    innovations = _among_beacons if among else _by_fixes
    e, without, n = innovations(mission, faulty), innovations(mission, quiet), len(faulty.truth)
    if fault != AWAY:  # of the truth itself, which has no flight without it
        e = e - without
    rho = np.ones(n)
    rho[during] = {NOISY: 9.0, GUSTY: _larger(mission, 3.0)}.get(fault, 1.0)
    if among:
        assert mission.beacons is not None
        chance = by_windows(e, rho, BeaconWitness(mission.beacons, mission, KalmanConfig()).windows.thresholds)
    else:
        read = np.flatnonzero(np.isfinite(e[:, 0]))
        chance = np.zeros(n)
        chance[read] = by_windows(e[read], rho[read], InnovationMonitor("fixes", 3, EVERY * PERIOD).thresholds)
    return from_onset(chance, during.start)


def _among_beacons(mission: FlightMission, flight: Flight) -> Array:
    """Normalised innovations (n, m) of the filter of all ranges, without a monitor."""
    estimator = FlightBeaconFilter(KalmanConfig(), mission)
    extras = [estimator.update(*update).extra for update in _updates(flight)]
    return np.array([extra["innovations"] / extra["innovation_std"] for extra in extras])


def _by_fixes(mission: FlightMission, flight: Flight) -> Array:
    """Normalised innovations (n, 3) of a stationary Kalman filter of each axis, by its gain."""
    F, B, K, S = _stationary(mission)[:4]
    x, e = np.zeros((3, 3)), np.full((len(flight.truth), 3), np.nan)
    x[0] = mission.start
    for k, (_, read, command) in enumerate(_updates(flight)):
        x = F @ x + B * command if k else x
        for fix in read:
            e[k] = fix.value - x[0]
            x = x + K * e[k]
    return e / math.sqrt(S)


def _axis(mission: FlightMission) -> AxisModel:
    """Model of an axis, among beacons as if fixes were as exact as a range."""
    model = AxisModel.from_config(KalmanConfig(), mission)
    return model if mission.beacons is None else dataclasses.replace(model, fix_std=RANGE_NOISE)


def _stationary(mission: FlightMission) -> tuple[Array, Array, Array, float, Array]:
    """F, B over an update, gain K (3, 1) and variance S of a fix, and Q over a time between fixes, of an axis."""
    model, H = _axis(mission), np.array([[1.0, 0.0, 0.0]])
    F, B, _ = model.discretised(PERIOD)
    over, _, Q = model.discretised(EVERY * PERIOD)
    P = solve_discrete_are(over.T, H.T, Q, np.array([[model.fix_std**2]]))
    S = float(P[0, 0]) + model.fix_std**2
    return F, B, P[:, :1] / S, S, Q


def _larger(mission: FlightMission, times: float) -> float:
    """Variance of an innovation over the declared one, under gusts that are ``times`` as large as declared."""
    _, _, K, S, Q = _stationary(mission)
    model, H = _axis(mission), np.array([[1.0, 0.0, 0.0]])
    over = model.discretised(EVERY * PERIOD)[0]
    moved = over @ (np.eye(3) - K @ H)
    noise = over @ K @ K.T @ over.T * model.fix_std**2
    P = solve_discrete_lyapunov(moved, times**2 * Q + noise)
    return (float(P[0, 0]) + model.fix_std**2) / S
