"""Motion of the quadrotor beneath the point mass: a rigid body with four rotors, gravity, drag and a lag of the rotors.

State x = (p, q, v, omega): p (3,) [m] and v (3,) [m/s] in the map frame (x east, y north, z up), q (4,) the unit
quaternion (w, x, y, z) of R, which leads from the body frame (x through the nose, y to the left, z along the thrust) to
the map frame, and omega (3,) [rad/s] in the body frame: that is MuJoCo's free joint. With the rotors' thrusts T_i [N]

    p' = v,    m v' = -m g e_z + R ((0, 0, T) - D R' v),    q' = q (0, omega) / 2,    J omega' = tau - omega x J omega,
    T = sum_i T_i,    tau = (sum_i y_i T_i, -sum_i x_i T_i, sum_i s_i kappa T_i),    tau_m T_i' = u_i - T_i.

(x_i, y_i) is where rotor i stands, s_i = +-1 the sense of its moment against its turn, kappa [m] the ratio of moment
and thrust, D the diagonal drag of the rotors' discs and of the hull, linear in the velocity (M. Faessler, A. Franchi,
D. Scaramuzza, IEEE Robot. Autom. Lett. 3, 2018). Input u (4,) [N] is the commanded thrust of each rotor.

The thrust of a rotor goes with the square of its speed. What is modelled is the lag of the thrust; a lag of the speed
with the same time constant differs from it only to second order in a change. Left out are the moment of a rotor that is
accelerated, its gyroscopic moment, and the ground effect.

``rigid_dynamics`` and ``dynamics`` are CasADi functions, ``flow`` is numpy; the tests compare them with MuJoCo.
"""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import Annotated

import casadi
import numpy as np
from annotated_types import Ge, Gt

from mathnavi.interfaces.bounds import FINITE, Condition, Each, Positive, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.quaternion import symbolic_rotation
from mathnavi.models.runge_kutta import classical_step

ROTORS = ("front_left", "rear_left", "rear_right", "front_right")
STATE_SIZE, ROTOR_COUNT = 13, len(ROTORS)
POSITION, ATTITUDE, VELOCITY, RATE = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)
"""slices of p, q, v and omega in a state"""

_SIDES = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])  # of the rotors: ahead, to the left
_SENSES = np.array([-1.0, 1.0, -1.0, 1.0])  # s_i: the front left rotor turns counter-clockwise
_STEP = 1.0 / 300.0  # [s] at most, of ``flow``

_Diagonal = Annotated[tuple[float, float, float], Condition(lambda values: len(values) == 3, "three numbers")]
PositiveDiagonal = Annotated[_Diagonal, Each(Gt(0.0), FINITE)]
NonNegativeDiagonal = Annotated[_Diagonal, Each(Ge(0.0), FINITE)]
INERTIA = Condition(lambda J: 2.0 * max(J) <= sum(J), "none greater than the two others together")
"""condition on the moments of inertia of a body"""


@configuration
class Quadrotor:
    """Parameters of the vehicle that flies, or of a controller's model of it."""

    mass: Positive = 1.2  # [kg] m
    inertia: Annotated[PositiveDiagonal, INERTIA] = (0.0115, 0.0115, 0.0205)  # [kg m^2] the diagonal of J
    arm: Positive = 0.2  # [m] from the centre to a hub
    moment_ratio: Positive = 0.016  # [m] kappa
    thrust_max: Positive = 9.0  # [N] of each rotor; a rotor cannot pull down
    motor_lag: Positive = 0.03  # [s] tau_m
    drag: NonNegativeDiagonal = (0.25, 0.25, 0.1)  # [N s/m] the diagonal of D
    gravity: Positive = 9.81  # [m/s^2] g

    def __post_init__(self) -> None:
        if ROTOR_COUNT * self.thrust_max <= self.mass * self.gravity:
            raise FieldError(
                f"thrust_max = {self.thrust_max!r} does not lift mass = {self.mass!r} kg; "
                f"allowed: > {self.hover_thrust:.4g} N"
            )

    @property
    def hover_thrust(self) -> float:
        """Thrust [N] of each rotor in hover."""
        return self.mass * self.gravity / ROTOR_COUNT

    @property
    def places(self) -> Array:
        """Places x_i, y_i (4, 2) [m] of the hubs in the body frame, in the order of ``ROTORS``."""
        places: Array = self.arm / math.sqrt(2.0) * _SIDES
        return places

    @cached_property
    def allocation(self) -> Array:
        """Matrix (4, 4) from the thrusts of the rotors [N] to (T, tau) [N, N m]."""
        x, y = self.places.T
        return np.array([np.ones(ROTOR_COUNT), y, -x, self.moment_ratio * _SENSES])

    @property
    def moments(self) -> Array:
        """Moment per thrust s_i kappa (4,) [m] of the rotors."""
        moments: Array = self.moment_ratio * _SENSES
        return moments


NOMINAL = Quadrotor()


@lru_cache(maxsize=8)
def rigid_dynamics(vehicle: Quadrotor = NOMINAL) -> casadi.Function:
    """f(x, T) -> x' (13,) under the thrusts T (4,) [N] that act."""
    x, thrusts = casadi.SX.sym("x", STATE_SIZE), casadi.SX.sym("T", ROTOR_COUNT)
    q, v, omega = x[ATTITUDE], x[VELOCITY], x[RATE]
    wrench = casadi.DM(vehicle.allocation) @ thrusts
    R, J, D = symbolic_rotation(q), casadi.diag(casadi.DM(vehicle.inertia)), casadi.diag(casadi.DM(vehicle.drag))
    force = casadi.vertcat(0.0, 0.0, wrench[0]) - D @ R.T @ v
    w, axis = q[0], q[1:]
    rate = casadi.vertcat(
        v,
        -0.5 * casadi.dot(axis, omega),
        0.5 * (w * omega + casadi.cross(axis, omega)),
        R @ force / vehicle.mass - casadi.DM([0.0, 0.0, vehicle.gravity]),
        casadi.solve(J, wrench[1:] - casadi.cross(omega, J @ omega)),
    )
    return casadi.Function("f", [x, thrusts], [rate], ["x", "T"], ["x_dot"])


@lru_cache(maxsize=8)
def dynamics(vehicle: Quadrotor = NOMINAL) -> casadi.Function:
    """f(x, T, u) -> (x' (13,), T' (4,)): the body and its rotors under the commanded thrusts u (4,) [N]."""
    x, thrusts = casadi.SX.sym("x", STATE_SIZE), casadi.SX.sym("T", ROTOR_COUNT)
    u = casadi.SX.sym("u", ROTOR_COUNT)
    asked = casadi.fmin(casadi.fmax(u, 0.0), vehicle.thrust_max)
    rates = [rigid_dynamics(vehicle)(x, thrusts), (asked - thrusts) / vehicle.motor_lag]
    return casadi.Function("f", [x, thrusts, u], rates, ["x", "T", "u"], ["x_dot", "T_dot"])


def flow(vehicle: Quadrotor, x: Array, thrusts: Array, dt: float) -> Array:
    """State (13,) after the rotors pushed with ``thrusts`` (4,) [N] for dt [s] from x (13,), by Runge-Kutta steps of
    order 4.

    The rotors' lag between a commanded thrust and the one that acts is left out: when an estimate is propagated, the
    rotors' thrusts at its time are not known.
    """
    f = rigid_dynamics(vehicle)
    steps = max(1, math.ceil(dt / _STEP - 1e-9))
    h = dt / steps

    def rate(state: Array, _: float) -> Array:
        return np.asarray(f(state, thrusts), dtype=np.float64)[:, 0]

    for _ in range(steps):
        x = classical_step(rate, x, h)
        x[ATTITUDE] /= np.linalg.norm(x[ATTITUDE])
    return x


def at_rest(position: Array) -> Array:
    """State (13,) of rest at a ``position`` (3,) [m], level, the nose to the east."""
    return np.array([*position, 1.0, *np.zeros(9)])
