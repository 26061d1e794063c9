"""The tracker: the plan's acceleration plus critically damped feedback, and the bound it keeps.

    u = a_ref - omega^2 (p^ - p_ref) - 2 omega (v^ - v_ref) - g^,   the last three terms' norm clipped to a_fb,

g^ the gust that the estimator sees, if it does. ``a_ref`` is the plan's mean acceleration until the next command, so
arcs may change between commands. With the estimate x^ = x - e of a linear-Gaussian estimator, the loop's stationary
covariance follows from one Lyapunov equation per axis (see ``EstimateQuality``); five of its standard deviations are
the bound that plans are certified with.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.linalg import solve_continuous_lyapunov

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.models.aerial.kernels import state_on
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.sim.interfaces.signals import Array, Estimate, Plan

_DEVIATIONS = 5.0
_FASTEST = 0.1  # bandwidth times period
_STILL = np.zeros(3)  # no gust
_NUMERICAL = TrackingBound(0.05, 0.05, 0.05, 0.1)  # what rounding and feedback on it need


def tracking_bound(bandwidth: float, mission: FlightMission) -> TrackingBound:
    """Five standard deviations of the tracked vehicle about its plan, and of the feedback that keeps it there.

    Per axis, with the estimated error (p^ - p_ref, v^ - v_ref, g^): d/dt = A . + noise of covariance W per second, A
    = [[0, 1, 0], [-omega^2, -2 omega, c], [0, 0, -1/tau]], c = 0 if the gust's estimate is fed forward and 1 if not;
    the true error's covariance is that of the estimated one plus P.

    Commands are held for the mission's control period h: where the plan's acceleration changes by up to 2 a_max between
    two of them, its mean keeps the velocity at both ends but is off by up to a_max h^2 / 4 in position. There is room
    for four such changes before the feedback answers.
    """
    quality, gust = mission.quality, mission.gust
    held = mission.acceleration_max * mission.control_period**2
    omega, forward = bandwidth, 1.0 if quality.estimates_gust else 0.0
    a = np.array([[0.0, 1.0, 0.0], [-(omega**2), -2.0 * omega, 1.0 - forward], [0.0, 0.0, -1.0 / gust.time_constant]])
    estimated = solve_continuous_lyapunov(a, -quality.driving)
    true = estimated + quality.error
    gain = np.array([omega**2, 2.0 * omega, forward])
    position = _DEVIATIONS * math.sqrt(max(0.0, true[0, 0]))
    speed = _DEVIATIONS * math.sqrt(max(0.0, true[1, 1]))
    # Where no filter stands between, the noise of a position reading reaches the feedback directly.
    feedback = _DEVIATIONS * math.sqrt(max(0.0, float(gain @ estimated @ gain) + omega**4 * quality.error[0, 0]))
    floor = _NUMERICAL
    return TrackingBound(
        floor.horizontal + held + position,
        floor.vertical + held + position,
        floor.speed + speed,
        floor.feedback + omega**2 * held + feedback,
    )


class CriticallyDamped:
    """Flies the last accepted plan, to rest and beyond."""

    def __init__(self, period: float, bandwidth: float, bound: TrackingBound) -> None:
        """ValueError for a bandwidth [rad/s] that is too fast for commands held over a period [s]."""
        if not 0.0 < bandwidth <= _FASTEST / period:
            raise ValueError(
                f"bandwidth = {bandwidth!r}; allowed: > 0 and <= {_FASTEST / period:g} rad/s "
                f"at a control_rate of {1.0 / period:g} Hz"
            )
        self.period, self.bound = period, bound
        self._bandwidth = bandwidth
        self._limit = bound.feedback

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """Acceleration (3,) [m/s^2] at ``t`` [s] that tracks the plan."""
        gust = estimate.extra.get("gust", _STILL)
        for name, value, shape in (("state", estimate.x, (6,)), ("gust", gust, (3,))):
            if value.shape != shape:  # compiled code would read on
                raise ValueError(f"the estimate's {name} has shape {value.shape}; allowed: {shape}")
        command: Array = tracking_command(
            plan.t, plan.x, plan.u, t, self.period, estimate.x, gust, self._bandwidth, self._limit
        )
        return command


@njit(cache=True, nogil=True)
def tracking_command(
    breaks: Array,
    x: Array,
    u: Array,
    t: float,
    period: float,
    estimate: Array,
    gust: Array,
    bandwidth: float,
    limit: float,
) -> Array:
    """a_ref - clip(omega^2 (p^ - p_ref) + 2 omega (v^ - v_ref) + g^), a_ref the plan's mean over the period."""
    reference = state_on(breaks, x, u, t)
    ahead = state_on(breaks, x, u, t + period)
    m = u.shape[1]
    feedback = np.empty(m)
    square = 0.0
    for i in range(m):
        error, drift = estimate[i] - reference[i], estimate[m + i] - reference[m + i]
        feedback[i] = -(bandwidth * bandwidth) * error - 2.0 * bandwidth * drift - gust[i]
        square += feedback[i] * feedback[i]
    if square > limit * limit:
        feedback *= limit / np.sqrt(square)
    for i in range(m):
        feedback[i] += (ahead[m + i] - reference[m + i]) / period
    return feedback
