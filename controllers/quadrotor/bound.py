"""What the quadrotor's tracker keeps: the deviation from a plan that the certificate has to allow for.

Two parts add up: how far the reference is from the plan (``reference.deviation``) and how far the vehicle is from the
reference. The second comes from the loop on one axis, about an attitude that follows closely, with the letters of
``tracker``; theta is the acceleration by tilt, tau its second derivative by the rotors, r the observer's residual, and
half a period h is added to the lag of the rotors, tau_a = tau_m + h / 2, because commands are held:

    e'' = theta + d,    theta'' = tau,    r' = d - d^ - 2 omega_d r,    d^' = omega_d^2 r,
    tau_a tau' = -omega_R^2 (theta - c) - 2 zeta_R omega_R (theta' - c') - tau,
    c = -k_p (e + n) - k_v e' - d^,    c' = -k_p e' - k_v (theta + d^),

d the force per mass that nobody knows and n the noise of a position. The axis of the thrust has the rotors' lag alone
and answers faster; the same numbers serve for it.

* Gusts are Gauss-Markov, readings noisy: five standard deviations of the stationary covariance, by one Lyapunov equation;
  or, where that is less, the gusts' limit times the loop's peak-to-peak gain int |g| dt, g its impulse response.
* What the model of the vehicle may be off by is bounded and otherwise free: the peak-to-peak gain times mass_tolerance
  |a_r| + drag_tolerance |D| v_max / m, on the vertical also the greatest answer to a step times mass_tolerance g.

That is exact for the linear loop; the tests hold it against the flight in MuJoCo.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from controllers.flight.certificate import TrackingBound
from controllers.quadrotor.reference import deviation
from controllers.quadrotor.tracker import TrackerConfig
from models.aerial.mission import FlightMission
from models.quadrotor.dynamics import ROTOR_COUNT, Quadrotor
from sim.signals import Array

_DEVIATIONS = 5.0
_NUMERICAL = TrackingBound(0.03, 0.03, 0.05, 0.0)  # attitudes that follow closely but not at once
_STEP, _DURATION = 2e-3, 8.0  # [s] of the impulse responses
_E, _E_DOT, _THETA, _THETA_DOT, _TAU, _R, _D = np.eye(7)


@dataclass(frozen=True, eq=False)
class Loop:
    """The linear loop x' = A x + B (d, n), x = (e, e', theta, theta', tau, r, d^)."""

    A: Array  # (7, 7)
    B: Array  # (7, 2)
    command: Array  # (7,) c without the noise

    @staticmethod
    def of(config: TrackerConfig, vehicle: Quadrotor, period: float) -> Loop:
        """ValueError if these gains do not hold the vehicle at commands every ``period`` [s]."""
        k_p = config.position_bandwidth**2
        k_v = 2.0 * config.position_damping * config.position_bandwidth
        k_R = config.attitude_bandwidth**2
        k_Omega = 2.0 * config.attitude_damping * config.attitude_bandwidth
        observer, lag = config.disturbance_bandwidth, vehicle.motor_lag + 0.5 * period
        command = -k_p * _E - k_v * _E_DOT - _D
        rate = -k_p * _E_DOT - k_v * (_THETA + _D)
        turning = (-k_R * (_THETA - command) - k_Omega * (_THETA_DOT - rate) - _TAU) / lag
        A = np.array([_E_DOT, _THETA, _THETA_DOT, _TAU, turning, -_D - 2.0 * observer * _R, observer**2 * _R])
        B = np.column_stack([_E_DOT + _R, -k_R * k_p / lag * _TAU])
        slowest = float(np.linalg.eigvals(A).real.max())
        if slowest > -0.1:
            raise ValueError(
                f"position_bandwidth = {config.position_bandwidth!r}, attitude_bandwidth = "
                f"{config.attitude_bandwidth!r}, disturbance_bandwidth = {config.disturbance_bandwidth!r} do not hold "
                f"rotors with motor_lag = {vehicle.motor_lag!r} s (growth {slowest:.2g}/s); allowed: slower ones"
            )
        return Loop(A, B, command)

    def gains(self, row: Array) -> tuple[float, float]:
        """Peak-to-peak gain of d to an output, and the greatest answer to a step of d by 1 m/s^2."""
        phi, x = expm(_STEP * self.A), self.B[:, 0]
        response = np.empty(round(_DURATION / _STEP))
        for k in range(len(response)):
            response[k] = row @ x
            x = phi @ x
        return float(np.abs(response).sum() * _STEP), float(np.abs(response.cumsum()).max() * _STEP)

    def deviations(self, rows: Array, mission: FlightMission) -> Array:
        """(k,) standard deviations of outputs (k, 7) under the mission's gusts and the noise of its positions."""
        gust = mission.gust
        A = np.zeros((8, 8))
        A[:7, :7], A[:7, 7], A[7, 7] = self.A, self.B[:, 0], -1.0 / gust.time_constant
        noise = np.append(self.B[:, 1], 0.0)
        driving = mission.position_noise**2 * mission.control_period * np.outer(noise, noise)
        driving[7, 7] += 2.0 * gust.rms**2 / gust.time_constant
        covariance = solve_continuous_lyapunov(A, -driving)[:7, :7]
        return np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", rows, covariance, rows), 0.0))


def tracking_bound(config: TrackerConfig, vehicle: Quadrotor, mission: FlightMission) -> TrackingBound:
    """The bound over a mission of the vehicle that is believed to fly.

    The rotors can do more than a plan may ask for. Only what reference and feedback together ask for beyond their
    ability is taken from a_max, as ``feedback``; ValueError by the certificate if that leaves nothing.
    """
    loop = Loop.of(config, vehicle, mission.control_period)
    rows = np.array([_E, _E_DOT, loop.command])
    gains, steps = np.array([loop.gains(row) for row in rows]).T
    foreseen = deviation(config.reference_bandwidth, config.preview)
    unforeseen = deviation(config.reference_bandwidth, 0.0)
    a_max = mission.acceleration_max
    reference = foreseen.acceleration * a_max
    drag = config.drag_tolerance * max(vehicle.drag) / vehicle.mass * mission.speed_max
    unknown = config.mass_tolerance * reference + drag
    spread = _DEVIATIONS * loop.deviations(rows, mission)
    if mission.position_noise == 0.0:
        spread = np.minimum(spread, gains * mission.gust.limit)
    across = spread + gains * unknown
    along = across + steps * config.mass_tolerance * vehicle.gravity
    position = max(foreseen.position, unforeseen.position) * a_max
    speed = max(foreseen.velocity, unforeseen.velocity) * a_max
    able = ROTOR_COUNT * vehicle.thrust_max / (vehicle.mass * (1.0 + config.mass_tolerance)) - vehicle.gravity
    missing = reference + float(along[2]) + drag - able
    floor = _NUMERICAL
    return TrackingBound(
        floor.horizontal + position + float(across[0]),
        floor.vertical + position + float(along[0]),
        floor.speed + speed + float(math.hypot(across[1], steps[1] * config.mass_tolerance * vehicle.gravity)),
        max(floor.feedback, missing),
    )
