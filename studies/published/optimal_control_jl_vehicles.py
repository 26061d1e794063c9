"""Vehicles of OptimalControlProblems.jl (control-toolbox), as its ext/OptimalControlModels has them."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.problem import OptimalControlProblem


def ducted_fan() -> OptimalControlProblem:
    """A planar ducted fan that hovers 1 m aside, fast and with little thrust (Graichen and Petit, 2009).

        minimise 1/T ∫_0^T 2 u1^2 + u2^2 dt + μ T   subject to   m x1'' = u1 cos α - u2 sin α,
            m x2'' = -W + u1 sin α + u2 cos α,   α'' = r u1 / J,
            |α| <= 30 deg,   |u1| <= 5 N,   0 <= u2 <= 17 N,   rest at (0, 0, 0) to rest at (1, 0, 0)

    with m = 2.2 kg, W = 4 N, J = 0.05 kg m^2, r = 0.2 m, μ = 1000 (ducted_fan.jl).
    """
    r, J, m, weight, mu = 0.2, 0.05, 2.2, 4.0, 1000.0  # [m], [kg m^2], [kg], [N], [1/s]
    steepest = math.radians(30.0)
    ocp = OptimalControlProblem("ducted fan")

    x1 = ocp.state("x1")  # [m]
    v1 = ocp.state("v1")  # [m/s]
    x2 = ocp.state("x2")  # [m]
    v2 = ocp.state("v2")  # [m/s]
    alpha = ocp.state("alpha", lower=-steepest, upper=steepest)  # [rad]
    rate = ocp.state("rate")  # [rad/s]
    u1 = ocp.control("u1", lower=-5.0, upper=5.0)  # [N]
    u2 = ocp.control("u2", lower=0.0, upper=17.0)  # [N]
    T = ocp.free_duration(guess=1.0)

    ocp.minimise(running=(2 * u1**2 + u2**2) / T, terminal=mu * T)

    sin, cos = ca.sin(alpha), ca.cos(alpha)
    ocp.dynamics(x1, v1)
    ocp.dynamics(v1, (u1 * cos - u2 * sin) / m)
    ocp.dynamics(x2, v2)
    ocp.dynamics(v2, (-weight + u1 * sin + u2 * cos) / m)
    ocp.dynamics(alpha, rate)
    ocp.dynamics(rate, r * u1 / J)

    for state in (x1, v1, x2, v2, alpha, rate):
        ocp.start(state, 0.0)
        ocp.end(state, 1.0 if state is x1 else 0.0)
    return ocp


def electric_vehicle() -> OptimalControlProblem:
    """An electric vehicle on a hilly road with the least energy (Petit and Sciarretta, 2011).

        minimise ∫_0^1 u v + u^2 dt   subject to   x' = v,   v' = u - 0.001 v^2 - 0.1 - r(x),
            r = 3 + 0.4 x - x^2 + 0.1 x^3,   rest at 0 to rest at 10

    (electric_vehicle.jl.)
    """
    ocp = OptimalControlProblem("electric vehicle")

    x = ocp.state("x", guess=0.1)
    v = ocp.state("v", guess=0.1)
    u = ocp.control("u", guess=0.1)
    ocp.duration(1.0)

    ocp.minimise(running=u * v + u**2)

    ocp.dynamics(x, v)
    ocp.dynamics(v, u - 1e-3 * v**2 - 0.1 - (3 + 0.4 * x - x**2 + 0.1 * x**3))

    for state, end in ((x, 10.0), (v, 0.0)):
        ocp.start(state, 0.0)
        ocp.end(state, end)
    return ocp


def moonlander() -> OptimalControlProblem:
    """A lander with two thrusters that flies to (5, 5) m in the least time (Vanroye et al., 2023, FATROP).

        minimise T   subject to   m p'' = (F1 + F2) (-sin θ, cos θ) - m (0, g),   I θ'' = (F2 - F1) D / 2,
            0 <= F <= 2 m g,   rest at (0, 0), θ = θ' = 0, to rest at (5, 5), θ and θ' free

    with m = 1 kg, g = 9.81 m/s^2, I = 0.1 kg m^2, D = 1 m (moonlander.jl).
    """
    m, g, inertia, width = 1.0, 9.81, 0.1, 1.0  # [kg], [m/s^2], [kg m^2], [m]
    ocp = OptimalControlProblem("moonlander")

    p1, p2 = ocp.state("p1"), ocp.state("p2")  # [m]
    v1, v2 = ocp.state("v1"), ocp.state("v2")  # [m/s]
    theta = ocp.state("theta")  # [rad]
    omega = ocp.state("omega")  # [rad/s]
    F1, F2 = (ocp.control(f"F{k}", lower=0.0, upper=2 * g, guess=5.0) for k in (1, 2))  # [N]
    T = ocp.free_duration(guess=1.0)

    ocp.minimise(terminal=T)

    ocp.dynamics(p1, v1)
    ocp.dynamics(p2, v2)
    ocp.dynamics(v1, -(F1 + F2) * ca.sin(theta) / m)
    ocp.dynamics(v2, (F1 + F2) * ca.cos(theta) / m - g)
    ocp.dynamics(theta, omega)
    ocp.dynamics(omega, (F2 - F1) * width / 2 / inertia)

    for state in (p1, p2, v1, v2, theta, omega):
        ocp.start(state, 0.0)
    for state, end in ((p1, 5.0), (p2, 5.0), (v1, 0.0), (v2, 0.0)):
        ocp.end(state, end)
    return ocp


def quadrotor() -> OptimalControlProblem:
    """A quadrotor that flies 5 m aside in the least time, its tilt limited (Vanroye et al., 2023, FATROP).

        minimise T + ∫_0^T 1e-8 (φ^2 + θ^2 + ψ^2 + a^2) + 100 ψ^2 dt   subject to
            p'' = R(φ, θ, ψ) (0, 0, a) - (0, 0, g),   φ' = u_φ,   θ' = u_θ,   |φ|, |θ| <= π / 2,
            cos φ cos θ >= cos 0.55,   |u| <= 3,   0 <= a <= 45.9,
            rest at (0, 0, 2.5), φ = θ = 0, to rest at (0.01, 5, 2.5), φ and θ free

    with g = 9.81 m/s^2 (quadrotor.jl).
    """
    g, steepest = 9.81, 0.55  # [m/s^2], [rad]
    start, end = (0.0, 0.0, 2.5), (0.01, 5.0, 2.5)  # [m]
    ocp = OptimalControlProblem("quadrotor")

    p = ocp.state("p", 3)  # [m]
    v = ocp.state("v", 3)  # [m/s]
    phi = ocp.state("phi", lower=-math.pi / 2, upper=math.pi / 2)  # [rad]
    theta = ocp.state("theta", lower=-math.pi / 2, upper=math.pi / 2)  # [rad]
    a = ocp.control("a", lower=0.0, upper=9.18 * 5, guess=10.0)  # [m/s^2]
    phi_rate = ocp.control("phi_rate", lower=-3.0, upper=3.0)  # [rad/s]
    theta_rate = ocp.control("theta_rate", lower=-3.0, upper=3.0)  # [rad/s]
    psi = ocp.control("psi")  # [rad]
    T = ocp.free_duration(guess=1.0)

    ocp.minimise(running=1e-8 * (phi**2 + theta**2 + psi**2 + a**2) + 100 * psi**2, terminal=T)

    cr, sr, cp, sp, cy, sy = ca.cos(phi), ca.sin(phi), ca.cos(theta), ca.sin(theta), ca.cos(psi), ca.sin(psi)
    thrust = a * ca.vertcat(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr)
    ocp.dynamics(p, v)
    ocp.dynamics(v, thrust - ca.DM([0, 0, g]))
    ocp.dynamics(phi, phi_rate)
    ocp.dynamics(theta, theta_rate)

    ocp.constrain(cp * cr, lower=math.cos(steepest), name="tilt")

    ocp.start(p, start)
    ocp.start(v, 0.0)
    ocp.start(phi, 0.0)
    ocp.start(theta, 0.0)
    ocp.end(p, end)
    ocp.end(v, 0.0)
    return ocp


def truck_trailer() -> OptimalControlProblem:
    """A truck with two trailers that parks across, in the least time and little bent (Vanroye et al., 2023, FATROP).

        minimise T + ∫_0^T β01^2 + β12^2 dt   subject to   θ0' = v0 tan δ / L0,
            θ1' = (v0 sin β01 - M0 cos β01 θ0') / L1,   v1 = v0 cos β01 + M0 sin β01 θ0',
            θ2' = (v1 sin β12 - M1 cos β12 θ1') / L2,   v2 = v1 cos β12 + M1 sin β12 θ1',
            (x2, y2)' = v2 (cos θ2, sin θ2),   v0' = a,   δ' = w,   β01 = θ0 - θ1,   β12 = θ1 - θ2,
            |θ0|, |θ1|, |β01|, |β12| <= π / 2,   |v0| <= 0.2,   |δ| <= π / 6,   |a| <= 1,   |w| <= π / 10,
            (x2, y2, θ) = 0 to (0, -2), θ = π / 2; v0 and δ are free at both ends

    with L = (0.4, 1.1, 0.8) m, M = (0.1, 0.2) m, 1 <= T <= 1000 s (truck_trailer.jl).
    """
    L0, L1, L2, M0, M1 = 0.4, 1.1, 0.8, 0.1, 0.2  # [m]
    right = math.pi / 2
    ocp = OptimalControlProblem("truck trailer")

    x2, y2 = ocp.state("x2", guess=0.1), ocp.state("y2", guess=0.1)  # [m]
    theta0 = ocp.state("theta0", lower=-right, upper=right, guess=0.1)  # [rad]
    theta1 = ocp.state("theta1", lower=-right, upper=right, guess=0.1)  # [rad]
    theta2 = ocp.state("theta2", guess=0.1)  # [rad]
    v0 = ocp.state("v0", lower=-0.2, upper=0.2, guess=0.1)  # [m/s]
    delta = ocp.state("delta", lower=-math.pi / 6, upper=math.pi / 6, guess=0.1)  # [rad]
    a = ocp.control("a", lower=-1.0, upper=1.0, guess=0.1)  # [m/s^2]
    w = ocp.control("w", lower=-math.pi / 10, upper=math.pi / 10, guess=0.1)  # [rad/s]
    T = ocp.free_duration(guess=10.0, lower=1.0, upper=1000.0)

    beta01, beta12 = theta0 - theta1, theta1 - theta2
    ocp.minimise(running=beta01**2 + beta12**2, terminal=T)

    rate0 = v0 / L0 * ca.tan(delta)
    rate1 = (v0 * ca.sin(beta01) - M0 * ca.cos(beta01) * rate0) / L1
    v1 = v0 * ca.cos(beta01) + M0 * ca.sin(beta01) * rate0
    rate2 = (v1 * ca.sin(beta12) - M1 * ca.cos(beta12) * rate1) / L2
    v2 = v1 * ca.cos(beta12) + M1 * ca.sin(beta12) * rate1
    ocp.dynamics(x2, v2 * ca.cos(theta2))
    ocp.dynamics(y2, v2 * ca.sin(theta2))
    ocp.dynamics(theta0, rate0)
    ocp.dynamics(theta1, rate1)
    ocp.dynamics(theta2, rate2)
    ocp.dynamics(v0, a)
    ocp.dynamics(delta, w)

    ocp.constrain(beta01, lower=-right, upper=right, name="beta01")
    ocp.constrain(beta12, lower=-right, upper=right, name="beta12")

    for state in (x2, y2, theta0, theta1, theta2):
        ocp.start(state, 0.0)
    for state, end in ((x2, 0.0), (y2, -2.0), (theta2, right)):
        ocp.end(state, end)
    ocp.end_constraint(beta01 == 0.0)
    ocp.end_constraint(beta12 == 0.0)
    return ocp


def space_shuttle() -> OptimalControlProblem:
    """The space shuttle's re-entry with the greatest cross range (Betts; JuMP's tutorial).

        maximise θ(T)   subject to   h' = v sin γ,   φ' = v cos γ sin ψ / (r cos θ),   θ' = v cos γ cos ψ / r,
            v' = -D / m - g sin γ,   γ' = L cos β / (m v) + cos γ (v / r - g / v),
            ψ' = L sin β / (m v cos γ) + v cos γ sin ψ sin θ / (r cos θ),
            D = c_D S ρ v^2 / 2,   L = c_L S ρ v^2 / 2,   ρ = ρ0 e^(-h / 23800),   r = R + h,   g = μ / r^2,
            c_D = 0.07854 - 0.0061592 a + 0.000621408 a^2,   c_L = -0.20704 + 0.029244 a,   a = α in degrees,
            -90 <= α <= 90 deg,   -89 <= β <= 1 deg,   |θ|, |γ| <= 89 deg,   |φ|, |ψ| <= 2π,   1750 <= T <= 2250 s,
            (260000 ft, 0, 0, 25600 ft/s, -1 deg, 90 deg) to h = 80000 ft, v = 2500 ft/s, γ = -5 deg

    in feet, pounds and seconds: m = 203000 lb / 32.174 ft/s^2, S = 2690 ft^2, R = 20902900 ft (space_shuttle.jl).
    """
    m, S, R, mu = 203000.0 / 32.174, 2690.0, 20902900.0, 0.14076539e17  # [slug], [ft^2], [ft], [ft^3/s^2]
    steepest = math.radians(89.0)
    ocp = OptimalControlProblem("space shuttle")

    h = ocp.state("h", lower=0.0, guess=(2.6e5, 0.8e5))  # [ft]
    phi = ocp.state("phi", lower=-2 * math.pi, upper=2 * math.pi)  # [rad]
    theta = ocp.state("theta", lower=-steepest, upper=steepest)  # [rad]
    v = ocp.state("v", lower=1.0, guess=(2.56e4, 0.25e4))  # [ft/s]
    gamma = ocp.state("gamma", lower=-steepest, upper=steepest, guess=(math.radians(-1), math.radians(-5)))  # [rad]
    psi = ocp.state("psi", lower=-2 * math.pi, upper=2 * math.pi, guess=math.pi / 2)  # [rad]
    alpha = ocp.control("alpha", lower=-math.pi / 2, upper=math.pi / 2)  # [rad]
    beta = ocp.control("beta", lower=-steepest, upper=math.radians(1.0))  # [rad]
    ocp.free_duration(guess=2000.0, lower=1750.0, upper=2250.0)

    ocp.minimise(terminal=-theta)

    degrees = alpha * 180 / math.pi
    pressure = 0.002378 * ca.exp(-h / 23800.0) * v**2 / 2
    drag = (0.07854 - 0.61592e-2 * degrees + 0.621408e-3 * degrees**2) * S * pressure
    lift = (-0.20704 + 0.029244 * degrees) * S * pressure
    r = R + h
    g = mu / r**2
    ocp.dynamics(h, v * ca.sin(gamma))
    ocp.dynamics(phi, v / r * ca.cos(gamma) * ca.sin(psi) / ca.cos(theta))
    ocp.dynamics(theta, v / r * ca.cos(gamma) * ca.cos(psi))
    ocp.dynamics(v, -drag / m - g * ca.sin(gamma))
    ocp.dynamics(gamma, lift / (m * v) * ca.cos(beta) + ca.cos(gamma) * (v / r - g / v))
    turn = v / (r * ca.cos(theta)) * ca.cos(gamma) * ca.sin(psi) * ca.sin(theta)
    ocp.dynamics(psi, lift * ca.sin(beta) / (m * v * ca.cos(gamma)) + turn)

    starts = (2.6e5, 0.0, 0.0, 2.56e4, math.radians(-1.0), math.pi / 2)
    for state, start in zip((h, phi, theta, v, gamma, psi), starts, strict=True):
        ocp.start(state, start)
    for state, end in ((h, 0.8e5), (v, 0.25e4), (gamma, math.radians(-5.0))):
        ocp.end(state, end)
    return ocp
