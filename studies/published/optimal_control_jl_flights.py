"""Flights that OptimalControlProblems.jl (control-toolbox) takes from dymos and shortens to one phase."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem

GRAVITY = 9.80665  # [m/s^2]


def balanced_field() -> OptimalControlProblem:
    """The climb after take-off on one engine: the shortest way to 35 ft and 5 degrees (Raymer, 2012; dymos).

        minimise r(T)   subject to   r' = v cos γ,   v' = (F cos α - D) / m - g sin γ,   h' = v sin γ,
            γ' = (F sin α + L) / (m v) - g cos γ / v,   L = q S c_L,   D = q S (0.03 + K c_L^2),   q = ρ v^2 / 2,
            c_L = 0.5 + 1.5 α / 0.1745,   K = k / (π 9.45 0.801 (1 + k)),   k = 33 ((h + 1) / 17.85)^1.5,
            0 <= α <= 0.2618,   h >= 0,   v >= 1,   T >= 0.1,   (600, 70, 0, 0) to h = 10.668, γ = 0.0873

    with m = 79015.8 kg, S = 124.7 m^2, F = 120102 N, ρ = 1.225 kg/m^3; K is less near the ground (balanced_field.jl).
    """
    m, S, thrust, density = 79015.8, 124.7, 120102.0, 1.225  # [kg], [m^2], [N], [kg/m^3]
    ocp = OptimalControlProblem("balanced field, climb")

    r = ocp.state("r", guess=600.0)  # [m]
    v = ocp.state("v", lower=1.0, guess=80.0)  # [m/s]
    h = ocp.state("h", lower=0.0, guess=5.334)  # [m]
    gamma = ocp.state("gamma", guess=0.0873)  # [rad]
    alpha = ocp.control("alpha", lower=0.0, upper=0.2618, guess=0.1)  # [rad]
    ocp.free_duration(guess=10.0, lower=0.1)

    ocp.minimise(terminal=r)

    pressure = density * v**2 / 2
    lift_coefficient = 0.5 + alpha / 0.1745 * 1.5
    lift = pressure * S * lift_coefficient
    ground = 33.0 * ((h + 1.0) / (35.7 / 2)) ** 1.5
    induced = ground / (1 + ground) / (math.pi * 9.45 * 0.801)
    drag = pressure * S * (0.03 + induced * lift_coefficient**2)
    ocp.dynamics(r, v * ca.cos(gamma))
    ocp.dynamics(v, (thrust * ca.cos(alpha) - drag) / m - GRAVITY * ca.sin(gamma))
    ocp.dynamics(h, v * ca.sin(gamma))
    ocp.dynamics(gamma, (thrust * ca.sin(alpha) + lift) / (m * v) - GRAVITY * ca.cos(gamma) / v)

    for state, start in ((r, 600.0), (v, 70.0), (h, 0.0), (gamma, 0.0)):
        ocp.start(state, start)
    ocp.end(h, 10.668)
    ocp.end(gamma, 0.0873)
    return ocp


def cannonball() -> OptimalControlProblem:
    """An iron ball of a size and an angle to be chosen, shot as far as 400 kJ carry it through the air.

        maximise r(T)   subject to   v' = -D / m - g sin γ,   γ' = -g cos γ / v,   h' = v sin γ,   r' = v cos γ,
            D = 0.5 ρ v^2 π R^2 / 2,   ρ = 1.225 e^(-h / 8440),   m = (4/3) π 7870 R^3,   m v(0)^2 / 2 <= 400 kJ,
            0.01 <= R <= 0.1 m,   0.1 <= v(0) <= 500 m/s,   5 <= γ(0) <= 85 deg,   h(0) = h(T) = 0,   0.1 <= T <= 100 s

    There is no control (cannonball.jl).
    """
    ocp = OptimalControlProblem("cannonball, exponential atmosphere")

    v = ocp.state("v", guess=100.0)  # [m/s]
    gamma = ocp.state("gamma", guess=0.785)  # [rad]
    h = ocp.state("h", guess=1.0)  # [m]
    r = ocp.state("r", guess=1.0)  # [m]
    radius = ocp.unknown("radius", lower=0.01, upper=0.1, guess=0.05)  # [m]
    ocp.free_duration(guess=10.0, lower=0.1, upper=100.0)

    ocp.minimise(terminal=-r)

    mass = 4 / 3 * math.pi * 7870.0 * radius**3
    drag = 0.5 * 1.225 * ca.exp(-h / 8440.0) * v**2 / 2 * math.pi * radius**2
    ocp.dynamics(v, -drag / mass - GRAVITY * ca.sin(gamma))
    ocp.dynamics(gamma, -GRAVITY * ca.cos(gamma) / v)
    ocp.dynamics(h, v * ca.sin(gamma))
    ocp.dynamics(r, v * ca.cos(gamma))

    ocp.start_constraint(mass * v**2 / 2, upper=4e5, name="muzzle energy")
    ocp.start_constraint(v, lower=0.1, upper=500.0)
    ocp.start_constraint(gamma, lower=math.radians(5.0), upper=math.radians(85.0))
    ocp.start(h, 0.0)
    ocp.start(r, 0.0)
    ocp.end(h, 0.0)
    return ocp


def single_stage_to_orbit() -> OptimalControlProblem:
    """A launch vehicle of one stage, a Titan II, into orbit in the least time (Longuski et al., 2014; dymos).

        minimise T   subject to   x' = vx,   y' = vy,   vx' = (F cos θ - D vx / v) / m,
            vy' = (F sin θ - D vy / v) / m - g,   m' = -F / (265.2 g),   D = 0.5 7.069 ρ v^2 / 2,
            ρ = 1.225 e^(-y / 8440),   |θ| <= π / 2,   10 <= T <= 1000 s,
            at rest with m = 117000 kg to y = 185 km, vx = 7796.6961 m/s, vy = 0

    with F = 2.1 MN; v = sqrt(vx^2 + vy^2 + 1e-9), as ssto_earth.jl smooths it.
    """
    thrust = 2.1e6  # [N]
    ocp = OptimalControlProblem("single stage to orbit")

    x = ocp.state("x", guess=(0.0, 5e5))  # [m]
    y = ocp.state("y", guess=(0.0, 185e3))  # [m]
    vx = ocp.state("vx", guess=(0.0, 7796.6961))  # [m/s]
    vy = ocp.state("vy")  # [m/s]
    m = ocp.state("m", guess=(117000.0, 117000.0 - thrust / (GRAVITY * 265.2) * 150.0))  # [kg]
    theta = ocp.control("theta", lower=-math.pi / 2, upper=math.pi / 2, guess=0.5)  # [rad]
    T = ocp.free_duration(guess=150.0, lower=10.0, upper=1000.0)

    ocp.minimise(terminal=T)

    v = ca.sqrt(vx**2 + vy**2 + 1e-9)
    drag_over_v = 0.5 * 7.069 * 1.225 * ca.exp(-y / 8440.0) * v / 2
    ocp.dynamics(x, vx)
    ocp.dynamics(y, vy)
    ocp.dynamics(vx, (thrust * ca.cos(theta) - drag_over_v * vx) / m)
    ocp.dynamics(vy, (thrust * ca.sin(theta) - drag_over_v * vy) / m - GRAVITY)
    ocp.dynamics(m, -thrust / (GRAVITY * 265.2))

    for state, start in ((x, 0.0), (y, 0.0), (vx, 0.0), (vy, 0.0), (m, 117000.0)):
        ocp.start(state, start)
    for state, end in ((y, 185e3), (vx, 7796.6961), (vy, 0.0)):
        ocp.end(state, end)
    return ocp


def water_rocket() -> OptimalControlProblem:
    """A water rocket while water leaves it: how high it is when the bottle is empty.

        maximise h(T)   subject to   r' = v cos γ,   h' = v sin γ,   γ' = -g cos γ / v,   V' = -A w,
            v' = (2 A (p - p_a) - D) / m - g sin γ,   p' = -k p A w / (V_b - V),   w = sqrt(2 (p - p_a) / ρ),
            m = 0.15 + ρ V,   D = 0.345 1.225 S v^2 / 2,   h >= 0,   V(T) = 0,   0.001 <= T <= 1 s,
            0.1 <= V(0) <= 1.9 l,   0.1 <= γ(0) <= 1.5,   (r, h, v, p)(0) = (0, 0, 0.1 m/s, 6.5 bar + p_a)

    with A and S of 13 mm and 106 mm diameter, V_b = 2 l, k = 1.2, ρ = 1000 kg/m^3, p_a = 1.01325 bar. There is no
    control (water_rocket.jl).
    """
    outlet, section = math.pi * 0.013**2 / 4, math.pi * 0.106**2 / 4  # [m^2]
    ambient, bottle = 1.01325e5, 2e-3  # [Pa], [m^3]
    ocp = OptimalControlProblem("water rocket, propelled")

    r = ocp.state("r")  # [m]
    h = ocp.state("h", lower=0.0)  # [m]
    v = ocp.state("v", guess=1.0)  # [m/s]
    gamma = ocp.state("gamma", guess=0.785)  # [rad]
    p = ocp.state("p", guess=7e5)  # [Pa]
    V = ocp.state("V", guess=1e-3)  # [m^3]
    ocp.free_duration(guess=0.3, lower=0.001, upper=1.0)

    ocp.minimise(terminal=-h)

    mass = 0.15 + 1000.0 * V
    flow = ca.sqrt(2 * (p - ambient) / 1000.0) * outlet
    drag = 0.345 * 1.225 * section * v**2 / 2
    ocp.dynamics(r, v * ca.cos(gamma))
    ocp.dynamics(h, v * ca.sin(gamma))
    ocp.dynamics(v, (2 * outlet * (p - ambient) - drag) / mass - GRAVITY * ca.sin(gamma))
    ocp.dynamics(gamma, -GRAVITY * ca.cos(gamma) / v)
    ocp.dynamics(p, -1.2 * p * flow / (bottle - V))
    ocp.dynamics(V, -flow)

    for state, start in ((r, 0.0), (h, 0.0), (v, 0.1), (p, 6.5e5 + ambient)):
        ocp.start(state, start)
    ocp.start_constraint(gamma, lower=0.1, upper=1.5)
    ocp.start_constraint(V, lower=0.1e-3, upper=1.9e-3)
    ocp.end(V, 0.0)
    return ocp
