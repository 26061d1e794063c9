"""The part of the study of integrity by an attitude sensor: a body whose rates of turn are observed without a gyro.

It has three different moments of inertia and turns about all axes, under torques that every observer is given. Attitude
and rates are judged each by themselves, by the deviations that an observer declares. There is no protection level.
What can be found without trust in a model is that of encoders (``encoder_integrity``).
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from mathnavi.estimators.integrity.repeats import STUCK
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.invariant.attitude import AttitudeIekf
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.mission import POSITION, LagrangianMission, PositionQuality
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.ranging.encoder_integrity import APART, chances, roughness
from mathnavi.studies.ranging.integrity_detection import from_onset
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

SURE_OF_MODEL = ("attitude_iekf",)
ESTIMATORS = tuple(f"{name}, attitude" for name in (*SURE_OF_MODEL, "riemannian_observer"))
PERIOD, SUBSTEPS = 0.01, 10  # [s] of readings and torques, and steps of the truth in it
DURATION, ONSET, END = 40.0, 5.0, 15.0  # [s]
TIMING = Timing(PERIOD, ONSET, END, 3.0)
NOISE, SPEED_MAX = 0.003, 20.0  # [rad], [rad/s]
MOMENTS, TORQUE = "0.03 0.04 0.05", 0.1  # [kg m^2], [N m]
BLOCKS = (slice(0, 3), slice(3, 6))
"""blocks of an error: attitude and rates"""
SLIP, LATE, SILENT = 0.2, 0.05, 2.0  # [rad], [s], [s]
WINDOWS = (0.04, 0.2, 0.8, 2.0)  # [s] of the tests
NOISY, OFF, STANDS = "noise times 3", "torques off", "attitude stuck"
SETTING = (
    f"A body turns for {DURATION:g} s, its torques known; its attitude, with noise of {NOISE:g} rad, is read "
    f"{1.0 / PERIOD:g} times a second, the fault from {ONSET:g} to {END:g} s; attitude and rates are judged, without a "
    "protection level."
)
_ATTITUDE = Attitude()
_BALL = f"""<mujoco><option gravity="0 0 0" timestep="{PERIOD / SUBSTEPS}" integrator="RK4"/><worldbody><body>
<joint name="ball" type="ball"/><inertial pos="0 0 0" mass="1" diaginertia="{MOMENTS}"/></body></worldbody><actuator>
<motor joint="ball" gear="1 0 0"/><motor joint="ball" gear="0 1 0"/><motor joint="ball" gear="0 0 1"/>
</actuator></mujoco>"""


@dataclass(frozen=True, eq=False)
class Turning:
    """A body at n updates, whose attitude is read without a fault."""

    truth: Array  # (n, 7) [-, rad/s]
    readings: Array  # (n, 4) [-]; NaN where nothing is read
    noise: Array  # (n, 3) [rad] in them
    torques: Array  # (n, 3) [N m] asked for since the update before


Fault = Callable[[Turning, slice, np.random.Generator], None]
"""change of the readings of a body, in place, in the updates of a slice"""


def _none(body: Turning, during: slice, rng: np.random.Generator) -> None:
    pass


def _stuck(body: Turning, during: slice, rng: np.random.Generator) -> None:
    body.readings[during] = body.readings[during.start]


def _turned(body: Turning, during: slice, angles: Array) -> None:
    """Turn the readings by ``angles`` (n, 3) [rad] in the body's axes."""
    for k, angle in zip(range(during.start, during.stop), angles, strict=True):
        body.readings[k] = _ATTITUDE.point(body.readings[k], angle)


def _direction(rng: np.random.Generator) -> Array:
    direction = rng.standard_normal(3)
    unit: Array = direction / np.linalg.norm(direction)
    return unit


def _slip(body: Turning, during: slice, rng: np.random.Generator) -> None:
    _turned(body, during, np.tile(SLIP * _direction(rng), (during.stop - during.start, 1)))


def _drift(body: Turning, during: slice, rng: np.random.Generator) -> None:
    _turned(body, during, np.outer(0.1 * PERIOD * np.arange(during.stop - during.start), _direction(rng)))


def _noisy(body: Turning, during: slice, rng: np.random.Generator) -> None:
    _turned(body, during, 2.0 * body.noise[during])


def _doubled(body: Turning, during: slice, rng: np.random.Generator) -> None:
    """Every second reading is the one before, with a later time stamp."""
    body.readings[during][1::2] = body.readings[during][::2]


def _late(body: Turning, during: slice, rng: np.random.Generator) -> None:
    """Readings of ``LATE`` ago with the stamp of now."""
    ago = round(LATE / PERIOD)
    body.readings[during] = body.readings[during.start - ago : during.stop - ago].copy()


def _silent(body: Turning, during: slice, rng: np.random.Generator) -> None:
    body.readings[during.start : during.start + round(SILENT / PERIOD)] = np.nan


FAULTS: dict[str, Fault] = {
    "none": _none,
    STANDS: _stuck,
    "attitude 0.2 rad off": _slip,
    "attitude drifts by 0.1 rad/s": _drift,
    NOISY: _noisy,
    "every reading twice": _doubled,
    "readings 50 ms late": _late,
    "silent for 2 s": _silent,
    OFF: _none,  # of the body itself, not of its sensor
}


@cache
def _model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(_BALL)


def _mission() -> LagrangianMission:
    return LagrangianMission(MechanismSystem(_model()), PositionQuality(noise=NOISE), PERIOD, SPEED_MAX)


def turning(rng: np.random.Generator, fault: str) -> Turning:
    """A body whose sensor has no fault: it is ``fault`` that leaves it without torques from ONSET to END."""
    n, model = round(DURATION / PERIOD), _model()
    data, phases = mujoco.MjData(model), rng.uniform(0.0, 2.0 * math.pi, 3)
    data.qpos[:] = _ATTITUDE.point(np.array([1.0, 0.0, 0.0, 0.0]), rng.normal(0.0, 0.5, 3))
    data.qvel[:] = rng.uniform(-1.0, 1.0, 3)
    truth, torques, u = np.empty((n, 7)), np.empty((n, 3)), np.zeros(3)
    for k in range(n):
        t = PERIOD * k
        truth[k], torques[k] = np.concatenate([data.qpos, data.qvel]), u
        u = TORQUE * np.sin(np.array([1.1, 1.7, 2.6]) * t + phases)
        data.ctrl[:] = 0.0 if fault == OFF and ONSET <= t < END else u
        mujoco.mj_step(model, data, SUBSTEPS)
    noise = NOISE * rng.standard_normal((n, 3))
    readings = np.array([_ATTITUDE.point(q, e) for q, e in zip(truth[:, :4], noise, strict=True)])
    return Turning(truth, readings, noise, torques)


def _updates(body: Turning) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    for k, (y, torque) in enumerate(zip(body.readings, body.torques, strict=True)):
        t = PERIOD * k
        yield t, (Measurement(POSITION, t, y),) if np.isfinite(y).all() else (), torque


def watched(run: Watched) -> Outcome:
    """A job: what becomes of the estimator under a fault; the seed determines motion and fault."""
    rng, during = np.random.default_rng(run.seed), slice(round(ONSET / PERIOD), round(END / PERIOD))
    body = turning(rng, run.fault)
    quiet = dataclasses.replace(body, readings=body.truth[:, :4].copy(), noise=np.zeros_like(body.noise))
    FAULTS[run.fault](quiet, during, copy.deepcopy(rng))
    FAULTS[run.fault](body, during, rng)
    name = run.estimator.partition(",")[0]
    plugin = load("estimators", name)
    estimator = plugin.build(plugin.Config(), _mission())
    estimates = [
        _erring(estimator.update(*update), truth) for update, truth in zip(_updates(body), body.truth, strict=True)
    ]
    found = findable(quiet, during, run.fault, modelled=name in SURE_OF_MODEL)
    return judged(estimates, np.zeros((len(estimates), 6)), found, TIMING, blocks=BLOCKS)


def _erring(estimate: Estimate, truth: Array) -> Estimate:
    """The estimate with its error (6,) [rad, rad/s] as its state, and its declared deviations as its covariance."""
    error = np.concatenate([_ATTITUDE.coordinates(truth[:4], estimate.x[:4]), estimate.x[4:] - truth[4:]])
    return dataclasses.replace(estimate, x=error, covariance=np.diag(np.square(estimate.extra["deviation"])))


def findable(quiet: Turning, during: slice, fault: str, *, modelled: bool) -> Flags:
    """True (n,) from the update on at which a fault can be found in readings without noise; as of encoders."""
    e = _innovations(quiet) if modelled else roughness(_unwound(quiet.readings), NOISE**2)
    rho = np.ones(len(e))
    rho[during] = 9.0 if fault == NOISY else 1.0
    chance = chances(e, rho, 1 if modelled else APART, PERIOD, WINDOWS)
    if fault == STANDS:
        chance[during.start + STUCK :] = 1.0
    return from_onset(chance, during.start)


def _unwound(readings: Array) -> Array:
    """Sums (n, 3) [rad] of the turns from reading to reading; NaN next to one that is missing."""
    turns = np.zeros((len(readings), 3))
    for k in range(1, len(readings)):
        missing = np.isnan(readings[k - 1 : k + 1]).any()
        turns[k] = np.nan if missing else _ATTITUDE.coordinates(readings[k - 1], readings[k])
    known = np.isfinite(turns)
    return np.where(known, np.cumsum(np.where(known, turns, 0.0), axis=0), np.nan)


def _innovations(body: Turning) -> Array:
    """Innovations (n, 3), each over its deviation, of the filter on SO(3), which uses every reading."""
    estimator = AttitudeIekf.build(AttitudeIekf.Config(gate=1e-300), _mission())
    extras = [estimator.update(*update).extra for update in _updates(body)]
    return np.array([extra["innovations"] / extra["innovation_std"] for extra in extras])
