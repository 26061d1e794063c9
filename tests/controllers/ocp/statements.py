"""Statements of optimal control problems with which many tests of this folder begin."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


def integrator(
    name: str = "integrator", limit: float = math.inf, **state: Any
) -> tuple[OptimalControlProblem, ca.SX, ca.SX]:
    """x' = u from 0 with |u| at most ``limit``; its duration and its cost are left to the test."""
    ocp = OptimalControlProblem(name)
    x, u = ocp.state("x", **state), ocp.control("u", lower=-limit, upper=limit)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    return ocp, x, u


def two_costs() -> tuple[OptimalControlProblem, ca.SX]:
    """x' = u from -1 to 1 in 2 s, u^2 three times as dear beyond 0.1: a jump of the cost that J crosses; with x."""
    ocp = OptimalControlProblem("two costs")
    x, u = ocp.state("x", guess=(-1.0, 1.0)), ocp.control("u")
    ocp.duration(2.0)
    ocp.dynamics(x, u)
    ocp.minimise(running=ca.if_else(x > 0.1, 3.0, 1.0) * u**2)
    ocp.start(x, -1.0)
    ocp.end(x, 1.0)
    return ocp, x


def double_integrator(
    name: str = "double integrator", limit: float = math.inf, **state: Any
) -> tuple[OptimalControlProblem, ca.SX, ca.SX, ca.SX]:
    """x'' = u from rest at 0 with |u| at most ``limit``; its duration and its cost are left to the test."""
    ocp = OptimalControlProblem(name)
    x, v, u = ocp.state("x", **state), ocp.state("v"), ocp.control("u", lower=-limit, upper=limit)
    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))
    ocp.start(ca.vertcat(x, v), 0.0)
    return ocp, x, v, u


def transfer(end: float, limit: float = math.inf, name: str = "transfer") -> OptimalControlProblem:
    """x' = u from 0 to ``end`` in a second, with |u| at most ``limit`` and the least ∫ u^2."""
    ocp, x, u = integrator(name, limit)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.end(x, end)
    return ocp


def race_car() -> OptimalControlProblem:
    """s' = v, v' = u - v from rest over a distance of 1 in least time, 0 <= u <= 1, v <= 1 - sin(2 pi s) / 2.

    Full throttle, along the limit, full throttle; by quadratures of these three parts T* = 1.904682271.
    """
    ocp = OptimalControlProblem("race car")
    s, v = ocp.state("s", guess=(0.0, 1.0)), ocp.state("v", guess=1.0)
    u = ocp.control("u", lower=0.0, upper=1.0)
    ocp.minimise(terminal=ocp.free_duration(guess=1.0, lower=0.1, upper=20.0))
    ocp.dynamics(ca.vertcat(s, v), ca.vertcat(v, u - v))
    ocp.constrain(v <= 1.0 - ca.sin(2.0 * math.pi * s) / 2.0, name="limit")
    ocp.start(ca.vertcat(s, v), 0.0)
    ocp.end(s, 1.0)
    return ocp


def growing(guess: float) -> ProblemFunctions:
    """``growing_problem`` as functions."""
    return growing_problem(guess).functions()


def growing_problem(guess: float) -> OptimalControlProblem:
    """x' = e^x + u from 0 to 1 in 1 s; at a guess of 5 FATROP 1.1 raises its regularisation without end."""
    ocp = OptimalControlProblem("growing")
    x, u = ocp.state("x", guess=(guess,)), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, ca.exp(x) + u)
    ocp.start(x, 0.0)
    ocp.end(x, 1.0)
    return ocp
