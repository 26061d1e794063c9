"""The problem solved at each step: (A.2) with the safety manoeuvre of (A.4) embedded, condensed.

Unknowns: accelerations a_1 ... a_n (n = N - 1 arcs of length h) and the climb rate w with which the manoeuvre ends.
With the exact zero-order-hold double integrator

    p_{i+1} = p_i + h v_i + h^2 a_i / 2,   v_{i+1} = v_i + h a_i,

and the manoeuvre, one arc of duration M = N_bar h, N_bar = ceil(v_max / (h a_max)), that brings the state (p_N, v_N)
to the velocity (0, 0, w), w >= 0, with the constant acceleration ((0, 0, w) - v_N) / M:

    minimise  sum_i h |a_i|^2 + Psi(p_N) + rho_w w^2 / 2 + kappa_H / 2 sum_q s_q^2 + kappa_S / 2 s_S^2
    subject to  z_q - H(x_q, y_q) >= h_min + margin - s_q     at 4 points per arc and 15 on the manoeuvre,
                [Psi(p_N + h v_N) - Psi(p_N)] / (h beta) + 1 + epsilon <= s_S      (a_N = 0 in S_eps of Definition A.1),
                |v_i| <= v_max, |a_i| <= a_max, |(0, 0, w) - v_N| <= M a_max,
                p_N and the manoeuvre's end on the map, 0 <= w <= v_max.

H is the cubic spline of the terrain. The bounds are Euclidean, unlike the print's L-infinity boxes, because Psi is:
in a box the best speed is its corner's. Sum h beta is constant at fixed N and h and left out. Near the target the
terminal cost gives way to ``hold``: p_N = p_f, with fewer arcs, so that the vehicle arrives exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from controllers.flight import kernels, spline
from controllers.flight.cost_to_go import REFERENCE_SPEED, FactoredCost
from models.terrain.height_field import HeightField
from sim.signals import Array

POINTS_PER_ARC = 4
POINTS_ON_MANOEUVRE = 15
_CLIMB_WEIGHT = 1e-3  # rho_w [1 / (m/s)^2 * cost]: without it w would be undetermined where the ground is far below
_APPROACH_WEIGHT = 1e5  # kappa_S


@dataclass(frozen=True)
class Parameters:
    """What stays the same over a mission."""

    arcs: int  # n = N - 1
    h: float  # [s]
    speed_max: float  # [m/s] v_max left to the plan
    acceleration_max: float  # [m/s^2] a_max left to the plan
    beta: float  # [m^2/s^4] cost per second
    clearance: float  # [m] h_min + margin
    epsilon: float = 0.01  # of h beta

    @property
    def manoeuvre_duration(self) -> float:
        """M = N_bar h [s]."""
        return math.ceil(self.speed_max / (self.h * self.acceleration_max) - 1e-9) * self.h

    @property
    def psi_per_metre(self) -> float:
        return self.beta / REFERENCE_SPEED


@dataclass(frozen=True, eq=False)
class Stencil:
    """Where the problem looks: p_q = p_1 + base_q v_1 + sum_j weights_qj a_j + climbs_q w e_z.

    The clearance points in time order, the last of them the manoeuvre's end; then p_N; then p_N + h v_N.
    """

    base: Array  # (Q,) [s]
    weights: Array  # (Q, n) [s^2]
    climbs: Array  # (Q,) [s]


@lru_cache(maxsize=64)
def stencil(arcs: int, h: float, manoeuvre_duration: float) -> Stencil:
    """The stencil of a horizon of ``arcs`` arcs."""
    middles = (np.arange(arcs) + 0.5) * h
    base: list[float] = []
    weights: list[Array] = []
    climbs: list[float] = []

    def add(time: float, drift: float, climb: float) -> None:
        """The point at ``time``, followed by ``drift`` seconds at the velocity of that time and a climb."""
        lag = time - np.arange(arcs) * h
        row = np.where(lag >= h, h * (time - middles), 0.5 * np.clip(lag, 0.0, h) ** 2)
        base.append(time + drift)
        weights.append(row + drift * np.clip(lag, 0.0, h))
        climbs.append(climb)

    for k in range(arcs):
        for part in range(1, POINTS_PER_ARC + 1):
            add((k + part / POINTS_PER_ARC) * h, 0.0, 0.0)
    end = arcs * h
    for part in range(1, POINTS_ON_MANOEUVRE + 1):
        sigma = manoeuvre_duration * part / POINTS_ON_MANOEUVRE
        quadratic = sigma * sigma / (2.0 * manoeuvre_duration)
        add(end, sigma - quadratic, quadratic)
    add(end, 0.0, 0.0)
    add(end, h, 0.0)
    return Stencil(np.array(base), np.ascontiguousarray(np.array(weights)), np.array(climbs))


@dataclass(frozen=True, eq=False)
class Landscape:
    """The ground as the optimiser sees it: a cubic spline of the heights, and the cost-to-go."""

    terrain: HeightField
    heights: Array  # spline coefficients [m]
    cost: FactoredCost

    @staticmethod
    def build(terrain: HeightField, cost: FactoredCost) -> Landscape:
        return Landscape(terrain, spline.coefficients(terrain.z), cost)


@dataclass(frozen=True, eq=False)
class Problem:
    """One instance: from this state, over this many arcs, with or without an exact arrival."""

    parameters: Parameters
    landscape: Landscape
    start: Array  # (6,) p_1 [m], v_1 [m/s]
    arcs: int
    hold: Array | None = None  # (3,) [m]: p_N must be here

    @property
    def stencil(self) -> Stencil:
        return stencil(self.arcs, self.parameters.h, self.parameters.manoeuvre_duration)

    @property
    def terrain_weight(self) -> float:
        """kappa_H [1/m^2]: a violation must stay within a few metres, whatever a metre of progress is worth."""
        return 10.0 * (1.0 + self.parameters.psi_per_metre)

    @property
    def packed(self) -> Array:
        """The numbers the kernels read, by their indices."""
        p, out = self.parameters, np.zeros(kernels.PACKED_SIZE)
        out[kernels.H], out[kernels.MANOEUVRE] = p.h, p.manoeuvre_duration
        out[kernels.FLOOR], out[kernels.SPEED], out[kernels.ACCELERATION] = p.clearance, p.speed_max, p.acceleration_max
        out[kernels.BETA], out[kernels.EPSILON] = p.beta, p.epsilon
        out[kernels.PSI] = 0.0 if self.hold is not None else p.psi_per_metre
        out[kernels.WIDTH], out[kernels.DEPTH] = self.landscape.terrain.width, self.landscape.terrain.depth
        out[kernels.TERRAIN_WEIGHT], out[kernels.APPROACH_WEIGHT] = self.terrain_weight, _APPROACH_WEIGHT
        out[kernels.CLIMB_WEIGHT], out[kernels.SPACING] = _CLIMB_WEIGHT, self.landscape.terrain.spacing
        return out

    @property
    def data(self) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array, Array]:
        """What the kernels take beside the unknowns: start, stencil, splines and numbers."""
        s, cost = self.stencil, self.landscape.cost
        splines = (self.landscape.heights, cost.ground, cost.ratio, cost.scales)
        return (self.start, s.base, s.weights, s.climbs, *splines, self.packed)


@dataclass(frozen=True, eq=False)
class Solution:
    """What a solver found, and how."""

    accelerations: Array  # (n, 3) [m/s^2]
    climb: float  # [m/s] w
    cost: float  # the objective, soft penalties included
    converged: bool
    iterations: int
    message: str = ""

    @property
    def unknowns(self) -> Array:
        return np.append(self.accelerations.ravel(), self.climb)
