"""The plug-in ``floating_base_iekf``: a mechanism whose base carries an IMU and whose joints carry encoders.

The base is found by an invariant extended Kalman filter on SE_2(3), X = (R, v, p) of the IMU, see ``inertial``; no
sensor reads its pose. While a foot stands, that is, its switch is closed in consecutive readings, its velocity is that
of the ground, zero (M. Bloesch et al., State Estimation for Legged Robots, RSS 2012; R. Hartley et al., IJRR 39(4),
2020): with the foot's lowest point at p_f of the base, J its Jacobian there and q^ the joints,

    0 = R_b' v_b + omega x p_f + J q^',    z = R' v = what that leaves,    z - R^' v^ = xi_v + (R^' v^) x xi_R + n.

So the velocity of the base, and with it the attitude relative to gravity, is observable while a foot stands; position
and heading never are: they drift. In the air everything but the rate is integrated and drifts; ``base_deviation`` says
by how much, and the estimate is lost once the velocity's standard deviation exceeds a limit. Without IMU readings the
last one is held, and trusted less and less. What a gap that is longer than declared leaves unknown of position and
heading is never found again: the estimate stays DEGRADED. So it is after an IMU has contradicted the feet (``feet``).

The IMU's biases are states where their standard deviations are given. A base that begins at rest reads those of its
gyro (see ``rest``). While a foot stands, the velocity shows the gyro's about the horizontal axes and the
accelerometer's along the vertical, and along the horizontal axes once the base has turned; the gyro's about the
vertical shows at rest alone.

Another plug-in estimates the joints' velocities; it gets the estimated pose of the base as if it had been read, which
it does not test. Forces of the ground on feet are in no model: while what the encoders read contradicts an observer
with one, ``filtered_differences`` of what they read take its place, which run beside it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import mujoco
import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.integrity.repeats import StuckImu
from mathnavi.estimators.invariant import strapdown
from mathnavi.estimators.invariant.feet import SLIPS_FOR, FootWitness
from mathnavi.estimators.invariant.lie_groups import SE23, SO3, quaternion
from mathnavi.estimators.invariant.rest import Rest
from mathnavi.estimators.invariant.strapdown import Strapdown
from mathnavi.estimators.kalman_steps import condition
from mathnavi.estimators.riemannian.plugin import RiemannianObserver
from mathnavi.estimators.timeout_monitor import TimeoutMonitor, waiting, worst
from mathnavi.estimators.velocity.filtered_differences import FilteredDifferences
from mathnavi.estimators.velocity.momentum import MomentumObserver
from mathnavi.estimators.velocity.position_observer import PositionObserver
from mathnavi.estimators.velocity.possible import possible_or_lost
from mathnavi.interfaces.bounds import NonNegative, Positive, Probability, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.cross_product import cross
from mathnavi.models.manifold.mission import POSITION, LagrangianMission
from mathnavi.models.mechanism.floating_base import (
    ATTITUDE,
    FEET,
    IMU,
    JOINT_POSITIONS,
    JOINT_RATES,
    JOINTS,
    PLACE,
    RATE,
    VELOCITY,
    BaseImu,
    FloatingBase,
    FootSwitches,
    JointEncoders,
)
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.quaternion import rotation
from mathnavi.models.tolerances import TIME_TOLERANCE

JointObserverName = Literal["riemannian_observer", "momentum_observer", "filtered_differences"]

_LASTING_SLIP = 0.1  # of a foot's slip velocity, as of one that rolls, which stays the same for good
_OBSERVERS: Mapping[str, Any] = {
    "riemannian_observer": RiemannianObserver,
    "momentum_observer": MomentumObserver,
    "filtered_differences": FilteredDifferences,
}


@configuration
class FloatingBaseIekfConfig:
    """Fields of ``--estimator``."""

    joints: JointObserverName = "riemannian_observer"
    """plug-in that estimates the velocities of the joints, while encoders do not contradict it"""
    start_attitude: Positive = 0.02
    """standard deviation of the base's initial attitude, about each axis [rad]"""
    start_velocity: Positive = 0.05
    """standard deviation of the base's initial velocity, along each axis [m/s]"""
    start_position: Positive = 0.01
    """standard deviation of the base's initial position, along each axis [m]"""
    gyro_bias: NonNegative = 0.0
    """standard deviation of the gyro's bias about each axis [rad/s]; 0 for a gyro without"""
    accelerometer_bias: NonNegative = 0.0
    """standard deviation of the accelerometer's bias along each axis [m/s^2]; 0 for one without"""
    slip: Positive = 0.05
    """standard deviation of the velocity of a foot that stands, along each axis [m/s]"""
    gate: Probability = 1e-4
    """probability that a standing foot is taken for a sliding one"""
    deviation_max: Positive = 0.5
    """standard deviation of the base's velocity, in its worst direction, beyond which the estimate is lost [m/s]"""
    timeout: Positive = 0.5
    """time without IMU readings, or without encoder readings, after which the estimate is lost, or without readings of
    the foot switches after which it is degraded [s]"""


class FloatingBaseIekf:
    """Estimator of a mechanism's full state from an IMU on its base, foot switches and encoders."""

    Config = FloatingBaseIekfConfig

    def __init__(self, config: FloatingBaseIekfConfig, mission: LagrangianMission, *, monitored: bool = True) -> None:
        """Without being ``monitored`` its IMU is not tested: to compare."""
        self.period = mission.period
        self._config, self._mission, self._base = config, mission, _base_of(mission)
        self._data = mujoco.MjData(self._base.model)
        self._imu = TimeoutMonitor(config.timeout, mission.period, of="IMU readings")
        self._switches = TimeoutMonitor(
            config.timeout, mission.period, beyond=Status.DEGRADED, of="readings of foot switches"
        )
        self._limit = float(chdtri(3, config.gate))
        self._witness = FootWitness(config.slip) if monitored else None
        noise = (self._base.gyro, self._base.accelerometer)
        x = mission.start_state
        nq, R = self._base.model.nq, rotation(x[ATTITUDE])
        v, omega = x[nq:][VELOCITY], x[nq:][RATE]
        self._stuck_imu = StuckImu(noise if monitored else (0.0, 0.0))
        X = SE23.from_parts(
            R @ self._base.mounting, v + R @ cross(omega, self._base.offset), x[PLACE] + R @ self._base.offset
        )
        starts = (config.start_attitude, config.start_velocity, config.start_position)
        P = np.diag(np.repeat(np.square(starts), 3))
        biases = (config.gyro_bias, config.accelerometer_bias)
        self._strapdown = Strapdown(X, P, self._base.mounting.T @ omega, self._base.gravity, noise, biases)
        at_rest = self._strapdown.has_biases and not x[nq:].any()
        self._rest = Rest(noise, float(np.linalg.norm(self._base.gravity))) if at_rest else None
        self._joints = x[JOINT_POSITIONS.start : nq].copy()
        self._observer: PositionObserver | None = None
        self._differences: PositionObserver | None = None  # in its place
        if self._base.has_joints:
            plugin = _OBSERVERS[config.joints]
            self._observer = plugin.build(plugin.Config(timeout=config.timeout), mission)
            if plugin is not FilteredDifferences:
                own = FilteredDifferences.Config(timeout=config.timeout)
                self._differences = FilteredDifferences.build(own, mission)
            for each in (self._observer, self._differences):
                if each is not None:
                    each.ignore(slice(JOINT_RATES.start))  # the base is estimated, not read
        self._since = math.nan  # [s] of the first call
        self._counts = ReadingCounts() if self._observer is None else self._observer.counts
        self._joint_rates = np.zeros(self._base.model.nv - JOINT_RATES.start)
        self._stood = np.zeros(len(self._base.feet), dtype=bool)
        self._contact_t = 0.0  # [s] of the last reading of the switches
        self._standing = np.zeros(len(self._base.feet))

    @staticmethod
    def build(config: FloatingBaseIekfConfig, mission: LagrangianMission) -> FloatingBaseIekf:
        """Build the estimator of one run. Raises FieldError for a system without a floating base, or without an IMU."""
        return FloatingBaseIekf(config, mission)

    @staticmethod
    def sensors(config: FloatingBaseIekfConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the mechanism has to carry for this estimator."""
        base = _base_of(mission)
        sensors: list[Sensor] = [BaseImu(base, 1.0 / float(base.model.opt.timestep))]
        if base.has_joints:
            sensors.append(JointEncoders(mission.sensor))
        if base.feet:
            sensors.append(FootSwitches(base, 1.0 / mission.period))
        return tuple(sensors)

    @staticmethod
    def quality(config: FloatingBaseIekfConfig, mission: LagrangianMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: FloatingBaseIekfConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            Domain.LOCAL, Rate.NONE, InputDependence.NON_UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
            note="velocity and attitude relative to gravity while a foot stands; not its position and heading",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (nq + nv,) at t [s]; ``command`` (nu,) was held since the last call.

        ``extra`` has ``base_deviation`` (9,), standard deviations of the attitude about the IMU's axes [rad], of its
        velocity [m/s] and of its position [m] along those of the world, the IMU's ``bias`` (6,) [rad/s, m/s^2] with
        its ``bias_deviation`` (6,), ``standing`` (k,), 1 for each foot whose velocity was used, and the extra arrays of
        the joints' observer. It also counts the readings that were not used; a standing foot that slides, and a reading
        of an IMU that repeats itself, count as outliers.
        """
        self._standing[:] = 0.0
        self._since = t if math.isnan(self._since) else self._since
        order = {IMU: 0, JOINTS: 1, FEET: 2}
        known = [reading for reading in measurements if self._is_known(reading, order)]
        joints: list[Measurement] = []
        for reading in sorted(known, key=lambda each: (each.t, order[each.name])):
            if reading.name == IMU:
                self._hold(reading.t)
                self._propagate(reading)
                self._imu.note(reading.t)
            elif reading.name == JOINTS:
                self._joints = reading.value
                joints.append(Measurement(POSITION, reading.t, self._position()))
            else:
                self._stand(reading)
        self._hold(t)
        status, extra = self._base_status(t), dict(self._counts.extra)
        message = waiting(status, "IMU readings")
        if self._observer is not None:
            within = self._observer.update(t, joints, command)
            extra = dict(within.extra)
            if self._differences is not None:
                plain = self._differences.update(t, joints, command)
                if plain.status is Status.OK and within.status is not Status.OK:
                    within, extra = plain, extra | {name: plain.extra[name] for name in ("deviation", "integrity")}
            nq = self._base.model.nq
            self._joints, self._joint_rates = within.x[:nq][JOINT_POSITIONS], within.x[nq:][JOINT_RATES]
            message = message or within.message
            status = worst(status, within.status)
        if self._witness is not None:
            agreement, doubt = self._witness.doubt(t)
            status, message = worst(status, agreement), doubt or message
        deviation = self._deviation(t)
        if not deviation[strapdown.SPEED].max() <= self._config.deviation_max:
            status = worst(status, Status.LOST)
            message = message or f"knows its speed to {deviation[strapdown.SPEED].max():.3g} m/s only, one sigma"
        extra |= {"base_deviation": deviation, "standing": self._standing.copy()}
        extra |= {"bias": self._strapdown.bias.copy(), "bias_deviation": self._strapdown.bias_deviation}
        message = message or self._imu.message or self._switches.message
        return possible_or_lost(self._mission, Estimate(t, self._state(), None, status, extra, message))

    def _is_known(self, reading: Measurement, order: Mapping[str, int]) -> bool:
        """True for a reading of one of its sensors that is finite and not late; others are counted."""
        reason = None
        if reading.name not in order:
            reason = Unused.UNKNOWN_SENSOR
        elif not np.isfinite(reading.value).all():
            reason = Unused.NOT_FINITE
        elif reading.name == IMU and reading.t < self._imu.t - TIME_TOLERANCE:
            reason = Unused.LATE
        elif reading.name == IMU and self._stuck_imu.has(reading.value):
            reason = Unused.OUTLIER
        if reason is not None:
            self._counts.add(reason)
        return reason is None

    def _propagate(self, reading: Measurement) -> None:
        """Propagate by a reading of the IMU, and condition on it while the base has not moved yet."""
        own = self._strapdown
        h = 0.0 if own.t is None else reading.t - own.t
        own.propagate(reading.t, reading.value)
        if self._rest is not None:
            self._rest.take(reading.t, reading.value)
            if self._rest.seen and h > TIME_TOLERANCE:
                self._rest.hold(own, reading.value, h)

    def _hold(self, t: float) -> None:
        """Propagate to t [s] by the last reading of the IMU once it is older than declared."""
        now = self._strapdown.t
        if now is not None and t > now + TIME_TOLERANCE and t - self._imu.t > self._imu.longest + TIME_TOLERANCE:
            self._strapdown.hold(t, float(np.linalg.norm(self._base.gravity)))

    def _base_status(self, t: float) -> Status:
        """Status at t [s] as far as the base is concerned."""
        P = self._strapdown.P
        switches = self._switches.status(t, P)
        if switches is Status.INITIALISING:  # a base without feet, or before their first reading
            switches = Status.OK
        return worst(self._imu.status(t, P), switches)

    def events(self) -> list[tuple[str, str]]:
        """Return the kinds and messages of what has happened since the last call."""
        return [] if self._observer is None else self._observer.events()

    def _stand(self, reading: Measurement) -> None:
        """Condition on the velocities of the feet that stand by a reading of their switches."""
        h = reading.t - self._contact_t
        if h < -TIME_TOLERANCE:
            self._counts.add(Unused.LATE)
            return
        standing = reading.value > 0.5
        still, self._stood = standing & self._stood, standing
        self._contact_t = reading.t
        self._switches.note(reading.t)
        if not still.any() or h <= TIME_TOLERANCE:
            return
        base, data, model = self._base, self._data, self._base.model
        data.qpos[:] = 0.0
        data.qpos[3] = 1.0
        data.qpos[JOINT_POSITIONS] = self._joints
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        omega = base.mounting @ self._strapdown.rate
        fall = base.mounting @ self._strapdown.X[:3, :3].T @ base.gravity
        down, J = fall / max(float(np.linalg.norm(fall)), 1e-9), np.empty((3, model.nv))
        variance = self._config.slip**2 * max(1.0, SLIPS_FOR / h)
        read: list[tuple[int, Array, Array]] = []  # foot, velocity and H of those that stand
        body_velocity = self._strapdown.X[:3, :3].T @ self._strapdown.X[:3, 3]
        for k in np.flatnonzero(still):
            site = base.feet[k]
            place = data.site_xpos[site] + base.radii[k] * down
            mujoco.mj_jac(model, data, J, None, place, int(model.site_bodyid[site]))
            z = base.mounting.T @ (cross(omega, base.offset - place) - J[:, JOINT_RATES] @ self._joint_rates)
            H = np.zeros((3, len(self._strapdown.P)))
            H[:, strapdown.SPEED] = np.eye(3)
            if self._strapdown.has_biases:  # the rate by which the foot's velocity is found has the gyro's
                arm = SO3.bracket(base.mounting.T @ (base.offset - place))
                H[:, strapdown.BIAS] = np.hstack([-arm, np.zeros((3, 3))])
            read.append((int(k), z, H))
        if self._witness is not None:
            off, (_, _, H) = np.array([z - body_velocity for _, z, _ in read]), read[0]
            if self._witness.take(reading.t, off, H @ self._strapdown.P @ H.T, self._strapdown):
                self._imu.restart(reading.t)  # what it has done to position and heading is never found again
        for foot, z, H in read:
            body_velocity = self._strapdown.X[:3, :3].T @ self._strapdown.X[:3, 3]
            H[:, strapdown.TURN] = SO3.bracket(body_velocity)
            d, P, nis = condition(self._strapdown.P, H, z - body_velocity, variance * np.eye(3))
            if nis <= self._limit:
                self._strapdown.correct(d, P)
                self._standing[foot] = 1.0
                if self._witness is not None:
                    self._witness.used()
            else:
                self._counts.add(Unused.OUTLIER)

    def _position(self) -> Array:
        """Position q (nq,): the base as estimated by the filter, the joints as read."""
        R = self._strapdown.X[:3, :3] @ self._base.mounting.T
        return np.concatenate([self._strapdown.X[:3, 4] - R @ self._base.offset, quaternion(R), self._joints])

    def _state(self) -> Array:
        """State (nq + nv,)."""
        omega = self._base.mounting @ self._strapdown.rate
        R = self._strapdown.X[:3, :3] @ self._base.mounting.T
        v = self._strapdown.X[:3, 3] - R @ cross(omega, self._base.offset)
        return np.concatenate([self._position(), v, omega, self._joint_rates])

    def _deviation(self, t: float) -> Array:
        """Standard deviations (9,) at t [s] of attitude [rad], velocity [m/s] and position [m] along world axes."""
        P, R = self._strapdown.P, self._strapdown.X[:3, :3]
        wandered = (_LASTING_SLIP * self._config.slip * (t - self._since)) ** 2 * np.eye(3)
        turn, speed, place = (P[part, part] for part in (strapdown.TURN, strapdown.SPEED, strapdown.PLACE))
        turned = [turn, R @ speed @ R.T, R @ place @ R.T + wandered]
        deviation: Array = np.sqrt(np.concatenate([np.diag(part) for part in turned]))
        return deviation


def _base_of(mission: LagrangianMission) -> FloatingBase:
    """The floating base of a mission's system. Raises FieldError if none exists, or if it carries no IMU."""
    if not isinstance(mission.system, MechanismSystem):
        raise FieldError(f"system = one on {mission.system.manifold.name}; allowed: a mechanism with a floating base")
    return mission.system.floating_base
