"""Examples of PSOPT from space flight: transfers between orbits and turns; each as its file states it."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published.details import Details
from mathnavi.studies.published.optimum import Statement

MU, EARTH_RADIUS, GRAVITY = 1.407645794e16, 20925662.73, 32.174  # [ft^3/s^2], [ft], [ft/s^2]
ZONAL_HARMONICS = {2: 1082.639e-6, 3: -2.565e-6, 4: -1.608e-6}
PARKING_ORBIT = [21837080.052835, 0.0, 0.0, -0.25396764647494, 0.0, math.pi]  # p [ft], f, g, h, k, L [rad]


def low_thrust() -> OptimalControlProblem:
    """Transfer with an engine of low thrust from a low orbit to an eccentric one of 63.4 degrees (Betts, 2010).

        maximise w(T)   subject to   y' = A(y) Δ + b(y),   w' = -F (1 + 0.01 τ) / 450,   0.999 <= |u|^2 <= 1.001,
            Δ = Δ_g + 32.174 F (1 + 0.01 τ) u / w,   F = 4.446618e-3 lb,   -50 <= τ <= 0,
            y(0) given, w(0) = 1,     p(T) = 40007346,   f^2 + g^2 = 0.7355^2,   h^2 + k^2 = 0.6176^2,
            f h + g k = 0,   g h - k f <= 0 at T,   50000 <= T <= 100000 s

    y = (p, f, g, h, k, L) are modified equinoctial elements, Δ_g the disturbance by J2, J3 and J4, u the direction of
    the thrust in the radial frame, w the weight, in feet, pounds and seconds. w(T)* = 0.2203.
    The file's guess is a solution on 141 nodes. This one is thrust ahead with τ = -25, simulated.
    """
    THRUST, IMPULSE = 4.446618e-3, 450.0  # [lb], [s]
    ocp = OptimalControlProblem("PSOPT: low_thrust")

    y = ca.vertcat(
        ocp.state("p", lower=10e6, upper=60e6),  # [ft]
        ocp.state("f", lower=-0.20, upper=0.20),
        ocp.state("g", lower=-0.10, upper=1.0),
        ocp.state("h", lower=-1.0, upper=1.0),
        ocp.state("k", lower=-0.20, upper=0.20),
        ocp.state("L", lower=math.pi, upper=20.0 * math.pi),  # [rad]
    )
    w = ocp.state("w", lower=0.0, upper=2.0)  # [lb]
    u = ocp.control("u", 3, lower=-1.0, upper=1.0, guess=(0.0, 1.0, 0.0))
    tau = ocp.unknown("tau", lower=-50.0, upper=0.0, guess=-25.0)
    ocp.free_duration(guess=86810.0, lower=50000.0, upper=100000.0)

    ocp.minimise(terminal=-w)

    thrust = THRUST * (1 + 0.01 * tau)
    ocp.dynamics(y, equinoctial_rates(y, oblateness(y) + GRAVITY * thrust * u / w))
    ocp.dynamics(w, -thrust / IMPULSE)

    ocp.constrain(ca.sumsqr(u), lower=1.0 - 0.001, upper=1.0 + 0.001)

    ocp.start(ca.vertcat(y, w), [*PARKING_ORBIT, 1.0])
    p, f, g, h, k, _ = ca.vertsplit(y)
    ocp.end(p, 40007346.015232)
    ocp.end_constraint(ca.sqrt(f**2 + g**2) == 0.73550320568829)
    ocp.end_constraint(ca.sqrt(h**2 + k**2) == 0.61761258786099)
    ocp.end_constraint(f * h + g * k == 0)
    ocp.end_constraint(g * h - k * f, lower=-10.0, upper=0.0)
    ocp.guess_by_simulation()
    return ocp


def twoburn() -> MultiPhaseProblem:
    """Transfer from a low orbit to the geostationary one by two burns: coast, burn, coast, burn (Betts, 2010).

        maximise w(T)   subject to   y' = A(y) (Δ_g + Δ_F) + b(y),
            coasting:   Δ_F = 0,     burning:   w' = -F / 300,   F = 1.2 lb,   Δ_F = 32.174 F / w Q(y) d(θ, φ),
            y(0) given, w = 1 at the first burn,   ends of the phases within 2000 to 3000, 2100 to 3100, 21600 to 21800
            and 21650 to 21900 s,   p(T) = 19323 nautical miles above R, f = g = h = k = 0

    y = (p, f, g, h, k, L) are modified equinoctial elements, Δ_g the disturbance by J2, J3 and J4, d the direction of
    the thrust by its angles in the frame of the velocity, w the weight, in feet, pounds and seconds. w(T)* = 0.23672.
    """
    THRUST, IMPULSE = 1.2, 300.0  # [lb], [s]
    DEGREE = math.pi / 180.0
    TARGET = [19323.0 * 6076.1154855643 + EARTH_RADIUS, 0.0, 0.0, 0.0, 0.0]
    END = [*TARGET, 9.4]
    LOWER, UPPER = (10e6, -1.0, -1.0, -1.0, -1.0, math.pi), (2e8, 1.0, 1.0, 1.0, 1.0, 30.0 * math.pi)
    WEIGHTS = (1.0, math.exp(-8000.0 / (GRAVITY * IMPULSE)), math.exp(-11000.0 / (GRAVITY * IMPULSE)))  # guess [lb]
    ANGLES = {1: (0.148637e-2, -9.08446), 3: (-0.136658e-2, 49.7892)}  # guess [degrees]
    DURATIONS = (2690.0, 150.0, 18810.0, 50.0)  # guess [s]
    WINDOWS = ((2000.0, 3000.0), (2100.0, 3100.0), (21600.0, 21800.0), (21650.0, 21900.0))  # [s] of the ends
    problem = MultiPhaseProblem("PSOPT: twoburn")

    phases = [problem.phase(name) for name in ("coast", "burn", "second coast", "second burn")]
    weights = dict[int, ca.SX]()
    elapsed, last = ca.SX(0), ca.SX(0, 1)
    for index, (phase, guess, window) in enumerate(zip(phases, DURATIONS, WINDOWS, strict=True)):
        ways = [
            [a + (b - a) * share / 4 for share in (index, index + 1)] for a, b in zip(PARKING_ORBIT, END, strict=True)
        ]
        y = ca.vertcat(
            *(
                phase.state(name, lower=LOWER[k], upper=UPPER[k], guess=ways[k])
                for k, name in enumerate(("p", "f", "g", "h", "k", "L"))
            )
        )
        disturbance = oblateness(y)
        if index in ANGLES:
            w = phase.state("w", lower=0.0, upper=2.0, guess=WEIGHTS[index // 2 : index // 2 + 2])
            theta, phi = (
                phase.control(name, lower=-math.pi, upper=math.pi, guess=angle * DEGREE)
                for name, angle in zip(("theta", "phi"), ANGLES[index], strict=True)
            )
            disturbance += GRAVITY * THRUST / w * along_velocity(y, theta, phi)
            phase.dynamics(w, -THRUST / IMPULSE)
            weights[index] = w
        phase.dynamics(y, equinoctial_rates(y, disturbance))
        elapsed += phase.free_duration(guess=guess)
        problem.couple(elapsed, lower=window[0], upper=window[1], name=f"end of {phase.statement.name}")
        if index == 0:
            phase.start(y, PARKING_ORBIT)
        else:
            for before, after in zip(ca.vertsplit(last), ca.vertsplit(y), strict=True):
                problem.couple(phase.initial(after) == before, name=f"{after.name()} at the start of phase {index + 1}")
        last = y
    phases[1].start(weights[1], 1.0)
    problem.couple(phases[3].initial(weights[3]) == weights[1], name="weight between the burns")
    phases[3].end(last[:5], TARGET)
    phases[3].minimise(terminal=-weights[3])
    return problem


def equinoctial_rates(y: ca.SX, disturbance: ca.SX) -> ca.SX:
    """Rates (6,) of modified equinoctial elements (6,) under a disturbance (3,) [ft/s^2] in the radial frame."""
    p, f, g, h, k, L = ca.vertsplit(y)
    sin, cos = ca.sin(L), ca.cos(L)
    q, s2 = 1 + f * cos + g * sin, 1 + h**2 + k**2
    root, lean = ca.sqrt(p / MU), h * sin - k * cos
    radial, transversal, normal = ca.vertsplit(disturbance)
    return ca.vertcat(
        2 * p / q * root * transversal,
        root * (sin * radial + ((q + 1) * cos + f) / q * transversal - g * lean / q * normal),
        root * (-cos * radial + ((q + 1) * sin + g) / q * transversal + f * lean / q * normal),
        root * s2 * cos / (2 * q) * normal,
        root * s2 * sin / (2 * q) * normal,
        ca.sqrt(MU * p) * (q / p) ** 2 + root * lean / q * normal,
    )


def oblateness(y: ca.SX) -> ca.SX:
    """Disturbance (3,) [ft/s^2] by the zonal harmonics at elements (6,), radial, transversal and normal.

    With P_j of the sine of the latitude, -μ / r^2 Σ J_j (R / r)^j (P_j' n - (j + 1) P_j e_r), n the north without its
    radial part.
    """
    p, f, g, h, k, L = ca.vertsplit(y)
    sin, cos, s2 = ca.sin(L), ca.cos(L), 1 + h**2 + k**2
    r = p / (1 + f * cos + g * sin)
    latitude = 2 * (h * sin - k * cos) / s2  # its sine
    north = ca.vertcat(0, 2 * (h * cos + k * sin) / s2, (1 - h**2 - k**2) / s2)
    polynomials = {
        2: ((3 * latitude**2 - 1) / 2, 3 * latitude),
        3: ((5 * latitude**3 - 3 * latitude) / 2, (15 * latitude**2 - 3) / 2),
        4: ((35 * latitude**4 - 30 * latitude**2 + 3) / 8, (35 * latitude**3 - 15 * latitude) / 2),
    }
    total = ca.SX(3, 1)
    for j, (value, slope) in polynomials.items():
        total += ZONAL_HARMONICS[j] * (EARTH_RADIUS / r) ** j * (slope * north - ca.vertcat((j + 1) * value, 0, 0))
    return -MU / r**2 * total


def along_velocity(y: ca.SX, theta: ca.SX, phi: ca.SX) -> ca.SX:
    """Direction (3,), in the radial frame, of angles [rad] in the frame of the velocity: v, v × r and their product."""
    _, f, g, _, _, L = ca.vertsplit(y)
    radial, transversal = f * ca.sin(L) - g * ca.cos(L), 1 + f * ca.cos(L) + g * ca.sin(L)  # of the velocity
    ahead = ca.vertcat(radial, transversal, 0) / ca.sqrt(radial**2 + transversal**2)
    aside = ca.vertcat(0, 0, -1)
    return ca.cos(theta) * (ca.cos(phi) * ahead + ca.sin(phi) * aside) + ca.sin(theta) * ca.cross(ahead, aside)


def reorientation() -> OptimalControlProblem:
    """A rigid body turned by 150 degrees in the least time, with torques about its three axes (Betts, 2010).

        minimise T   subject to   q' = (q4 ω + q × ω) / 2,   |q|^2 + q4^2 = 1,   I ω' = u - ω × I ω,
            I = diag(5621, 4547, 2364),   |u| <= 50,   |ω| <= 0.5,   |q|, |q4| <= 1,   25 <= T <= 35,
            q = 0 to (sin 75°, 0, 0), at rest

    q4 is a control that the equation fixes up to its sign; the file pins it at both ends too. T* = 28.6304.
    """
    INERTIA = ca.DM([5621.0, 4547.0, 2364.0])
    HALF = math.radians(75.0)
    ocp = OptimalControlProblem("PSOPT: reorientation")

    q = ocp.state("q", 3, lower=-1.0, upper=1.0)
    omega = ocp.state("omega", 3, lower=-0.5, upper=0.5)  # [rad/s]
    u = ocp.control("u", 3, lower=-50.0, upper=50.0, guess=(50.0, 50.0, 50.0))
    q4 = ocp.control("q4", lower=-1.0, upper=1.0, guess=(1.0, math.cos(HALF)))
    T = ocp.free_duration(guess=35.0, lower=25.0, upper=35.0)  # the file guesses 40, outside of the limits
    ocp.guess(q, [[0.0, 0.0, 0.0], [math.sin(HALF), 0.0, 0.0]])

    ocp.minimise(terminal=T)

    ocp.dynamics(q, (q4 * omega + ca.cross(q, omega)) / 2)
    ocp.dynamics(omega, (u - ca.cross(omega, INERTIA * omega)) / INERTIA)

    ocp.constrain(ca.sumsqr(q) + q4**2 == 1)

    ocp.start(ca.vertcat(q, omega), 0.0)
    ocp.end(ca.vertcat(q, omega), [math.sin(HALF), 0.0, 0.0, 0.0, 0.0, 0.0])
    return ocp


def zpm() -> OptimalControlProblem:
    """Zero propellant manoeuvre: the space station turned by its gyroscopes alone (Bhatt, 2007; Bedrossian), 7200 s.

        minimise 0.1 γ + ∫_0^7200 |u|^2 dt   subject to   q' = T(q) (ω - ω_0(q)) / 2,
            J ω' = 3 n^2 c × J c - ω × J ω - u,   h' = u - ω × h,   u = J (K_p 2 T(q_c)^T q + K_d (ω - ω_0(q_c))),
            |q|^2, |q_c|^2 within 2e-4 of 1,   |h|^2 <= γ <= 10800^2,   |h'| <= 200,
            |q_1|, |q_4| <= 1,   |q_2|, |q_3| <= 0.2,   |ω| <= 0.01,   |h| <= 8000,
            from q within 1e-4 of one attitude to another, at rest in orbit

    q_c is the attitude that the controller is given, ω_0 the orbital rate, c the vertical, h the momentum of the
    gyroscopes in ft lb s. The file states the aerodynamic torque and sets it to 0. J* = 6.68e6.
    """
    RATE, MOST = 1.1475e-3, 3.0 * 3600.0  # [rad/s], [ft lb s]
    PROPORTIONAL, DERIVATIVE = 0.000128, 0.015846  # gains [1/s^2], [1/s]
    J = ca.DM(
        [
            [18836544.0, 3666370.0, 2965301.0],
            [3666370.0, 27984088.0, -1129004.0],
            [2965301.0, -1129004.0, 39442649.0],
        ]
    )  # [slug ft^2]
    FROM, TO = [0.98996, 0.02650, -0.07891, 0.11422], [0.70531, -0.06201, -0.03518, -0.70531]
    H_FROM, H_TO = [1000.0, -500.0, -4200.0], [-9.0, -3557.0, -135.0]
    ocp = OptimalControlProblem("PSOPT: zpm")

    def orbital(q: ca.SX) -> ca.SX:
        """Angular velocity (3,) [rad/s] of the orbital frame, in the body's."""
        return -RATE * ca.vertcat(
            2 * (q[1] * q[2] + q[0] * q[3]), 1 - 2 * (q[1] ** 2 + q[3] ** 2), 2 * (q[2] * q[3] - q[0] * q[1])
        )

    def kinematics(q: ca.SX) -> ca.SX:
        """Matrix T (4, 3) of q' = T ω / 2."""
        return ca.vertcat(
            ca.horzcat(-q[1], -q[2], -q[3]),
            ca.horzcat(q[0], -q[3], q[2]),
            ca.horzcat(q[3], q[0], -q[1]),
            ca.horzcat(-q[2], q[1], q[0]),
        )

    omegas = [[float(each) for each in ca.DM(orbital(ca.SX(ca.DM(q)))).full().ravel()] for q in (FROM, TO)]
    q = ocp.state("q", 4, lower=[-1.0, -0.2, -0.2, -1.0], upper=[1.0, 0.2, 0.2, 1.0], guess=FROM)
    omega = ocp.state("omega", 3, lower=-1e-2, upper=1e-2)  # [rad/s]
    h = ocp.state("h", 3, lower=-8000.0, upper=8000.0)  # [ft lb s]
    q_c = ocp.control("q_c", 4, lower=-1.0, upper=1.0, guess=FROM)
    gamma = ocp.unknown("gamma", lower=0.0, upper=MOST**2, guess=MOST**2)
    ocp.duration(7200.0)
    ocp.guess(omega, omegas)
    ocp.guess(h, [H_FROM, H_TO])

    u = J @ (PROPORTIONAL * 2 * (kinematics(q_c).T @ q) + DERIVATIVE * (omega - orbital(q_c)))
    ocp.minimise(running=ca.sumsqr(u), terminal=0.1 * gamma)

    vertical = ca.vertcat(
        2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1]), 1 - 2 * (q[1] ** 2 + q[2] ** 2)
    )
    gravity = 3 * RATE**2 * ca.cross(vertical, J @ vertical)
    dh = u - ca.cross(omega, h)
    ocp.dynamics(q, kinematics(q) @ (omega - orbital(q)) / 2)
    ocp.dynamics(omega, ca.inv(J) @ (gravity - ca.cross(omega, J @ omega) - u))
    ocp.dynamics(h, dh)

    for attitude in (q, q_c):
        ocp.constrain(ca.sumsqr(attitude), lower=1.0 - 0.0002, upper=1.0 + 0.0002)
    ocp.constrain(ca.sumsqr(h) - gamma, lower=-(MOST**2), upper=0.0)
    ocp.constrain(ca.sumsqr(dh), lower=0.0, upper=200.0**2)

    ocp.start(ca.vertcat(omega, h), [*omegas[0], *H_FROM])
    ocp.end(ca.vertcat(omega, h), [*omegas[1], *H_TO])
    ocp.start_constraint(q - ca.DM(FROM), lower=-0.0001, upper=0.0001)
    ocp.end_constraint(q - ca.DM(TO), lower=-0.0001, upper=0.0001)
    return ocp


STATEMENTS: dict[str, Statement] = {
    "low_thrust": low_thrust,
    "reorientation": reorientation,
    "twoburn": twoburn,
    "zpm": zpm,
}

INDEPENDENT: dict[str, tuple[float, str]] = {
    "low_thrust": (-0.2203404, "Gauss-Legendre and Radau, 160 x 6 and 240 x 6, agree to 1e-7"),
    "reorientation": (28.630406535, "Gauss-Legendre and Radau on six arcs, 36 x 5 and 36 x 6"),
    "twoburn": (-0.23672487125, "Gauss-Legendre and Radau, 40 x 6 and 60 x 6"),
    "zpm": (6680291.0, "Gauss-Legendre and Radau, 160 x 4, and Gauss-Legendre, 240 x 4, agree to 1e-7"),
}

DETAILS: dict[str, Details] = {
    "reorientation": {"note": "the file guesses T = 40, above its limit of 35"},
}
