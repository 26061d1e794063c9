"""Demand of turning the thrust on the rotors: the acceleration that plans may have, however sudden they are.

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

from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from mathnavi.controllers.quadrotor.tracker import TrackerConfig
from mathnavi.models.quadrotor.dynamics import ROTOR_COUNT, Quadrotor

_STEP, _DURATION = 1e-3, 4.0  # [s] of the response to a jump
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
    asked = 2.0 * np.sqrt(a_max**2 - vertical**2) * peaks
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
    step, greatest = expm(_STEP * A), 0.0
    for _ in range(round((_DURATION + preview) / _STEP)):
        x = step @ x
        greatest = max(greatest, abs(float(x[6])))
    return greatest
