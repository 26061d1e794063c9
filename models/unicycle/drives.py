"""Drives: they turn the inputs of a unicycle, u = (u_1 [m/s], u_2 [rad/s]), into the motion of its two driven wheels.

With the wheels' radius r and their distance b apart, a wheel that does not slip turns at

    omega_l = (u_1 - u_2 b / 2) / r,    omega_r = (u_1 + u_2 b / 2) / r.

Both drives are ``mathnavi.interfaces.protocols.ActuatorModel``. The joints of either robot are led by x_1, x_2 and
phi and end with the left and the right wheel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.kernels import integrate

WHEEL_RADIUS = 0.05  # [m] r
TRACK = 0.22  # [m] b
RIM_ACCELERATION = 4.0  # [m/s^2] at which a servo takes a wheel to another speed

_RATES = np.array([[1.0, -0.5 * TRACK], [1.0, 0.5 * TRACK]]) / WHEEL_RADIUS  # u -> (omega_l, omega_r)
_INPUTS = np.linalg.inv(_RATES)


def wheel_rates(u: Array) -> Array:
    """Rates (omega_l, omega_r) (2,) [rad/s] of the wheels under an input u (2,) [m/s, rad/s]."""
    rates: Array = _RATES @ u
    return rates


def inputs_of(rates: Array) -> Array:
    """Input u (2,) [m/s, rad/s] of wheels that turn at rates (omega_l, omega_r) (2,) [rad/s] and do not slip."""
    u: Array = _INPUTS @ rates
    return u


@dataclass(frozen=True)
class IdealDrive:
    """Kinematic drive: over a tick the robot moves along the exact arc of its input, and the wheels turn with it."""

    input_size: int = 2

    def act(self, u: Array, q: Array, v: Array, control: Array, dt: float) -> None:
        """Set the joint rates v (5,) so that over dt [s] the robot moves along the exact arc of u (2,) [m/s, rad/s]."""
        v[:3] = (integrate(q[:3], float(u[0]), float(u[1]), dt) - q[:3]) / dt
        v[3:] = wheel_rates(u)


@dataclass(frozen=True)
class DifferentialDrive:
    """Drive with a velocity servo on each wheel; friction then moves the robot.

    A servo changes its speed at a limited rate, so that a step of the input alone does not make the wheels spin.
    """

    input_size: int = 2

    def act(self, u: Array, q: Array, v: Array, control: Array, dt: float) -> None:
        """Move the servos' set rates in ``control`` (2,) [rad/s] towards those of u (2,) [m/s, rad/s] for dt [s]."""
        step = RIM_ACCELERATION / WHEEL_RADIUS * dt
        control += np.clip(wheel_rates(u) - control, -step, step)
