"""Flights of several phases among dymos' examples (OpenMDAO), of which OptimalControlProblems.jl has one phase each."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem

GRAVITY = 9.80665  # [m/s^2]
FOOT, POUND, POUND_FORCE = 0.3048, 0.45359237, 4.4482216152605  # [m], [kg], [N]
DEGREE = math.pi / 180


def density(h: ca.SX) -> ca.SX:
    """Air density [kg/m^3] of the US standard atmosphere 1976 at an altitude h [m] up to 11 km."""
    return 1.225 * (1 - 2.25577e-5 * h) ** 4.25588


def pressure(h: ca.SX) -> ca.SX:
    """Air pressure [Pa] of the US standard atmosphere 1976 at an altitude h [m] up to 11 km."""
    return 101325.0 * (1 - 2.25577e-5 * h) ** 5.25588


MASS, WING, THRUST = 174200.0 * POUND, 124.7, 27000.0 * POUND_FORCE  # [kg], [m^2], [N] of one engine
STALL = math.sqrt(2 * MASS * GRAVITY / (1.225 * WING * 2.0))  # [m/s]


def _aerodynamics(v: ca.SX, alpha: ca.SX | float, h: ca.SX | float) -> tuple[ca.SX, ca.SX]:
    """Lift and drag [N] near the ground at a speed [m/s], an angle of attack [rad] and an altitude [m]."""
    coefficient = 0.5 + alpha / (10 * DEGREE) * 1.5
    ground = 33.0 * ((h + 1.0) / (35.7 / 2)) ** 1.5
    induced = ground / (1 + ground) / (math.pi * 9.45 * 0.801)
    q = 1.225 * v**2 / 2
    return q * WING * coefficient, q * WING * (0.03 + induced * coefficient**2)


def _roll(
    phase: OptimalControlProblem,
    thrust: float,
    friction: float,
    alpha: ca.SX | float,
    r_guess: tuple[float, float],
    v_guess: tuple[float, float],
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """State a roll on the runway; returns range [m], speed [m/s] and the force on the gear [N]."""
    r = phase.state("r", lower=0.0, guess=r_guess)  # [m]
    v = phase.state("v", lower=0.0, guess=v_guess)  # [m/s]
    lift, drag = _aerodynamics(v, alpha, 0.0)
    gear = MASS * GRAVITY - lift * ca.cos(alpha) - thrust * ca.sin(alpha)
    phase.dynamics(r, v)
    phase.dynamics(v, (thrust * ca.cos(alpha) - drag - gear * friction) / MASS)
    return r, v, gear


def balanced_field() -> MultiPhaseProblem:
    """The balanced field length: the shortest runway on which an engine may fail at V_1 (Raymer, 2012).

    Five phases: on two engines to V_1; from there to rest without engines, braking; or on one engine to the rotation at
    v >= 1.2 stall speeds, rotation with α' constant and α = 0 to α <= 10 deg until the gear carries nothing, within
    1 to 5 s; and the climb with 0 <= γ <= 5 deg, -10 <= α <= 15 deg to h = 35 ft, γ = 5 deg, v >= 1.25 stall speeds.
    Both ways end at the same r, which is least. On the runway

        r' = v,   v' = (F cos α - D - μ (m g - L cos α - F sin α)) / m,   μ = 0.03, and 0.3 when braking,

    and in the climb as in ``optimal_control_jl_flights.balanced_field``, with m = 174200 lbm and F = 27000 lbf of one
    engine (dymos/examples/balanced_field). In dymos α is also continuous from the rotation to the climb, where it is a
    free control: an instant that changes nothing here.
    """
    problem = MultiPhaseProblem("balanced field length")

    start = problem.phase("brake release to V1")
    r, v, _ = _roll(start, 2 * THRUST, 0.03, 0.0, (0.0, 2500.0), (0.0001, 100.0))
    start.free_duration(guess=35.0, lower=1.0, upper=1000.0)
    start.start(r, 0.0)
    start.start(v, 0.0)

    stop = problem.phase("rejected take-off")
    stopped, v, _ = _roll(stop, 0.0, 0.3, 0.0, (2500.0, 5000.0), (110.0, 0.0001))
    stop.free_duration(guess=1.0, lower=1.0, upper=1000.0)
    stop.minimise(terminal=stopped)
    stop.end(v, 0.0)

    run = problem.phase("V1 to rotation")
    _, v, _ = _roll(run, THRUST, 0.03, 0.0, (2500.0, 300.0), (100.0, 110.0))
    run.free_duration(guess=35.0, lower=1.0, upper=1000.0)
    run.end_constraint(v >= 1.2 * STALL)

    rotate = problem.phase("rotation")
    alpha = rotate.state("alpha", lower=0.0, upper=10 * DEGREE)  # [rad]
    rate = rotate.unknown("rate")  # [rad/s]
    _, _, gear = _roll(rotate, THRUST, 0.03, alpha, (1750.0, 1800.0), (80.0, 85.0))
    rotate.free_duration(guess=5.0, lower=1.0, upper=5.0)
    rotate.dynamics(alpha, rate)
    rotate.start(alpha, 0.0)
    rotate.end_constraint(gear == 0.0)

    climb = problem.phase("climb")
    r = climb.state("r", lower=0.0, guess=(5000 * FOOT, 5500 * FOOT))  # [m]
    v = climb.state("v", lower=0.0, guess=(82.3, 87.5))  # [m/s]
    h = climb.state("h", lower=0.0, guess=(0.0, 35 * FOOT))  # [m]
    gamma = climb.state("gamma", lower=0.0, upper=5 * DEGREE, guess=(0.0, 5 * DEGREE))  # [rad]
    attack = climb.control("attack", lower=-10 * DEGREE, upper=15 * DEGREE, guess=5 * DEGREE)  # [rad]
    climb.free_duration(guess=20.0, lower=1.0, upper=100.0)
    lift, drag = _aerodynamics(v, attack, h)
    climb.dynamics(r, v * ca.cos(gamma))
    climb.dynamics(v, (THRUST * ca.cos(attack) - drag) / MASS - GRAVITY * ca.sin(gamma))
    climb.dynamics(h, v * ca.sin(gamma))
    climb.dynamics(gamma, (THRUST * ca.sin(attack) + lift) / (MASS * v) - GRAVITY / v * ca.cos(gamma))
    climb.start(h, 0.0)
    climb.start(gamma, 0.0)
    climb.end(h, 35 * FOOT)
    climb.end(gamma, 5 * DEGREE)
    climb.end_constraint(v >= 1.25 * STALL)

    problem.link(start, stop)
    problem.link(start, run)
    problem.link(run, rotate)
    problem.link(rotate, climb)
    problem.couple(stopped == r, name="both ways end at the same range")
    return problem


def _ballistic(
    phase: OptimalControlProblem, mass: ca.SX, drag_area: ca.SX | float, guesses: dict[str, tuple[float, float]]
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """State a flight without thrust; returns range [m], altitude [m], speed [m/s] and flight path angle [rad]."""
    r, h, v, gamma = (phase.state(name, guess=guesses[name]) for name in ("r", "h", "v", "gamma"))
    phase.dynamics(r, v * ca.cos(gamma))
    phase.dynamics(h, v * ca.sin(gamma))
    phase.dynamics(v, -drag_area * density(h) * v**2 / 2 / mass - GRAVITY * ca.sin(gamma))
    phase.dynamics(gamma, -GRAVITY / v * ca.cos(gamma))
    return r, h, v, gamma


def cannonball() -> MultiPhaseProblem:
    """An iron ball of a size and an angle to be chosen, shot as far as 400 kJ carry it, in two phases.

    The equations of ``optimal_control_jl_flights.cannonball``, with the air of the US standard atmosphere 1976.
    The first phase ends at the apogee, γ = 0; each lasts 1 to 100 s, and 0.01 <= R <= 0.1 m (dymos,
    multi_phase_cannonball.ipynb, which interpolates a table of the atmosphere linearly between 1000 ft).
    """
    problem = MultiPhaseProblem("cannonball, two phases")
    radius = problem.unknown("radius", lower=0.01, upper=0.1, guess=0.05)  # [m]
    mass = 4 / 3 * math.pi * 7870.0 * radius**3
    drag_area = 0.5 * math.pi * radius**2

    ascent = problem.phase("ascent")
    guesses = {"r": (0.0, 100.0), "h": (0.0, 100.0), "v": (200.0, 150.0), "gamma": (25 * DEGREE, 0.0)}
    r, h, v, gamma = _ballistic(ascent, mass, drag_area, guesses)
    ascent.free_duration(guess=10.0, lower=1.0, upper=100.0)
    ascent.start(r, 0.0)
    ascent.start(h, 0.0)
    ascent.start_constraint(mass * v**2 / 2, lower=0.0, upper=4e5, name="muzzle energy")
    ascent.end(gamma, 0.0)

    descent = problem.phase("descent")
    guesses = {"r": (100.0, 200.0), "h": (100.0, 0.0), "v": (150.0, 200.0), "gamma": (0.0, -45 * DEGREE)}
    r, h, v, gamma = _ballistic(descent, mass, drag_area, guesses)
    descent.free_duration(guess=10.0, lower=1.0, upper=100.0)
    descent.minimise(terminal=-r)
    descent.end(h, 0.0)

    problem.link(ascent, descent)
    return problem


def water_rocket(farthest: bool = False) -> MultiPhaseProblem:
    """A water rocket flown as high or as far as it goes, its empty mass, its water and its angle to be chosen.

    Three phases. While water leaves the bottle (0.001 to 0.5 s, 0 <= γ <= 85 deg, v >= 0.01 m/s, p >= 1.02 bar)

        r' = v cos γ,   h' = v sin γ,   v' = (ρ A w^2 - D) / m - g sin γ,   γ' = -g cos γ / v,   V' = -A w,
        p' = -k p A w / (V_b - V),   w = sqrt(2 (p - p_a(h)) / ρ),   m = m_0 + ρ V,   D = 0.345 S ρ_a(h) v^2 / 2

    from (r, h, v) = (0, 0, 0.1 m/s), p = 6.5 bar and 0 <= V <= V_b to V = 0; then without thrust to the apogee, γ = 0,
    and to the ground, h = 0. A and S of 22 mm and 106 mm diameter, V_b = 2 l, k = 1.2, 0.001 <= m_0 <= 1 kg, the air of
    the US standard atmosphere 1976 (dymos/examples/water_rocket, whose guess of 9 l does not fit into the bottle).
    """
    outlet, section, bottle = math.pi * 0.022**2 / 4, math.pi * 0.106**2 / 4, 2e-3  # [m^2], [m^2], [m^3]
    drag_area = 0.345 * section
    problem = MultiPhaseProblem("water rocket, range" if farthest else "water rocket, height")
    empty = problem.unknown("empty mass", lower=0.001, upper=1.0, guess=0.15)  # [kg]

    propelled = problem.phase("propelled ascent")
    r = propelled.state("r", guess=(0.0, 3.0))  # [m]
    h = propelled.state("h", guess=(0.0, 10.0))  # [m]
    v = propelled.state("v", lower=0.01, guess=(0.1, 100.0))  # [m/s]
    gamma = propelled.state("gamma", lower=0.0, upper=85 * DEGREE, guess=80 * DEGREE)  # [rad]
    p = propelled.state("p", lower=1.02e5, guess=(6.5e5, 3.5e5))  # [Pa]
    V = propelled.state("V", lower=0.0, upper=bottle, guess=(1e-3, 0.0))  # [m^3]
    propelled.free_duration(guess=0.3, lower=0.001, upper=0.5)
    speed = ca.sqrt(2 * (p - pressure(h)) / 1000.0)
    mass = empty + 1000.0 * V
    drag = drag_area * density(h) * v**2 / 2
    propelled.dynamics(r, v * ca.cos(gamma))
    propelled.dynamics(h, v * ca.sin(gamma))
    propelled.dynamics(v, (1000.0 * outlet * speed**2 - drag) / mass - GRAVITY * ca.sin(gamma))
    propelled.dynamics(gamma, -GRAVITY / v * ca.cos(gamma))
    propelled.dynamics(p, -1.2 * p * outlet * speed / (bottle - V))
    propelled.dynamics(V, -outlet * speed)
    for state, start in ((r, 0.0), (h, 0.0), (v, 0.1), (p, 6.5e5)):
        propelled.start(state, start)
    propelled.end(V, 0.0)

    ascent = problem.phase("ballistic ascent")
    guesses = {"r": (0.0, 10.0), "h": (10.0, 100.0), "v": (60.0, 20.0), "gamma": (80 * DEGREE, 0.0)}
    r, h, v, gamma = _ballistic(ascent, empty, drag_area, guesses)
    ascent.free_duration(guess=5.0, lower=0.001, upper=10.0)
    ascent.constrain(gamma <= 89 * DEGREE)
    ascent.end(gamma, 0.0)
    if not farthest:
        ascent.minimise(terminal=-h)

    descent = problem.phase("descent")
    guesses = {"r": (10.0, 20.0), "h": (10.0, 0.0), "v": (20.0, 60.0), "gamma": (0.0, -45 * DEGREE)}
    r, h, v, gamma = _ballistic(descent, empty, drag_area, guesses)
    descent.free_duration(guess=10.0, lower=0.5, upper=100.0)
    descent.end(h, 0.0)
    if farthest:
        descent.minimise(terminal=-r)

    problem.link(propelled, ascent)
    problem.link(ascent, descent)
    return problem


def single_stage_to_orbit() -> OptimalControlProblem:
    """A launch vehicle of one stage, a Titan II, into orbit in the least time (Longuski et al., 2014).

        minimise T   subject to   x' = vx,   y' = vy,   vx' = (F cos θ - k vx^2) / m,
            vy' = (F sin θ - k vy^2) / m - g,   m' = -F / (265.2 g),   k = 0.5 7.069 ρ / 2,   ρ = 1.225 e^(-y / 8440),
            |θ| <= 1.57,   10 <= T <= 500 s,
            at rest with m = 117000 kg to y = 185 km, vx = 7796.6961 m/s, vy = 0

    with F = 2.1 MN. The drag of a component is proportional to its square, as dymos' code has it, where its text and
    ``optimal_control_jl_flights.single_stage_to_orbit`` have |v| times the component (ssto_earth.ipynb).
    """
    thrust = 2.1e6  # [N]
    ocp = OptimalControlProblem("single stage to orbit, dymos")

    x = ocp.state("x", guess=(0.0, 1.15e5))  # [m]
    y = ocp.state("y", guess=(0.0, 1.85e5))  # [m]
    vx = ocp.state("vx")  # [m/s]
    vy = ocp.state("vy", guess=(1e-6, 0.0))  # [m/s]
    m = ocp.state("m", guess=(117000.0, 1163.0))  # [kg]
    theta = ocp.control("theta", lower=-1.57, upper=1.57, guess=(1.5, -0.76))  # [rad]
    T = ocp.free_duration(guess=150.0, lower=10.0, upper=500.0)

    ocp.minimise(terminal=T)

    k = 0.5 * 7.069 * 1.225 * ca.exp(-y / 8440.0) / 2
    ocp.dynamics(x, vx)
    ocp.dynamics(y, vy)
    ocp.dynamics(vx, (thrust * ca.cos(theta) - k * vx**2) / m)
    ocp.dynamics(vy, (thrust * ca.sin(theta) - k * vy**2) / m - GRAVITY)
    ocp.dynamics(m, -thrust / (GRAVITY * 265.2))

    for state, start in ((x, 0.0), (y, 0.0), (vx, 0.0), (vy, 0.0), (m, 117000.0)):
        ocp.start(state, start)
    for state, end in ((y, 1.85e5), (vx, 7796.6961), (vy, 0.0)):
        ocp.end(state, end)
    return ocp
