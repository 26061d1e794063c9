"""Test of an accelerometer by the thrusts of the vehicle: in units of g, or with other axes, it reads what cannot be.

Under thrusts of the sum T at a velocity v the specific force in the body's axes is

    f^ = (0, 0, T / m) - D R' v / m

(``models.quadrotor.dynamics``), but for gusts, a vehicle that is not as assumed, and what carries it at rest: no more
than the weight that T does not. A reading is possible if

    |f - f^| <= 0.3 max(T / m, g) + w + 5 sigma + 5 delta + max(g - T / m, 0),

w the least of five deviations of a declared gust and of its limit, sigma^2 the variance of a reading and of its bias,
and delta the deviation of the drag by those of velocity and attitude, sigma_v and sigma_R: max D (sigma_v + |v|
sigma_R) / m.
An accelerometer that reads what is not for 0.1 s, in which rotors follow their thrusts, is left out until its readings
have been within half of that, without the last term, for a second.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.invariant.strapdown import SPEED, TURN, Strapdown
from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.tolerances import TIME_TOLERANCE

_UNMODELLED = 0.05  # [m/s^1.5] square root of the density of the acceleration that the declared motion lacks
_SHARE = 0.3  # of the thrust, by which mass and thrusts may be others than assumed
_DEVIATIONS = 5.0
_LASTING, _FEWEST, _GOOD, _NEAR = 0.1, 5, 1.0, 0.5  # [s], readings, [s], share of the limit


class ThrustTest:
    """The specific force by the thrusts, and whether the accelerometer contradicts it."""

    def __init__(self, mission: QuadrotorMission) -> None:
        self._mission, self._vehicle = mission, mission.vehicle
        imu, gust = mission.inertial, mission.flight.gust
        sigma = math.hypot(imu.accelerometer, imu.accelerometer_bias)
        self._margin = min(gust.limit, _DEVIATIONS * gust.rms) + _DEVIATIONS * sigma  # [m/s^2]
        self._since, self._count = math.inf, 0  # [s] of the first reading in a row that is not possible, and readings
        self._good = math.inf  # [s] likewise, of those that are near
        self._failed = False

    def replaces(self, strapdown: Strapdown, t: float, reading: Array, command: Array) -> bool:
        """Propagate to t [s] by the gyro of a ``reading`` (6,) and the thrusts of a ``command`` (4,) [N], if the
        accelerometer is left out; True if it is.
        """
        if not command.any():  # none is known
            return False
        X, failed = strapdown.X, self._failed
        velocity = X[:3, :3].T @ X[:3, 3]
        expected = self.expected(command, velocity)
        turn, speed = (math.sqrt(strapdown.P[part, part].diagonal().max()) for part in (TURN, SPEED))
        drag = max(self._vehicle.drag) / self._vehicle.mass * (speed + float(np.linalg.norm(velocity)) * turn)
        harm = self._take(t, reading[3:], expected, drag)
        if not self._failed:
            return False
        if not failed:
            strapdown.P[SPEED, SPEED] += harm**2 * np.eye(3)
        if strapdown.t is not None and t - strapdown.t > TIME_TOLERANCE:
            strapdown.propagate_by(t, reading[:3], expected, unmodelled(self._mission, t - strapdown.t))
        return True

    def expected(self, command: Array, velocity: Array) -> Array:
        """Specific force (3,) [m/s^2] under a command (4,) [N] at a ``velocity`` (3,) [m/s], both in the body's
        axes.
        """
        vehicle = self._vehicle
        force: Array = -np.array(vehicle.drag) * velocity / vehicle.mass
        force[2] += float(np.clip(command, 0.0, vehicle.thrust_max).sum()) / vehicle.mass
        return force

    def _take(self, t: float, force: Array, expected: Array, drag: float) -> float:
        """Take a reading (3,) of t [s], and what was ``expected`` (3,), with the deviation of its ``drag`` [m/s^2];
        return the velocity [m/s] by which those in a row were off that are not possible.
        """
        g, lift = self._vehicle.gravity, max(float(expected[2]), 0.0)
        limit = _SHARE * max(lift, g) + self._margin + _DEVIATIONS * drag
        off = float(np.linalg.norm(force - expected))
        possible, near = off <= limit + max(g - lift, 0.0), off <= _NEAR * limit
        self._since = math.inf if possible else min(self._since, t)
        self._count = 0 if possible else self._count + 1
        self._good = min(self._good, t) if near else math.inf
        if self._failed:
            self._failed = t - self._good < _GOOD
        else:
            self._failed = self._count >= _FEWEST and t - self._since >= _LASTING
        return 0.0 if possible else off * (t - self._since)


def unmodelled(mission: QuadrotorMission, dt: float) -> float:
    """Variance [m^2/s^4] of a constant acceleration over dt [s] > 0 that the declared motion lacks."""
    gust = mission.flight.gust
    return (2.0 * gust.time_constant * gust.rms**2 + _UNMODELLED**2) / dt
