"""The part of the study of integrity by legs: a quadruped in MuJoCo, with an IMU, encoders and foot switches.

It stands on four feet and moves its legs by sines, so that the trunk sways. Position, velocity and attitude of its base
are judged each by itself, against ``base_deviation``. Position and heading are not observable: what an IMU that is
silent, or wrong, leaves unknown of them is never found again.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.invariant.feet import SLIPS_FOR
from mathnavi.estimators.invariant.floating_base import FloatingBaseIekf, FloatingBaseIekfConfig
from mathnavi.estimators.invariant.strapdown import PLACE, SPEED, TURN
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.floating_base import ATTITUDE, FEET, IMU, JOINTS, VELOCITY
from mathnavi.models.mechanism.floating_base import PLACE as BASE
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.quaternion import rotation
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.studies.ranging.integrity_detection import by_windows, from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

ESTIMATOR = "floating_base_iekf, legs"
PERIOD, DURATION, ONSET, END = 0.01, 30.0, 3.0, 6.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 1.0)
CONFIG = FloatingBaseIekfConfig(joints="filtered_differences")
ENCODERS = PositionQuality(1e-4)
AMPLITUDES = np.array([0.25, -0.25, 0.25, -0.25, 0.1, -0.3, 0.2, -0.2])  # [rad] of the joints: no foot slides
RATES = (2.0, 8.0)  # [rad/s] of all of them, from and to
BLOCKS = (slice(0, 3), slice(3, 6), slice(6, 9))
"""blocks of a state: position, velocity and attitude"""
SETTING = (
    f"A quadruped that moves its legs for {DURATION:g} s reads its IMU, encoders and foot switches, the fault from "
    f"{ONSET:g} to {END:g} s; nor has it a protection level."
)
_NAME = "robot"
_GYRO, _FORCE = slice(0, 3), slice(3, 6)


@dataclass(frozen=True, eq=False)
class Walk:
    """A walk of n updates, whose sensors have no fault."""

    mission: LagrangianMission
    truth: Array  # (n, 9) position, velocity [m, m/s] and zeros
    attitudes: Array  # (n, 3, 3)
    readings: list[tuple[Measurement, ...]]  # of each update
    commands: Array  # (n, nu) held since the update before


Fault = Callable[[str, Array, dict[str, Array]], Array | None]
"""change of a reading of a sensor, by its name, None if it does not come; in the last argument is what it keeps"""


def _none(name: str, y: Array, kept: dict[str, Array]) -> Array:
    return y


def _imu(part: slice, change: Callable[[Array], Array]) -> Fault:
    def fault(name: str, y: Array, kept: dict[str, Array]) -> Array:
        if name == IMU:
            y[part] = change(y[part])
        return y

    return fault


def _stuck(part: slice) -> Fault:
    def fault(name: str, y: Array, kept: dict[str, Array]) -> Array:
        if name == IMU:
            y[part] = kept.setdefault(name, y[part].copy())
        return y

    return fault


def _silent(name: str, y: Array, kept: dict[str, Array]) -> Array | None:
    return None if name == IMU else y


def _feet(change: Callable[[Array], Array]) -> Fault:
    return lambda name, y, kept: change(y) if name == FEET else y


def _encoder_off(name: str, y: Array, kept: dict[str, Array]) -> Array:
    if name == JOINTS:
        y[0] += 0.1
    return y


OF_ITS_IMU: dict[str, Fault] = {
    "accelerometer in g": _imu(_FORCE, lambda f: f / 9.81),
    "accelerometer bias 0.5 m/s^2": _imu(_FORCE, lambda f: f + np.array([0.5, 0.0, 0.0])),
    "gyro in deg/s": _imu(_GYRO, np.rad2deg),
    "gyro bias 0.1 rad/s": _imu(_GYRO, lambda w: w + np.array([0.1, 0.0, 0.0])),
    "gyro stuck": _stuck(_GYRO),
    "accelerometer stuck": _stuck(_FORCE),
    "IMU silent for 3 s": _silent,
}
FAULTS: dict[str, Fault] = {
    "none": _none,
    **OF_ITS_IMU,
    "feet always in contact": _feet(np.ones_like),
    "feet never in contact": _feet(np.zeros_like),
    "an encoder 0.1 rad off": _encoder_off,
}


def walked(seed: int, *, exact: bool = False) -> Walk:
    """The walk of a seed; ``exact`` with readings that have no noise, until the end of the fault."""
    rng = np.random.default_rng(seed)
    model = build_model("quadruped", name=_NAME)
    if exact:
        model.sensor_noise[:] = 0.0
    system = MechanismSystem(model)
    mission = LagrangianMission(system, PositionQuality(0.0) if exact else ENCODERS, PERIOD)
    amplitudes, rate, phase = rng.uniform(0.5, 1.0) * AMPLITUDES, rng.uniform(*RATES), rng.uniform(0.0, 2.0 * math.pi)
    first = model.key_qvel[0] if model.nkey else np.zeros(model.nv)
    start = np.concatenate([system.manifold.origin, first])
    plant = MujocoPlant(model, {_NAME: VehicleSetup(start, FloatingBaseIekf.sensors(CONFIG, mission))}, rng)
    readings, truth, attitudes, commands = list[tuple[Measurement, ...]](), [], [], []
    u, steps = np.zeros(len(AMPLITUDES)), round(PERIOD / model.opt.timestep)
    for k in range(round((END if exact else DURATION) / PERIOD)):
        readings.append(tuple(plant.sense(_NAME)))
        x = plant.state(_NAME)
        truth.append(np.concatenate([x[BASE], x[model.nq :][VELOCITY], np.zeros(3)]))
        attitudes.append(rotation(x[ATTITUDE]))
        commands.append(u)
        u = min(1.0, k * PERIOD) * math.sin(rate * PERIOD * k + phase) * amplitudes
        plant.step({_NAME: u}, steps)
    return Walk(mission, np.array(truth), np.array(attitudes), readings, np.array(commands))


def estimated(walk: Walk, mission: LagrangianMission, fault: str, *, monitored: bool) -> list[Estimate]:
    """Estimates of a walk with a fault; ``mission`` is the estimator's."""
    estimator = FloatingBaseIekf(CONFIG, mission, monitored=monitored)
    estimates, kept = [], dict[str, Array]()
    for k, (readings, command) in enumerate(zip(walk.readings, walk.commands, strict=True)):
        t = PERIOD * k
        if ONSET <= t < END:
            readings = _changed(readings, FAULTS[fault], kept)
        estimates.append(estimator.update(t, readings, command))
    return estimates


def _changed(readings: Sequence[Measurement], fault: Fault, kept: dict[str, Array]) -> tuple[Measurement, ...]:
    changed = [(each, fault(each.name, each.value.copy(), kept)) for each in readings]
    return tuple(dataclasses.replace(each, value=y) for each, y in changed if y is not None)


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the estimator under a fault; the seed determines the walk."""
    walk, exact = walked(run.seed), walked(run.seed, exact=True)
    estimates = estimated(walk, walk.mission, run.fault, monitored=run.monitored)
    judging = [_of_base(each, walk, R) for each, R in zip(estimates, walk.attitudes, strict=True)]
    faulty, quiet = (estimated(exact, walk.mission, each, monitored=False) for each in (run.fault, "none"))
    found = findable(walk.mission, faulty, quiet)
    found = np.append(found, np.full(len(estimates) - len(found), found[-1]))
    return judged(judging, walk.truth, found, TIMING, blocks=BLOCKS)


def _of_base(estimate: Estimate, walk: Walk, R: Array) -> Estimate:
    """Position, velocity and turn from the true attitude R of the base, with the variances that are declared."""
    x, deviation = estimate.x, estimate.extra["base_deviation"]
    turn = Rotation.from_matrix(R.T @ rotation(x[ATTITUDE])).as_rotvec()
    nq = walk.mission.system.manifold.size
    parts = np.concatenate([deviation[PLACE], deviation[SPEED], deviation[TURN]])
    moved = np.concatenate([x[BASE], x[nq:][VELOCITY], turn])
    return dataclasses.replace(estimate, x=moved, covariance=np.diag(parts**2))


def findable(mission: LagrangianMission, faulty: Sequence[Estimate], quiet: Sequence[Estimate]) -> Flags:
    """True (n,) from the update on at which a fault can be found in the velocities of feet that stand, of a walk whose
    readings have no noise, by a filter that is not monitored: they are those of the ground.
    """
    nq, every = mission.system.manifold.size, round(SLIPS_FOR / PERIOD)
    off = np.array([a.x[nq:][VELOCITY] - b.x[nq:][VELOCITY] for a, b in zip(faulty, quiet, strict=True)])
    spread = np.array([each.extra["base_deviation"][SPEED] for each in faulty])
    e = (off / np.hypot(spread, CONFIG.slip))[every - 1 :: every]
    found = by_windows(e, np.ones(len(e)), InnovationMonitor("feet", 3, SLIPS_FOR).thresholds)
    chance = np.zeros(len(off))
    chance[every - 1 :: every] = found
    return from_onset(chance, round(ONSET / PERIOD))
