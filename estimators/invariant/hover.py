"""The stationary filter in hover of an IMU and position fixes, with whose covariance a filter begins."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import solve_discrete_are

from mathnavi.estimators.invariant.strapdown import SPEED, TURN, trusted
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.linear_noise import discretised
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.sensor_faults import longest_gap


def stationary(mission: QuadrotorMission, timeout: float, fix_deviation: float) -> tuple[float, Array]:
    """Time [s] between fixes, and covariance (3, 3) of (p, v, tilt) along an axis just before one.

    In hover, p' = v, v' = g tilt + force, tilt' = gyro. The vehicle accelerates by up to a_max, and an error of its
    heading then acts like an error of its tilt: g is the length of both accelerations together. Fixes have a deviation
    [m], and come after ``timeout`` [s] at the latest.
    """
    flight, (gyro, force) = mission.flight, imu_deviations(mission)
    interval = longest_gap(1.0 / flight.position_rate, flight.dropout_rate, timeout)
    g = math.hypot(mission.vehicle.gravity, flight.acceleration_max)
    model = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, g], [0.0, 0.0, 0.0]])
    F, Q = discretised(model, np.diag([0.0, force**2 * TICK, gyro**2 * TICK]), interval)
    before = solve_discrete_are(F.T, np.array([[1.0], [0.0], [0.0]]), Q, np.array([[fix_deviation**2]]))
    return interval, 0.5 * (before + before.T)


def first_covariance(axis: Array, attitude: float | None, velocity: float | None) -> Array:
    """Initial covariance (9, 9) of the errors of attitude, velocity and position.

    It is that of the stationary filter, ``axis`` (3, 3), except where a standard deviation is given, of the attitude
    [rad] or of the velocity [m/s].

    Anything wider would let the first fixes move the estimate by more than the declared quality says.
    """
    P = np.zeros((9, 9))
    for k in range(3):
        P[np.ix_([6 + k, 3 + k], [6 + k, 3 + k])] = axis[:2, :2]
        P[k, k] = axis[2, 2]
    for k, tilt, sign in ((0, 1, 1.0), (1, 0, -1.0)):  # xi_v' = xi_turn x f
        P[[6 + k, 3 + k], tilt] = P[tilt, [6 + k, 3 + k]] = sign * axis[2, :2]
    for part, stated in ((TURN, attitude), (SPEED, velocity)):
        if stated is not None:
            P[part], P[:, part] = 0.0, 0.0
            P[part, part] = stated**2 * np.eye(3)
    return P


def imu_deviations(mission: QuadrotorMission) -> tuple[float, float]:
    """Standard deviations [rad/s, m/s^2] that a filter assumes for a reading of the IMU."""
    return trusted((mission.inertial.gyro, mission.inertial.accelerometer))
