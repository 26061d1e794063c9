"""Examples of PSOPT from flight: a glider, rockets, orbits; each as its file states it, in its units."""

from __future__ import annotations

import math

import casadi as ca

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published.details import Details
from mathnavi.studies.published.optimum import Statement


def glider() -> OptimalControlProblem:
    """A hang glider that crosses a thermal and flies as far as it can (Bulirsch, Nerz, Pesch, von Stryk, 1993).

        minimise -x(T)   subject to   x' = v_x,   v_x' = -(L sin η + D cos η) / m,
                                      y' = v_y,   v_y' = (L cos η - D sin η) / m - g,   0 <= c <= 1.4,
            X = (x / 100 - 2.5)^2,   V = v_y - 2.5 (1 - X) e^(-X),   v^2 = v_x^2 + v_y^2,   sin η = V / v,
            cos η = v_x / v,
            L = c ρ S v^2 / 2,   D = (0.034 + 0.069662 c^2) ρ S v^2 / 2,   ρ = 1.13, S = 14, m = 100, g = 9.80665,
            0 <= x <= 1500,   0 <= y <= 1100,   0 <= v_x <= 15,   |v_y| <= 4,   0.1 <= T <= 200,
            (x, y) = (0, 1000) to y = 900, (v_x, v_y) = (13.2275675, -1.28750052) at either end

    The file takes the speed over the ground, not that through the air, so J is not that of the literature.
    """
    MASS, GRAVITY, AREA, DENSITY = 100.0, 9.80665, 14.0, 1.13  # [kg], [m/s^2], [m^2], [kg/m^3]
    GLIDE = (13.2275675, -1.28750052)  # [m/s]
    ocp = OptimalControlProblem("PSOPT: glider")

    x = ocp.state("x", lower=0.0, upper=1500.0, guess=(0.0, 1250.0))  # [m]
    y = ocp.state("y", lower=0.0, upper=1100.0, guess=(1000.0, 900.0))  # [m]
    v_x = ocp.state("v_x", lower=0.0, upper=15.0, guess=13.23)  # [m/s]
    v_y = ocp.state("v_y", lower=-4.0, upper=4.0, guess=-1.288)  # [m/s]
    c = ocp.control("c", lower=0.0, upper=1.4, guess=1.0)
    ocp.free_duration(guess=105.0, lower=0.1, upper=200.0)  # [s]

    ocp.minimise(terminal=-x)

    X = (x / 100 - 2.5) ** 2
    V = v_y - 2.5 * (1 - X) * ca.exp(-X)
    v = ca.sqrt(v_x**2 + v_y**2)
    lift = c * DENSITY * AREA * v**2 / 2
    drag = (0.034 + 0.069662 * c**2) * DENSITY * AREA * v**2 / 2
    ocp.dynamics(ca.vertcat(x, y), ca.vertcat(v_x, v_y))
    ocp.dynamics(v_x, -(lift * V + drag * v_x) / (v * MASS))
    ocp.dynamics(v_y, (lift * v_x - drag * V) / (v * MASS) - GRAVITY)

    ocp.start(ca.vertcat(x, y, v_x, v_y), [0.0, 1000.0, *GLIDE])
    ocp.end(ca.vertcat(y, v_x, v_y), [900.0, *GLIDE])
    return ocp


def goddard() -> OptimalControlProblem:
    """Goddard's rocket with the file's air, which is a vacuum: e^(-500 h) where others have e^(-500 (h - 1)).

        minimise -h(T)   subject to   v' = (F - 310 v^2 e^(-500 h)) / m - 1 / h^2,   h' = v,   m' = -2 F,
            0 <= F <= 3.5,   0 <= v <= 2,   1 <= h <= 2,   0.6 <= m <= 1,   0.1 <= T <= 1,   (0, 1, 1) to m = 0.6

    In units of the planet's radius, its gravity and the take-off mass. Full thrust until the fuel is spent, and coast.
    """
    ocp = OptimalControlProblem("PSOPT: goddard")

    v = ocp.state("v", lower=0.0, upper=2.0)
    h = ocp.state("h", lower=1.0, upper=2.0, guess=1.0)
    m = ocp.state("m", lower=0.6, upper=1.0, guess=1.0)
    F = ocp.control("F", lower=0.0, upper=3.5, guess=3.5)
    ocp.free_duration(guess=1.0, lower=0.1, upper=1.0)  # the file guesses 15, outside its bounds

    ocp.minimise(terminal=-h)

    ocp.dynamics(v, (F - 310 * v**2 * ca.exp(-500 * h)) / m - 1 / h**2)
    ocp.dynamics(ca.vertcat(h, m), ca.vertcat(v, -2 * F))

    ocp.start(ca.vertcat(v, h, m), [0.0, 1.0, 1.0])
    ocp.end(m, 0.6)
    return ocp


def lambert() -> OptimalControlProblem:
    """Lambert's problem: the orbit that joins two places in a given time (Vallado, 2001). There is nothing to minimise.

        r'' = -μ r / |r|^3,   μ = 6.6720e-11 · 5.9742e24 m^3/s^2,
                              (15945.34, 0, 0) km to (12214.83899, 10249.46731, 0) km in 76 min

    The places are bounded by ten times the ends and the speeds by that over the time: in the third direction both
    are 0.
    """
    mu, duration = 6.6720e-11 * 5.9742e24, 76.0 * 60.0  # [m^3/s^2], [s]
    start, end = [15945.34e3, 0.0, 0.0], [12214.83899e3, 10249.46731e3, 0.0]  # [m]
    most = [10.0 * max(ends) for ends in zip(start, end, strict=True)]  # [m]
    ocp = OptimalControlProblem("PSOPT: lambert")

    r = ocp.state("r", 3, lower=[-each for each in most], upper=most, guess=[start, end])  # [m]
    guess = [[each / duration for each in place] for place in (start, end)]
    v = ocp.state("v", 3, lower=-most[0] / duration, upper=[each / duration for each in most], guess=guess)  # [m/s]
    ocp.duration(duration)

    ocp.dynamics(r, v)
    ocp.dynamics(v, -mu * r / ca.norm_2(r) ** 3)

    ocp.start(r, start)
    ocp.end(r, end)
    return ocp


MU, RADIUS, SEA_LEVEL_GRAVITY, EARTH_RATE = 3.986012e14, 6378145.0, 9.80665, 7.29211585e-5  # SI
SIDE_THRUST, FIRST_THRUST, SECOND_THRUST = 628500.0, 1083100.0, 110094.0  # [N]
SIDE_FLOW, FIRST_FLOW, SECOND_FLOW = 17010.0 / 75.2, 95550.0 / 261.0, 16820.0 / 700.0  # [kg/s]
SIDE_DRY, FIRST_DRY = 19290.0 - 17010.0, 104380.0 - 95550.0  # [kg]
PAYLOAD = 4164.0  # [kg]
ORBIT = (24361140.0, 0.7308, math.radians(28.5), math.radians(269.8), math.radians(130.5))  # a [m], e, i, Ω, ω
QUADRANT = 0.1  # width of the step that chooses a quadrant


def launch() -> MultiPhaseProblem:
    """A launch vehicle with nine boosters, flown into a transfer orbit with the most fuel left (Benson, 2004; GPOPS).

        minimise -m(T)   subject to   r' = v,   v' = F u / m - μ r / |r|^3 - D,   m' = -F / (g I),   |u|^2 = 1,
            D = ρ S c |w| w / (2 m),   w = v - Ω x r,   ρ = 1.225 e^(-(|r| - R) / 7200),   S = 4π,   c = 0.5

    in four phases: six boosters and the first stage until 75.2 s, three boosters and the first stage until 150.4 s, the
    first stage until 261 s, the second stage until the orbit (a, e, i, Ω, ω) = (24361.14 km, 0.7308, 28.5°, 269.8°,
    130.5°), at 961 s at the latest; empty boosters and stages fall off in between. The start is at 28.5° north, at rest
    on the turning earth. The quadrants of Ω and ω are chosen by a smooth step, 1/2 (1 + tanh(s / 0.1)), of the y of the
    node and of the z of the vector of eccentricity. That is 0.27 and leaves half a percent of the other quadrant: the ω
    that is flown is not quite 130.5°.
    """
    latitude = math.radians(28.5)
    place = [RADIUS * math.cos(latitude), 0.0, RADIUS * math.sin(latitude)]  # [m]
    speed = [0.0, EARTH_RATE * place[0], 0.0]  # [m/s]
    flows = [6 * SIDE_FLOW + FIRST_FLOW, 3 * SIDE_FLOW + FIRST_FLOW, FIRST_FLOW, SECOND_FLOW]  # [kg/s]
    thrusts = [6 * SIDE_THRUST + FIRST_THRUST, 3 * SIDE_THRUST + FIRST_THRUST, FIRST_THRUST, SECOND_THRUST]  # [N]
    durations, dropped = [75.2, 75.2, 110.6, 700.0], [6 * SIDE_DRY, 3 * SIDE_DRY, FIRST_DRY]  # [s], [kg]
    problem = MultiPhaseProblem("PSOPT: launch")

    phases: list[OptimalControlProblem] = []
    heaviest = PAYLOAD + 19300.0 + 104380.0 + 9 * 19290.0  # [kg]
    for k, (thrust, flow, duration) in enumerate(zip(thrusts, flows, durations, strict=True)):
        phase = problem.phase(f"phase {k + 1}")
        lightest = PAYLOAD if k == 3 else heaviest - flow * duration
        around, along = (place, speed) if k < 3 else _perigee()
        r = phase.state("r", 3, lower=-2 * RADIUS, upper=2 * RADIUS, guess=around)
        v = phase.state("v", 3, lower=-1e4, upper=1e4, guess=along)
        m = phase.state("m", lower=lightest, upper=heaviest, guess=(heaviest, lightest))
        u = phase.control("u", 3, lower=-1.0, upper=1.0, guess=[1.0, 0.0, 0.0])
        if k < 3:
            phase.duration(duration)
        else:
            phase.free_duration(guess=duration, lower=1e-3, upper=duration)  # from 0 in the file

        distance = ca.norm_2(r)
        wind = v - EARTH_RATE * ca.vertcat(-r[1], r[0], 0)
        density = 1.225 * ca.exp(-(distance - RADIUS) / 7200)
        drag = density * 4 * math.pi * 0.5 / (2 * m) * ca.norm_2(wind) * wind
        phase.dynamics(r, v)
        phase.dynamics(v, thrust / m * u - MU * r / distance**3 - drag)
        phase.dynamics(m, -flow)

        phase.constrain(ca.sumsqr(u) == 1)
        if k == 0:
            phase.start(r, place)
            phase.start(v, speed)
            phase.start(m, heaviest)
        else:
            problem.link(phases[-1], phase, jumps={"m": -dropped[k - 1]})
        if k == 3:
            for element, value in zip(_elements(r, v), ORBIT, strict=True):
                phase.end_constraint(element == value)
            phase.minimise(terminal=-m)
        phases.append(phase)
        heaviest = lightest - (dropped[k] if k < 3 else 0.0)
    return problem


def _perigee() -> tuple[list[float], list[float]]:
    """Place [m] and velocity [m/s] at the perigee of the orbit: the guess of the last phase."""
    a, e, i, Om, om = ORBIT
    p = a * (1 - e**2)
    toward = [
        math.cos(Om) * math.cos(om) - math.sin(Om) * math.sin(om) * math.cos(i),
        math.sin(Om) * math.cos(om) + math.cos(Om) * math.sin(om) * math.cos(i),
        math.sin(om) * math.sin(i),
    ]
    across = [
        -math.cos(Om) * math.sin(om) - math.sin(Om) * math.cos(om) * math.cos(i),
        -math.sin(Om) * math.sin(om) + math.cos(Om) * math.cos(om) * math.cos(i),
        math.cos(om) * math.sin(i),
    ]
    return [p / (1 + e) * each for each in toward], [math.sqrt(MU / p) * (1 + e) * each for each in across]


def _elements(r: ca.SX, v: ca.SX) -> list[ca.SX]:
    """Elements a [m], e, i, Ω, ω [rad] of the orbit through r [m] with v [m/s], quadrants by the file's smooth step."""
    momentum = ca.cross(r, v)
    node = ca.vertcat(-momentum[1], momentum[0], 0)
    eccentricity = ((ca.sumsqr(v) - MU / ca.norm_2(r)) * r - ca.dot(r, v) * v) / MU
    e = ca.norm_2(eccentricity)

    def angle(cosine: ca.SX, sign: ca.SX) -> ca.SX:
        step = (1 + ca.tanh(sign / QUADRANT)) / 2
        return step * ca.acos(cosine) + (1 - step) * (2 * math.pi - ca.acos(cosine))

    return [
        ca.sumsqr(momentum) / MU / (1 - e**2),
        e,
        ca.acos(momentum[2] / ca.norm_2(momentum)),
        angle(node[0] / ca.norm_2(node), node[1]),
        angle(ca.dot(node, eccentricity) / ca.norm_2(node) / e, eccentricity[2]),
    ]


STATEMENTS: dict[str, Statement] = {"glider": glider, "goddard": goddard, "lambert": lambert, "launch": launch}

INDEPENDENT: dict[str, tuple[float, str]] = {
    "glider": (-1247.87267, "Radau and Gauss-Legendre, 100 x 6, 150 x 7 and 200 x 6: these agree to 3e-9"),
    "goddard": (-1.02534106, "Radau and Gauss-Legendre, 60 x 4, controls of degree 0, moving"),
    "lambert": (0.0, "closed form: there is no cost"),
    "launch": (-7529.6612516, "Radau and Gauss-Legendre, 15 x 5 and 24 x 5"),
}

DETAILS: dict[str, Details] = {}
