"""Example 2.1 (observability does not imply an observer).

    x_1' = -x_1 + u x_2^3
    x_2' =  x_2 + x_1^2
    y    =  x_1

With u = 0 the output does not depend on x_2; u = 1 distinguishes all initial points. The linearisation at the origin
has the eigenvalue 1 along x_2, which y does not see, so no smooth observer has asymptotically stable error dynamics.
Under u = 1 the solution from the start below escapes at 1.908 s.
"""

from __future__ import annotations

import casadi

from mathnavi.models.textbook.system import System


def f(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Rate x' (2,) of x (2,) under u (1,)."""
    x_1, x_2 = casadi.vertsplit(x)
    return casadi.vertcat(
        -x_1 + u * x_2**3,
        x_2 + x_1**2,
    )


def h(x: casadi.SX, u: casadi.SX) -> casadi.SX:
    """Output y (1,) of x (2,)."""
    return x[0]


EXAMPLE_2_1 = System(
    name="example-2-1",
    title="Example 2.1",
    states=("x_1 [-]", "x_2 [-]"),
    inputs=("u [1/s]",),
    outputs=("y [-]",),
    f=f,
    h=h,
    start=(0.2, 0.3),
    start_error=(0.0, 0.1),
    constant=(1.0,),
    amplitude=(0.0,),
)
