"""The plug-in ``inertial_iekf``: the invariant extended Kalman filter on SE_2(3), of an IMU and position fixes.

    R' = R omega^,   v' = R f + g,   p' = v,    gyro = omega + n_g,  accelerometer = f + n_a,  fix = p + n.

With X = (R, v, p) and readings held over dt, X <- Gamma Phi(X) Upsilon, Gamma the effect of gravity, Phi (R, v, p) =
(R, v, p + dt v), an automorphism of the group, and Upsilon what the IMU read. So the error of X = X^ Exp(xi) follows

    xi <- Ad_{Upsilon^-1} F xi,    F the derivative of Phi,

exactly, however large it is and whatever the state: the motion is group affine and its error log-linear (A. Barrau,
S. Bonnabel, IEEE TAC 62(4), 2017, Theorem 2). A fix is a left-invariant observation: R^' (y - p^) = xi_p + R^' n to
first order.

While IMU readings are missing the estimate is propagated by the vehicle's declared motion under its input, with the
declared gusts as its noise; without an input, as in a log of sensors alone, by the last reading, which is trusted less
and less. After a gap that is longer than declared it is DEGRADED until it has converged again; without fixes it is
LOST. Fixes that are off together make it DEGRADED or LOST (see ``integrity.innovations``); once many in a row
contradict it, it goes on from their place. An alarm does not say which sensor is wrong: the covariance becomes as much
larger as the innovations are, that of the biases most (see ``Strapdown.widen``), and the estimate is not OK for 30 s.
What the fixes have leapt by is part of its covariance until they leap back, and it is DEGRADED while they may be late
(``flight_leaps``).
Gyro, accelerometer or fixes that repeat a reading which has noise are stuck, and left out as if they were silent; where
an accelerometer reads what the thrusts cannot do, they take its place (``thrust_test``). A
rotation about the vertical shows in the fixes only while the vehicle accelerates sideways; the initial heading is the
mission's.

The IMU's biases are states where the mission declares their standard deviations. At rest, from the first reading until
the vehicle moves, the gyro reads its own (see ``rest``). In flight the fixes show the gyro's bias about the horizontal
axes and the accelerometer's along the vertical; the gyro's about the vertical while the vehicle accelerates sideways;
and the accelerometer's along the horizontal axes, which act as a tilt does, only once the vehicle has turned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.flight_leap_filters import FixRows
from mathnavi.estimators.flight_leaps import Leaps
from mathnavi.estimators.flight_model import AxisModel
from mathnavi.estimators.integrity.innovations import LATCHED, InnovationMonitor
from mathnavi.estimators.integrity.repeats import StuckImu
from mathnavi.estimators.invariant.hover import first_covariance, imu_deviations, stationary
from mathnavi.estimators.invariant.imu_noise import ImuNoise
from mathnavi.estimators.invariant.lie_groups import SE23, SO3, quaternion
from mathnavi.estimators.invariant.rest import Rest
from mathnavi.estimators.invariant.strapdown import PLACE, SPEED, TURN, Strapdown, propagation
from mathnavi.estimators.invariant.thrust_test import ThrustTest, unmodelled
from mathnavi.estimators.kalman_steps import condition
from mathnavi.estimators.timeout_monitor import FARTHEST, TimeoutMonitor, is_late, waiting, worst
from mathnavi.estimators.velocity.readings import OutlierCounter
from mathnavi.interfaces.bounds import Positive, Probability, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.mission import EstimateQuality
from mathnavi.models.quadrotor.dynamics import ATTITUDE, POSITION, RATE, VELOCITY
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.quaternion import rotation
from mathnavi.models.tolerances import TIME_TOLERANCE

_UNMODELLED_TURN = 0.02  # [rad/s^1.5] likewise, of the angular acceleration
_ASTRAY = 0.3, 10.0  # [m/s^2], [s] of the error of an acceleration by the IMU, of its attitude first of all
_DOUBTED = 30.0  # [s] at least until an estimate is OK again that goes on by fixes which disagreed: they may go back


@configuration
class InertialIekfConfig:
    """Fields of the command line."""

    gate: Probability = 1e-6
    """probability that a good fix is refused"""
    timeout: Positive = 1.0
    """time without a fix after which the estimate is lost [s]"""
    imu_gap: Positive = 0.5
    """time without IMU readings after which the estimate is degraded [s]"""
    fix_floor: Positive = 0.01
    """least standard deviation that the filter assumes for a fix [m]"""
    start_attitude: Positive | None = None
    """standard deviation of the initial attitude about each axis [rad]; that of the stationary filter if not given"""
    start_velocity: Positive | None = None
    """standard deviation of the initial velocity on each axis [m/s]; that of the stationary filter, of a vehicle that
    begins at rest, if not given"""


class InertialIekf:
    """Estimator of attitude, velocity and position from an IMU and position fixes."""

    Config = InertialIekfConfig

    def __init__(self, config: InertialIekfConfig, mission: QuadrotorMission, *, monitored: bool = True) -> None:
        """Without being ``monitored`` its status says how old its readings are, and no more: to compare."""
        self._monitored = monitored
        self.period = mission.control_period
        self._mission, self._counts, self._outlier_counter = mission, ReadingCounts(), OutlierCounter()
        self._fixes = TimeoutMonitor(config.timeout, 1.0 / mission.flight.position_rate, of="fixes")
        # What the gap leaves unknown shows in the fixes.
        self._imu = TimeoutMonitor(
            config.imu_gap, self.period, settling=config.timeout, beyond=Status.DEGRADED, of="IMU readings"
        )
        self._limit = float(chdtri(3, config.gate))
        self._monitor = InnovationMonitor("fixes", 3, 1.0 / mission.flight.position_rate)
        self._agreed = -math.inf  # [s] of the last fix that agreed
        self._begun = self._doubted = -math.inf  # [s] when it began again, and when its fixes began to disagree
        self._stuck_imu = StuckImu((mission.inertial.gyro, mission.inertial.accelerometer))
        self._thrust_test = ThrustTest(mission)
        self._noisy_fixes = mission.flight.position_noise > 0.0
        fix_deviation = _fix_deviation(config, mission)
        self._R = fix_deviation**2 * np.eye(3)
        x, imu = mission.start_state, mission.inertial
        X = SE23.from_parts(rotation(x[ATTITUDE]), x[VELOCITY], x[POSITION])
        self._gravity = np.array([0.0, 0.0, -mission.vehicle.gravity])
        noise = (imu.gyro, imu.accelerometer)
        biases = (imu.gyro_bias, imu.accelerometer_bias)
        _, axis = stationary(mission, config.timeout, fix_deviation)
        P = first_covariance(axis, config.start_attitude, config.start_velocity)
        self._strapdown = Strapdown(X, P, x[RATE], self._gravity, noise, biases)
        self._imu_noise = ImuNoise(self._strapdown.variances)
        at_rest = self._strapdown.has_biases and config.start_velocity is None
        self._rest = Rest(noise, mission.vehicle.gravity) if at_rest else None
        self._innovations = np.full((2, 3), np.nan)  # of the last fix, and their deviations
        self._H = np.eye(3, len(self._strapdown.P), 6)  # a fix reads the position
        self._leaps = Leaps(
            AxisModel(*_ASTRAY, fix_deviation), FixRows(fix_deviation**2), 1.0 / mission.flight.position_rate
        )
        self._since = x[VELOCITY].copy(), math.nan  # [m/s] velocity after the last fix, and its time [s]

    @staticmethod
    def build(config: InertialIekfConfig, mission: QuadrotorMission) -> InertialIekf:
        """Build the estimator of one run."""
        return InertialIekf(config, mission)

    @staticmethod
    def sensors(config: InertialIekfConfig, mission: QuadrotorMission) -> tuple[Sensor, ...]:
        """Sensors that the vehicle has to carry for this estimator."""
        return mission.inertial_sensors()

    @staticmethod
    def quality(config: InertialIekfConfig, mission: QuadrotorMission) -> EstimateQuality:
        """Quality of the stationary filter in hover, along any axis; the gust is not estimated.

        The covariance is that just before a fix; each fix changes the estimate with covariance K S K'. Raises
        FieldError for an IMU with declared biases: in hover nothing bounds the heading, nor what it does to a later
        acceleration.
        """
        if mission.inertial.has_biases:
            raise FieldError(
                f"inertial = {mission.inertial}; allowed where plans are certified from the estimates: biases of 0, "
                "for the heading of a vehicle that hovers is not bounded"
            )
        fix_deviation = _fix_deviation(config, mission)
        interval, before = stationary(mission, config.timeout, fix_deviation)
        correction = np.outer(before[:2, 0], before[:2, 0]) / ((before[0, 0] + fix_deviation**2) * interval)
        error, driving = np.zeros((3, 3)), EstimateQuality.exact(mission.flight.gust).driving
        error[:2, :2] = before[:2, :2]
        driving[:2, :2] += correction
        return EstimateQuality(error, driving)

    @staticmethod
    def properties(config: InertialIekfConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            Domain.LOCAL, Rate.EXPONENTIAL, InputDependence.NON_UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
            note="the heading shows only while the vehicle accelerates sideways",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate of the point mass (6,) [m, m/s] at t [s]; ``command`` (4,) [N] was held since the last call.

        ``extra`` has the ``attitude`` (4,) and the ``rate`` (3,) [rad/s] of the body, the standard deviations
        ``attitude_deviation`` (3,) [rad] about its axes, ``integrity`` (1,), the worst statistic of the fixes over its
        threshold, the IMU's ``bias`` (6,) [rad/s, m/s^2] with its
        ``bias_deviation`` (6,), ``nis`` (2,) of the newest fix with its number of
        components, NaN if none was used, and its ``innovations`` (3,) [m] with their standard deviations
        ``innovation_std`` (3,) [m] (``interfaces.innovations``). It also counts the readings that were not used.
        """
        self._innovations[:] = np.nan
        nis = np.full(2, np.nan)
        strapdown = self._strapdown
        if strapdown.t is None:
            strapdown.t = min([t, *(reading.t for reading in measurements)])
        for reading in sorted(measurements, key=lambda each: (each.t, each.name != "imu")):
            if (reason := self._unused(reading)) is not None:
                self._counts.add(reason)
            elif reading.name == "imu":
                if reading.t - strapdown.t > self._imu.longest:
                    self._coast(reading.t, command)
                h = reading.t - strapdown.t
                if self._monitored:
                    strapdown.read_with(*self._imu_noise.take(reading.t, reading.value))
                if self._monitored and self._thrust_test.replaces(strapdown, reading.t, reading.value, command):
                    self._counts.add(Unused.OUTLIER)
                    continue
                strapdown.propagate(reading.t, reading.value)
                self._stand(reading, h)
                self._imu.note(reading.t)
            else:
                self._coast(reading.t, command)
                nis = self._fix(reading)
        self._coast(t, command)
        R, P = strapdown.X[:3, :3], self._covariance()
        inflation = self._monitor.inflation if self._monitored else 1.0
        extra = {
            "attitude": quaternion(R),
            "rate": strapdown.rate.copy(),
            "attitude_deviation": np.sqrt(inflation * np.diag(strapdown.P)[TURN]),
            "nis": nis,
            **published(self._innovations),
            "integrity": np.array([self._monitor.ratio]),
            "bias": strapdown.bias.copy(),
            "bias_deviation": strapdown.bias_deviation,
            **self._counts.extra,
        }
        x = np.concatenate([strapdown.X[:3, 4], strapdown.X[:3, 3]])
        message, integrity = self._doubts(t) if self._monitored else ("", Status.OK)
        P *= inflation
        if self._monitored and (leapt := self._leaps.covariance) is not None:
            P[:3, :3] += leapt
        status = worst(self._fixes.status(t, strapdown.P), self._imu.status(t, strapdown.P), integrity)
        wanted = "a fix" if self._fixes.t == -math.inf else "IMU readings"
        message = waiting(status, wanted) or message or self._fixes.message or self._imu.message
        return Estimate(t, x, 0.5 * (P + P.T), status, extra, message)

    def _doubts(self, t: float) -> tuple[str, Status]:
        """Message and status at t [s] as far as the fixes agree with the estimate."""
        status = self._monitor.status(t)
        if status is Status.OK and t - self._doubted < _DOUBTED:
            return "goes on by fixes that disagreed with it", Status.DEGRADED
        if status is Status.OK and self._imu_noise.contradicted:
            return "has an IMU that is noisier than declared", Status.DEGRADED
        if status is Status.OK and (doubt := self._leaps.doubt("fixes")):
            return doubt, Status.DEGRADED
        return self._monitor.message, status

    def _unused(self, reading: Measurement) -> Unused | None:
        """Reason why a reading is not used; None for one that is, or is judged by its innovation."""
        if reading.name not in ("imu", "position"):
            return Unused.UNKNOWN_SENSOR
        if is_late(reading.t, self._strapdown.t):
            return Unused.LATE
        if not np.isfinite(reading.value).all():
            return Unused.NOT_FINITE
        return Unused.OUTLIER if self._is_stuck(reading) else None

    def _is_stuck(self, reading: Measurement) -> bool:
        """True for a reading of a sensor with noise that has read the same many times, or the half of an IMU has."""
        if reading.name == "imu":
            return self._stuck_imu.has(reading.value)
        return self._noisy_fixes and self._monitor.note_value(reading.t, reading.value)

    def _coast(self, t: float, command: Array) -> None:
        """Propagate to t [s] without an IMU reading, by the declared motion under the command (4,) [N]."""
        strapdown = self._strapdown
        assert strapdown.t is not None
        dt = t - strapdown.t
        if dt <= TIME_TOLERANCE:
            return
        if (dt > FARTHEST or not command.any()) and strapdown.hold(t, self._mission.flight.acceleration_max):
            return
        X = strapdown.X
        x = np.concatenate([X[:3, 4], quaternion(X[:3, :3]), X[:3, 3], strapdown.rate])
        after = self._mission.flow(x, command, dt)
        moved = SE23.from_parts(rotation(after[ATTITUDE]), after[VELOCITY], after[POSITION])
        turned = SO3.log(X[:3, :3].T @ moved[:3, :3])
        force = moved[:3, :3].T @ ((moved[:3, 3] - X[:3, 3]) / dt - self._gravity)
        _, A = propagation(X, turned / dt, force, self._gravity, dt)
        effect = np.zeros((9, 3))  # of a constant acceleration that the declared motion lacks
        effect[SPEED], effect[PLACE] = dt * np.eye(3), 0.5 * dt * dt * np.eye(3)
        noise = unmodelled(self._mission, dt) * effect @ effect.T
        since, until = (at - strapdown.read for at in (strapdown.t, t))
        wandered = imu_deviations(self._mission)[0] ** 2 * (until**2 - since**2)  # by the error of the last rate
        wandered += _UNMODELLED_TURN**2 * (until**3 - since**3) / 3.0
        noise[TURN, TURN] += wandered * np.eye(3)
        strapdown.carry(moved, A, noise, dt)
        strapdown.rate, strapdown.t = after[RATE].copy(), t

    def _stand(self, reading: Measurement, h: float) -> None:
        """Condition on an IMU reading, h [s] after the one before, of a vehicle that has not moved yet."""
        if self._rest is not None:
            self._rest.take(reading.t, reading.value)
            if self._rest.seen and h > TIME_TOLERANCE:
                self._rest.hold(self._strapdown, reading.value, h)

    def _covariance(self) -> Array:
        """Covariance (6, 6) of position and velocity in the frame of the fixes."""
        R, axes = self._strapdown.X[:3, :3], np.zeros((6, len(self._strapdown.P)))
        axes[:3, PLACE], axes[3:, SPEED] = R, R
        return np.asarray(axes @ self._strapdown.P @ axes.T, np.float64)

    def _moments(self) -> tuple[Array, Array]:
        """Position, velocity and error of the acceleration (9,), and their covariance (9, 9)."""
        X = self._strapdown.X
        P = np.diag(np.full(9, _ASTRAY[0] ** 2))
        P[:6, :6] = self._covariance()
        return np.concatenate([X[:3, 4], X[:3, 3], np.zeros(3)]), P

    def _fix(self, reading: Measurement) -> Array:
        """Take a fix, and follow its leaps; return NIS and its number of components, NaN if it was refused."""
        velocity, since = self._since
        h = reading.t - since
        acceleration = (self._strapdown.X[:3, 3] - velocity) / h if h > TIME_TOLERANCE else np.zeros(3)
        nis = self._condition(reading)
        alarming, surprising = self._monitor.alarming, self._monitor.surprising
        self._leaps.follow(
            reading.t, acceleration, reading.value, self._moments, alarming=alarming, surprising=surprising
        )
        self._since = self._strapdown.X[:3, 3].copy(), reading.t
        return nis

    def _condition(self, reading: Measurement) -> Array:
        """Condition on a fix; return NIS and its number of components, NaN if the fix was refused."""
        X = self._strapdown.X
        off = reading.value - X[:3, 4]
        nu = X[:3, :3].T @ off
        calm = self._doubts(reading.t)[1] is Status.OK
        S = self._H @ self._strapdown.P @ self._H.T + self._R
        R = X[:3, :3]  # from the body's axes, in which S is, to those of a fix
        self._innovations[0], self._innovations[1] = off, np.sqrt((R @ S @ R.T).diagonal())
        self._monitor.note(reading.t, nu, S, self._R)
        if calm and self._monitor.status(reading.t) is not Status.OK:
            self._doubted = reading.t
        d, P, nis = condition(self._strapdown.P, self._H, nu, self._R)
        agrees = nis <= self._limit
        if self._monitored and agrees and self._monitor.ratio > 1.0:
            self._strapdown.widen(self._monitor.inflation)
            self._monitor.begin_again()
            d, P, nis = condition(self._strapdown.P, self._H, nu, self._R)
        if not self._outlier_counter.admits(agrees):
            self._counts.add(Unused.OUTLIER)
            return np.full(2, np.nan)
        self._fixes.note(reading.t, agrees=agrees)
        if agrees:
            self._agreed = reading.t
            self._strapdown.correct(d, P)
        else:
            self._begin_again(reading, nu)
        return np.array([nis, 3.0])

    def _begin_again(self, reading: Measurement, nu: Array) -> None:
        """Take the place of a fix that many in a row contradict the estimate with, nu (3,) [m] off.

        The attitude would turn far if the filter were conditioned on it. The velocity may be off by as much as the
        place since a fix agreed, by no more than the vehicle can fly both ways.
        """
        strapdown = self._strapdown
        if self._monitored and reading.t - self._begun < LATCHED:  # the IMU may be wrong rather than the place
            strapdown.widen(self._monitor.inflation)
        elapsed = max(reading.t - self._agreed, 1.0 / self._mission.flight.position_rate)
        off = min(float(np.linalg.norm(nu)) / elapsed, 2.0 * self._mission.flight.speed_max)
        strapdown.X[:3, 4] = reading.value
        P = strapdown.P
        P[PLACE], P[:, PLACE] = 0.0, 0.0
        P[PLACE, PLACE] = self._R
        P[SPEED, SPEED] += off**2 * np.eye(3)
        self._monitor.begin_again()
        self._agreed = self._begun = reading.t


def _fix_deviation(config: InertialIekfConfig, mission: QuadrotorMission) -> float:
    """Standard deviation [m] that the filter assumes for a fix."""
    return max(mission.flight.position_noise, config.fix_floor)
