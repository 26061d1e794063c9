"""Arcs of every optimum in the order of time: the structure of each control, and a guess of each duration."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import casadi as ca

from benchmarks.ocp_references.collocation import Arc, Reference, collocate, radau
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems import manuals
from mathnavi.interfaces.signals import Array


@dataclass(frozen=True)
class Chain:
    """Computation of an optimum: arcs, degrees of the two methods, and a uniform grid for the guess."""

    arcs: tuple[Arc, ...]
    radau: int = 7
    gauss: int = 5
    uniform: tuple[int, ...] = (20,)  # intervals of Radau IIA of three points, one grid after the other
    moving: bool = True  # widths are unknowns

    def guess(self, problem: ProblemFunctions) -> Reference | None:
        """Return the optimum on the uniform grids, None without grids; NoReferenceError if a solve fails."""
        found: Reference | None = None
        for intervals in self.uniform:
            found = collocate(problem, [Arc(1.0, intervals=intervals)], radau(3), found, moving=False, tolerance=1e-8)
        return found

    def optimum(self, problem: ProblemFunctions, points: Array, guess: Reference | None) -> float:
        """Return the optimum on the arcs with these points in an interval; NoReferenceError if the solve fails."""
        return collocate(problem, self.arcs, points, guess, moving=self.moving).cost


def smooth(intervals: int, uniform: tuple[int, ...] = (20,)) -> Chain:
    """Return a chain of one arc with equal intervals."""
    return Chain((Arc(1.0, intervals=intervals),), uniform=uniform, moving=False)


def bunt_load(x: ca.SX, u: ca.SX, t: ca.SX) -> ca.SX:
    """Return the residual of the active limit of the normal load, L / (m g) = -4."""
    air = manuals.BUNT_C1 * x[3] ** 2 + manuals.BUNT_C2 * x[3] + manuals.BUNT_C3
    lift = manuals.BUNT_B1 * u[1] * air * x[1] ** 2 * manuals.BUNT_AREA / 2
    return lift / (manuals.BUNT_MASS * manuals.BUNT_GRAVITY) + manuals.BUNT_MOST_LOAD


def rayleigh_bound(x: ca.SX, u: ca.SX, t: ca.SX) -> ca.SX:
    """Return the residual of the active mixed constraint, u + x1 / 6 = 0."""
    return u[0] + x[0] / 6


def on_parabola(x: ca.SX, t: ca.SX) -> ca.SX:
    """Return the residual of the state bound of stc1, x2 = 8 (t - 1/2)^2 - 1/2, at its entry."""
    return 8 * (t - 0.5) ** 2 - 0.5 - x[1]


def along_parabola(x: ca.SX, u: ca.SX, t: ca.SX) -> ca.SX:
    """Return the residual of the control of stc1 along its state bound, u - x2 = 16 (t - 1/2)."""
    return u[0] - x[1] - 16 * (t - 0.5)


def _layers(duration: float) -> Chain:
    """Return the chain of the hypersensitive problem, finer towards its ends."""
    widths = ((1.0, 20), (3.0, 20), (12.0, 24))  # [s], intervals
    rest = duration - 2 * sum(width for width, _ in widths)
    arcs = [Arc(width, intervals=n) for width, n in widths]
    return Chain((*arcs, Arc(rest, intervals=12), *reversed(arcs)), moving=False)


def _graded(starts: tuple[tuple[float, int], ...]) -> tuple[Arc, ...]:
    """Return the arcs between start times [s], with their numbers of intervals; the last time is the end."""
    return tuple(Arc(end - start, intervals=n) for (start, n), (end, _) in pairwise(starts))


def _crane(width: float, u1: float | None, u2: float, intervals: int) -> Arc:
    """Return an arc of the crane with a width [s]; u1 is singular if it is None."""
    held = {"u2": u2} if u1 is None else {"u1": u1, "u2": u2}
    return Arc(width, held, intervals=intervals, degree=None if u1 is not None else 4)


def _thrusters(width: float, *firing: int) -> Arc:
    """Return an arc of the free-flying robot with a width [s]."""
    return Arc(width, {f"u{k}": float(k in firing) for k in (1, 2, 3, 4)}, intervals=3)


def _torques(width: float, **u: float) -> Arc:
    """Return an arc of a robot arm with a width [s]."""
    return Arc(width, u, intervals=3)


LEAST, ZERO, MOST = -0.80865, 0.0, 0.71265  # u2 of the crane: x5 falls, stays on its bound, rises
RISE, FULL = 2.83374, 3.5  # u1 of the crane, the thrust of Goddard's rocket

ALP_RIDER = (
    (0.0, 8), (0.012, 6), (0.05, 6), (0.34, 20), (0.4, 24), (2.6, 14), (2.9, 30), (5.6, 14), (5.95, 40), (9.65, 12),
    (9.95, 44), (14.6, 14), (14.95, 36), (18.4, 16), (18.46, 12), (19.8, 8), (19.95, 14), (20.0, 0),
)  # fmt: skip
"""start times [s] and intervals: finer at both ends, where the constraint becomes active and inactive, and at the foot
of every peak, where layers last 0.01 s"""

CHAINS: dict[str, Chain] = {
    "brachistochrone": smooth(12),
    "brachistochrone, g = 9.81": smooth(12),
    "brachistochrone, drop": smooth(12),
    "hypersensitive": _layers(1e4),
    "hypersensitive, short": _layers(50.0),
    "linear hypersensitive": smooth(20),
    "target line": smooth(2, uniform=()),
    "double integrator, energy": smooth(2, uniform=()),
    "double integrator, energy, v(T) free": smooth(2, uniform=()),
    "steering": smooth(20),
    "Zermelo": smooth(20),
    "maximum range": smooth(20),
    "orbit raising": smooth(40, uniform=(30,)),
    "cart-pole": smooth(30),
    "missile, SM": smooth(24),
    "missile, SM2": smooth(24),
    "missile, SM3": smooth(24),
    "missile, FAST": smooth(24),
    "stirred tank": smooth(12),
    "hanging chain": smooth(20),
    "double integrator, time": Chain((Arc(0.5, {"u": 1.0}, intervals=2), Arc(0.5, {"u": -1.0}, intervals=2))),
    "lunar landing": Chain((Arc(0.33, {"u": 0.0}), Arc(0.67, {"u": 3.0}))),
    "lander": Chain((Arc(0.17, {"F": 0.0}), Arc(0.83, {"F": 1.227}))),
    "van der Pol, time": Chain((Arc(0.13, {"u": 1.0}), Arc(0.87, {"u": -1.0}))),
    "tumour": Chain((Arc(0.17, {"u": 75.0}, intervals=6), Arc(0.83, {"u": 0.0}, intervals=6))),
    "robot arm": Chain(
        (
            _torques(2.28, u1=-1.0, u2=1.0, u3=-1.0),
            _torques(0.51, u1=1.0, u2=1.0, u3=-1.0),
            _torques(1.77, u1=1.0, u2=1.0, u3=1.0),
            _torques(1.77, u1=1.0, u2=-1.0, u3=1.0),
            _torques(0.51, u1=1.0, u2=-1.0, u3=-1.0),
            _torques(2.28, u1=-1.0, u2=-1.0, u3=-1.0),
        )
    ),
    "two-link arm": Chain(
        (
            _torques(0.94, u1=1.0, u2=1.0),
            _torques(0.55, u1=1.0, u2=-1.0),
            _torques(1.13, u1=-1.0, u2=-1.0),
            _torques(0.36, u1=-1.0, u2=1.0),
        )
    ),
    "free-flying robot": Chain(
        (
            _thrusters(0.189, 2, 3),
            _thrusters(1.576, 3),
            _thrusters(3.588),
            Arc(0.585, {"u1": 0.0, "u2": 0.0, "u3": 0.0}, intervals=3, degree=2),
            _thrusters(3.017, 1),
            _thrusters(1.156),
            _thrusters(1.365, 2),
            _thrusters(0.525, 2, 4),
        ),
        uniform=(),
    ),
    "Goddard": Chain((Arc(0.12, {"F": FULL}), Arc(0.25, degree=2), Arc(0.63, {"F": 0.0}))),
    "catalyst mixing": Chain((Arc(0.13, {"u": 1.0}), Arc(0.6, degree=1, intervals=3), Arc(0.27, {"u": 0.0}))),
    "singular regulator": Chain((Arc(0.28, {"u": -1.0}), Arc(0.72, equation=lambda x, u, t: u - x[0]))),
    "fishing": Chain(
        (
            Arc(2.44, {"u": 0.0}),
            Arc(1.4, {"u": 1.0}),
            Arc(7.0, degree=3, intervals=8),
            Arc(1.2, {"u": 0.0}),
        )
    ),
    "container crane": Chain(
        (
            _crane(0.144, RISE, ZERO, 3),
            _crane(0.85, None, ZERO, 6),
            _crane(3.2, None, ZERO, 6),
            _crane(0.667, None, MOST, 4),
            _crane(0.588, None, LEAST, 4),
            _crane(2.17, None, ZERO, 6),
            _crane(0.97, None, MOST, 6),
            _crane(0.19, None, MOST, 4),
            _crane(0.238, RISE, MOST, 3),
        ),
        radau=8,
        gauss=7,
        uniform=(60,),
    ),
    "Bryson-Denham": Chain((Arc(1 / 3), Arc(1 / 3, {"u": 0.0}), Arc(1 / 3))),
    "Bryson-Denham, L = 0.1": Chain((Arc(0.3), Arc(0.4, {"u": 0.0}), Arc(0.3))),
    "stc1": Chain(
        (Arc(0.29, intervals=10), Arc(0.41, {}, along_parabola, on_parabola, 2), Arc(0.3, intervals=10)), uniform=(40,)
    ),
    "van der Pol": Chain(
        (Arc(0.0156, intervals=3), Arc(0.1246, {"u": 0.75}, intervals=6), Arc(0.8598, intervals=25)), uniform=(60,)
    ),
    "Rayleigh": Chain(
        (
            Arc(1.27, equation=rayleigh_bound, intervals=8),
            Arc(1.71, intervals=16),
            Arc(1.32, equation=rayleigh_bound, intervals=8),
            Arc(0.2, intervals=4),
        )
    ),
    "bunt": Chain((Arc(0.75, {"F": 6000.0}, intervals=20), Arc(0.25, {"F": 6000.0}, bunt_load, intervals=10)), gauss=6),
    "alp rider": Chain(_graded(ALP_RIDER), radau=5, gauss=4, uniform=(20, 80, 160), moving=False),
    "hang glider": Chain(
        (Arc(0.162, intervals=24), Arc(0.1, {"c": 1.4}, intervals=12), Arc(0.738, intervals=80)),
        radau=6, gauss=6, uniform=(60,),
    ),
}  # fmt: skip
"""chain of every problem of the library, by the problem's name"""
