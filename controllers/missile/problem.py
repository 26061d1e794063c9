"""Problem that a missile solves while it flies: the thesis' design study (B.4), from its present state to where the
target will be.

    minimise   J = ∫_0^T 1 + a_x (F_x / m g)^2 + a_z (F_z / m g)^2 + b (M / I_y)^2 + k (w / u)^2 dt,      T free,
    subject to x' = f(x, F) of the declared body,     x(0) = x_0,     |F| <= limits,
               (x_e, z_e)(T) = p + v T,   theta(T) = the aspect angle,   w(T) = 0,

in the pitch plane. In space F_z^2 stands for F_y^2 + F_z^2, M^2 for M^2 + N^2, w^2 for v^2 + w^2, and the end holds
y_e(T) = p_y + v_y T, psi(T) = 0 and v(T) = 0 as well. The start x_0, the target's place p and its velocity v are
parameters: a target that moves needs the lead v T. The aspect angle pins theta and w, for with three inputs, three
degrees of freedom and no aerodynamics theta alone says nothing about the path.

A plan stays above the ground, z_e = 0. With the distance r ahead to the target as it moves, p + v t, its height is

    -z_e >= -delta + r^2 / (r^2 + R^2) (h + delta - (h + delta - h_0)^+ exp(-t / t_r)),

so h is kept but near the target, and regained from a start that is lower, h_0 < h. The constraint holds at the nodes
and in the middle between them (``MultipleShooting``); ``lowest_height`` measures what is left between those.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.missile.dynamics import Body
from mathnavi.models.missile.mission import Case, Target, running_cost

LEAST_SPEED = 1.0
"""least speed u [m/s]: below it the angle of attack w / u is meaningless"""
MOST_YAW = math.radians(85.0)
"""greatest psi [rad], which must stay below 90 degrees"""
DURATIONS = (0.02, 600.0)
"""limits of T [s]"""
TYPICAL_DURATION = 5.0
"""typical T [s]"""

STATE_SCALES = {"u": 100.0, "v": 100.0, "w": 100.0, "x_e": 100.0, "y_e": 100.0, "z_e": 100.0}
STATE_LIMITS = {"u": (LEAST_SPEED, math.inf), "psi": (-MOST_YAW, MOST_YAW)}
TAPER = 100.0
"""distance R [m] ahead to the target at which half the clearance is kept"""
RECOVERY = 1.0
"""time constant t_r [s] at which a missile that is too low regains the clearance"""
ALLOWANCE = 0.1
"""depth delta [m] by which the middle of the missile may pass below the ground, at the target for instance"""

END = ("x_e", "y_e", "z_e", "theta", "psi", "v", "w")
"""states that the terminal condition fixes"""


@dataclass(frozen=True, eq=False)
class TerminalCondition:
    """Terminal condition of a flight of unknown duration T: end at ``place`` + ``velocity`` T, attitude, drift."""

    place: Array  # (3,) [m] Earth frame, where the target is at the start of the flight
    velocity: Array  # (3,) [m/s]
    theta: float  # [rad]
    psi: float = 0.0  # [rad]
    v: float = 0.0  # [m/s]
    w: float = 0.0  # [m/s]

    @staticmethod
    def at(target: Target, t: float, attitude: tuple[float, float], *, lead: bool) -> TerminalCondition:
        """The condition for a flight that starts at t [s] towards a target, there with theta and psi [rad]; without
        ``lead`` as if the target stood still.
        """
        velocity = np.array(target.velocity) if lead else np.zeros(3)
        return TerminalCondition(target.at(t), velocity, *attitude)

    def wound_to(self, theta: float) -> TerminalCondition:
        """The same condition, its theta whole turns nearest to an angle [rad]: a loop ends a turn later."""
        turns = round((theta - self.theta) / (2.0 * math.pi))
        return dataclasses.replace(self, theta=self.theta + 2.0 * math.pi * turns)

    def after(self, T: float) -> Array:
        """Place (3,) [m] of the target after T [s]."""
        place: Array = self.place + T * self.velocity
        return place

    def parameters(self, start: Array, coordinates: Coordinates) -> Array:
        """Parameters (np,) of ``guidance_problem``, but for the weights, from the state ``start`` (nx,)."""
        values = {
            **dict(zip(("x_e", "y_e", "z_e"), self.place.tolist(), strict=True)),
            **{name: getattr(self, name) for name in ("theta", "psi", "v", "w")},
        }
        rates = dict(zip(("x_e", "y_e", "z_e"), self.velocity.tolist(), strict=True))
        end: list[float] = []
        for name in END:
            if name in coordinates.states:
                end.append(values[name])
                if name in rates:
                    end.append(rates[name])
        return np.concatenate([start, end])

    def error_of(self, end: Array, T: float, coordinates: Coordinates) -> TerminalCondition:
        """Error of the state ``end`` (nx,) after T [s], component by component."""
        x = coordinates.in_space(end)
        theta = wrapped(x[5] - self.theta)
        return TerminalCondition(
            x[7:] - self.after(T), np.zeros(3), theta, x[6] - self.psi, x[1] - self.v, x[2] - self.w
        )

    @property
    def norm(self) -> float:
        """Norm of an error [m], a radian counted as 10 m and 1 m/s as 1 m."""
        return math.hypot(*self.place, 10.0 * self.theta, 10.0 * self.psi, self.v, self.w)

    def corrected_for(self, error: TerminalCondition) -> TerminalCondition:
        """The condition shifted against an error, so that a flight which errs by it again ends at the target."""
        return dataclasses.replace(
            self,
            place=self.place - error.place,
            **{name: getattr(self, name) - getattr(error, name) for name in ("theta", "psi", "v", "w")},
        )


def out_of_bounds(x: Array, coordinates: Coordinates) -> str | None:
    """Reason why no flight may start at a state (nx,) [m, m/s, rad]; None if one may."""
    height = -float(x[coordinates.index("z_e")])
    if height < -ALLOWANCE:
        return f"the flight would start {-height:.3g} m below the ground"
    for name, value in zip(coordinates.states, x.tolist(), strict=True):
        lower, upper = STATE_LIMITS.get(name, (-math.inf, math.inf))
        if not lower <= value <= upper:
            return f"the flight would start with {name} = {value:.6g}; allowed: {lower:.6g} to {upper:.6g}"
    return None


GROUND = ("clearance", "deficit")
"""parameters h + delta and (h + delta - h_0)^+ [m] of the constraint on the height"""


def ground_parameters(height: float, clearance: float) -> Array:
    """Values (2,) of ``GROUND`` at a height h_0 [m] over the ground, for a clearance h [m]."""
    kept = clearance + ALLOWANCE
    return np.array([kept, max(0.0, kept - height)])


def keep_above_ground(ocp: OptimalControlProblem, z_e: ca.SX, ahead: Sequence[ca.SX], t: ca.SX) -> None:
    """Declare ``GROUND`` and constrain z_e [m], at t [s] and the distances ``ahead`` [m] from the target then."""
    kept, deficit = (ocp.parameter(name, 0.0) for name in GROUND)
    squared = sum((distance**2 for distance in ahead), ca.SX(0))
    least = squared / (squared + TAPER**2) * (kept - deficit * ca.exp(-t / RECOVERY)) - ALLOWANCE
    ocp.constrain((z_e + least) / STATE_SCALES["z_e"], upper=0.0)


def input_scales(body: Body) -> dict[str, float]:
    """Typical magnitudes of forces [N] and moments [N m]."""
    force, moment = 5.0 * body.mass * body.gravity, 2.0 * body.inertia
    return {"F_x": force, "F_y": force, "F_z": force, "M": moment, "N": moment}


WEIGHTS = ("a_x", "a_z", "b", "k")
"""weights of the running cost, which are parameters, so that one compiled problem serves every case"""


def weights(case: Case) -> Array:
    """Values (4,) of ``WEIGHTS`` in a case."""
    return np.array([getattr(case, name) for name in WEIGHTS])


def declared_weights(ocp: OptimalControlProblem) -> list[ca.SX]:
    """Declare ``WEIGHTS`` as parameters of a problem."""
    return [ocp.parameter(name, 1.0) for name in WEIGHTS]


@lru_cache(maxsize=16)
def guidance_problem(body: Body, coordinates: Coordinates, limits: tuple[float, ...]) -> ProblemFunctions:
    """The joint problem of the module docstring; ``limits`` (nu,) [N, N m] are those of the inputs.

    Its parameters are ``WEIGHTS``, ``TerminalCondition.parameters`` and ``GROUND``.
    """
    ocp = OptimalControlProblem(f"missile, {coordinates.name}")
    cost = declared_weights(ocp)
    scales = STATE_SCALES | input_scales(body)
    x = {}
    for name in coordinates.states:
        lower, upper = STATE_LIMITS.get(name, (-math.inf, math.inf))
        x[name] = ocp.state(name, lower=lower, upper=upper, scale=scales.get(name, 1.0))
    F = {
        name: ocp.control(name, lower=-limit, upper=limit, scale=scales[name])
        for name, limit in zip(coordinates.inputs, limits, strict=True)
    }
    T = ocp.free_duration(guess=TYPICAL_DURATION, lower=DURATIONS[0], upper=DURATIONS[1])

    none = ca.SX(0)
    ocp.minimise(
        running=running_cost(
            cost,
            body,
            (x["u"], x.get("v", none), x["w"]),
            (F["F_x"], F.get("F_y", none), F["F_z"]),
            F["M"] ** 2 + F.get("N", none) ** 2,
        )
    )

    rates = coordinates.dynamics(body)(ca.vertcat(*x.values()), ca.vertcat(*F.values()))
    for state, rate in zip(x.values(), ca.vertsplit(rates), strict=True):
        ocp.dynamics(state, rate)

    for name, state in x.items():
        ocp.start(state, ocp.parameter(f"start_{name}", 0.0))
    ahead = []
    for name in (name for name in END if name in x):
        end = ocp.parameter(f"end_{name}", 0.0)
        if name.endswith("_e"):
            rate = ocp.parameter(f"end_rate_{name}", 0.0)
            ocp.end(x[name], end + rate * T)
            ahead.append(x[name] - end - rate * ocp.t)
        else:
            ocp.end(x[name], end)
    keep_above_ground(ocp, x["z_e"], ahead[:-1], ocp.t)
    return ocp.functions()
