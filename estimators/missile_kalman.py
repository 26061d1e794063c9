"""Extended Kalman filter for a missile with noisy readings and an unknown disturbance.

The thesis' state x (B.4) is joined by the disturbance d = (d_F, d_M), a force in the Earth frame [N] and a moment about
the body's axes [N m], each component a first-order Gauss-Markov process:

    x' = f(x, u + (R' d_F, d_M)),   d' = -d / tau + noise of intensity 2 sigma^2 / tau,   y = x + noise of variance R.

A lasting gust is such a disturbance, and so is the effect of a wrong mass or thrust on the commanded input. The filter
(filterpy's) propagates (x, d) by Runge-Kutta steps and its covariance by their Jacobian, which CasADi derives; it
predicts at its period and conditions on each reading at the time of the reading. Differences of angles are wrapped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated

import casadi
import numpy as np

from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.kalman_steps import condition, external_prediction_ekf
from mathnavi.estimators.missile_channels import Channels, Reading
from mathnavi.estimators.timeout_monitor import FARTHEST, TimeoutMonitor, is_late, time_ahead, waiting, worst
from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.angles import wrapped
from mathnavi.models.buffered_function import NumericFunction
from mathnavi.models.missile.coordinates import STEP, Coordinates
from mathnavi.models.missile.dynamics import Body, rotation
from mathnavi.models.missile.input_history import InputHistory
from mathnavi.models.missile.mission import MissileMission
from mathnavi.models.runge_kutta import classical_step
from mathnavi.models.tolerances import TIME_TOLERANCE

_FORGOTTEN = 0.3  # [rad] deviation of an attitude after a gap from which on a reading says more
_FAR = 1e4  # times the standard deviations of a reading: a state of which nothing is known


@configuration
class MissileKalmanConfig:
    """Fields of the command line."""

    rate: Positive | None = None
    """rate of the readings [Hz]; that of the estimates if not given"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""
    start_position_std: Positive = 1.0
    """standard deviation of the declared start on each axis [m]"""
    start_velocity_std: Positive = 1.0
    """standard deviation of the initial velocity on each axis [m/s]"""
    start_angle_std: Annotated[float, Radians(0.0, 0.25 * math.pi, open_low=True)] = 0.02
    """standard deviation of the initial attitude angles [rad]"""
    start_rate_std: Annotated[float, Radians(0.0, 20.0, open_low=True, unit="rad/s")] = 0.02
    """standard deviation of the initial angular velocity on each axis [rad/s]"""
    force_std: Positive = 500.0
    """sigma of the disturbing force on each axis, in addition to the declared gusts [N]"""
    moment_std: Positive = 30.0
    """sigma of the disturbing moment about each axis, in addition to the declared gusts [N m]"""
    time_constant: Positive = 5.0
    """correlation time tau of the disturbance [s]"""
    noise_floor: Positive = 1e-3
    """least standard deviation that the filter assumes for a reading [m, m/s, rad, rad/s]"""


class MissileKalman:
    """Estimator of a missile's state and of the disturbance that acts on it, from noisy readings of the state."""

    Config = MissileKalmanConfig

    def __init__(self, config: MissileKalmanConfig, mission: MissileMission, *, monitored: bool = True) -> None:
        """The filter; without its tests of innovations it is as sure as its covariance unless it is ``monitored``."""
        coordinates = self._coordinates = mission.coordinates
        self.period = mission.control_period
        interval = mission.control_period if config.rate is None else 1.0 / config.rate
        self._timeout_monitor, self._input_max = TimeoutMonitor(config.timeout, interval), np.array(mission.input_max)
        self._size, self._monitored = coordinates.state_size, monitored
        self._step = NumericFunction(transition(coordinates, mission.body, config.time_constant))
        self._input_of = NumericFunction(disturbing_input(coordinates))
        disturbance = disturbance_deviation(config, mission)
        self._intensity = 2.0 * disturbance**2 / config.time_constant  # (nu,) of the disturbance's noise
        self._filter = external_prediction_ekf(self._size + len(disturbance), self._size)
        self._filter.x = np.concatenate([mission.start_state, np.zeros(len(disturbance))])
        self._filter.P = np.diag([*start_deviation(config, mission), *disturbance]) ** 2
        self._filter.R = np.diag(np.maximum(mission.noise.deviations(coordinates), config.noise_floor) ** 2)
        far = np.concatenate([_FAR * np.sqrt(np.diag(self._filter.R)), disturbance])
        self._anywhere = np.diag(np.square(far))  # covariance of a missile of which nothing is known
        self._H = np.eye(self._size, len(self._filter.x))
        self._t: float | None = None  # [s] of the filter's state; None before the first call
        self._inputs = InputHistory(mission.input_delay, len(disturbance))
        self._called: float | None = None  # [s] of the last call
        self._monitor = InnovationMonitor("readings", self._size, interval)
        noisy = mission.noise.deviations(coordinates) > 0.0
        self._noisy = bool(noisy.any())
        self._channels = Channels(coordinates, self._filter.R, noisy, interval)
        self._Phi = np.eye(len(self._filter.x))  # transition since the last reading
        self._counts = ReadingCounts()
        self._innovations = np.full((2, self._size), np.nan)  # of the last reading, and their deviations

    @staticmethod
    def build(config: MissileKalmanConfig, mission: MissileMission) -> MissileKalman:
        """Build the estimator of one run."""
        return MissileKalman(config, mission)

    @staticmethod
    def sensors(config: MissileKalmanConfig, mission: MissileMission) -> tuple[Sensor, ...]:
        """Sensors that the missile has to carry for this estimator."""
        return (mission.full_state_sensor(config.rate),)

    @staticmethod
    def quality(config: MissileKalmanConfig, mission: MissileMission) -> Array:
        """Covariance (nx, nx) of a reading, which bounds that of the filter."""
        return mission.full_state_covariance(0.0)

    @staticmethod
    def properties(config: MissileKalmanConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1): the state is read, the disturbance is estimated by linearisation."""
        return ObserverProperties(
            Domain.LOCAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.LOCAL, Domain.LOCAL,
            note="as far as the linearisation holds, which it does not for a nose across the pitch plane",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (nx,) at t [s] from the readings since the last call, ``command`` (nu,) [N, N m] held in between.

        ``extra["disturbance"]`` (nu,) [N, N m] acts in addition to the input, along the body's axes,
        ``extra["integrity"]`` (1,) is the worst statistic of the readings over its threshold, and
        ``extra["innovations"]`` (nx,) and ``extra["innovation_std"]`` (nx,) are those of the last reading
        (``interfaces.innovations``); ``extra`` also counts the readings that were not used. Raises ValueError for a
        reading of another shape.
        """
        self._innovations[:] = np.nan
        held = np.clip(command, -self._input_max, self._input_max)
        if self._called is not None:
            self._inputs.note(self._called, held)
        self._called = t
        for reading in measurements:
            if reading.name != "full_state":
                self._counts.add(Unused.UNKNOWN_SENSOR)
            elif is_late(reading.t, self._t):
                self._counts.add(Unused.LATE)
            else:
                self._predict(reading.t)
                self._condition(reading)
        self._predict(t)
        x, P = self._filter.x, self._filter.P[: self._size, : self._size]
        P = 0.5 * (self._monitor.inflation if self._monitored else 1.0) * (P + P.T)
        status, doubt = self._timeout_monitor.status(t, P), ""
        if self._monitored:
            integrity, doubt = self._monitor.status(t), self._channels.doubt(t)
            status = worst(status, integrity, Status.DEGRADED if doubt else Status.OK)
            doubt = doubt or self._monitor.message
            self._channels.add_leaps(P)
        extra = {"disturbance": self._input_of(x)[0].ravel(), **self._counts.extra}
        extra |= {"integrity": np.array([self._monitor.ratio]), **published(self._innovations)}
        message = waiting(status, "a reading of full_state") or doubt or self._timeout_monitor.message
        return Estimate(t, x[: self._size].copy(), P, status, extra, message)

    def _predict(self, t: float) -> None:
        """Predict from the filter's time to t [s] with the inputs that act until then, delayed by the thrusters'
        declared delay. After a time in which it may have gone anywhere the next reading says where it is.
        """
        if self._t is None:
            self._t = t
        ahead = time_ahead(t, self._t)
        if ahead > FARTHEST:
            self._inputs.forget(t)
            self._begin_again(t)
        else:
            for h, u in self._inputs.acting(self._t, self._t + ahead):
                self._advance(h, u)
        self._t = t

    def _begin_again(self, t: float) -> None:
        """Forget where the missile is at t [s], and what disturbs it."""
        self._filter.x = np.concatenate([self._filter.x[: self._size], np.zeros(len(self._intensity))])
        self._filter.P = self._anywhere.copy()
        self._channels.begin_again(t)

    @property
    def _has_turned_anyhow(self) -> bool:
        """True where so little is left of the attitude that no linearisation holds."""
        angles = self._coordinates.angles
        return not bool(self._filter.P[angles, angles].max() < _FORGOTTEN**2)  # NaN too

    def _advance(self, h: float, u: Array) -> None:
        """Advance by h [s] with the input held."""
        while h > TIME_TOLERANCE:
            step = min(h, STEP)
            after, F = self._step(self._filter.x, u, step)
            self._filter.x = after.ravel()
            noise = np.zeros(len(self._filter.x))
            noise[self._size :] = step * self._intensity
            self._filter.P = F.dot(self._filter.P).dot(F.T) + F * noise @ F.T
            self._Phi = F @ self._Phi
            h -= step

    def _condition(self, reading: Measurement) -> None:
        # Both the state and the reading are flat: filterpy broadcasts a flat array and a column to a square matrix.
        if reading.value.shape != (self._size,):
            raise ArgumentError(f"a reading of the state has shape {reading.value.shape}; allowed: ({self._size},)")
        if not np.isfinite(reading.value).all():
            self._counts.add(Unused.NOT_FINITE)
            return
        if self._monitored and self._is_stuck(reading):
            self._counts.add(Unused.OUTLIER)
            return
        n, R, used = self._size, self._filter.R, self._channels.used
        if reading.t - self._timeout_monitor.t > self._timeout_monitor.longest and self._has_turned_anyhow:
            self._begin_again(reading.t)
            self._filter.x[:n] = reading.value
        before, P_before = self._filter.x, self._filter.P
        nu = self._difference(reading.value, before[:n])
        S = P_before[:n, :n] + R
        self._innovations[0], self._innovations[1] = nu, np.sqrt(S.diagonal())
        self._monitor.note(reading.t, nu, S, R, used)
        if used is None:
            self._filter.update(reading.value, lambda _: self._H, lambda x: x[: self._size], residual=self._difference)
        else:
            moved, self._filter.P, _ = condition(P_before, self._H[used], nu[used], R[np.ix_(used, used)])
            self._filter.x = before + moved
            self._counts.add(Unused.OUTLIER, int((~used).sum()))
        self._timeout_monitor.note(reading.t)
        noted = Reading(self._Phi, before, P_before, nu, self._filter.x, self._filter.P, reading.t)
        self._Phi = np.eye(len(before))
        if self._monitored:
            self._change(self._channels.note(noted, S, alarming=self._monitor.alarming))
            if self._monitor.disagrees and used is not None:
                self._channels.begin_again(reading.t)

    def _is_stuck(self, reading: Measurement) -> bool:
        """True for a reading with noise that has read the same many times; a channel that has is left out."""
        if self._noisy and self._monitor.note_value(reading.t, reading.value):
            return True
        self._change(self._channels.stuck(reading.t, reading.value))
        return False

    def _change(self, found: tuple[Array, Array] | None) -> None:
        """Change state and covariance by what they were found to differ by after the last reading, if anything."""
        if found is not None:
            delta, Delta = found
            self._filter.x = self._filter.x + self._Phi @ delta
            self._filter.P = self._filter.P + self._Phi @ Delta @ self._Phi.T
            self._monitor.explain()

    def _difference(self, reading: Array, expected: Array) -> Array:
        error: Array = reading - expected
        angles = self._coordinates.angles
        error[angles] = wrapped(error[angles])
        return error


def disturbance_deviation(config: MissileKalmanConfig, mission: MissileMission) -> Array:
    """Standard deviations (nu,) [N, N m] of the disturbance, the mission's declared gusts included."""
    return np.array(
        [
            math.hypot(config.force_std, mission.gust.force)
            if name.startswith("F")
            else math.hypot(config.moment_std, mission.gust.moment)
            for name in mission.coordinates.inputs
        ]
    )


def start_deviation(config: MissileKalmanConfig, mission: MissileMission) -> Array:
    """Standard deviations (nx,) of the mission's declared start."""
    kinds = {"m": config.start_position_std, "m/s": config.start_velocity_std}
    kinds |= {"rad": config.start_angle_std, "rad/s": config.start_rate_std}
    return np.array([kinds[unit] for unit in mission.coordinates.units])


@lru_cache(maxsize=8)
def disturbing_input(coordinates: Coordinates) -> casadi.Function:
    """Function (x, d) -> (R' d_F, d_M) (nu,), along the axes of the body."""
    z = casadi.SX.sym("z", coordinates.state_size + coordinates.input_size)
    theta = z[coordinates.index("theta")]
    psi = z[coordinates.index("psi")] if "psi" in coordinates.states else casadi.SX(0.0)
    axes = [k for k, name in enumerate(("F_x", "F_y", "F_z")) if name in coordinates.inputs]
    R = rotation(theta, psi)[axes, axes]
    d = z[coordinates.state_size :]
    made = casadi.vertcat(R.T @ d[: len(axes)], d[len(axes) :])
    return casadi.Function("disturbing_input", [z], [made])


@lru_cache(maxsize=8)
def transition(coordinates: Coordinates, body: Body, time_constant: float) -> casadi.Function:
    """Function ((x, d), u, h) -> (x, d) after h [s] by one Runge-Kutta step, and its Jacobian."""
    nx, nu = coordinates.state_size, coordinates.input_size
    z, u, h = casadi.SX.sym("z", nx + nu), casadi.SX.sym("u", nu), casadi.SX.sym("h")
    f, disturbing = coordinates.dynamics(body), disturbing_input(coordinates)

    def rate(at: casadi.SX, _: float) -> casadi.SX:
        return casadi.vertcat(f(at[:nx], u + disturbing(at)), -at[nx:] / time_constant)

    after = classical_step(rate, z, h)
    return casadi.Function("transition", [z, u, h], [after, casadi.jacobian(after, z)])
