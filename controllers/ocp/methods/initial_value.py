"""Problems that leave nothing to choose: no controls, a start that is given, a fixed duration.

Their one trajectory is that of an initial value problem, which may be stiff: on uniform nodes a boundary layer of 1e-4
of T is inside the first interval, and no solver finds what is there. An integrator for stiff equations finds it; its
steps are the nodes, its states the guess.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
from scipy.integrate import Radau

from mathnavi.controllers.ocp.call import check
from mathnavi.controllers.ocp.feasibility.enclosure import pinned
from mathnavi.controllers.ocp.grid import LEAST_WIDTH, Grid
from mathnavi.controllers.ocp.problem_functions import GuessedTrajectory, ProblemFunctions
from mathnavi.interfaces.signals import Array

_TOLERANCE = 1e-6  # of the integrator, over the scales
_MOST_NODES = 60
_MOST_STEPS = 2000  # of the integrator, beyond which a motion has too much in it for so few nodes


def initial_value(problem: ProblemFunctions, parameters: Array) -> tuple[Grid, GuessedTrajectory] | None:
    """Nodes at an integrator's steps and the trajectory there.

    None where something is left to choose, and where the motion diverges, is not finite or takes too many steps: then
    the solver says what is wrong.

    Args:
        problem: the problem as compiled functions.
        parameters: (np,) values of the problem's parameters.
    """
    start = pinned(problem, parameters, "start")
    if problem.nu or problem.free_duration or not (start.lower == start.upper).all():
        return None
    duration, scale = problem.guess_duration, problem.state_scale
    inputs = problem.dynamics.sx_in()
    rates = problem.dynamics(*inputs)
    slopes = ca.Function("slopes", inputs, [rates, ca.densify(ca.jacobian(rates, inputs[0]))])

    def at(tau: float, y: Array) -> tuple[Array, Array]:
        check()
        found, jacobian = (np.array(each.full()) for each in slopes(y * scale, [], tau * duration, parameters))
        return duration * found[:, 0] / scale, duration * jacobian * scale / scale[:, None]

    times, states = [0.0], [start.lower / scale]
    try:
        with np.errstate(all="ignore"):
            stepper = Radau(
                lambda tau, y: at(tau, y)[0], 0.0, states[0], 1.0, rtol=_TOLERANCE, atol=_TOLERANCE,
                jac=lambda tau, y: at(tau, y)[1],
            )  # fmt: skip
            while stepper.status == "running" and len(times) <= _MOST_STEPS:
                stepper.step()
                times.append(float(stepper.t))
                states.append(stepper.y.copy())
    except ValueError:  # of SciPy, for what is not finite
        return None
    t, y = np.array(times), np.array(states)
    if stepper.status != "finished" or not np.isfinite(y).all():
        return None
    steps = t[:: math.ceil(len(t) / _MOST_NODES)]
    inner = steps[(steps >= LEAST_WIDTH) & (steps <= 1.0 - LEAST_WIDTH)]
    guess = GuessedTrajectory(t, y * scale, np.zeros((len(t), 0)), duration)
    return Grid(np.concatenate([[0.0], inner, [1.0]])), guess
