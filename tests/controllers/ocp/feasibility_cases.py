"""Problems whose default guess is a stationary point of a constraint, and problems without a feasible point."""

from __future__ import annotations

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from tests.controllers.ocp.statements import double_integrator


def valve() -> OptimalControlProblem:
    """x' = u |u| from 0 to 1 in a second, min ∫ u^4: J = 1."""
    ocp = OptimalControlProblem("valve")
    x, u = ocp.state("x"), ocp.control("u", lower=-2.0, upper=2.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**4)
    ocp.dynamics(x, u * ca.fabs(u))
    ocp.start(x, 0.0)
    ocp.end(x, 1.0)
    return ocp


def cubic() -> OptimalControlProblem:
    """x' = u^3 from 0 to 1 in a second, min ∫ u^4: J = 1."""
    ocp = OptimalControlProblem("cubic")
    x, u = ocp.state("x"), ocp.control("u", lower=-2.0, upper=2.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**4)
    ocp.dynamics(x, u**3)
    ocp.start(x, 0.0)
    ocp.end(x, 1.0)
    return ocp


def sideways(distance: float = 1.0, seconds: float | None = None) -> OptimalControlProblem:
    """A unicycle moves sideways in 4 s with the least ∫ v² + w² (2.7895), or with |v|, |w| <= 1 in the least time."""
    ocp = OptimalControlProblem("sideways")
    x, y, th = (ocp.state(name) for name in ("x", "y", "th"))
    limit = 1.0 if seconds is not None else float("inf")
    v, w = (ocp.control(name, lower=-limit, upper=limit) for name in ("v", "w"))
    if seconds is None:
        ocp.duration(4.0)
        ocp.minimise(running=v**2 + w**2)
    else:
        ocp.minimise(terminal=ocp.free_duration(guess=0.5 * seconds, lower=0.1, upper=seconds))
    ocp.dynamics(ca.vertcat(x, y, th), ca.vertcat(v * ca.cos(th), v * ca.sin(th), w))
    ocp.start(ca.vertcat(x, y, th), 0.0)
    ocp.end(ca.vertcat(x, y, th), [0.0, distance, 0.0])
    return ocp


def enclosed_area() -> OptimalControlProblem:
    """A closed curve of the least ∫ u² that encloses an area of 1/2: a circle, J = 2π."""
    ocp = OptimalControlProblem("area")
    p, z, u = ocp.state("p", 2), ocp.state("z"), ocp.control("u", 2)
    ocp.duration(1.0)
    ocp.minimise(running=ca.sumsqr(u))
    ocp.dynamics(p, u)
    ocp.dynamics(z, p[0] * u[1] - p[1] * u[0])
    ocp.start(ca.vertcat(p, z), 0.0)
    ocp.end(ca.vertcat(p, z), [0.0, 0.0, 1.0])
    return ocp


def dubins() -> OptimalControlProblem:
    """Dubins' car to a target behind it, in the least time: 6.5140532 s."""
    ocp = OptimalControlProblem("Dubins")
    x, y, th = ocp.state("x", guess=(0.0, -3.0)), ocp.state("y", guess=(0.0, -0.5)), ocp.state("th", scale=3.0)
    w = ocp.control("w", lower=-1.0, upper=1.0)
    ocp.minimise(terminal=ocp.free_duration(guess=4.0, lower=0.5, upper=30.0))
    ocp.dynamics(ca.vertcat(x, y, th), ca.vertcat(ca.cos(th), ca.sin(th), w))
    ocp.start(ca.vertcat(x, y, th), 0.0)
    ocp.end(ca.vertcat(x, y), [-3.0, -0.5])
    return ocp


def horizon(seconds: float = 3.0) -> OptimalControlProblem:
    """A moving horizon of a unicycle behind a disc; its end is free, so that standing still is feasible."""
    ocp = OptimalControlProblem("horizon")
    x, y, th = (ocp.state(name) for name in ("x", "y", "th"))
    v, w = ocp.control("v", lower=-1.0, upper=1.0), ocp.control("w", lower=-1.5, upper=1.5)
    ocp.duration(seconds)
    ocp.minimise(running=x**2 + y**2 + 0.1 * th**2 + 0.05 * v**2 + 0.05 * w**2, terminal=20.0 * (x**2 + y**2) + th**2)
    ocp.dynamics(ca.vertcat(x, y, th), ca.vertcat(v * ca.cos(th), v * ca.sin(th), w))
    ocp.constrain((x + 2.0) ** 2 + y**2 >= 1.0, name="disc")
    ocp.start(ca.vertcat(x, y, th), [-4.0, 0.3, 0.0])
    return ocp


def round_a_disc(start: float = 0.0, end: float = 4.0) -> OptimalControlProblem:
    """Rest to rest along a line through the middle of a disc of radius 1 at 2, with |a| <= 2 in 4 s."""
    ocp = OptimalControlProblem("round a disc")
    p, v = ocp.state("p", 2, guess=[(start, 0.0), (end, 0.0)]), ocp.state("v", 2)
    a = ocp.control("a", 2, lower=-2.0, upper=2.0)
    ocp.duration(4.0)
    ocp.minimise(running=ca.sumsqr(a))
    ocp.dynamics(ca.vertcat(p, v), ca.vertcat(v, a))
    ocp.start(ca.vertcat(p, v), [start, 0.0, 0.0, 0.0])
    ocp.end(ca.vertcat(p, v), [end, 0.0, 0.0, 0.0])
    ocp.constrain((p[0] - 2.0) ** 2 + p[1] ** 2 >= 1.0, name="disc")
    return ocp


def one_way() -> OptimalControlProblem:
    """x' = u² from 0 to -1."""
    ocp = OptimalControlProblem("one way")
    x, u = ocp.state("x"), ocp.control("u", lower=-2.0, upper=2.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u**2)
    ocp.start(x, 0.0)
    ocp.end(x, -1.0)
    return ocp


def sledge(
    end: float, T: float, *, speed: float | None = None, most: float = float("inf"), wall: float | None = None
) -> OptimalControlProblem:
    """x'' = u from rest to ``end`` in T [s] with |u| <= 1 and v <= ``most``; at last at a ``speed``, before a wall."""
    ocp, x, v, u = double_integrator("sledge", 1.0)
    ocp.duration(T)
    ocp.minimise(running=u**2)
    ocp.end(x, end)
    if speed is not None:
        ocp.end(v, speed)
    if wall is not None:
        ocp.constrain(x + 0.1 * v <= wall, name="wall")
    if most < float("inf"):
        ocp.constrain(v <= most)
    return ocp


def swing(end: float, T: float = 4.0) -> OptimalControlProblem:
    """x'' = -x + u from rest to x(T) = ``end`` with |u| <= 1, which carries it to (1 - cos T) or less in T < π."""
    ocp = OptimalControlProblem("swing")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(T)
    ocp.minimise(running=u**2)
    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u - x))
    ocp.start(ca.vertcat(x, v), 0.0)
    ocp.end(x, end)
    return ocp
