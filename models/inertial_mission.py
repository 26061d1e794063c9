"""The task of a device that carries an inertial measurement unit and nothing else: which way is up, and how it turns.

A gyro reads the rate of turn and an accelerometer the specific force. Without a position, what tells gravity from
acceleration is that the device stays about where it is: its place along each horizontal axis is taken for a stationary
process, at rest in the mean, with the standard deviations sigma_p of the place and sigma_v of the velocity and the
spectrum of critical damping,

    S_p(w) = 4 omega^3 sigma_p^2 / (w^2 + omega^2)^2,    omega = sigma_v / sigma_p.

The heading is never seen: it is that of the gyro, from wherever it was at the start.
"""

from __future__ import annotations

from mathnavi.interfaces.bounds import NonNegative, Positive, configuration
from mathnavi.interfaces.protocols import Sensor
from mathnavi.models.quadrotor.mission import InertialQuality, InertialSensor

IMU = "imu"
"""name of the sensor: rate of turn (3,) [rad/s] and specific force (3,) [m/s^2] in the axes of the device"""
STATES = ("attitude w [-]", "attitude x [-]", "attitude y [-]", "attitude z [-]")
"""names of what is estimated: the quaternion that leads from the axes of the device to those of a world with z up"""

CALIBRATED = InertialQuality(0.005, 0.05, 0.01, 0.05)
"""errors of a micromechanical unit whose scale and axes were calibrated"""


@configuration
class InertialMission:
    """A device with an inertial measurement unit that moves about a place."""

    inertial: InertialQuality = CALIBRATED
    """errors of the unit; biases of the gyro are estimated, those of the accelerometer widen the covariance"""
    gyro_scale: NonNegative = 0.005
    """standard deviation of the error of the gyro's scale and of the alignment of its axes, as a share of the rate"""
    region: Positive = 0.3
    """standard deviation of the place along each horizontal axis, about the middle of the motion [m]"""
    speed: Positive = 1.0
    """standard deviation of the velocity along each horizontal axis [m/s]"""
    delay: NonNegative = 0.0
    """time by which readings tell of an earlier motion than their stamps say, as behind a low-pass filter [s]"""
    stamps: NonNegative = 0.002
    """standard deviation of the time between the stamps and what they tell of, beyond the delay [s]"""
    rate_max: Positive = 35.0
    """rate about an axis at which the gyro saturates [rad/s]; 2000 deg/s"""
    force_max: Positive = 157.0
    """specific force along an axis at which the accelerometer saturates [m/s^2]; 16 times gravity"""
    gravity: Positive = 9.81
    """acceleration of free fall [m/s^2]"""
    period: Positive = 0.01
    """time between readings [s]"""

    @property
    def input_size(self) -> int:
        """Number 0 of inputs."""
        return 0

    @property
    def corner(self) -> float:
        """Corner frequency omega [rad/s] of the motion."""
        return self.speed / self.region

    @property
    def motion_densities(self) -> tuple[float, float, float]:
        """Densities of the noises with which place, velocity and acceleration are read as zero.

        White noises of these densities [m^2 s, m^2/s, m^2/s^3] give the likelihood of the motion: 1 / S_p(w) is a sum
        of w^0, w^2 and w^4.
        """
        omega = self.corner
        return 4.0 * self.region**2 / omega, 2.0 * self.speed**2 / omega, 4.0 * self.speed**2 * omega

    def sensors_carried(self) -> tuple[Sensor, ...]:
        """Make the sensors of one run: "imu" (6,), without biases."""
        return (InertialSensor(self.inertial, self.gravity, 1.0 / self.period, name=IMU),)
