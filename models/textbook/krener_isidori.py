"""A system with linear error dynamics in the right coordinates (2.3): van der Pol's oscillator, the output sinh x_1.

    x_1' = x_2
    x_2' = -x_1 + mu (1 - x_1^2) x_2 + u
    y    = sinh x_1

In Lienard's coordinates T_1(x) = (x_1, x_2 - mu (x_1 - x_1^3 / 3)) and with T_2(y) = arsinh y, which are global,

    x~_1' = x~_2 + mu (y~ - y~^3 / 3)
    x~_2' = -y~ + u
    y~    = x~_1:

linear up to the injection of the output. Krener and Isidori (Syst. Control Lett. 3, 1983) say when T_1 exists for a
linear output, Krener and Respondek (SIAM J. Control Optim. 23, 1985) add T_2.
"""

from __future__ import annotations

import casadi
import numpy as np

from mathnavi.models.textbook.system import ObserverForm, System

MU = 1.0


def f(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Rate x' (2,) of x (2,) under u (1,)."""
    x_1, x_2 = casadi.vertsplit(x)
    return casadi.vertcat(
        x_2,
        -x_1 + MU * (1.0 - x_1**2) * x_2 + u,
    )


def h(x: casadi.SX, u: casadi.SX) -> casadi.SX:
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
    f=f,
    h=h,
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
