"""Example 2.2 (an observer does not imply observability).

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
"""

from __future__ import annotations

import casadi
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.system import System


def f(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Rate x' (3,) of x (3,) under u (1,)."""
    x_1, x_2, x_3 = casadi.vertsplit(x)
    return casadi.vertcat(
        u,
        x_1 + x_2**2,
        -x_3 + x_2,
    )


def h(x: casadi.SX, u: casadi.SX) -> casadi.SX:
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
    f=f,
    h=h,
    start=(-3.0, 0.0, 0.0),
    start_error=(1.0, -1.0, 1.0),
    constant=(0.0,),
    amplitude=(1.0,),
)
