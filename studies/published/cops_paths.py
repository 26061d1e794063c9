"""Paths and shapes of COPS 3: a cam, a chain, a channel, a robot arm, a particle, a rocket, a glider, two catalysts.

Each is stated with the data and the starting values of the AMPL models of the report (Dolan, Moré and Munson, 2004),
the latter at a few places. The report's own programmes are these problems on a given number of uniform intervals.
"""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem


def camshape() -> MultiPhaseProblem:
    """A convex cam whose valve opens the most in one rotation (COPS 3, problem 3), as its points become dense.

        maximise π R_v / Θ ∫_0^Θ r dθ   subject to   1 / r + (1 / r)'' >= 0,   |r'| <= 1.5,   1 <= r <= 2,
            Θ = 2π/5,   r = 1 for θ <= 0,   r(Θ) = 2,   R_v = 1

    r is the radius over the angle. The first constraint, on the curvature, is r'' <= (r^2 + 2 r'^2) / r; so r' may fall
    in a corner: two phases, the rise and the dwell, and r' of the dwell begins at or below that of the rise. The best
    cam rises along a straight edge, r = 1 / cos θ, until r' = 1.5, then along a spiral, and dwells at r = 2.
    """
    ANGLE, SLOPE, VALVE = 2.0 * math.pi / 5.0, 1.5, 1.0  # [rad]
    LEAST, MOST = 1.0, 2.0
    cam = MultiPhaseProblem("cam shape")
    stated = []
    for name in ("rise", "dwell"):
        phase = cam.phase(name)
        r = phase.state("r", lower=LEAST, upper=MOST, guess=(LEAST + MOST) / 2)
        slope = phase.state("slope", lower=-SLOPE, upper=SLOPE)
        bend = phase.control("bend")  # r''
        width = phase.free_duration(guess=ANGLE / 2, upper=ANGLE)  # [rad]
        phase.minimise(running=-math.pi * VALVE / ANGLE * r)
        phase.dynamics(r, slope)
        phase.dynamics(slope, bend)
        phase.constrain(r**2 + 2 * slope**2 - r * bend >= 0, name="convex")
        stated.append((phase, r, slope, width))
    (rise, r_rise, slope_rise, rise_width), (dwell, r_dwell, slope_dwell, dwell_width) = stated
    rise.start(r_rise, LEAST)
    rise.start(slope_rise, 0.0)
    dwell.end(r_dwell, MOST)
    cam.couple(dwell.initial(r_dwell) == r_rise, name="radius")
    cam.couple(dwell.initial(slope_dwell) <= slope_rise, name="corner")
    cam.couple(rise_width + dwell_width == ANGLE, name="angle")
    return cam


def chain() -> OptimalControlProblem:
    """The chain that hangs between two points with the least potential energy (COPS 3, problem 4).

        minimise ∫_0^1 x sqrt(1 + u^2) dt   subject to   x' = u,   ∫_0^1 sqrt(1 + u^2) dt = 4,   x from 1 to 3

    J* = 5.0684801, a catenary.
    """
    ocp = OptimalControlProblem("chain")
    x = ocp.state("x", guess=(1.0, 1.0, 3.0))
    u = ocp.control("u", guess=(-2.0, 6.0))
    ocp.duration(1.0)

    ocp.minimise(running=x * ca.sqrt(1 + u**2))
    ocp.dynamics(x, u)
    ocp.integral(ca.sqrt(1 + u**2), name="length", lower=4.0, upper=4.0)
    ocp.start(x, 1.0)
    ocp.end(x, 3.0)
    return ocp


def channel() -> OptimalControlProblem:
    """A fluid that is injected through the wall of a channel: a boundary value problem (COPS 3, problem 7).

        u'''' = R (u' u'' - u u''')   with   u(0) = 0,   u(1) = 1,   u'(0) = u'(1) = 0,   R = 10

    for the potential u of the flow. Nothing is left to choose: the cost is the constant 1.
    """
    REYNOLDS = 10.0
    ocp = OptimalControlProblem("channel")
    u = ocp.state("u", guess=lambda t: t**2 * (3 - 2 * t))
    du = ocp.state("du", guess=lambda t: 6 * t * (1 - t))
    ddu = ocp.state("ddu", guess=(6.0, -6.0))
    dddu = ocp.state("dddu", guess=-12.0)
    ocp.duration(1.0)

    ocp.minimise(terminal=1.0)
    ocp.dynamics(u, du)
    ocp.dynamics(du, ddu)
    ocp.dynamics(ddu, dddu)
    ocp.dynamics(dddu, REYNOLDS * (du * ddu - u * dddu))
    ocp.start(u, 0.0)
    ocp.start(du, 0.0)
    ocp.end(u, 1.0)
    ocp.end(du, 0.0)
    return ocp


def robot() -> OptimalControlProblem:
    """A robot arm turned in the least time: a bar that slides and swings on two axes (COPS 3, problem 8).

        minimise T   subject to   ρ'' = u1 / L,   θ'' = u2 / I_θ,   φ'' = u3 / I_φ,   |u| <= 1,
            I_φ = ((L - ρ)^3 + ρ^3) / 3,   I_θ = I_φ sin^2 φ,   L = 5,   0 <= ρ <= L,   |θ| <= π,   0 <= φ <= π,
            (4.5, 0, π/4) to (4.5, 2π/3, π/4), rest to rest

    All three controls are bang-bang: T* = 9.1409117.
    """
    L, TURN = 5.0, 2.0 * math.pi / 3.0  # [m], [rad]
    ocp = OptimalControlProblem("robot")
    rho = ocp.state("rho", lower=0.0, upper=L, guess=4.5)
    theta = ocp.state("theta", lower=-math.pi, upper=math.pi, guess=(0.0, TURN / 4, TURN))  # [rad]
    phi = ocp.state("phi", lower=0.0, upper=math.pi, guess=math.pi / 4)  # [rad]
    drho, dphi = ocp.state("drho"), ocp.state("dphi")
    dtheta = ocp.state("dtheta", guess=(0.0, 2 * TURN))
    u1, u2, u3 = (ocp.control(f"u{k}", lower=-1.0, upper=1.0) for k in (1, 2, 3))
    T = ocp.free_duration(guess=1.0)

    ocp.minimise(terminal=T)
    inertia = ((L - rho) ** 3 + rho**3) / 3
    ocp.dynamics(rho, drho)
    ocp.dynamics(theta, dtheta)
    ocp.dynamics(phi, dphi)
    ocp.dynamics(drho, u1 / L)
    ocp.dynamics(dtheta, u2 / (inertia * ca.sin(phi) ** 2))
    ocp.dynamics(dphi, u3 / inertia)
    for state, start, end in ((rho, 4.5, 4.5), (theta, 0.0, TURN), (phi, math.pi / 4, math.pi / 4)):
        ocp.start(state, start)
        ocp.end(state, end)
    for state in (drho, dtheta, dphi):
        ocp.start(state, 0.0)
        ocp.end(state, 0.0)
    return ocp


def steering() -> OptimalControlProblem:
    """A particle of constant thrust, steered to a height and a speed in the least time (COPS 3, problem 9).

        minimise T   subject to   y1'' = a cos u,   y2'' = a sin u,   |u| <= π/2,   a = 100,
                                  rest at 0 to y2 = 5, y1' = 45, y2' = 0

    The optimum follows the linear tangent law: T* = 0.55457088.
    """
    THRUST, HEIGHT, SPEED = 100.0, 5.0, 45.0
    ocp = OptimalControlProblem("particle steering")
    y1 = ocp.state("y1")
    y2 = ocp.state("y2", guess=(0.0, HEIGHT))
    dy1 = ocp.state("dy1", guess=(0.0, SPEED))
    dy2 = ocp.state("dy2")
    u = ocp.control("u", lower=-math.pi / 2, upper=math.pi / 2)  # [rad]
    T = ocp.free_duration(guess=1.0)

    ocp.minimise(terminal=T)
    ocp.dynamics(y1, dy1)
    ocp.dynamics(y2, dy2)
    ocp.dynamics(dy1, THRUST * ca.cos(u))
    ocp.dynamics(dy2, THRUST * ca.sin(u))
    for state in (y1, y2, dy1, dy2):
        ocp.start(state, 0.0)
    for state, value in ((y2, HEIGHT), (dy1, SPEED), (dy2, 0.0)):
        ocp.end(state, value)
    return ocp


def rocket() -> OptimalControlProblem:
    """Goddard's rocket: the greatest height for a given amount of fuel, against drag and gravity (COPS 3, problem 10).

        maximise h(T)   subject to   h' = v,   v' = (F - D(h, v)) / m - 1 / h^2,   m' = -2 F,
            D = 310 v^2 exp(-500 (h - 1)),   0 <= F <= 3.5,   h >= 1,   v >= 0,   0.6 <= m <= 1,   (1, 0, 1) to m = 0.6

    In units of the planet's radius, its gravity and the mass at take-off. Full thrust, a singular arc, and a coast:
    h(T)* = 1.0128369.
    """
    ocp = OptimalControlProblem("rocket")
    h = ocp.state("h", lower=1.0, guess=1.0)
    v = ocp.state("v", lower=0.0, guess=(0.0, 0.25, 0.0))
    m = ocp.state("m", lower=0.6, upper=1.0, guess=(1.0, 0.6))
    F = ocp.control("F", lower=0.0, upper=3.5, guess=1.75)
    ocp.free_duration(guess=1.0)

    ocp.minimise(terminal=-h)
    ocp.dynamics(h, v)
    ocp.dynamics(v, (F - 310 * v**2 * ca.exp(-500 * (h - 1))) / m - 1 / h**2)
    ocp.dynamics(m, -2 * F)
    ocp.start(h, 1.0)
    ocp.start(v, 0.0)
    ocp.start(m, 1.0)
    ocp.end(m, 0.6)
    return ocp


def glider() -> OptimalControlProblem:
    """A hang glider that crosses a thermal and flies as far as it can (COPS 3, problem 11).

        maximise x(T)   subject to   x' = v_x,   v_x' = -(L w + D v_x) / (m v),
                                     y' = v_y,   v_y' = (L v_x - D w) / (m v) - g,   0 <= c <= 1.4,   x, v_x >= 0,
            r = (x / 100 - 2.5)^2,   w = v_y - 2.5 (1 - r) e^(-r),   v^2 = v_x^2 + w^2,
            L = c ρ S v^2 / 2,   D = (0.034 + 0.069662 c^2) ρ S v^2 / 2,   ρ = 1.13, S = 14, m = 100, g = 9.81,
            (x, y) = (0, 1000) to y = 900, (v_x, v_y) = (13.23, -1.288) at either end

    c is the lift coefficient. Speeds and gravity are rounded, which makes it another problem than Bulirsch's.
    """
    MASS, GRAVITY, AREA, DENSITY = 100.0, 9.81, 14.0, 1.13  # [kg], [m/s^2], [m^2], [kg/m^3]
    GLIDE = (13.23, -1.288)  # [m/s] v_x, v_y
    ocp = OptimalControlProblem("glider")
    x = ocp.state("x", lower=0.0, guess=(0.0, GLIDE[0]))  # [m]
    y = ocp.state("y", guess=(1000.0, 900.0))  # [m]
    v_x = ocp.state("v_x", lower=0.0, guess=GLIDE[0])  # [m/s]
    v_y = ocp.state("v_y", guess=GLIDE[1])  # [m/s]
    c = ocp.control("c", lower=0.0, upper=1.4, guess=0.7)
    ocp.free_duration(guess=1.0)  # [s]

    ocp.minimise(terminal=-x)
    r = (x / 100 - 2.5) ** 2
    w = v_y - 2.5 * (1 - r) * ca.exp(-r)
    v = ca.sqrt(v_x**2 + w**2)
    pressure = DENSITY * AREA * v**2 / 2
    lift, drag = c * pressure, (0.034 + 0.069662 * c**2) * pressure
    ocp.dynamics(x, v_x)
    ocp.dynamics(y, v_y)
    ocp.dynamics(v_x, -(lift * w + drag * v_x) / (v * MASS))
    ocp.dynamics(v_y, (lift * v_x - drag * w) / (v * MASS) - GRAVITY)
    for state, start in ((x, 0.0), (y, 1000.0), (v_x, GLIDE[0]), (v_y, GLIDE[1])):
        ocp.start(state, start)
    for state, end in ((y, 900.0), (v_x, GLIDE[0]), (v_y, GLIDE[1])):
        ocp.end(state, end)
    return ocp


def catmix() -> OptimalControlProblem:
    """Two catalysts mixed along a reactor so that it yields the most (COPS 3, problem 14).

        minimise x1(1) + x2(1) - 1   subject to   x1' = u (10 x2 - x1),   x2' = u (x1 - 10 x2) - (1 - u) x2,
                                                  0 <= u <= 1,   x(0) = (1, 0)

    u is the fraction of the first catalyst: all of it, a singular arc, none of it. J* = -0.04805568.
    """
    ocp = OptimalControlProblem("catmix")
    x1, x2 = ocp.state("x1", guess=1.0), ocp.state("x2")
    u = ocp.control("u", lower=0.0, upper=1.0)
    ocp.duration(1.0)

    ocp.minimise(terminal=x1 + x2 - 1)
    ocp.dynamics(x1, u * (10 * x2 - x1))
    ocp.dynamics(x2, u * (x1 - 10 * x2) - (1 - u) * x2)
    ocp.start(x1, 1.0)
    ocp.start(x2, 0.0)
    return ocp
