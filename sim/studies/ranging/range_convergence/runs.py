"""Runs of a robot that reads ranges and drives a figure of eight, and what estimators make of the same readings.

The robot is the ideal unicycle, which moves exactly (``mathnavi.estimators.observability.region``), so nothing is
simulated but its readings. A run's errors are drawn for it alone: the ranges' noise, the odometry's noise, and the
sign of its bias. Every estimator of a run reads the same.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.estimators.observability.region import ConvergenceCriterion, ExactRun, exact_run, region_of_convergence
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart
from mathnavi.sim.interfaces.signals import Array, Estimate, Measurement
from mathnavi.sim.metrics.consistency import normalised_error_squared
from mathnavi.sim.metrics.convergence import LAST
from mathnavi.sim.metrics.ranging import HEADING, POSITION
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.scenarios.ranging_fields import RangingNoise
from mathnavi.sim.studies.ranging.observability_measures import SENSORS, drawn_start, driving, spread

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

_SLIP = (0.0, 0.0)  # of a robot without wheels


@dataclass(frozen=True)
class RangeRun:
    """A run with noise, and the estimators that follow it."""

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
    """Mission with the standard noise, and an unknown start."""
    noise, angles = RangingNoise(), tuple(math.radians(angle) for angle in SENSORS[sensors])
    return RangingMission(curve, angles, noise.ranging(), noise.odometry(_SLIP))


def noisy_run(mission: RangingMission, start: Array, seconds: float, rng: np.random.Generator) -> ExactRun:
    """A run from a pose (3,) with what sensors of the quality that the mission declares read."""
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
    """Run each of the estimators over the readings; the same seed is the same run."""
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
    estimator = plugin.build(plugin.Config(**own), mission)
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
    """A start and a first estimate, both from anywhere, without noise."""

    curve: Curve
    sensors: str
    seed: int
    seconds: float


def observer_converges(attempt: ExactAttempt) -> bool:
    """Tell whether the observer (C.5) with the manifold feed-forward finds the true state."""
    rng, curve = np.random.default_rng(attempt.seed), attempt.curve
    start, estimate = drawn_start(curve, rng), curve.draw(rng)
    mission = RangingMission(curve, tuple(math.radians(angle) for angle in SENSORS[attempt.sensors]))
    run, plugin = exact_run(mission, start, driving, attempt.seconds), load("estimators", "range_observer")
    config, criterion = plugin.Config(feedforward="manifold"), ConvergenceCriterion(POSITION, HEADING, LAST)
    return bool(region_of_convergence(plugin, config, run, estimate[None], spread(curve), criterion)[0])


def converged(found: Sequence[EstimatorResult]) -> list[EstimatorResult]:
    """Runs that converged."""
    return [one for one in found if one.converged]
