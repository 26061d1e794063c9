"""The plug-in ``alpha_beta_gamma``: position fixes to position, velocity and gust, by three constant gains.

Each axis has the state x = (p, v, g), position, velocity and a gust that dies away with its time constant tau, and the
known input u:

    p' = v,   v' = u + g,   g' = -g / tau,        from one fix to the next, exactly:  x+ = F x + B u.

A fix y of the position moves the estimate x^ by L (y - p^), with the gains of a polynomial of second degree through
all past fixes whose weights fade with their age (E. Brookner, Tracking and Kalman Filtering Made Easy, 1998):

    alpha = 1 - theta^3,   beta = 3/2 (1 - theta)^2 (1 + theta) / T,   gamma = (1 - theta)^3 / T^2,

T the time between two fixes and theta = exp(-T / memory). The gains do not depend on how much noise and gusts there
are; how good the estimates are follows from that by one Lyapunov equation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from mathnavi.estimators.timeout_monitor import TimeoutMonitor, is_late, waiting
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.aerial.mission import EstimateQuality, FlightMission, PositionSensor
from mathnavi.models.tolerances import TIME_TOLERANCE

FREQUENCIES = 400  # at which the corrections are looked at
DEVIATIONS = 6.0  # by which a fix that agrees with the estimate is off at most


@configuration
class AlphaBetaGammaConfig:
    """Fields of ``--estimator``."""

    memory: Positive = 2.0
    """time in which the weight theta fades to 1/e [s]"""
    timeout: Positive = 1.0
    """time without a fix after which the estimate is lost [s]"""


class AlphaBetaGamma:
    """Position fixes to position, velocity and gust, by a filter of fading memory."""

    Config = AlphaBetaGammaConfig

    def __init__(self, config: AlphaBetaGammaConfig, mission: FlightMission) -> None:
        self.period = mission.control_period
        self._tau = mission.gust.time_constant
        self._gains = gains(config, mission)
        error = AlphaBetaGamma.quality(config, mission).error[:2, :2]
        self._covariance = np.kron(error, np.eye(3))  # (6, 6), between fixes no larger than just before one
        self._x = np.vstack([mission.start, np.zeros((2, 3))])  # (3, 3) rows p, v, g, one column an axis
        self._t: float | None = None  # [s] of _x; None before the first call
        # After a gap longer than the timeout the estimate is OK again once fixes have agreed for two memories.
        interval, settling = 1.0 / mission.position_rate, 2.0 * config.memory
        self._fixes = TimeoutMonitor(config.timeout, interval, settling=settling, of="fixes")
        self._agreeing = DEVIATIONS * math.sqrt(error[0, 0] + mission.position_noise**2)  # [m]
        self._counts = ReadingCounts()

    @staticmethod
    def build(config: AlphaBetaGammaConfig, mission: FlightMission) -> AlphaBetaGamma:
        return AlphaBetaGamma(config, mission)

    @staticmethod
    def sensors(config: AlphaBetaGammaConfig, mission: FlightMission) -> tuple[PositionSensor, ...]:
        """Sensors that the vehicle has to carry for this estimator."""
        return (PositionSensor(mission.position_noise, mission.position_rate),)

    @staticmethod
    def quality(config: AlphaBetaGammaConfig, mission: FlightMission) -> EstimateQuality:
        """The stationary filter under the declared noise and gusts.

        Just before a fix the error of an axis obeys e+ = A e - F L v + G w, A = F (1 - L H), with the noise v of the
        fix and a white w of variance q for the gust, so that P = A P A' + F L R L' F' + q G G'. Each fix feeds
        L (H e + v) into the estimate. Unlike a Kalman filter's these corrections depend on each other; what they drive
        is no more than what white ones would that are as strong as these are at their strongest frequency:

            S = max over f of  R |1 - H (z - A)^-1 F L|^2 + q |H (z - A)^-1 G|^2,   z = exp(i f).
        """
        interval, tau, gust = 1.0 / mission.position_rate, mission.gust.time_constant, mission.gust.rms
        F, _ = motion(interval, tau)
        L = gains(config, mission)[:, np.newaxis]
        H, R = np.array([[1.0, 0.0, 0.0]]), mission.position_noise**2
        fall = math.exp(-interval / tau)
        G = np.array([[0.5 * interval**2], [interval], [1.0]])  # a gust that changes does so just after a fix
        q = gust**2 * (1.0 - fall**2)
        A, FL = F @ (np.eye(3) - L @ H), F @ L
        P = solve_discrete_lyapunov(A, R * FL @ FL.T + q * G @ G.T)
        z = np.exp(1j * np.geomspace(1e-4, math.pi, FREQUENCIES))[:, np.newaxis, np.newaxis]
        heard = H @ np.linalg.solve(z * np.eye(3) - A, np.hstack([FL, G])[np.newaxis])  # (n, 1, 2)
        S = float((R * abs(1.0 - heard[:, 0, 0]) ** 2 + q * abs(heard[:, 0, 1]) ** 2).max())
        driving = S / interval * L @ L.T
        return EstimateQuality(0.5 * (P + P.T), driving, estimates_gust=True)

    @staticmethod
    def properties(config: AlphaBetaGammaConfig) -> ObserverProperties:
        """The error obeys a stable linear equation, for any known input."""
        return ObserverProperties(
            Domain.GLOBAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
            note="linear, with constant gains; gusts and noise leave an error of their size",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        for fix in measurements:
            if fix.name != "position":
                self._counts.add(Unused.UNKNOWN_SENSOR)
            elif is_late(fix.t, self._t):
                self._counts.add(Unused.LATE)
            elif not np.isfinite(fix.value).all():
                self._counts.add(Unused.NOT_FINITE)
            else:
                self._predict(fix.t, command)
                error = fix.value - self._x[0]
                self._x = self._x + np.outer(self._gains, error)
                self._fixes.note(fix.t, agrees=bool((np.abs(error) <= self._agreeing).all()))
        self._predict(t, command)
        status, extra = self._fixes.status(t), {"gust": self._x[2].copy(), **self._counts.extra}
        message = waiting(status, "a fix") or self._fixes.message
        return Estimate(t, self._x[:2].flatten(), self._covariance.copy(), status, extra, message)

    def _predict(self, t: float, command: Array) -> None:
        """Propagate the filter to t [s] with the input held."""
        h = 0.0 if self._t is None else t - self._t
        if h > TIME_TOLERANCE:
            F, B = motion(h, self._tau)
            self._x = F @ self._x + np.outer(B, command)
        self._t = t


def gains(config: AlphaBetaGammaConfig, mission: FlightMission) -> Array:
    """Return the gains (3,): alpha, beta [1/s], gamma [1/s^2]."""
    interval = 1.0 / mission.position_rate
    theta = math.exp(-interval / config.memory)
    left = 1.0 - theta
    return np.array([1.0 - theta**3, 1.5 * left**2 * (1.0 + theta) / interval, left**3 / interval**2])


def motion(h: float, tau: float) -> tuple[Array, Array]:
    """F (3, 3) and B (3,) over h [s]."""
    gone = -math.expm1(-h / tau)  # share of the gust that dies away
    F = np.array([[1.0, h, tau * (h - tau * gone)], [0.0, 1.0, tau * gone], [0.0, 0.0, 1.0 - gone]])
    return F, np.array([0.5 * h * h, h, 0.0])
