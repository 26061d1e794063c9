"""Problems that leave nothing to choose: no controls, a start that is given, a fixed duration.

Their one trajectory is that of an initial value problem, which may be stiff: on uniform nodes a boundary layer of 1e-4
of T is inside the first interval, and no solver finds what is there. An integrator for stiff equations finds it; its
steps are the nodes, its states the guess.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from mathnavi.controllers.ocp.feasibility.enclosure import pinned
from mathnavi.controllers.ocp.grid import LEAST_WIDTH, Grid
from mathnavi.controllers.ocp.problem_functions import GuessedTrajectory, ProblemFunctions
from mathnavi.interfaces.signals import Array

_TOLERANCE = 1e-6  # of the integrator, over the scales
_MOST_NODES = 60


def initial_value(problem: ProblemFunctions, parameters: Array) -> tuple[Grid, GuessedTrajectory] | None:
    """Nodes at an integrator's steps and the trajectory there; None where something is left to choose, or it diverges.

    Args:
        problem: the problem as compiled functions.
        parameters: (np,) values of the problem's parameters.
    """
    start = pinned(problem, parameters, "start")
    if problem.nu or problem.free_duration or not (start.lower == start.upper).all():
        return None
    duration, scale = problem.guess_duration, problem.state_scale
    x, u, t, p = problem.dynamics.sx_in()
    rates = problem.dynamics(x, u, t, p)
    slopes = ca.Function("slopes", [x, u, t, p], [rates, ca.densify(ca.jacobian(rates, x))])

    def at(tau: float, y: Array) -> tuple[Array, Array]:
        found, jacobian = slopes(y * scale, [], tau * duration, parameters)
        return duration * np.array(found.full())[:, 0] / scale, duration * np.array(jacobian.full()) * scale / scale[
            :, None
        ]

    found = solve_ivp(
        lambda tau, y: at(tau, y)[0],
        (0.0, 1.0),
        start.lower / scale,
        method="Radau",
        jac=lambda tau, y: at(tau, y)[1],
        rtol=_TOLERANCE,
        atol=_TOLERANCE,
    )
    if not found.success or not np.isfinite(found.y).all():
        return None
    steps = found.t[:: math.ceil(len(found.t) / _MOST_NODES)]
    inner = steps[(steps >= LEAST_WIDTH) & (steps <= 1.0 - LEAST_WIDTH)]
    guess = GuessedTrajectory(found.t, found.y.T * scale, np.zeros((len(found.t), 0)), duration)
    return Grid(np.concatenate([[0.0], inner, [1.0]])), guess
