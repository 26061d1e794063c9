"""Example C.2: a unicycle with a camera, the goal flag at the origin and the start flag at (d_0, 0).

    x_1' = u_1 cos phi,   x_2' = u_1 sin phi,   phi' = u_2,   (d_0' = 0)

    y_1 = tan(phi - atan(-x_2, d_0 - x_1))
    y_2 = tan(phi - atan(-x_2, -x_1))

with the two-argument atan: on the image plane of a camera of focal length one, the distances of the flags from the
centre. Where d_0 is not known it is a state, and the robot maps its environment while it localises itself in it. The
tangent has period pi: the formula does not distinguish ahead from behind. It has poles, too, and the image has
an edge, beyond which a flag is not seen.
"""

from __future__ import annotations

import math
from functools import cache

import casadi

from mathnavi.models.textbook.system import System

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
