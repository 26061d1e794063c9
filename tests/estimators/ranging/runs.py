"""Runs of filters that know their start, and the filter that they are held against, that tests have in common."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable

import numpy as np

from mathnavi.estimators.ranging.kalman_kernels import expected_ranges
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from tests.estimators.ranging.walls import FIELD, SENSORS
from tests.ranging import Step, driven, eight

START = np.array([0.6, -0.4, 0.5])
"""a pose from which the figure of eight stays within the ellipse, the egg and the bean"""

Run = list[tuple[Step, Estimate]]


def mission(sensors: str = "2s", deviation: float = 0.3, curve: Curve = FIELD) -> RangingMission:
    """Ranges of 5 %, odometry of .05 and 2 %, and the start known to be ``START``, to deviations [m, m, rad]."""
    return RangingMission(
        curve,
        tuple(math.radians(angle) for angle in SENSORS[sensors]),
        RangeQuality(0.05),
        OdometryQuality((0.05, 0.05), 0.02),
        start=KnownStart(tuple(START), (deviation, deviation, deviation)),
    )


def misplaced(task: RangingMission, rng: np.random.Generator) -> RangingMission:
    """The mission with a start that is off by as much as it says it may be."""
    assert task.start is not None
    while True:
        pose = np.array(task.start.pose) + np.array(task.start.deviation) * rng.standard_normal(3)
        if task.curve.contains(pose):
            return dataclasses.replace(task, start=dataclasses.replace(task.start, pose=tuple(pose)))


def steps_of(task: RangingMission, duration: float, rng: np.random.Generator) -> list[Step]:
    """Readings on a figure of eight from ``START``, the odometry's bias being of either sign."""
    bias = float(rng.choice((-1.0, 1.0))) * task.odometry.bias
    biased = dataclasses.replace(task, odometry=dataclasses.replace(task.odometry, bias=bias))
    return list(driven(biased, START, duration, eight, rng))


def estimates_of(estimator: Estimator, steps: Iterable[Step]) -> Run:
    return [(step, estimator.update(step.t, step.measurements, step.command)) for step in steps]


def errors(task: RangingMission, run: Run) -> Array:
    """(n, 2) [m] and [rad]."""
    return np.array([task.error(estimate.x, step.truth) for step, estimate in run])


def nees(task: RangingMission, run: Run) -> float:
    """NEES of the last estimate."""
    step, estimate = run[-1]
    assert estimate.covariance is not None
    error = task.difference(estimate.x, step.truth)
    return float(error @ np.linalg.solve(estimate.covariance, error))


def with_ranges(step: Step, change: Callable[[Array], Array]) -> Step:
    """The step with its ranges put through a function."""
    readings = (Measurement(m.name, m.t, change(m.value)) if m.name == "ranges" else m for m in step.measurements)
    return dataclasses.replace(step, measurements=tuple(readings))


def with_odometry(step: Step, u: Array | None) -> Step:
    """The step with another reading (2,) of odometry, or with none."""
    readings = [m for m in step.measurements if m.name != "odometry"]
    if u is not None:
        readings.append(Measurement("odometry", step.t, u))
    return dataclasses.replace(step, measurements=tuple(readings))


def reference(task: RangingMission, step: Step, x: Array, P: Array) -> tuple[Array, Array, float]:
    """x (4,), P (4, 4) and NIS of the extended Kalman filter after a step, by the textbook and by differences."""
    h, quality, odometry = 1e-6, task.ranging, task.odometry
    readings = {m.name: m.value for m in step.measurements}

    def motion(at: Array, v: Array) -> Array:
        u_1, u_2 = (1.0 - at[3]) * u + v
        return np.array([*integrate(at[:3], u_1, u_2, task.period), at[3]])

    if step.t > 0.0:
        u, still = readings["odometry"], np.zeros(2)
        A = np.array([(motion(x + e, still) - motion(x - e, still)) / (2.0 * h) for e in h * np.eye(4)]).T
        G = np.array([(motion(x, e) - motion(x, -e)) / (2.0 * h) for e in h * np.eye(2)]).T
        W = np.diag(np.square(odometry.noise) + np.square(odometry.slip))
        x, P = motion(x, still), A @ P @ A.T + G @ W @ G.T
    rho, H = expected_ranges(task.curve.wall, x[:3], task.rays)
    H = np.column_stack((H, np.zeros(len(H))))
    S = H @ P @ H.T + np.diag(np.square(quality.relative * rho) + quality.absolute**2)
    nu = readings["ranges"] - rho
    K = P @ H.T @ np.linalg.inv(S)
    return x + K @ nu, P - K @ S @ K.T, float(nu @ np.linalg.solve(S, nu))
