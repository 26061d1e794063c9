"""A unicycle that drives within a wall and reads ranges and odometry: what tests feed to estimators."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.patterns import figure_eight

Input = Callable[[float], tuple[float, float]]


def eight(t: float) -> tuple[float, float]:
    """1.5 m by 0.55 m in 8 s."""
    return figure_eight(t, 0.5, 8.0)


def still(t: float) -> tuple[float, float]:
    return 0.0, 0.0


@dataclass(frozen=True)
class Step:
    """One call of an estimator: what it is given, and what is true then."""

    t: float
    measurements: tuple[Measurement, ...]
    command: Array  # (2,) held since the last call
    truth: Array  # (3,)


def driven(
    mission: RangingMission,
    start: Array,
    duration: float,
    input_at: Input = eight,
    rng: np.random.Generator | None = None,
) -> Iterator[Step]:
    """Input of an estimator, every period; with the noise that the mission declares where a generator is given.

    At t = 0 there is no odometry yet. Inputs are held over a period at their value in its middle.
    """
    x, dt = np.array(start, dtype=np.float64), mission.period
    command = np.zeros(2)
    for k in range(round(duration / dt) + 1):
        t = k * dt
        rho, _ = mission.curve.ranges(x, mission.alpha)
        u = command
        if rng is not None:
            quality, odometry = mission.ranging, mission.odometry
            deviation = np.hypot(quality.relative * rho, quality.absolute)
            rho = rho + deviation * rng.standard_normal(len(rho))
            rho[rng.random(len(rho)) < quality.dropout] = np.nan
            u = (1.0 + odometry.bias) * command + np.array(odometry.noise) * rng.standard_normal(2)
        readings = [Measurement("ranges", t, rho)]
        if k:
            readings.append(Measurement("odometry", t, u))
        yield Step(t, tuple(readings), command, x.copy())
        command = np.array(input_at(t + 0.5 * dt))
        x = mission.flow(x, command, dt)
