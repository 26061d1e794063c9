"""The task of one quadrotor: that of the point mass above it, and the assumed parameters of the vehicle that flies it.

The flight planner and its certificate see ``flight``, the double integrator with its bounds; the tracker and the
estimator see the quadrotor. It holds no truth of a run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mathnavi.interfaces.bounds import NonNegative, configuration
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.aerial.mission import EstimateQuality, FlightMission, PositionSensor
from mathnavi.models.quadrotor.dynamics import (
    ATTITUDE,
    NOMINAL,
    POSITION,
    RATE,
    ROTOR_COUNT,
    STATE_SIZE,
    Quadrotor,
    at_rest,
    flow,
)
from mathnavi.models.quaternion import rotation

_STIFF = 1e-2  # [rad, rad/s] assumed error of attitude and rate of a propagated reading, per second


@configuration(prefix="{name} sensor: ")
class QuadrotorStateSensor:
    """Sensor of the state (13,) of ``mathnavi.models.quadrotor.dynamics``: the position with a noise uniform in a cube,
    the rest exact.

    Section A.7 of the thesis draws the position noise from U(-w, w) on each axis; w = sqrt(3) position_noise.
    """

    position_noise: NonNegative = 0.0  # [m] standard deviation on each axis
    rate: float | None = None  # [Hz]; None: every control step
    name: str = "full_state"
    size: int = STATE_SIZE
    quaternions: ClassVar[tuple[slice, ...]] = (ATTITUDE,)

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the state (13,) of ``motion``; ``rng`` draws the noise."""
        x = motion.x
        if self.position_noise > 0.0:
            half_width = math.sqrt(3.0) * self.position_noise
            x[POSITION] += rng.uniform(-half_width, half_width, 3)
        return x


@configuration
class InertialQuality:
    """Declared errors of an inertial measurement unit about or along each axis, as standard deviations."""

    gyro: NonNegative = 0.005  # [rad/s] of each reading
    accelerometer: NonNegative = 0.05  # [m/s^2] of each reading
    gyro_bias: NonNegative = 0.0  # [rad/s] of what all readings have in common
    accelerometer_bias: NonNegative = 0.0  # [m/s^2] likewise

    @property
    def has_biases(self) -> bool:
        """True if biases are declared."""
        return self.gyro_bias > 0.0 or self.accelerometer_bias > 0.0


NOMINAL_IMU = InertialQuality()


@configuration(prefix="{name} sensor: ")
class InertialSensor:
    """IMU: body rate (3,) [rad/s] and specific force (3,) [m/s^2] in the body frame.

    omega + b_g + n_g and R' (a + g e_z) + b_a + n_a, a being the acceleration over the last tick, gusts included.
    """

    quality: InertialQuality = NOMINAL_IMU
    gravity: NonNegative = NOMINAL.gravity  # [m/s^2] g
    rate: float | None = 1.0 / TICK  # [Hz]
    bias: tuple[float, ...] = (0.0,) * 6  # [rad/s, m/s^2] b_g and b_a
    name: str = "imu"
    size: int = 6

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read rate and specific force (6,) of ``motion``; ``rng`` draws the noise."""
        x, n = motion.x, rng.standard_normal(6)
        force = motion.acceleration[:3] + np.array([0.0, 0.0, self.gravity])
        gyro = x[RATE] + self.quality.gyro * n[:3]
        read: Array = np.concatenate([gyro, rotation(x[ATTITUDE]).T @ force + self.quality.accelerometer * n[3:]])
        read += np.array(self.bias)
        return read


@dataclass(frozen=True, eq=False)
class QuadrotorMission:
    """Flight mission of a point mass that a quadrotor flies; a ``FullStateMission`` (``estimators.full_state``) too."""

    state_names: ClassVar[tuple[str, ...]] = (
        *("position_x [m]", "position_y [m]", "position_z [m]"),
        *("attitude_w [-]", "attitude_x [-]", "attitude_y [-]", "attitude_z [-]"),
        *("velocity_x [m/s]", "velocity_y [m/s]", "velocity_z [m/s]"),
        *("rate_x [rad/s]", "rate_y [rad/s]", "rate_z [rad/s]"),
    )

    flight: FlightMission
    vehicle: Quadrotor = NOMINAL  # the assumed one
    inertial: InertialQuality = NOMINAL_IMU

    @property
    def control_period(self) -> float:
        """Period [s] of estimator and tracker."""
        return self.flight.control_period

    @property
    def input_size(self) -> int:
        """Number of inputs: the thrusts of the rotors."""
        return ROTOR_COUNT

    @property
    def start_state(self) -> Array:
        """State (13,) at t = 0: at rest, level, the nose towards the target."""
        x = at_rest(np.array(self.flight.start))
        east, north = (b - a for a, b in zip(self.flight.start[:2], self.flight.target[:2], strict=True))
        half = 0.5 * math.atan2(north, east)
        x[ATTITUDE] = math.cos(half), 0.0, 0.0, math.sin(half)
        return x

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """State (13,) after the thrusts u (4,) [N] acted for dt [s] from x (13,), in still air."""
        return flow(self.vehicle, x, u, dt)

    def inertial_sensors(self) -> tuple[InertialSensor, PositionSensor]:
        """Make the IMU, read at every tick of the physics, and the position fixes of the flight mission."""
        fixes = PositionSensor(self.flight.position_noise, self.flight.position_rate)
        return InertialSensor(self.inertial, self.vehicle.gravity), fixes

    def full_state_sensor(self, rate: float | None) -> QuadrotorStateSensor:
        """Sensor that reads the whole state ``rate`` times a second, or at every control step if it is None."""
        return QuadrotorStateSensor(self.flight.position_noise, rate)

    def full_state_covariance(self, age: float) -> Array:
        """Covariance (13, 13) of a reading propagated for ``age`` [s]: that of the point mass, small for the rest."""
        point = self.flight.full_state_covariance(age)
        covariance = np.zeros((STATE_SIZE, STATE_SIZE))
        place = [0, 1, 2, 7, 8, 9]
        covariance[np.ix_(place, place)] = point
        rest = [k for k in range(STATE_SIZE) if k not in place]
        covariance[rest, rest] = (_STIFF * age) ** 2
        return covariance

    def full_state_quality(self, rate: float | None, timeout: float) -> EstimateQuality:
        """Quality of the readings of the point mass, ``rate`` [Hz] times a second and lost after ``timeout`` [s]."""
        return self.flight.full_state_quality(rate, timeout)
