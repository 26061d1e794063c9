"""The tracker: the plan's acceleration plus critically damped feedback, and the bound it keeps.

    u = a_ref - omega^2 (p^ - p_ref) - 2 omega (v^ - v_ref) - g^,   the last three terms' norm clipped to a_fb,

g^ the gust that the estimator sees, if it does. ``a_ref`` is the plan's mean acceleration until the next command, so
arcs may change between commands (``held_input``). With the estimate x^ = x - e of a linear-Gaussian estimator, the
loop's stationary covariance follows from one Lyapunov equation per axis (see ``EstimateQuality``); five of its standard
deviations are the bound that plans are certified with, and of the velocity's, whose length counts, a few more.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.held_input import HeldInput
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.aerial.kernels import state_on
from mathnavi.models.aerial.mission import DeclaredGusts, EstimateQuality, FlightMission
from mathnavi.models.linear_noise import discretised

_DEVIATIONS = 5.0  # of a component
_DEVIATIONS_OF_LENGTH = 5.65  # of a vector in space: its length exceeds them as rarely
_PHASES = 16  # of a period at which its covariance is taken
_SLOWEST, FASTEST = 1e-5, 0.1  # bandwidth times period; a lag is followed for some 40 periods over this product
_STEP = 8.0 / math.e**2  # of held noise over 1 / omega: each step of it moves the loop by (omega / e) times as much
_STILL = np.zeros(3)  # no gust
_NUMERICAL = TrackingBound(0.05, 0.05, 0.05, 0.1)  # what rounding and feedback on it need


def tracking_bound(bandwidth: float, mission: FlightMission) -> TrackingBound:
    """Five standard deviations of the tracked vehicle about its plan, and of the feedback that keeps it there.

    Commands are held for the mission's control period h: where the plan's acceleration changes by up to 2 a_max between
    two of them, its mean keeps the velocity at both ends but is off by up to a_max h^2 / 4 in position. ``held`` sets
    four times that aside; a plan that needs more is not certified.
    """
    held = mission.acceleration_max * mission.control_period**2
    spread = stationary_deviations(bandwidth, mission.quality, mission.gust)
    position, feedback = _DEVIATIONS * spread[0], _DEVIATIONS * spread[2]
    speed = _DEVIATIONS_OF_LENGTH * spread[1]
    floor = _NUMERICAL
    return TrackingBound(
        floor.horizontal + held + position,
        floor.vertical + held + position,
        floor.speed + speed,
        floor.feedback + bandwidth**2 * held + feedback,
        held,
    )


def stationary_deviations(
    bandwidth: float, quality: EstimateQuality, gust: DeclaredGusts
) -> tuple[float, float, float]:
    """Standard deviations of position [m], velocity [m/s] and feedback [m/s^2] about a plan, on one axis.

    The estimated error z = (p^ - p_ref, v^ - v_ref, g^) obeys z' = A z + noise of covariance W per second,

        A = [[0, 1, 0], [-omega^2, -2 omega, c], [0, 0, -1 / tau]],

    c = 0 if the gust's estimate is fed forward and 1 if not; the true error's covariance is that of z plus P.

    Between readings that are up to T = ``quality.age`` apart an estimate that knows no gust misses what the gust does,
    (eps, eps') with eps'' = g. A reading moves the estimate by it. The covariance of (p^, v^, g, eps, eps') is periodic
    with T then: Sigma = R (F Sigma F' + Q) R', F and Q over T and R the reading; the greatest variances over a period
    count. The noise of a reading is independent of both.
    """
    omega, forward = bandwidth, 1.0 if quality.estimates_gust else 0.0
    late = quality.age > 0.0 and not quality.estimates_gust
    # (p^, v^, g, eps, eps'), the last two for a late reading only.
    n = 5 if late else 3
    A, W = np.zeros((n, n)), np.zeros((n, n))
    A[0, 1], A[1, :2], A[2, 2] = 1.0, (-(omega**2), -2.0 * omega), -1.0 / gust.time_constant
    W[:3, :3] = quality.driving
    # The feedback on the noise of a reading pushes the vehicle: as white noise does, or as far as a step of it does.
    W[1, 1] += omega**4 * quality.error[0, 0] * min(quality.held, _STEP / omega)
    if not W.any():
        covariances, true = np.zeros((1, n, n)), np.zeros((2, n))
    elif late:
        A[3, 4] = A[4, 2] = 1.0
        covariances = _periodic(A, W, quality.age)
        true = np.hstack([np.eye(2), np.zeros((2, 1)), np.eye(2)])
    else:
        from scipy.linalg import solve_continuous_lyapunov  # takes a while to import

        A[1, 2] = 1.0 - forward
        covariances = np.array([solve_continuous_lyapunov(A, -W)])
        true = np.eye(2, n)
    gain = np.zeros(n)
    gain[:3] = omega**2, 2.0 * omega, forward
    position, speed = np.einsum("ki,nij,kj->nk", true, covariances, true).max(axis=0) + np.diag(quality.error)[:2]
    # Where no filter stands between, the noise of a position reading reaches the feedback directly.
    feedback = float(np.einsum("i,nij,j->n", gain, covariances, gain).max()) + omega**4 * quality.error[0, 0]
    deviations = np.sqrt(np.maximum([position, speed, feedback], 0.0))
    return float(deviations[0]), float(deviations[1]), float(deviations[2])


def _periodic(A: Array, W: Array, period: float) -> Array:
    """Covariances (n, 5, 5) over a period [s] of x' = A x + noise of W per second, with a reading at its end."""
    from scipy.linalg import solve_discrete_lyapunov

    reading = np.eye(5)
    reading[:2, 3:], reading[3:, 3:] = np.eye(2), 0.0
    F, Q = discretised(A, W, period / _PHASES)
    whole, noise = np.eye(5), np.zeros((5, 5))
    for _ in range(_PHASES):
        whole, noise = F @ whole, F @ noise @ F.T + Q
    covariance = solve_discrete_lyapunov(reading @ whole, reading @ noise @ reading.T)
    covariances = [covariance]
    for _ in range(_PHASES):
        covariance = F @ covariance @ F.T + Q
        covariances.append(covariance)
    return np.array(covariances)


class CriticallyDamped:
    """Tracker of the last accepted plan, to rest and beyond."""

    def __init__(self, period: float, bandwidth: float, bound: TrackingBound) -> None:
        """Raise FieldError for a bandwidth [rad/s] out of range for commands held over a period [s]."""
        if not _SLOWEST <= round(bandwidth * period, 12) <= FASTEST:  # the values that the message names are allowed
            raise FieldError(
                f"bandwidth = {bandwidth!r}; allowed: {_SLOWEST / period:g} to {FASTEST / period:g} rad/s "
                f"at a control_rate of {1.0 / period:g} Hz"
            )
        self.period, self.bound = period, bound
        self._bandwidth = bandwidth
        self._limit = bound.feedback
        self.held = None if bound.held is None else HeldInput(period, bandwidth, bound.held)

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """Acceleration (3,) [m/s^2] at ``t`` [s] that tracks the plan."""
        x, gust = estimate.x, estimate.extra.get("gust", _STILL)
        if x.shape != (6,):  # compiled code would read on
            raise ArgumentError(f"the estimate's state has shape {x.shape}; allowed: (6,)")
        if gust is not _STILL and not (gust.shape == (3,) and math.isfinite(gust.dot(gust))):
            gust = _STILL  # another gust than (3,) is none, which the guarantee knows (``guarantee.doubt``)
        command: Array = tracking_command(plan.t, plan.x, plan.u, t, self.period, x, gust, self._bandwidth, self._limit)
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
    """a_ref - clip(omega^2 (p^ - p_ref) + 2 omega (v^ - v_ref) + g^) (3,), a_ref the plan's mean over the period.

    The plan: breaks (K + 1,) [s], states x (K + 1, 6) [m, m/s], inputs u (K, 3) [m/s^2]; t, period [s], estimate (6,)
    [m, m/s], gust g^ (3,) [m/s^2], bandwidth omega [rad/s], limit [m/s^2] of the feedback.
    """
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
        shrunk = limit / np.sqrt(square)
        for i in range(m):
            feedback[i] *= shrunk
    for i in range(m):
        feedback[i] += (ahead[m + i] - reference[m + i]) / period
    return feedback
