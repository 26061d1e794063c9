"""Textbook systems by name.

**Example 2.1** (observability does not imply an observer):

    x_1' = -x_1 + u x_2^3
    x_2' =  x_2 + x_1^2
    y    =  x_1

With u = 0 the output does not depend on x_2; u = 1 distinguishes all initial points. The linearisation at the origin
has the eigenvalue 1 along x_2, which y does not see, so no smooth observer has asymptotically stable error dynamics.
Under u = 1 the solution from the start below escapes at 1.908 s.

**Example 2.2** (an observer does not imply observability):

    x_1' = u
    x_2' = x_1 + x_2^2
    x_3' = -x_3 + x_2
    y    = x_2

is not observable, for x_3 neither is measured nor acts on the others, and still has the observer

    x^_1' = u + alpha (y - x^_2)
    x^_2' = x^_1 + y^2 + beta (y - x^_2)
    x^_3' = -x^_3 + y,

whose error e = x^ - x obeys e_1' = -alpha e_2, e_2' = e_1 - beta e_2, e_3' = -e_3 for any input: s^2 + beta s +
alpha has its roots in the left half plane for alpha > 0 and beta > 0, and only then. Most solutions escape: under u =
sin t from x = (0.1, -0.5, 0) x_2 does so at 2.649 s. With x_1 below zero, as from the start below, they do not.

**Example C.2**: a unicycle with a camera, the goal flag at the origin and the start flag at (d_0, 0).

    x_1' = u_1 cos phi,   x_2' = u_1 sin phi,   phi' = u_2,   (d_0' = 0)

    y_1 = tan(phi - atan(-x_2, d_0 - x_1))
    y_2 = tan(phi - atan(-x_2, -x_1))

with the two-argument atan: on the image plane of a camera of focal length one, the distances of the flags from the
centre. Where d_0 is not known it is a state, and the robot maps its environment while it localises itself in it. The
tangent has period pi: the formula does not distinguish ahead from behind. It has poles, too, and the image has
an edge, beyond which a flag is not seen.

**Krener and Isidori's system**, with linear error dynamics in the right coordinates (2.3), is van der Pol's oscillator
with the output sinh x_1.

    x_1' = x_2
    x_2' = -x_1 + mu (1 - x_1^2) x_2 + u
    y    = sinh x_1

In Lienard's coordinates T_1(x) = (x_1, x_2 - mu (x_1 - x_1^3 / 3)) and with T_2(y) = arsinh y, which are global,

    x~_1' = x~_2 + mu (y~ - y~^3 / 3)
    x~_2' = -y~ + u
    y~    = x~_1:

linear up to the injection of the output. Krener and Isidori (Syst. Control Lett. 3, 1983) say when T_1 exists for a
linear output, Krener and Respondek (SIAM J. Control Optim. 23, 1985) add T_2.

**The system for the observer of Kazantzis and Kravaris** is a pendulum whose damping grows with its speed.

    x_1' = x_2
    x_2' = -sin x_1 - c x_2 - d x_2^3
    y    = x_1

Here y'' is of third degree in y'. Where T_1 and T_2 of Krener and Respondek exist it is of the second at most, so for
this system they do not. A diffeomorphism to x~' = A x~ - g(y) without a linear output does exist near the origin, where
the linearisation has its eigenvalues on one side of the imaginary axis; ``power_series`` finds it.
"""

from __future__ import annotations

import math
from functools import cache

import casadi
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.system import ObserverForm, System


def _rate_2_1(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Rate x' (2,) of x (2,) under u (1,)."""
    x_1, x_2 = casadi.vertsplit(x)
    return casadi.vertcat(
        -x_1 + u * x_2**3,
        x_2 + x_1**2,
    )


def _output_2_1(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Output y (1,) of x (2,)."""
    return x[0]


EXAMPLE_2_1 = System(
    name="example-2-1",
    title="Example 2.1",
    states=("x_1 [-]", "x_2 [-]"),
    inputs=("u [1/s]",),
    outputs=("y [-]",),
    f=_rate_2_1,
    h=_output_2_1,
    start=(0.2, 0.3),
    start_error=(0.0, 0.1),
    constant=(1.0,),
    amplitude=(0.0,),
)


def _rate_2_2(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Rate x' (3,) of x (3,) under u (1,)."""
    x_1, x_2, x_3 = casadi.vertsplit(x)
    return casadi.vertcat(
        u,
        x_1 + x_2**2,
        -x_3 + x_2,
    )


def _output_2_2(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Output y (1,) of x (3,)."""
    return x[1]


def observer(x_hat: casadi.SX, u: casadi.SX, y: casadi.SX, alpha: float, beta: float) -> casadi.SX:
    """Rate x^' (3,) of the observer at x^ (3,) under u (1,) with the output y (1,) and its gains."""
    x_1, x_2, x_3 = casadi.vertsplit(x_hat)
    return casadi.vertcat(
        u + alpha * (y - x_2),
        x_1 + y**2 + beta * (y - x_2),
        -x_3 + y,
    )


def error_dynamics(alpha: float, beta: float) -> Array:
    """Matrix (3, 3) of e'."""
    return np.array([[0.0, -alpha, 0.0], [1.0, -beta, 0.0], [0.0, 0.0, -1.0]])


EXAMPLE_2_2 = System(
    name="example-2-2",
    title="Example 2.2",
    states=("x_1 [-]", "x_2 [-]", "x_3 [-]"),
    inputs=("u [-]",),
    outputs=("y [-]",),
    f=_rate_2_2,
    h=_output_2_2,
    start=(-3.0, 0.0, 0.0),
    start_error=(1.0, -1.0, 1.0),
    constant=(0.0,),
    amplitude=(1.0,),
)


DISTANCE = 4.0  # [m] d_0
EDGE = 5.0  # of the image, |y|: 79 degrees off the optical axis


@cache
def camera_and_flags(distance_known: bool = True) -> System:
    """The system with the state (x_1, x_2, phi), or (x_1, x_2, phi, d_0)."""

    def f(x: casadi.SX, u: casadi.SX) -> casadi.SX:
        phi, (u_1, u_2) = x[2], casadi.vertsplit(u)
        rate = casadi.vertcat(
            u_1 * casadi.cos(phi),
            u_1 * casadi.sin(phi),
            u_2,
        )
        return rate if distance_known else casadi.vertcat(rate, 0.0)

    def h(x: casadi.SX, u: casadi.SX) -> casadi.SX:
        x_1, x_2, phi = x[0], x[1], x[2]
        d_0 = DISTANCE if distance_known else x[3]
        return casadi.vertcat(
            casadi.tan(phi - casadi.atan2(-x_2, d_0 - x_1)),
            casadi.tan(phi - casadi.atan2(-x_2, -x_1)),
        )

    distance = () if distance_known else (("d_0 [m]", DISTANCE, 0.5),)
    states, start, start_error = zip(
        ("x_1 [m]", 2.5, 0.4),
        ("x_2 [m]", -4.0, -0.4),
        ("phi [rad]", 0.5 * math.pi, 0.2),
        *distance,
        strict=True,
    )
    return System(
        name="camera-and-flags",
        title=f"Example C.2, distance {'known' if distance_known else 'unknown'}",
        states=states,
        inputs=("u_1 [m/s]", "u_2 [rad/s]"),
        outputs=("y_1 [-]", "y_2 [-]"),
        f=f,
        h=h,
        start=start,
        start_error=start_error,
        constant=(0.4, 0.0),
        amplitude=(0.0, 0.6),
        angles=(2,),
        output_max=EDGE,
    )


MU = 1.0


def _oscillator_rate(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Rate x' (2,) of x (2,) under u (1,)."""
    x_1, x_2 = casadi.vertsplit(x)
    return casadi.vertcat(
        x_2,
        -x_1 + MU * (1.0 - x_1**2) * x_2 + u,
    )


def _oscillator_output(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Output y (1,) of x (2,)."""
    return casadi.sinh(x[0])


def transformed(x: casadi.SX) -> casadi.SX:
    """Coordinates T_1(x) (2,) of x (2,)."""
    x_1, x_2 = casadi.vertsplit(x)
    return casadi.vertcat(x_1, x_2 - MU * (x_1 - x_1**3 / 3.0))


def transformed_back(z: casadi.SX) -> casadi.SX:
    """State (2,) with the coordinates z (2,): the inverse of T_1."""
    z_1, z_2 = casadi.vertsplit(z)
    return casadi.vertcat(z_1, z_2 + MU * (z_1 - z_1**3 / 3.0))


def output_transformed(y: casadi.SX) -> casadi.SX:
    """Coordinate T_2(y) (1,) of the output y (1,)."""
    return casadi.asinh(y)


def g(y: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Output injection g(y, u) (2,) of the output y (1,) and the input u (1,)."""
    seen = output_transformed(y)
    return casadi.vertcat(-MU * (seen - seen**3 / 3.0), seen - u)


KRENER_ISIDORI = System(
    name="krener-isidori",
    title="Van der Pol, y = sinh x₁",
    states=("x_1 [-]", "x_2 [-]"),
    inputs=("u [-]",),
    outputs=("y [-]",),
    f=_oscillator_rate,
    h=_oscillator_output,
    start=(1.0, 0.0),
    start_error=(1.0, -1.5),
    constant=(0.0,),
    amplitude=(0.5,),
    form=ObserverForm(
        T_1=transformed,
        T_1_inverse=transformed_back,
        T_2=output_transformed,
        A=np.array([[0.0, 1.0], [0.0, 0.0]]),
        C=np.array([[1.0, 0.0]]),
        g=g,
    ),
)


C, D = 0.2, 0.1  # [1/s], [s]


def _pendulum_rate(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Rate x' (2,) of x (2,); there is no input."""
    x_1, x_2 = casadi.vertsplit(x)
    return casadi.vertcat(
        x_2,
        -casadi.sin(x_1) - C * x_2 - D * x_2**3,
    )


def _pendulum_output(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Output y (1,) of x (2,)."""
    return x[0]


KAZANTZIS_KRAVARIS = System(
    name="kazantzis-kravaris",
    title="Pendulum with cubic damping",
    states=("x_1 [rad]", "x_2 [rad/s]"),
    inputs=(),
    outputs=("y [rad]",),
    f=_pendulum_rate,
    h=_pendulum_output,
    start=(0.8, 0.0),
    start_error=(-0.3, 0.3),
)


SYSTEMS: dict[str, System] = {
    system.name: system for system in (EXAMPLE_2_1, EXAMPLE_2_2, camera_and_flags(), KRENER_ISIDORI, KAZANTZIS_KRAVARIS)
}
