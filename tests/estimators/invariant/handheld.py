"""A device in a hand, simulated: it rests, then is turned about all axes and moved about a place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import mathnavi as mn
from mathnavi.estimators.invariant.inclination_kernels import turned
from mathnavi.interfaces.signals import Array
from mathnavi.models.quaternion import rotation

PERIOD = 0.01  # [s]
BIAS = np.array([0.01, -0.008, 0.006])  # [rad/s] of the gyro
MISSION = mn.InertialMission(period=PERIOD)


@dataclass(frozen=True)
class Handled:
    """Readings, and the attitudes at their times."""

    log: mn.SensorLog
    truth: Array  # (n, 4)


def handled(seconds: float = 20.0, rest: float = 3.0, reach: float = 0.15, seed: int = 0) -> Handled:
    """Simulate a device that rests for ``rest`` [s] and then moves by ``reach`` [m] either way along each axis.

    The rate of turn is the same over each period, at whose end it is read.
    """
    rng = np.random.default_rng(seed)
    t = PERIOD * np.arange(round(seconds / PERIOD) + 1)
    phases, frequencies = rng.uniform(0.0, 2.0 * math.pi, (2, 3)), rng.uniform(3.0, 7.0, 3)
    moving = np.clip((t - rest) / 0.5, 0.0, 1.0)[:, None]
    rates = moving * np.array([2.0, 1.5, 1.0]) * np.sin(t[:, None] * np.array([1.1, 1.7, 2.3]) + phases[0])
    acceleration = -moving * reach * frequencies**2 * np.sin(frequencies * t[:, None] + phases[1])
    q = turned(np.array([1.0, 0.0, 0.0, 0.0]), rng.normal(0.0, 0.3, 3))
    truth, imu = np.empty((len(t), 4)), np.empty((len(t), 6))
    for k in range(len(t)):
        q = turned(q, PERIOD * rates[k])
        truth[k] = q
        force = rotation(q).T @ (acceleration[k] + np.array([0.0, 0.0, 9.81]))
        imu[k] = np.concatenate([rates[k] + BIAS, force])
    imu += rng.standard_normal(imu.shape) * np.repeat([0.005, 0.05], 3)
    return Handled(mn.SensorLog(t, {"imu": imu}), truth)
