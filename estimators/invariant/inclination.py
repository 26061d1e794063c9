"""The plug-in ``inertial_attitude``: the attitude of a device from its gyro and accelerometer alone.

    q' = q omega / 2,   v' = R f + g,   p' = v,    gyro = omega + b + n_g,  accelerometer = f + n_a.

What tells gravity from acceleration is the declared motion: the device moves about a place (``InertialMission``), so
its place, velocity and acceleration along the horizontal axes are read as zero, with white noises whose densities make
the likelihood that of the motion. The error of the attitude is right-invariant, which makes the filter linear and the
heading, which nothing shows, a component that no reading touches; see ``inclination_kernels``.

A reading of the gyro is the mean rate since the reading before. Its noise is that declared and, larger in motion, the
error of its scale and of the alignment of its axes: s |omega|, which stays the same for about as long as the motion,
1 / omega_c of its corner frequency, and so has the density 2 s^2 |omega|^2 / omega_c. The gyro's bias is a state,
which rest shows, at any time (see ``quiet``), and motion, about horizontal axes, slowly. The bias of the accelerometer
tilts the vertical by its share of g, and nothing shows it: it only widens the covariance, and so do uncertain stamps,
of a device that turns.

    INITIALISING   until the vertical is known to 0.1 rad about each axis
    DEGRADED       after a gap, until it is again; while velocities are larger than declared
    LOST           without readings for ``timeout``

A gyro or an accelerometer with noise that reads the same for a tenth of a second is stuck: then nothing is read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.integrity.repeats import STUCK, Repeats
from mathnavi.estimators.invariant.inclination_kernels import (
    ACCELERATION,
    GRAVITY,
    GYRO,
    HEADING,
    PLACE,
    READING,
    REST,
    SCALE,
    SPEED,
    STATES,
    WALK,
    quaternion_covariance,
    step,
    turned,
)
from mathnavi.estimators.invariant.lie_groups import quaternion
from mathnavi.estimators.invariant.quiet import QuietWindow
from mathnavi.estimators.invariant.strapdown import WALK as WALKS_FOR
from mathnavi.estimators.invariant.strapdown import trusted
from mathnavi.estimators.timeout_monitor import FARTHEST, TimeoutMonitor, is_late, worst
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.inertial_mission import IMU, InertialMission
from mathnavi.models.quaternion import rotation
from mathnavi.models.tolerances import TIME_TOLERANCE

_UNKNOWN_HEADING = math.pi**2 / 3.0  # [rad^2] variance of an angle that may be any
_LONGEST = 2.1  # periods between readings, one of which was lost, with some jitter
_TURN_CHANGES = 2.0  # [rad^2/s^3] density of the change of the rate of turn in a gap: 1 rad/s in half a second
_FORGOTTEN = 0.3  # [rad] standard deviation of the inclination from which on a reading says more
_CREEP, _CREEPS_FOR = 0.01, 0.5  # [m/s] standard deviation of the velocity at rest, and for how long it is the same [s]
APART = 3.0
"""time between two tests of the velocity over 1 / omega_c, after which velocities are nearly independent"""
_STUCK = 0.1  # [s] for which a sensor with noise reads the same, several times at least, until it is stuck


@configuration
class InertialAttitudeConfig:
    """Fields of the command line."""

    found: Positive = 0.1
    """standard deviation of the inclination about each axis at which it is known [rad]"""
    timeout: Positive = 0.5
    """time without readings after which the estimate is lost [s]"""


class InertialAttitude:
    """Estimator of the attitude from a gyro and an accelerometer: inclination, and heading relative to the start."""

    Config = InertialAttitudeConfig

    def __init__(self, config: InertialAttitudeConfig, mission: InertialMission, *, monitored: bool = True) -> None:
        """The filter; without its tests of velocities and of stuck readings unless it is ``monitored``."""
        self.period = mission.period
        self._mission, self._config, self._counts = mission, config, ReadingCounts()
        imu = mission.inertial
        gyro, _ = trusted((imu.gyro, imu.accelerometer))
        place, speed, acceleration = mission.motion_densities
        parameters = np.empty(9)
        parameters[GYRO] = gyro**2 * mission.period
        parameters[SCALE] = 2.0 * mission.gyro_scale**2 / mission.corner
        parameters[WALK] = imu.gyro_bias**2 / WALKS_FOR
        parameters[PLACE], parameters[SPEED], parameters[ACCELERATION] = place, speed, acceleration
        parameters[REST] = min(2.0 * _CREEP**2 * _CREEPS_FOR, speed)
        parameters[READING], parameters[GRAVITY] = gyro**2, mission.gravity
        self._parameters = parameters
        self._tilt = (imu.accelerometer_bias / mission.gravity) ** 2  # [rad^2] that the accelerometer's bias makes
        self._readings = TimeoutMonitor(config.timeout, mission.period, of="IMU readings")
        self._monitor = InnovationMonitor("velocities", 2, APART / mission.corner)
        self._tested = -math.inf  # [s] when the velocity was last tested
        self._innovations = np.full((2, 2), np.nan)  # of that test in the last call, and their deviations
        self._quiet = QuietWindow(imu, mission.period)
        self._t: float | None = None  # [s] of the state; None before the first reading
        self._q, self._motion, self._bias = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(4), np.zeros(3)
        self._P = np.zeros((STATES, STATES))
        self._rate = np.zeros(3)  # [rad/s] of the last reading
        self._at_rest, self._found, self._gap = False, False, False
        self._noisy = imu.gyro > 0.0, imu.accelerometer > 0.0
        self._monitored, self._repeats = monitored, (Repeats(), Repeats())
        self._most = max(STUCK, round(_STUCK / mission.period))  # repetitions

    @staticmethod
    def build(config: InertialAttitudeConfig, mission: InertialMission) -> InertialAttitude:
        """Build the estimator of one run."""
        return InertialAttitude(config, mission)

    @staticmethod
    def sensors(config: InertialAttitudeConfig, mission: InertialMission) -> tuple[Sensor, ...]:
        """Sensors that the device has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: InertialAttitudeConfig, mission: InertialMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: InertialAttitudeConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            Domain.LOCAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.GLOBAL, Domain.GLOBAL, stays_on_truth=False,
            note="the inclination, not the heading; acceleration that lasts tilts it, as far as the declared motion "
            "allows",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate of the attitude, a quaternion (4,), at t [s]; there is no input.

        The covariance (4, 4) is that of its components; the heading's part is that of an unknown one. ``extra`` has
        ``attitude_deviation`` (3,), standard deviations about the axes of the world [rad], the last the heading's,
        the ``rate`` (3,) [rad/s], the gyro's ``bias`` (3,) [rad/s] with its ``bias_deviation`` (3,), ``at_rest`` (1,),
        and ``integrity`` (1,), the worst statistic of the velocities over its threshold. ``innovations`` (2,) [m/s] and
        ``innovation_std`` (2,) [m/s] are those of the horizontal velocity that the readings add up to, about the mean
        of the declared motion, zero, at the times when that is tested (``interfaces.innovations``). It also counts the
        readings that were not used.
        """
        self._innovations[:] = np.nan
        for reading in sorted(measurements, key=lambda each: each.t):
            if (reason := self._unused(reading)) is not None:
                self._counts.add(reason)
            else:
                self._take(reading.t, reading.value)
        return self._estimate(t)

    def _unused(self, reading: Measurement) -> Unused | None:
        if reading.name != IMU:
            return Unused.UNKNOWN_SENSOR
        if self._t is not None and (is_late(reading.t, self._t) or reading.t - self._t <= TIME_TOLERANCE):
            return Unused.LATE
        if not np.isfinite(reading.value).all():
            return Unused.NOT_FINITE
        largest = np.abs(reading.value)
        saturated = largest[:3].max() >= self._mission.rate_max or largest[3:].max() >= self._mission.force_max
        return Unused.OUTLIER if saturated or self._is_stuck(reading.value) else None

    def _is_stuck(self, reading: Array) -> bool:
        """True for a reading of which the gyro or the accelerometer has read the same again and again."""
        repeats = [each.take(part) for each, part in zip(self._repeats, (reading[:3], reading[3:]), strict=True)]
        return self._monitored and any(
            noisy and count >= self._most for noisy, count in zip(self._noisy, repeats, strict=True)
        )

    def _take(self, t: float, reading: Array) -> None:
        """Move to t [s] by a reading (6,), and condition."""
        h = math.inf if self._t is None else t - self._t
        self._readings.note(t)
        self._t, self._rate = t, reading[:3] - self._bias
        if h > FARTHEST:
            variances = np.full(3, self._mission.inertial.gyro_bias**2)
            self._bias, self._P[7:, 7:] = np.zeros(3), np.diag(variances)
            self._begin(reading[3:])
            return
        if h > _LONGEST * self._mission.period and self._bridge(h):
            self._begin(reading[3:])
            return
        self._at_rest = self._quiet.take(reading)
        still = self._quiet.oldest
        step(self._q, self._motion, self._bias, self._P, reading, h, self._at_rest, still, self._parameters)
        if self._found and t - self._tested >= APART / self._mission.corner - TIME_TOLERANCE:
            self._tested = t
            R = self._mission.speed**2 * np.eye(2)
            nu, S = self._motion[:2].copy(), self._P[3:5, 3:5] + R
            self._innovations[0], self._innovations[1] = nu, np.sqrt(S.diagonal())
            self._monitor.note(t, nu, S, R)
            self._monitor.note_state(t, float(nu @ np.linalg.solve(S, nu)), "a velocity")
        if not self._found and self._is_known():
            self._found, self._gap = True, False

    def _begin(self, force: Array) -> None:
        """Begin with the vertical along a specific force (3,), as far as the declared accelerations allow.

        What is known of the gyro's bias stays.
        """
        length = float(np.linalg.norm(force))
        up = force / length if length > TIME_TOLERANCE else np.array([0.0, 0.0, 1.0])
        aside = np.eye(3)[int(np.argmin(np.abs(up)))]
        forward = aside - (aside @ up) * up
        forward /= np.linalg.norm(forward)
        self._q = quaternion(np.array([forward, np.cross(up, forward), up]))
        mission = self._mission
        self._found, self._gap = False, self._gap or self._found
        acceleration = mission.speed * mission.corner
        tilt = min(math.hypot(acceleration, mission.inertial.accelerometer) / mission.gravity, 0.5 * math.pi)
        self._P[:3], self._P[:, :3] = 0.0, 0.0
        self._P[0, 0] = self._P[1, 1] = tilt**2
        self._P[HEADING, HEADING] = _UNKNOWN_HEADING
        self._monitor.begin_again()
        self._forget_motion()

    def _bridge(self, h: float) -> bool:
        """Prepare for a gap of h [s]: the device may have turned otherwise than evenly, and moved anyhow.

        True if so little is left of what was known of the vertical that the filter is to begin again.
        """
        for k in range(3):
            self._P[k, k] += _TURN_CHANGES * h**3 / 3.0
        self._P[HEADING, HEADING] = min(self._P[HEADING, HEADING], _UNKNOWN_HEADING)
        self._forget_motion()
        self._gap = self._gap or self._found
        self._found = self._is_known()
        return bool(max(self._P[0, 0], self._P[1, 1]) > _FORGOTTEN**2)

    def _forget_motion(self) -> None:
        """Take the declared motion for what is known of velocity and place."""
        self._quiet.clear()
        self._motion[:] = 0.0
        self._P[3:7], self._P[:, 3:7] = 0.0, 0.0
        for k in (0, 1):
            self._P[3 + k, 3 + k], self._P[5 + k, 5 + k] = self._mission.speed**2, self._mission.region**2

    def _is_known(self) -> bool:
        return bool(max(self._P[0, 0], self._P[1, 1]) <= self._config.found**2)

    def _estimate(self, t: float) -> Estimate:
        """Estimate at t [s], by the last rate from the time that the readings tell of."""
        mission = self._mission
        ahead = 0.0 if self._t is None else t - self._t + mission.delay
        q = turned(self._q, ahead * self._rate)
        P = self._P[:3, :3].copy()
        if self._t is None:
            P = _UNKNOWN_HEADING * np.eye(3)
        else:
            P[0, 0] += self._tilt
            P[1, 1] += self._tilt
            turning = rotation(q) @ self._rate
            P += mission.stamps**2 * np.outer(turning, turning)
            P += _TURN_CHANGES * max(ahead, 0.0) ** 3 / 3.0 * np.eye(3)
        P[HEADING, HEADING] = min(P[HEADING, HEADING], 2.0 * _UNKNOWN_HEADING)
        P[:2, :2] *= self._monitor.inflation if self._monitored else 1.0
        status, message = self._status(t)
        extra = {
            "attitude_deviation": np.sqrt(np.diag(P)),
            "rate": self._rate.copy(),
            "bias": self._bias.copy(),
            "bias_deviation": np.sqrt(np.diag(self._P)[7:]),
            "at_rest": np.array([float(self._at_rest)]),
            "integrity": np.array([self._monitor.ratio]),
            **published(self._innovations),
            **self._counts.extra,
        }
        return Estimate(t, q, quaternion_covariance(q, P), status, extra, message)

    def _status(self, t: float) -> tuple[Status, str]:
        status = self._readings.status(t)
        if status is Status.INITIALISING:
            return status, "waits for IMU readings"
        if not status.usable:
            return status, self._readings.message
        if not self._found:
            if not self._gap:
                return Status.INITIALISING, "waits for the vertical to be known"
            return Status.DEGRADED, "does not know the vertical after a gap"
        if not self._monitored:
            return status, self._readings.message
        return worst(status, self._monitor.status(t)), self._monitor.message or self._readings.message
