"""The part of the study of integrity by encoders: an arm of two links whose joints' velocities are observed.

It swings in a vertical plane, under torques that every observer is given and gravity and damping as every observer
knows them. Positions and velocities are judged each by itself, by the covariance of an observer or, without one, by the
deviations that it declares. There is no protection level.

``filtered_differences`` has no model, and two observers take any torque that their model lacks for possible, which
explains nearly every smooth motion. A fault can be found by them where the readings of a joint are not as smooth as a
cubic through the four before, and where an encoder with noise repeats itself. By the others it can also be found in
the innovations of the model.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from mathnavi.estimators.integrity.repeats import STUCK
from mathnavi.estimators.integrity.windows import Flags, Thresholds
from mathnavi.estimators.velocity.error_state import ErrorStateFilter, FilterModel
from mathnavi.estimators.velocity.kalman import LagrangianEkfConfig, linearised
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.manifold.mission import POSITION, LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.ranging.integrity_detection import by_windows, from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

SURE_OF_MODEL = ("high_gain", "lagrangian_ekf", "lagrangian_ukf")
ESTIMATORS = ("riemannian_observer", "momentum_observer", "filtered_differences", *SURE_OF_MODEL)
PERIOD, SUBSTEPS = 0.005, 5  # [s] of readings and torques, and steps of the truth in it
DURATION, ONSET, END = 16.0, 5.0, 9.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 3.0)
QUALITY = PositionQuality(noise=5e-4, resolution=14)
DAMPING, SPEED_MAX = 0.2, 20.0  # [N m s/rad], [rad/s]
SWING, RATES = np.array([1.0, 1.2]), np.array([1.7, 2.6])  # [rad], [rad/s]
STIFFNESS, DAMPED = np.array([60.0, 20.0]), np.array([12.0, 4.0])  # [N m/rad], [N m s/rad] of the control
BLOCKS = (slice(0, 2), slice(2, 4))
"""blocks of a state: positions and velocities"""
SLIP, SMALL_SLIP, LATE, SILENT = 0.1, 0.01, 0.05, 2.0  # [rad], [rad], [s], [s]
WINDOWS = (0.02, 0.1, 0.4, 1.0)  # [s] of the tests
APART = 5  # residuals of cubics, of which one and the next have no reading in common
NOISY, OFF, STANDS, ONE_TURN = "noise times 3", "a motor off", "an encoder stuck", "an encoder of one turn"
SETTING = (
    f"An arm of two links swings for {DURATION:g} s, its torques known; encoders of {QUALITY.resolution} bits, with "
    f"noise of {QUALITY.noise:g} rad, are read {1.0 / PERIOD:g} times a second, the fault from {ONSET:g} to {END:g} s; "
    "position and velocity are judged, without a protection level."
)


@dataclass(frozen=True, eq=False)
class Swing:
    """A swing of n updates of two joints, whose encoders have no fault."""

    truth: Array  # (n, 4) [rad, rad/s]
    readings: Array  # (n, 2) [rad]; NaN where nothing is read
    noise: Array  # (n, 2) [rad] in them
    torques: Array  # (n, 2) [N m] asked for since the update before


Fault = Callable[[Swing, slice, int], None]
"""change of the readings of a joint, in place, in the updates of a slice"""


def _none(swing: Swing, during: slice, joint: int) -> None:
    pass


def _stuck(swing: Swing, during: slice, joint: int) -> None:
    swing.readings[during, joint] = swing.readings[during.start, joint]


def _slip(swing: Swing, during: slice, joint: int) -> None:
    swing.readings[during, joint] += SLIP


def _slip_a_little(swing: Swing, during: slice, joint: int) -> None:
    swing.readings[during, joint] += SMALL_SLIP


def _drift(swing: Swing, during: slice, joint: int) -> None:
    swing.readings[during, joint] += 0.1 * PERIOD * np.arange(during.stop - during.start)


def _scaled(swing: Swing, during: slice, joint: int) -> None:
    swing.readings[during, joint] *= 1.1


def _noisy(swing: Swing, during: slice, joint: int) -> None:
    swing.readings[during, joint] += 2.0 * swing.noise[during, joint]


def _doubled(swing: Swing, during: slice, joint: int) -> None:
    """Every second reading of both joints is the one before, with a later time stamp."""
    swing.readings[during][1::2] = swing.readings[during][::2]


def _late(swing: Swing, during: slice, joint: int) -> None:
    """Readings of ``LATE`` ago with the stamp of now."""
    ago = round(LATE / PERIOD)
    late = swing.truth[during.start - ago : during.stop - ago, :2]
    swing.readings[during] = late + swing.noise[during]


def _silent(swing: Swing, during: slice, joint: int) -> None:
    swing.readings[during.start : during.start + round(SILENT / PERIOD), joint] = np.nan


def _of_one_turn(swing: Swing, during: slice, joint: int) -> None:
    """An encoder that begins again in the middle of the swing, from the start on: it does so as a good one does."""
    own, middle = swing.readings[:, joint], float(np.mean(swing.truth[:, joint]))
    own[:] += 2.0 * math.pi * (float(own[0] > middle) - (own > middle))


FAULTS: dict[str, Fault] = {
    "none": _none,
    STANDS: _stuck,
    "an encoder 0.1 rad off": _slip,
    "an encoder 0.01 rad off": _slip_a_little,
    "an encoder drifts by 0.1 rad/s": _drift,
    "an encoder times 1.1": _scaled,
    NOISY: _noisy,
    "every reading twice": _doubled,
    "readings 50 ms late": _late,
    "an encoder silent for 2 s": _silent,
    ONE_TURN: _of_one_turn,
    OFF: _none,  # of the arm itself, not of its encoders
}


@cache
def _model() -> mujoco.MjModel:
    model = build_model("two-link")
    model.dof_damping[:] = DAMPING
    return model


def _mission() -> LagrangianMission:
    return LagrangianMission(MechanismSystem(_model()), QUALITY, PERIOD, SPEED_MAX)


def swung(rng: np.random.Generator, mission: LagrangianMission, fault: str, joint: int) -> Swing:
    """A swing whose encoders have no fault: it is ``fault`` that leaves a joint without its torque from ONSET to
    END.
    """
    n, model = round(DURATION / PERIOD), _model()
    data, phases = mujoco.MjData(model), rng.uniform(0.0, 2.0 * math.pi, 2)
    data.qpos[:], data.qvel[:] = SWING * np.sin(phases), SWING * RATES * np.cos(phases)
    truth, torques, u = np.empty((n, 4)), np.empty((n, 2)), np.zeros(2)
    for k in range(n):
        t = k * PERIOD
        truth[k], torques[k] = np.concatenate([data.qpos, data.qvel]), u
        angle = RATES * t + phases
        u = STIFFNESS * (SWING * np.sin(angle) - data.qpos) + DAMPED * (SWING * RATES * np.cos(angle) - data.qvel)
        data.ctrl[:] = u
        if fault == OFF and ONSET <= t < END:
            data.ctrl[joint] = 0.0
        mujoco.mj_step(model, data, SUBSTEPS)
    noise = QUALITY.noise * rng.standard_normal((n, 2))
    return Swing(truth, truth[:, :2] + noise, noise, torques)


def _updates(swing: Swing, resolution: int) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    """Times [s], readings of encoders of ``resolution`` bits, exact ones if 0, and torques."""
    step = 2.0 * math.pi / 2.0**resolution if resolution else 0.0
    for k, (y, torque) in enumerate(zip(swing.readings, swing.torques, strict=True)):
        t = PERIOD * k
        yield t, (Measurement(POSITION, t, step * np.round(y / step) if step else y),), torque


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the estimator under a fault; the seed determines swing and fault."""
    mission, during = _mission(), slice(round(ONSET / PERIOD), round(END / PERIOD))
    swing, joint = of_seed(run.seed, mission, run.fault)
    quiet = dataclasses.replace(swing, readings=swing.truth[:, :2].copy(), noise=np.zeros_like(swing.noise))
    FAULTS[run.fault](quiet, during, joint)
    estimates = [_declared(each) for each in estimated(run.estimator, mission, run.fault, swing, joint)]
    if run.fault == ONE_TURN:  # which is no fault
        quiet.readings[:, joint] = swing.truth[:, joint]
    found = findable(mission, quiet, during, run.fault, modelled=run.estimator in SURE_OF_MODEL)
    return judged(estimates, swing.truth, found, TIMING, blocks=BLOCKS)


def of_seed(seed: int, mission: LagrangianMission, fault: str) -> tuple[Swing, int]:
    """The swing of a seed, its encoders without a fault, and the joint of the ``fault``."""
    rng = np.random.default_rng(seed)
    joint = int(rng.integers(2))
    return swung(rng, mission, fault, joint), joint


def estimated(name: str, mission: LagrangianMission, fault: str, swing: Swing, joint: int) -> list[Estimate]:
    """Estimates of a swing, whose readings have the fault from now on."""
    FAULTS[fault](swing, slice(round(ONSET / PERIOD), round(END / PERIOD)), joint)
    plugin = load("estimators", name)
    estimator = plugin.build(plugin.Config(), mission)
    return [estimator.update(*update) for update in _updates(swing, QUALITY.resolution)]


def _declared(estimate: Estimate) -> Estimate:
    """The estimate with its declared deviations as its covariance, if it has none."""
    if estimate.covariance is not None:
        return estimate
    return dataclasses.replace(estimate, covariance=np.diag(np.square(estimate.extra["deviation"])))


def findable(mission: LagrangianMission, quiet: Swing, during: slice, fault: str, *, modelled: bool) -> Flags:
    """True (n,) from the update on at which a fault can be found in the readings of a swing without noise; as within a
    wall, by the tests of single numbers and of all together.
    """
    e = _innovations(mission, quiet) if modelled else roughness(quiet.readings, _variance())
    rho = np.ones(len(e))
    rho[during] = 9.0 if fault == NOISY else 1.0  # noise is nearly all of the variance of an innovation
    chance = chances(e, rho, 1 if modelled else APART, PERIOD, WINDOWS)
    if fault == STANDS:
        chance[during.start + STUCK :] = 1.0
    return from_onset(chance, during.start)


def chances(e: Array, rho: Array, every: int, period: float, windows: tuple[float, ...]) -> Array:
    """The largest P (n,) by ``windows`` [s] of residuals e (n, k) of variances rho (n,), ``period`` [s] apart; of each
    ``every`` of them one is taken, so that no two have a reading in common.
    """
    chance: Array = np.zeros(len(e))
    for first in range(every):
        read = first + every * np.flatnonzero(np.isfinite(e[first::every, 0]))
        chance[read] = by_windows(e[read], rho[read], Thresholds.of(e.shape[1], every * period, windows))
    return chance


def _variance() -> float:
    """Variance [rad^2] of a reading."""
    return QUALITY.noise**2 + (2.0 * math.pi / 2.0**QUALITY.resolution) ** 2 / 12.0


def _innovations(mission: LagrangianMission, swing: Swing) -> Array:
    """Innovations (n, 2), each over its deviation, of the extended Kalman filter, which uses every reading."""
    config = LagrangianEkfConfig()
    law = ErrorStateFilter(FilterModel(config.acceleration, config.noise_floor, 0.0), mission, linearised)
    e = np.full((len(swing.readings), 2), np.nan)
    for k, (y, u) in enumerate(zip(swing.readings, swing.torques, strict=True)):
        if k:
            law.predict(PERIOD, u, y)
        if not np.isfinite(y).all():
            continue
        if k == 0:
            law.start(y)
        else:
            law.correct(y, PERIOD)
            assert law.residual is not None
            e[k] = law.residual.value / np.sqrt(law.residual.variance + _variance())
    return e


def roughness(readings: Array, variance: float) -> Array:
    """Residuals (n, k) of ``readings`` (n, k) about the cubic through the four before, over their deviation; each has
    a ``variance``.
    """
    e = np.full(readings.shape, np.nan)
    r = readings[4:] - 4.0 * readings[3:-1] + 6.0 * readings[2:-2] - 4.0 * readings[1:-3] + readings[:-4]
    e[4:] = r / math.sqrt(70.0 * variance)
    return e
