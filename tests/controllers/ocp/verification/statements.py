"""Problems with a stationary point that is no minimum, or with none at all."""

from __future__ import annotations

import math

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from tests.controllers.ocp.statements import integrator


def concave(limit: float = math.inf) -> OptimalControlProblem:
    """Least -∫ u² of x' = u: the guess 0 is stationary, and a maximum."""
    ocp, _, u = integrator(limit=limit)
    ocp.duration(1.0)
    ocp.minimise(running=-(u**2))
    return ocp


def far_end() -> OptimalControlProblem:
    """Least -x(T)² of x' = u, |u| <= 1: the guess 0 is stationary."""
    ocp, x, _ = integrator(limit=1.0)
    ocp.duration(1.0)
    ocp.minimise(terminal=-(x**2))
    return ocp


def conjugate(duration: float) -> OptimalControlProblem:
    """Least ∫ u² - x² of x' = u from 0 to 0: a minimum at 0 for T < π, where its conjugate point is; then no bound."""
    ocp, x, u = integrator()
    ocp.duration(duration)
    ocp.minimise(running=u**2 - x**2)
    ocp.end(x, 0.0)
    return ocp


def cubed(guess: float = 0.0) -> OptimalControlProblem:
    """A double integrator with v' = u³ and a quadratic cost: its infimum is not attained."""
    ocp = OptimalControlProblem("cubed")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u", guess=guess)
    ocp.duration(8.0)
    ocp.minimise(running=x**2 + v**2 + u**2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u**3)
    ocp.start(x, 1.0)
    ocp.start(v, 0.0)
    return ocp


def singular(sign: float) -> OptimalControlProblem:
    """Least ±∫ x² of x' = u, |u| <= 1: along u = 0 the sign is Kelley's, and the minimum is 0 or -1/3."""
    ocp, x, _ = integrator(limit=1.0)
    ocp.duration(1.0)
    ocp.minimise(running=sign * x**2)
    return ocp


def chattering() -> OptimalControlProblem:
    """Least ∫ x² of a double integrator with |u| <= 1 over 5 s: its control switches without end (Fuller)."""
    ocp = OptimalControlProblem("Fuller")
    x, v, u = ocp.state("x", guess=(1.0, 0.0)), ocp.state("v", scale=1.0), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(5.0)
    ocp.minimise(running=x**2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.start(x, 1.0)
    ocp.start(v, 0.0)
    return ocp
