"""Regions of convergence: the initial estimates from which an observer finds the true state without noise.

One true run with the readings of exact sensors is replayed to an estimator that is built again for every initial
estimate. The estimator has converged if the root mean square of its error over the last part of the run, modulo the
symmetry of the wall, is small enough.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.observability.range_outputs import Input
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart


@dataclass(frozen=True)
class ConvergenceCriterion:
    """Limits below which an observer counts as converged."""

    position: float  # [m] root mean square
    heading: float  # [rad] root mean square
    last: float  # share of the run, at its end, over which both are taken


@dataclass(frozen=True)
class ExactRun:
    """A run and the readings of exact range sensors and odometry along it, once a period."""

    mission: RangingMission
    t: Array  # (n,) [s]
    truth: Array  # (n, 3)
    readings: tuple[tuple[Measurement, ...], ...]  # (n) readings of each period
    commands: Array  # (n, 2) held since the reading before


def exact_run(mission: RangingMission, start: Array, input_at: Input, duration: float) -> ExactRun:
    """Run from a pose ``start`` (3,) under an input that is held over each period at its value in the middle.

    Raises ArgumentError if it leaves the field.
    """
    n = round(duration / mission.period) + 1
    t: Array = mission.period * np.arange(n, dtype=np.float64)
    truth, commands = np.empty((n, 3)), np.zeros((n, 2))
    truth[0] = start
    readings: list[tuple[Measurement, ...]] = []
    for k in range(n):
        if k:
            commands[k] = input_at(t[k] - 0.5 * mission.period)
            truth[k] = mission.flow(truth[k - 1], commands[k], mission.period)
        if not mission.curve.contains(truth[k, :2]):
            raise ArgumentError(f"start = {np.asarray(start).tolist()}: the run leaves the field at {t[k]:.2f} s")
        ranges = Measurement("ranges", t[k], mission.ranges(truth[k]))
        readings.append((ranges, Measurement("odometry", t[k], commands[k])) if k else (ranges,))
    return ExactRun(mission, t, truth, tuple(readings), commands)


def converges(estimator: Estimator, run: ExactRun, criterion: ConvergenceCriterion) -> bool:
    """True if an estimator with the readings of a run has converged by its end."""
    first = round((1.0 - criterion.last) * (len(run.t) - 1))
    errors = []
    for k in range(len(run.t)):
        estimate = estimator.update(run.t[k], run.readings[k], run.commands[k])
        if k >= first:
            errors.append(run.mission.error(estimate.x, run.truth[k]))
    position, heading = np.sqrt(np.mean(np.square(errors), axis=0))
    return bool(position < criterion.position and heading < criterion.heading)


def region_of_convergence(
    plugin: Any,
    config: Any,
    run: ExactRun,
    estimates: Array,
    deviation: tuple[float, float, float],
    criterion: ConvergenceCriterion,
) -> NDArray[np.bool_]:
    """True (n,) where the estimator of a plug-in converges from each of the initial ``estimates`` (n, 3) [m, m, rad].

    The plug-in is built for the mission of the run, with that estimate as the known start, of the standard
    ``deviation`` [m, m, rad].
    """
    converged = np.empty(len(estimates), dtype=bool)
    for k, estimate in enumerate(estimates):
        start = KnownStart((float(estimate[0]), float(estimate[1]), float(estimate[2])), deviation)
        mission = dataclasses.replace(run.mission, start=start)
        converged[k] = converges(plugin.build(config, mission), run, criterion)
    return converged
