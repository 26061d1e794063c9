"""Motion of the missile: a rigid body with thrusters (thesis B.4), z down, theta nose-up.

The Earth frame (X_e, Y_e, Z_e) has X_e ahead, Y_e to the right and Z_e down; the body frame (X_b, Y_b, Z_b) has X_b
through the nose. In the pitch plane the state is (u, w, q, theta, x_e, z_e) and the input (F_x, F_z, M), and

    u' = F_x / m - q w - g sin theta        w' = F_z / m + q u + g cos theta
    q' = M / I_y                            theta' = q
    x_e' = u cos theta + w sin theta        z_e' = -u sin theta + w cos theta,

as printed. In space the body turns by theta about the fixed horizontal axis Y_e and then by psi about its own Z_b, and
does not roll: R = R_y(theta) R_z(psi) leads from the body frame to the Earth frame, and a dive at theta = -90 degrees
is a state like any other (psi = +-90 degrees, a nose along Y_e, is not allowed). The state is (u, v, w, q, r, theta,
psi, x_e, y_e, z_e), with the velocity (u, v, w) in the body frame and the angular velocity there

    omega = R_z(psi)' (0, theta', 0) + (0, 0, psi') = (p, q, r),   p = q tan psi,   theta' = q / cos psi,   psi' = r.

The input is (F_x, F_y, F_z, M, N), forces and moments along the axes of the body frame; the moment that keeps the body
from rolling does no work. The kinetic energy of the rotation is (A theta'^2 + I_y psi'^2) / 2 with A = I_x sin^2 psi +
I_y cos^2 psi, for I_z = I_y; so Lagrange's equations, A theta'' + A_psi psi' theta' = M cos psi and I_y psi'' - A_psi
theta'^2 / 2 = N, become

    q' = cos psi theta'' - r theta' sin psi,   theta'' = (M cos psi - A_psi r theta') / A,
    r' = (N + A_psi theta'^2 / 2) / I_y,       A_psi = dA / dpsi = 2 (I_x - I_y) sin psi cos psi,

and with g_b = R' (0, 0, g) = g (-sin theta cos psi, sin theta sin psi, cos theta)

    (u, v, w)' = F / m - omega x (u, v, w) + g_b,   (x_e, y_e, z_e)' = R (u, v, w).

At psi = r = v = y_e = 0 and F_y = N = 0 that is the pitch plane. The tests compare everything with MuJoCo.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import casadi

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import FieldError

TICK = 1e-3
"""tick [s] of the missile's physics"""

PITCH_STATES = ("u", "w", "q", "theta", "x_e", "z_e")
PITCH_INPUTS = ("F_x", "F_z", "M")
SPATIAL_STATES = ("u", "v", "w", "q", "r", "theta", "psi", "x_e", "y_e", "z_e")
SPATIAL_INPUTS = ("F_x", "F_y", "F_z", "M", "N")
UNITS = {
    **dict.fromkeys(("u", "v", "w"), "m/s"),
    **dict.fromkeys(("q", "r"), "rad/s"),
    **dict.fromkeys(("theta", "psi"), "rad"),
    **dict.fromkeys(("x_e", "y_e", "z_e"), "m"),
    **dict.fromkeys(("F_x", "F_y", "F_z"), "N"),
    **dict.fromkeys(("M", "N"), "N m"),
}


@configuration
class Body:
    """Parameters of a missile in its equations of motion.

    The thesis prints mass, transversal inertia and gravity. A homogeneous cylinder 3.807 m long and 0.2286 m thick has
    both, and its inertia about the long axis is the default here; in the pitch plane it does not matter.
    """

    mass: Positive = 204.02  # [kg] m
    inertia: Positive = 247.437  # [kg m^2] I_y = I_z
    axial_inertia: Positive = 1.3327  # [kg m^2] I_x
    gravity: Positive = 9.8  # [m/s^2] g

    def __post_init__(self) -> None:
        if self.axial_inertia > 2.0 * self.inertia:
            raise FieldError(
                f"axial_inertia = {self.axial_inertia!r}; no body has more than twice inertia = {self.inertia!r}"
            )

    @property
    def numbers(self) -> tuple[float, float, float, float]:
        """(m, I_y, I_x, g), as the compiled kernels take them."""
        return self.mass, self.inertia, self.axial_inertia, self.gravity


NOMINAL = Body()
"""body of the thesis' missile"""


@lru_cache(maxsize=8)
def pitch_dynamics(body: Body = NOMINAL) -> casadi.Function:
    """f(x, u) -> x' (6,) in the pitch plane, as printed."""
    x, u = casadi.SX.sym("x", 6), casadi.SX.sym("u", 3)
    sin, cos = casadi.sin(x[3]), casadi.cos(x[3])  # once: derivatives of the recorded plans are summed over one node
    rates = pitch_rates(casadi.vertsplit(x), casadi.vertsplit(u), body, sin=lambda _: sin, cos=lambda _: cos)
    return casadi.Function("f", [x, u], [casadi.vertcat(*rates)], ["x", "u"], ["x_dot"])


def pitch_rates(
    x: Sequence[Any], u: Sequence[Any], body: Body, *, sin: Callable[[Any], Any], cos: Callable[[Any], Any]
) -> tuple[Any, ...]:
    """Rates x' of (u, w, q, theta, x_e, z_e) under (F_x, F_z, M) in the pitch plane, stated once.

    ``x`` and ``u`` are numbers, arrays or CasADi expressions, ``sin`` and ``cos`` the functions of theta for them.
    """
    forward, downward, q, theta, _, _ = x  # u, w, q, theta
    F_x, F_z, M = u
    m, I_y, _, g = body.numbers
    return (
        F_x / m - q * downward - g * sin(theta),
        F_z / m + q * forward + g * cos(theta),
        M / I_y,
        q,
        forward * cos(theta) + downward * sin(theta),
        -forward * sin(theta) + downward * cos(theta),
    )


@lru_cache(maxsize=8)
def spatial_dynamics(body: Body = NOMINAL) -> casadi.Function:
    """f(x, u) -> x' (10,) in space; cos psi = 0 is a singularity of the angles."""
    x, u = casadi.SX.sym("x", 10), casadi.SX.sym("u", 5)
    m, I_y, I_x, g = body.numbers
    V, theta, psi = x[0:3], x[5], x[6]
    q, r, F, M, N = x[3], x[4], u[0:3], u[3], u[4]
    sin, cos = casadi.sin(psi), casadi.cos(psi)
    theta_dot = q / cos
    A = I_x * sin**2 + I_y * cos**2
    A_psi = 2.0 * (I_x - I_y) * sin * cos
    R = rotation(theta, psi)
    omega = casadi.vertcat(q * sin / cos, q, r)
    rate = casadi.vertcat(
        F / m - casadi.cross(omega, V) + R.T @ casadi.vertcat(0.0, 0.0, g),
        cos * (M * cos - A_psi * r * theta_dot) / A - r * theta_dot * sin,
        (N + 0.5 * A_psi * theta_dot**2) / I_y,
        theta_dot,
        r,
        R @ V,
    )
    return casadi.Function("f", [x, u], [rate], ["x", "u"], ["x_dot"])


def rotation(theta: casadi.SX, psi: casadi.SX) -> casadi.SX:
    """R = R_y(theta) R_z(psi) (3, 3), from the body frame to the Earth frame."""
    sin, cos = casadi.sin(theta), casadi.cos(theta)
    pitch = casadi.blockcat([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    sin, cos = casadi.sin(psi), casadi.cos(psi)
    yaw = casadi.blockcat([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return pitch @ yaw
