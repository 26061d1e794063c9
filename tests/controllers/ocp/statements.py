"""Statements of optimal control problems with which many tests of this folder begin."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem


def integrator(
    name: str = "integrator", limit: float = math.inf, **state: Any
) -> tuple[OptimalControlProblem, ca.SX, ca.SX]:
    """x' = u from 0 with |u| at most ``limit``; its duration and its cost are left to the test."""
    ocp = OptimalControlProblem(name)
    x, u = ocp.state("x", **state), ocp.control("u", lower=-limit, upper=limit)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    return ocp, x, u


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
