"""Runs of a robot that measures ranges on a figure of eight: errors and cost of estimators over its readings.

The robot is the ideal unicycle, which moves exactly (``mathnavi.estimators.observability.region``), so only its
readings are simulated. The errors of each run are drawn separately: the noise of ranges and odometry, and the sign of
the odometry's bias. All estimators of a run have the same readings.

The cost of an update is CPU time on one thread, over the same readings. The compiled estimators are loops over the
kernels that the plug-ins call, without Python: the bank as used in a run, the bank if no hypothesis were ever dropped,
a single filter of the bank, and the kernels of the particle filter with a constant number of 1000 particles. The
plug-in of the particle filter adapts its number of particles.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from mathnavi.estimators.integrity.guard import alone
from mathnavi.estimators.observability.region import ConvergenceCriterion, ExactRun, exact_run, region_of_convergence
from mathnavi.estimators.ranging.bank_kernels import (
    Hypotheses,
    Scoring,
    Symmetry,
    condition_each,
    declare_scale,
    drop,
    no_hypotheses,
    predict_each,
)
from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBank, FeasibleSetBankConfig
from mathnavi.estimators.ranging.kalman_kernels import Innovations, RaySensors, no_innovations
from mathnavi.estimators.ranging.model import RangeModel, chi_square_gate
from mathnavi.estimators.ranging.noise_kernels import WINDOW, NoiseSums, declared_noise
from mathnavi.estimators.ranging.particle import RangeParticleConfig
from mathnavi.estimators.ranging.particle_clusters import Cells, clusters_of
from mathnavi.estimators.ranging.particle_kernels import propagate, resample, weigh
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.field.curve import Curve
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart
from mathnavi.sim.metrics.consistency import normalised_error_squared
from mathnavi.sim.metrics.convergence import LAST
from mathnavi.sim.metrics.ranging import HEADING, POSITION
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.scenarios.ranging_fields import RangingNoise
from mathnavi.studies.ranging.observability_measures import SENSORS, STANDARD, drawn_start, driving, spread

BANK, EKF, UKF, PARTICLES, FLOOR = "bank", "EKF", "UKF", "particle filter", "EKF from nearby"
PLUGINS: Mapping[str, str] = {
    BANK: "feasible_set_bank",
    EKF: "range_ekf",
    UKF: "range_ukf",
    PARTICLES: "range_particle",
    FLOOR: "range_ekf",
}
NEAR = 0.1  # [m, rad] standard deviation of the start that FLOOR is given
INSTANTS = 41  # of a run at which errors are kept

START = (1.0, 0.2, 0.5 * math.pi)  # from where the figure of eight stays within the standard field
BANK_LOOP, ALL_ALIVE, EKF_LOOP, PARTICLE_LOOP = "bank", "bank, whole", "one EKF", "1000 particles"

_SLIP = (0.0, 0.0)  # of a robot without wheels
_PARTICLES = 1000
_MEMORY = 0.98  # of the misfit, which costs the same whatever it is
_KLD = (0.05, 2.33)  # epsilon and z, which decide nothing where the number of particles stays


@dataclass(frozen=True)
class RangeRun:
    """A run with noise, and its estimators."""

    curve: Curve
    sensors: str
    seed: int
    seconds: float
    estimators: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class EstimatorResult:
    """Errors and consistency of one estimator over a run."""

    converged: bool
    position: float  # [m] RMS over the last quarter
    heading: float  # [rad]
    error: Array  # (INSTANTS,) [m]
    nees: Array  # (INSTANTS,) e' P^-1 e, NaN without a covariance
    nis: float  # mean over the last quarter, NaN of an estimator that has none
    rays: float  # that it is of, their mean


def declared_mission(curve: Curve, sensors: str) -> RangingMission:
    """Return a mission with the standard noise and an unknown start."""
    noise, angles = RangingNoise(), tuple(math.radians(angle) for angle in SENSORS[sensors])
    return RangingMission(curve, angles, noise.ranging(), noise.odometry(_SLIP))


def noisy_run(mission: RangingMission, start: Array, seconds: float, rng: np.random.Generator) -> ExactRun:
    """Return a run from a pose (3,) [m, m, rad] with readings of the quality that the mission declares."""
    exact = exact_run(mission, start, driving, seconds)
    odometry, n = mission.odometry, len(exact.t)
    rho = np.array([readings[0].value for readings in exact.readings])
    rho = rho + np.hypot(mission.ranging.relative * rho, mission.ranging.absolute) * rng.standard_normal(rho.shape)
    bias = odometry.bias * rng.choice((-1.0, 1.0))
    u = (1.0 + bias) * exact.commands + np.array(odometry.noise) * rng.standard_normal((n, 2))
    readings = tuple(
        (Measurement("ranges", t, rho[k]), Measurement("odometry", t, u[k]))[: 2 if k else 1]
        for k, t in enumerate(exact.t)
    )
    return dataclasses.replace(exact, readings=readings)


def estimator_results(asked: RangeRun) -> dict[str, EstimatorResult]:
    """A job: results of the estimators over the readings of one run, by name; the seed determines the run."""
    rng = np.random.default_rng(asked.seed)
    start, mission = drawn_start(asked.curve, rng), declared_mission(asked.curve, asked.sensors)
    run = noisy_run(mission, start, asked.seconds, rng)
    near = start + NEAR * rng.standard_normal(3)
    return {name: _found(name, run, near, asked.seed) for name in asked.estimators}


def _found(name: str, run: ExactRun, near: Array, seed: int) -> EstimatorResult:
    plugin, mission = load("estimators", PLUGINS[name]), run.mission
    if name == FLOOR:
        mission = dataclasses.replace(mission, start=KnownStart((near[0], near[1], near[2]), (NEAR, NEAR, NEAR)))
    own: dict[str, Any] = {"seed": seed} if name in (BANK, PARTICLES) else {}
    estimator = alone(plugin.build(plugin.Config(**own), mission))  # a monitor would begin a filter again from the bank
    estimates: list[Estimate] = [
        estimator.update(t, readings, command)
        for t, readings, command in zip(run.t, run.readings, run.commands, strict=True)
    ]
    differences = np.array([mission.difference(e.x, x) for e, x in zip(estimates, run.truth, strict=True)])
    position, last = np.hypot(differences[:, 0], differences[:, 1]), round((1.0 - LAST) * (len(run.t) - 1))
    rms = [math.sqrt(float(np.mean(np.square(values[last:])))) for values in (position, differences[:, 2])]
    shown = np.linspace(0, len(run.t) - 1, INSTANTS).round().astype(int)
    nis = np.array([e.extra.get("nis", (np.nan, np.nan)) for e in estimates[last:]])
    nis = nis[np.isfinite(nis).all(axis=1)]
    return EstimatorResult(
        converged=rms[0] < POSITION and rms[1] < HEADING,
        position=rms[0],
        heading=rms[1],
        error=position[shown],
        nees=_nees([estimates[k] for k in shown], differences[shown]),
        nis=float(nis[:, 0].mean()) if len(nis) else math.nan,
        rays=float(nis[:, 1].mean()) if len(nis) else math.nan,
    )


def _nees(estimates: Sequence[Estimate], differences: Array) -> Array:
    none = np.full((3, 3), np.nan)
    return normalised_error_squared(
        differences, np.array([none if e.covariance is None else e.covariance for e in estimates])
    )


@dataclass(frozen=True)
class ExactAttempt:
    """A run without noise, whose start and first estimate are drawn anywhere."""

    curve: Curve
    sensors: str
    seed: int
    seconds: float


def observer_converges(attempt: ExactAttempt) -> bool:
    """Return True if the observer (C.5) with the manifold feed-forward finds the true state."""
    rng, curve = np.random.default_rng(attempt.seed), attempt.curve
    start, estimate = drawn_start(curve, rng), curve.draw(rng)
    mission = RangingMission(curve, tuple(math.radians(angle) for angle in SENSORS[attempt.sensors]))
    run, plugin = exact_run(mission, start, driving, attempt.seconds), load("estimators", "range_observer")
    config, criterion = plugin.Config(feedforward="manifold"), ConvergenceCriterion(POSITION, HEADING, LAST)
    return bool(region_of_convergence(plugin, config, run, estimate[None], spread(curve), criterion)[0])


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of a robot that drives a figure of eight."""

    mission: RangingMission
    ranges: Array  # (n, l) [m]
    inputs: Array  # (n, 2) [m/s, rad/s] over the periods that end with them


def read(sensors: str, seconds: float, rng: np.random.Generator) -> Readings:
    """Draw readings of a set of ``SENSORS``, given by name, with the standard noise."""
    mission = declared_mission(STANDARD, sensors)
    readings = noisy_run(mission, np.array(START), seconds, rng).readings[1:]
    return Readings(mission, *(np.array([pair[k].value for pair in readings]) for k in (0, 1)))


def costs(readings: Readings, repetitions: int) -> Mapping[str, Array]:
    """Return CPU times (R,) [us] of an update by name: each once in each of R rounds, after a round that compiles."""
    config = FeasibleSetBankConfig()
    prepared: dict[str, Callable[[], Callable[[], int]]] = {
        ALL_ALIVE: partial(_bank, readings, config.hypotheses, -math.inf, 0.0),
        BANK_LOOP: partial(_bank, readings, config.hypotheses, config.lowest, 1.0),
        EKF_LOOP: partial(_bank, readings, 1, -math.inf, 0.0),
        PARTICLE_LOOP: partial(_particles, readings),
        **{name: partial(_plugin, readings, load("estimators", name)) for name in PLUGINS.values()},
    }
    taken: dict[str, list[float]] = {name: [] for name in prepared}
    for repetition in range(repetitions + 1):
        for name, prepare in prepared.items():
            work = prepare()
            began = time.thread_time()
            updates = work()
            if repetition:
                taken[name].append(1e6 * (time.thread_time() - began) / updates)
    return {name: np.array(figures) for name, figures in taken.items()}


def monitor_costs(readings: Readings, names: Sequence[str]) -> Mapping[str, tuple[Array, Array]]:
    """Return CPU times (n,) [us] of each update of estimators by name: with the monitor of integrity, and without.

    They know the start, and updated in turns with the same readings; the first second is left out.
    """
    start = KnownStart(START, (NEAR, NEAR, NEAR))
    mission = dataclasses.replace(readings.mission, start=start)
    first, taken = round(1.0 / mission.period), {}
    for name in names:
        plugin = load("estimators", name)
        pair = plugin.build(plugin.Config(), mission), alone(plugin.build(plugin.Config(), mission))
        times = np.empty((2, len(readings.ranges)))
        for k, (rho, u) in enumerate(zip(readings.ranges, readings.inputs, strict=True)):
            t = (k + 1) * mission.period
            measurements = Measurement("ranges", t, rho), Measurement("odometry", t, u)
            for i in (0, 1) if k % 2 else (1, 0):
                began = time.thread_time()
                pair[i].update(t, measurements, u)
                times[i, k] = 1e6 * (time.thread_time() - began)
        taken[name] = times[0, first:], times[1, first:]
    return taken


def _plugin(readings: Readings, plugin: Any) -> Callable[[], int]:
    """Prepare all updates of a plug-in, called as by the closed loop."""
    estimator, period = plugin.build(plugin.Config(), readings.mission), readings.mission.period
    calls = [
        (k * period, (Measurement("ranges", k * period, rho), Measurement("odometry", k * period, u)), u)
        for k, (rho, u) in enumerate(zip(readings.ranges, readings.inputs, strict=True))
    ]

    def work() -> int:
        for t, measurements, command in calls:
            estimator.update(t, measurements, command)
        return len(calls)

    return work


def _bank(readings: Readings, count: int, lowest: float, twin: float) -> Callable[[], int]:
    """Prepare updates of ``count`` of the bank's first hypotheses over all readings but those that created them."""
    config, model, mission = FeasibleSetBankConfig(), RangeModel(readings.mission), readings.mission
    bank, n, period = FeasibleSetBank(config, mission), config.readings, mission.period
    for k in range(n):
        made = bank.update(k * period, (Measurement("ranges", k * period, readings.ranges[k]),), readings.inputs[k])
    poses = made.extra["hypotheses"][np.isfinite(made.extra["scores"])][:count]
    hypotheses = no_hypotheses(len(poses), mission.sensors, WINDOW)
    hypotheses.x[:, :3], hypotheses.P[:], hypotheses.score[:] = poses, model.covariance(config.deviation), 0.0
    declare_scale(hypotheses, len(poses), model.scale)
    run = RecordedReadings(readings.ranges[n:], readings.inputs[n:], period)
    noise, innovations = declared_noise(mission.ranging.outliers), no_innovations(mission.sensors)
    quality = Quality(model.W, model.sensors(chi_square_gate(config.gate)), noise, innovations)
    scoring = Scoring(config.forgetting, _MEMORY, lowest, twin)
    symmetry = (mission.curve.symmetry, *mission.curve.centre)
    return lambda: int(bank_updates(hypotheses, run, model.wall, quality, scoring, symmetry))


def _particles(readings: Readings) -> Callable[[], int]:
    """Prepare updates of 1000 particles that start anywhere."""
    config, model, rng = RangeParticleConfig(), RangeModel(readings.mission), np.random.default_rng(0)
    x, z, u, period = model.particles(_PARTICLES, rng), readings.ranges, readings.inputs, readings.mission.period
    sensors = model.sensors(math.inf)._replace(outliers=config.outliers)
    cells = Cells(config.cell_position, round(2.0 * math.pi / config.cell_heading))
    return lambda: int(
        particle_updates(x, z, u, np.sqrt(model.W), model.scale, model.wall, sensors, cells, period, rng)
    )


class RecordedReadings(NamedTuple):
    """Readings and inputs of a run."""

    z: Array  # (n, l) [m] ranges
    u: Array  # (n, 2) [m/s, rad/s] inputs
    dt: float  # [s] from one to the next


class Quality(NamedTuple):
    """Noise of a robot's motion and sensors."""

    W: Array  # (2,) variances of the odometry
    sensors: RaySensors
    noise: NoiseSums
    innovations: Innovations


@njit(cache=True, nogil=True)
def bank_updates(
    bank: Hypotheses, run: RecordedReadings, wall: WallShape, quality: Quality, scoring: Scoring, symmetry: Symmetry
) -> int:
    """Update hypotheses in place by all n readings of a run, and return n."""
    z, u, dt = run
    W, sensors, noise, innovations = quality
    best = 0
    for k in range(len(z)):
        predict_each(bank, u[k], W, wall, dt, np.ones(2))
        best, _, _ = condition_each(bank, best, z[k], wall, sensors, noise, scoring, innovations)
        drop(bank, best, scoring, symmetry)
    return len(z)


@njit(cache=True, nogil=True)
def particle_updates(
    x: Array,
    z: Array,
    u: Array,
    deviation: Array,
    scale: float,
    wall: WallShape,
    sensors: RaySensors,
    cells: Cells,
    dt: float,
    rng: np.random.Generator,
) -> int:
    """Update a constant number of particles x (n, 4) by ranges z (m, l) and inputs u (m, 2), and return m."""
    w, limits, tested = np.full(len(x), 1.0 / len(x)), (len(x), len(x)), np.empty((2, z.shape[1]))
    for k in range(len(z)):
        propagate(x, u[k], deviation, scale, wall, dt, rng)
        effective, _ = weigh(x, w, z[k], wall, sensors, tested)
        clusters = clusters_of(x, w, cells)
        if effective < 0.5 * len(x):
            x = resample(x, w, clusters, 0.0, limits, _KLD, cells, scale, wall, rng)
            w[:] = 1.0 / len(x)
    return len(z)
