"""A system for the observer of Kazantzis and Kravaris: a pendulum whose damping grows with its speed.

    x_1' = x_2
    x_2' = -sin x_1 - c x_2 - d x_2^3
    y    = x_1

Here y'' is of third degree in y'. Where T_1 and T_2 of Krener and Respondek exist it is of the second at most, so for
this system they do not. A diffeomorphism to x~' = A x~ - g(y) without a linear output does exist near the origin, where
the linearisation has its eigenvalues on one side of the imaginary axis; ``power_series`` finds it.
"""

from __future__ import annotations

import casadi

from mathnavi.models.textbook.system import System

C, D = 0.2, 0.1  # [1/s], [s]


def f(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Rate x' (2,) of x (2,); there is no input."""
    x_1, x_2 = casadi.vertsplit(x)
    return casadi.vertcat(
        x_2,
        -casadi.sin(x_1) - C * x_2 - D * x_2**3,
    )


def h(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Output y (1,) of x (2,)."""
    return x[0]


KAZANTZIS_KRAVARIS = System(
    name="kazantzis-kravaris",
    title="Pendulum with cubic damping",
    states=("x_1 [rad]", "x_2 [rad/s]"),
    inputs=(),
    outputs=("y [rad]",),
    f=f,
    h=h,
    start=(0.8, 0.0),
    start_error=(-0.3, 0.3),
)
