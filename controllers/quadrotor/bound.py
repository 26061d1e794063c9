"""Tracking bound of the quadrotor: the deviation from a plan that the certificate has to allow for.

Two parts add up: how far the reference is from the plan (``tracker.deviation``) and how far the vehicle is from the
reference. The second comes from the loop on one axis, with the letters of ``tracker``; d is the unknown force
per mass, n the noise of a position, r the observer's residual and c the acceleration that the feedback commands:

    e'' = theta + d,    r' = d - d^ - 2 omega_d r,    d^' = omega_d^2 r,    c = -k_p (e + n) - k_v e' - d^.

Because commands are held, half a period h is added to the lag of the rotors, tau_a = tau_m + h / 2. Along the vertical
the tracker makes up for most of it; across it theta is an acceleration by tilt, tau = theta'':

    along:     tau_a theta' = c + tau_m c' - theta,    c' = -k_p e' - k_v (theta + d^),
    across:    tau_a tau' = -omega_R^2 (theta - c) - 2 zeta_R omega_R (theta' - c') - tau.

* Gusts are Gauss-Markov, readings noisy: five standard deviations of the stationary covariance, by one Lyapunov
  equation; or, where that is less, the gusts' limit times the loop's peak-to-peak gain int |g| dt, g its impulse
  response.
* The error of the vehicle's model is bounded and otherwise free: the peak-to-peak gain times
  mass_tolerance |a_r| + drag_tolerance |D| v_max / m, on the vertical also the greatest response to a step times
  mass_tolerance g.
* Between readings T apart the feedback misses what a gust g does: k_p |g| T^2 / 2 + k_v |g| T, an input like the one
  before; T^2 is the mean square where readings are lost at random, for the loop is slower than they come.

That is exact for the linear loop; the tests compare it with the flight in MuJoCo. Rotors have bounds: a plan gets what
they can do in addition to the feedback, up and down, where drag helps neither, what they have the moments for when
plans take over unforeseen (below), and a_max if that is less.

**Demand of turning the thrust on the rotors**: the acceleration that plans may have, however sudden they are.

Rotors turn a quadrotor by a difference of thrust between its sides. Where the difference exceeds the thrust itself the
allocation keeps the moments and gives up the commanded thrust, and the vehicle leaves its height. So a plan may have
only accelerations at which that does not happen.

A jump of the plan's acceleration by Delta, horizontal, leaves the attitude loop of ``bound`` (theta an acceleration by
tilt, tau = theta'', c = a_r of the reference) with

    |tau| <= |Delta| pi,    pi the greatest |tau| after a jump of 1 m/s^2,

pi_0 for one that was not foreseen (a plan that takes over), pi_d for one that was (the turns within a plan, begun a
preview before). One of each may fall together, |Delta| <= 2 sqrt(A^2 - a_z^2) with |a| <= A. The thrust per mass is s =
g - |a_z| at least, and it is turned by tau / s about any axis, at worst one through two rotors, where only the two
others have an arm:

    J 2 sqrt(A^2 - a_z^2) (pi_0 + pi_d) / s <= rho 2 l min(m s / 4, T_max - m (g + |a_z|) / 4)

for every |a_z| <= A, with a share rho of the room, 2/3: the rest is the feedback's. ``greatest_acceleration`` is the
largest such A. The feedback in gusts exceeds its share at five standard deviations; that it does no harm
there is measured, in the tests and the study ``quadrotor``, and not proven.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.quadrotor.tracker import LEAST_THRUST, TrackerConfig, deviation
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.quadrotor.dynamics import ROTOR_COUNT, Quadrotor

_TURN_STEP, _TURN_DURATION = 1e-3, 4.0  # [s] of the response to a jump
_SHARES = np.linspace(0.0, 1.0, 41)  # of A that are vertical
_STEPS = 60  # of a bisection
_ROOM = 2.0 / 3.0  # rho


def greatest_acceleration(config: TrackerConfig, vehicle: Quadrotor, period: float) -> float:
    """A [m/s^2] for commands every ``period`` [s]."""
    omega, lag = config.reference_bandwidth, vehicle.motor_lag + 0.5 * period
    loop = config.attitude_bandwidth, config.attitude_damping, lag
    peaks = turning_peak(omega, 0.0, *loop) + turning_peak(omega, config.preview, *loop)
    low, high = 0.0, vehicle.gravity
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        if _has_the_moments(vehicle, middle, peaks):
            low = middle
        else:
            high = middle
    return low


def _has_the_moments(vehicle: Quadrotor, a_max: float, peaks: float) -> bool:
    vertical = a_max * _SHARES
    least, most = vehicle.gravity - vertical, vehicle.gravity + vertical  # [m/s^2] of the thrust per mass
    each = vehicle.mass / ROTOR_COUNT
    room = np.minimum(each * least, vehicle.thrust_max - each * most)  # [N] of a rotor, either way
    if (room <= 0.0).any():
        return False
    asked = 2.0 * np.sqrt(a_max * a_max - vertical * vertical) * peaks  # of one rounding: 0 where they are equal
    return bool((max(vehicle.inertia[:2]) * asked / least <= _ROOM * 2.0 * vehicle.arm * room).all())


@lru_cache(maxsize=16)
def turning_peak(omega: float, preview: float, bandwidth: float, damping: float, lag: float) -> float:
    """pi [1/s^2]: the greatest |theta''| after the plan's acceleration has jumped by 1 m/s^2.

    With w the reference's deviation from the arc after the jump, extended back, and theta counted from the new
    acceleration, the whole is linear and undriven from a ``preview`` [s] before the jump on.
    """
    w, rest = np.eye(7)[:4], np.eye(7)[4:]
    theta, theta_dot, tau = rest
    snap = -(omega**4) * w[0] - 4.0 * omega**3 * w[1] - 6.0 * omega**2 * w[2] - 4.0 * omega * w[3]
    k_R, k_Omega = bandwidth**2, 2.0 * damping * bandwidth
    tau_dot = (-k_R * (theta - w[2]) - k_Omega * (theta_dot - w[3]) - tau) / lag
    A = np.array([w[1], w[2], w[3], snap, theta_dot, tau, tau_dot])
    x = np.array([-0.5 * preview**2, preview, -1.0, 0.0, -1.0, 0.0, 0.0])
    step, greatest = expm(_TURN_STEP * A), 0.0
    for _ in range(round((_TURN_DURATION + preview) / _TURN_STEP)):
        x = step @ x
        greatest = max(greatest, abs(float(x[6])))
    return greatest


_DEVIATIONS = 5.0
_FLOOR = 0.03, 0.05  # [m, m/s] attitudes that follow closely but not at once
_STEP, _DURATION = 2e-3, 8.0  # [s] of the impulse responses
_SLOWEST = -0.1  # [1/s] of a loop that holds


@dataclass(frozen=True, eq=False)
class AxisLoop:
    """Closed loop on one axis: x' = A x + B (d, n) with x = (e, e', r, d^, ...); outputs e [m], e' [m/s], c [m/s^2]."""

    A: Array  # (nx, nx)
    B: Array  # (nx, 2)
    C: Array  # (3, nx)

    @staticmethod
    @lru_cache(maxsize=16)  # a fresh controller is built for every run
    def along(config: TrackerConfig, vehicle: Quadrotor, period: float) -> AxisLoop:
        """Loop along the vertical: theta follows c by thrust; commands every ``period`` [s]."""
        e, e_dot, r, d, theta = np.eye(5)
        k_p, k_v, observer = _gains(config)
        lag = vehicle.motor_lag + 0.5 * period
        c, c_dot = -k_p * e - k_v * e_dot - d, -k_p * e_dot - k_v * (theta + d)
        theta_dot = (c + vehicle.motor_lag * c_dot - theta) / lag
        A = np.array([e_dot, theta, -d - 2.0 * observer * r, observer**2 * r, theta_dot])
        return AxisLoop(A, np.column_stack([e_dot + r, -k_p / lag * theta]), np.array([e, e_dot, c]))

    @staticmethod
    @lru_cache(maxsize=16)
    def across(config: TrackerConfig, vehicle: Quadrotor, period: float) -> AxisLoop:
        """Loop across the vertical: theta follows c by tilt.

        Raises ArgumentError if these gains do not hold it at commands every ``period`` [s].
        """
        e, e_dot, r, d, theta, theta_dot, tau = np.eye(7)
        k_p, k_v, observer = _gains(config)
        k_R = config.attitude_bandwidth**2
        k_Omega = 2.0 * config.attitude_damping * config.attitude_bandwidth
        lag = vehicle.motor_lag + 0.5 * period
        c, c_dot = -k_p * e - k_v * e_dot - d, -k_p * e_dot - k_v * (theta + d)
        tau_dot = (-k_R * (theta - c) - k_Omega * (theta_dot - c_dot) - tau) / lag
        A = np.array([e_dot, theta, -d - 2.0 * observer * r, observer**2 * r, theta_dot, tau, tau_dot])
        growth = float(np.linalg.eigvals(A).real.max())
        if growth > _SLOWEST:
            raise ArgumentError(
                f"position_bandwidth = {config.position_bandwidth!r} with attitude_bandwidth = "
                f"{config.attitude_bandwidth!r} and rotors with motor_lag = {vehicle.motor_lag!r} s grows by "
                f"{growth:.2g}/s; allowed: slower ones, below {_SLOWEST:g}/s"
            )
        return AxisLoop(A, np.column_stack([e_dot + r, -k_R * k_p / lag * tau]), np.array([e, e_dot, c]))

    @cached_property
    def peak_gains(self) -> tuple[Array, Array]:
        """L1 (peak-to-peak) gains from d to the outputs (3,), and the greatest responses (3,) to a step of 1 m/s^2."""
        phi, x = expm(_STEP * self.A), self.B[:, 0]
        response = np.empty((round(_DURATION / _STEP), 3))
        for k in range(len(response)):
            response[k] = self.C @ x
            x = phi @ x
        gains: Array = np.abs(response).sum(axis=0) * _STEP
        steps: Array = np.abs(response.cumsum(axis=0)).max(axis=0) * _STEP
        return gains, steps

    def deviations(self, mission: FlightMission) -> Array:
        """Standard deviations (3,) of the outputs under the mission's gusts and the noise of its positions."""
        gust, size = mission.gust, len(self.A)
        A = np.zeros((size + 1, size + 1))
        A[:size, :size], A[:size, size], A[size, size] = self.A, self.B[:, 0], -1.0 / gust.time_constant
        noise = np.append(self.B[:, 1], 0.0)
        driving = mission.position_noise**2 * mission.control_period * np.outer(noise, noise)
        driving[size, size] += 2.0 * gust.rms**2 / gust.time_constant
        covariance = solve_continuous_lyapunov(A, -driving)[:size, :size]
        deviations: Array = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", self.C, covariance, self.C), 0.0))
        return deviations


def _gains(config: TrackerConfig) -> tuple[float, float, float]:
    """k_p, k_v and omega_d."""
    omega = config.position_bandwidth
    return omega**2, 2.0 * config.position_damping * omega, config.disturbance_bandwidth


def _unread(config: TrackerConfig, mission: FlightMission) -> float:
    """Error of the feedback [m/s^2] from what gusts do between readings, by the mean square of the time without one."""
    k_p, k_v, _ = _gains(config)
    age = mission.quality.rms_age
    return min(_DEVIATIONS * mission.gust.rms, mission.gust.limit) * (0.5 * k_p * age**2 + k_v * age)


def tracking_bound(config: TrackerConfig, vehicle: Quadrotor, mission: FlightMission) -> TrackingBound:
    """Tracking bound over a mission of the assumed vehicle; ``feedback`` is the part of a_max that is reserved for it.

    Raises ValueError if the gains do not hold the vehicle, or if the rotors can do no more than the feedback needs.
    """
    m, g, tolerance = vehicle.mass, vehicle.gravity, config.mass_tolerance
    foreseen = deviation(config.reference_bandwidth, config.preview)
    unforeseen = deviation(config.reference_bandwidth, 0.0)
    # The drag along the vertical is that of the thrust's axis and, by tilt, at most half of what the others have more.
    d_x, d_y, d_z = (coefficient / m * mission.speed_max for coefficient in vehicle.drag)
    drags = max(d_x, d_y, d_z), d_z + 0.5 * max(abs(d_x - d_z), abs(d_y - d_z))
    a_max = mission.acceleration_max
    parts = []
    for build, drag in zip((AxisLoop.across, AxisLoop.along), drags, strict=True):
        loop = build(config, vehicle, mission.control_period)
        unknown = tolerance * foreseen.acceleration * a_max + config.drag_tolerance * drag + _unread(config, mission)
        gains, steps = loop.peak_gains
        spread = _DEVIATIONS * loop.deviations(mission)
        if mission.position_noise == 0.0:
            spread = np.minimum(spread, gains * mission.gust.limit)
        parts.append((spread + gains * unknown, steps * tolerance * g))
    (across, _), (along, weight) = parts
    # Upwards a heavier vehicle needs more; downwards it only leaves more thrust.
    up = ROTOR_COUNT * vehicle.thrust_max / m - g - d_z - float(along[2] + weight[2])
    down = (1.0 - LEAST_THRUST) * g - d_z - float(along[2])
    turned = greatest_acceleration(config, vehicle, mission.control_period)
    able = min(up / foreseen.acceleration, down / foreseen.acceleration, turned)
    if able <= 0.0:
        raise ArgumentError(
            f"speed_max = {mission.speed_max!r}, gust rms = {mission.gust.rms!r}, mass_tolerance = {tolerance!r} and "
            f"drag_tolerance = {config.drag_tolerance!r} together take {-able:.3g} m/s^2 more than the rotors have; "
            "allowed: less of them, slower flight above all"
        )
    feedback = max(0.0, a_max - able)
    left = a_max - feedback
    position = max(foreseen.position, unforeseen.position) * left
    speed = max(foreseen.velocity, unforeseen.velocity) * left
    return TrackingBound(
        _FLOOR[0] + position + float(across[0]),
        _FLOOR[0] + position + float(along[0] + weight[0]),
        _FLOOR[1] + speed + float(np.hypot(across[1], along[1] + weight[1])),
        feedback,
    )
