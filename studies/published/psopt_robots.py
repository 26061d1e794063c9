"""Examples of PSOPT of robots and vehicles on the ground; each as its file states it."""

from __future__ import annotations

import casadi as ca

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published.details import Details
from mathnavi.studies.published.optimum import Statement


def manutec() -> OptimalControlProblem:
    """Point to point with an industrial robot, the Manutec r3 with three joints, with the least energy (Otter, Türk).

        minimise ∫_0^0.53 |u|^2 dt   subject to   M(q) q'' + c(q, q') = F u,   |u| <= 7.5 V,
            |q| <= (2.97, 2.01, 2.86) rad,   |q'| <= (3, 1.5, 5.2) rad/s,   (0, -1.5, 0) to (1, -1.95, 1), at rest

    Arm 1 turns about the vertical, arms 2 and 3 about a horizontal axis; each joint has a motor with a rotor and a
    gear. The equations of motion are those of Lagrange: see ``manutec_accelerations``. J* = 20.404.
    """
    ocp = OptimalControlProblem("PSOPT: manutec")

    q = ocp.state("q", 3, lower=[-2.97, -2.01, -2.86], upper=[2.97, 2.01, 2.86])  # [rad]
    dq = ocp.state("dq", 3, lower=[-3.0, -1.5, -5.2], upper=[3.0, 1.5, 5.2])  # [rad/s]
    u = ocp.control("u", 3, lower=-7.5, upper=7.5)  # [V]
    ocp.duration(0.53)
    ocp.guess(q, [[0.0, -1.5, 0.0], [1.0, -1.95, 1.0]])

    ocp.minimise(running=ca.sumsqr(u))

    ocp.dynamics(q, dq)
    ocp.dynamics(dq, manutec_accelerations(q, dq, ca.vertcat(-126.0, 252.0, 72.0) * u))

    ocp.start(ca.vertcat(q, dq), [0.0, -1.5, 0.0, 0.0, 0.0, 0.0])
    ocp.end(ca.vertcat(q, dq), [1.0, -1.95, 1.0, 0.0, 0.0, 0.0])
    return ocp


def manutec_accelerations(q: ca.SX, dq: ca.SX, torque: ca.SX) -> ca.SX:
    """Accelerations (3,) [rad/s^2] at joint angles (3,) [rad], rates (3,) [rad/s] and torques (3,) [N m], no load.

    T = Σ m |v|^2 / 2 + ω · I ω / 2 of the arms, and of each rotor with its spin about the joint's axis, r q' in the arm
    that holds it; M = ∂²T/∂q'². The data of arm 3 are those of the file's model, not of its table of constants.
    """
    GRAVITY, REACH = 9.81, 0.5  # [m/s^2], [m] from joint 2 to joint 3
    ARMS = (  # mass [kg], centre of mass (x, z) [m], inertia xx, yy, zz, xz [kg m^2] about it
        (56.5, (0.172, 0.205), (2.58, 2.73, 0.64, -0.46)),
        (60.3, (0.028, 0.202), (5.41, 5.60, 0.39, 0.33)),
    )
    INERTIA, ROTOR, GEARS = 1.16, 1.3e-3, (105.0, 210.0, 60.0)  # [kg m^2] of arm 1, of each rotor; gear ratios

    kinetic = INERTIA * dq[0] ** 2 / 2
    kinetic += ROTOR * ((GEARS[0] * dq[0]) ** 2 + (GEARS[1] * dq[1]) ** 2) / 2
    kinetic += ROTOR * (GEARS[2] * dq[2]) ** 2 / 2 + ROTOR * GEARS[2] * dq[1] * dq[2]  # its axis is that of joint 2
    potential = ca.SX(0)
    joint = ca.SX.zeros(3)
    angle, rate = ca.SX(0), ca.SX(0)
    for arm, (mass, (x, z), (xx, yy, zz, xz)) in enumerate(ARMS):
        angle, rate = angle + q[arm + 1], rate + dq[arm + 1]
        sin, cos = ca.sin(angle), ca.cos(angle)
        # In the frame that turns with arm 1, x the axis of joints 2 and 3: the arm's x and z are x and (0, -sin, cos).
        centre = joint + ca.vertcat(x, -z * sin, z * cos)
        velocity = ca.jtimes(centre, q, dq) + dq[0] * ca.vertcat(-centre[1], centre[0], 0.0)
        omega = ca.vertcat(rate, sin * dq[0], cos * dq[0])  # in the arm's frame
        inertia = ca.SX(ca.DM([[xx, 0.0, xz], [0.0, yy, 0.0], [xz, 0.0, zz]]))
        kinetic += mass * ca.sumsqr(velocity) / 2 + ca.dot(omega, inertia @ omega) / 2
        potential += mass * GRAVITY * centre[2]
        joint += REACH * ca.vertcat(0.0, -sin, cos)
    momentum = ca.gradient(kinetic, dq)
    forces = torque + ca.gradient(kinetic - potential, q) - ca.jtimes(momentum, q, dq)
    accelerations: ca.SX = ca.solve(ca.jacobian(momentum, dq), forces)
    return accelerations


def obstacle() -> OptimalControlProblem:
    """A vehicle of constant speed that goes around two discs and arrives on time.

        minimise ∫_0^1 x'^2 + y'^2 dt   subject to   x' = V cos θ,   y' = V sin θ,   V = 2.138,   |θ| <= 10,
            (x - 0.4)^2 + (y - 0.5)^2 >= 0.1,   (x - 0.8)^2 + (y - 1.5)^2 >= 0.1,   0 <= x, y <= 2,
            (0, 0) to (1.2, 1.6)

    The speed is constant, so every way there costs the same: J* = V^2.
    """
    SPEED = 2.138
    ocp = OptimalControlProblem("PSOPT: obstacle")

    x = ocp.state("x", lower=0.0, upper=2.0, guess=(0.0, 1.2))
    y = ocp.state("y", lower=0.0, upper=2.0, guess=(0.0, 1.6))
    theta = ocp.control("theta", lower=-10.0, upper=10.0)  # [rad]
    ocp.duration(1.0)

    dx, dy = SPEED * ca.cos(theta), SPEED * ca.sin(theta)
    ocp.minimise(running=dx**2 + dy**2)

    ocp.dynamics(x, dx)
    ocp.dynamics(y, dy)

    ocp.constrain((x - 0.4) ** 2 + (y - 0.5) ** 2, lower=0.1, upper=100.0)
    ocp.constrain((x - 0.8) ** 2 + (y - 1.5) ** 2, lower=0.1, upper=100.0)

    ocp.start(ca.vertcat(x, y), 0.0)
    ocp.end(ca.vertcat(x, y), [1.2, 1.6])
    return ocp


def twolinkarm() -> OptimalControlProblem:
    """A robot arm of two links, moved in the least time (Luus, Iterative Dynamic Programming, 2000).

        minimise T   subject to   θ' = ω2 - ω1,   φ' = ω1,   |u| <= 1,   |ω|, |θ|, |φ| <= 2,   1 <= T <= 10,
            ω1' = (sin θ (9/4 cos θ ω1^2 + 2 ω2^2) + 4/3 (u1 - u2) - 3/2 cos θ u2) / d,
            ω2' = -(sin θ (7/2 ω1^2 + 9/4 cos θ ω2^2) - 7/3 u2 + 3/2 cos θ (u1 - u2)) / d,   d = 31/36 + 9/4 sin^2 θ,
            (ω1, ω2, θ, φ) = (0, 0, 0.5, 0) to (0, 0, 0.5, 0.522)

    Both torques are bang-bang: T* = 2.9822799.
    """
    ocp = OptimalControlProblem("PSOPT: twolinkarm")

    x1, x2, x3, x4 = (
        ocp.state(f"x{k + 1}", lower=-2.0, upper=2.0, guess=guess) for k, guess in enumerate((0.0, 0.0, 0.5, 0.522))
    )
    u1 = ocp.control("u1", lower=-1.0, upper=1.0)
    u2 = ocp.control("u2", lower=-1.0, upper=1.0)
    T = ocp.free_duration(guess=3.0, lower=1.0, upper=10.0)

    ocp.minimise(terminal=T)

    sin, cos = ca.sin(x3), ca.cos(x3)
    d = 31 / 36 + 9 / 4 * sin**2
    ocp.dynamics(x1, (sin * (9 / 4 * cos * x1**2 + 2 * x2**2) + 4 / 3 * (u1 - u2) - 3 / 2 * cos * u2) / d)
    ocp.dynamics(x2, -(sin * (7 / 2 * x1**2 + 9 / 4 * cos * x2**2) - 7 / 3 * u2 + 3 / 2 * cos * (u1 - u2)) / d)
    ocp.dynamics(x3, x2 - x1)
    ocp.dynamics(x4, x1)

    ocp.start(ca.vertcat(x1, x2, x3, x4), [0.0, 0.0, 0.5, 0.0])
    ocp.end(ca.vertcat(x1, x2, x3, x4), [0.0, 0.0, 0.5, 0.522])
    return ocp


def twophase_robot() -> MultiPhaseProblem:
    """A robot that follows an edge and then another one, around the corner, in two phases (manual of MISER3).

        minimise ∫_0^2 100 |p - p_ref|^2 + 500 |v - v_ref|^2 dt   subject to   p' = v,   v' = u,   |p|, |v|, |u| <= 10,
            p_ref = (t / 2, 0),   v_ref = (1/2, 0) until t = 1,     (1/2, (t - 1) / 2),   (0, 1/2) from there,
            (0, 0, 0.5, 0) to (0.5, 0.5, 0, 0.5)

    J* = 1.0426.
    """
    START, END = (0.0, 0.0, 0.5, 0.0), (0.5, 0.5, 0.0, 0.5)
    MIDDLE: tuple[float, ...] = tuple((a + b) / 2 for a, b in zip(START, END, strict=True))
    problem = MultiPhaseProblem("PSOPT: twophase_robot")

    along, up = problem.phase("along"), problem.phase("up")
    for phase, begin, end in ((along, START, MIDDLE), (up, MIDDLE, END)):
        x = ca.vertcat(*(phase.state(f"x{k + 1}", lower=-10.0, upper=10.0, guess=(begin[k], end[k])) for k in range(4)))
        u = phase.control("u", 2, lower=-10.0, upper=10.0)
        t = phase.elapsed
        phase.duration(1.0)

        edge: list[ca.SX | float] = [t / 2, 0.0, 0.5, 0.0] if phase is along else [0.5, t / 2, 0.0, 0.5]
        miss = x - ca.vertcat(*edge)
        phase.minimise(running=100 * ca.sumsqr(miss[:2]) + 500 * ca.sumsqr(miss[2:]))

        phase.dynamics(x, ca.vertcat(x[2], x[3], u))
        if phase is along:
            phase.start(x, START)
        else:
            phase.end(x, END)
    problem.link(along, up)
    return problem


STATEMENTS: dict[str, Statement] = {
    "manutec": manutec,
    "obstacle": obstacle,
    "twolinkarm": twolinkarm,
    "twophase_robot": twophase_robot,
}

INDEPENDENT: dict[str, tuple[float, str]] = {
    "manutec": (20.4042467283, "Gauss-Legendre and Radau on three arcs, 42 x 5 and 42 x 6"),
    "obstacle": (4.571044, "closed form: V^2"),
    "twolinkarm": (2.9822799425, "that of the collection's: two discretisations on arcs"),
    "twophase_robot": (1.0416861484, "parabolas and exponentials on six arcs, whose four instants are found"),
}

DETAILS: dict[str, Details] = {
    "manutec": {"note": "the file's model of arm 3 has other inertias than its table of constants"},
    "obstacle": {"note": "every feasible way is optimal"},
    "twolinkarm": {"note": "the problem 'two-link arm' of the collection, stated again"},
    "twophase_robot": {"singular": True, "note": "the printed value is 8e-4 above the optimum"},
}
