"""The problem solved at each step: (A.2) with the safety manoeuvre of (A.4) embedded, condensed.

Unknowns: accelerations a_1 ... a_n (n = N - 1 arcs of lengths h_1 ... h_n) and the climb rate w with which the
manoeuvre ends. With the exact zero-order-hold double integrator

    p_{i+1} = p_i + h_i v_i + h_i^2 a_i / 2,   v_{i+1} = v_i + h_i a_i,

and the manoeuvre, one arc of duration M = N_bar h_1, N_bar = ceil(v_max / (h_1 a_max)), that brings the state
(p_N, v_N) to the velocity (0, 0, w), w >= 0, with the constant acceleration ((0, 0, w) - v_N) / M:

    minimise  sum_i h_i |a_i|^2 + Psi(p_N) + rho_w w^2 / 2 + kappa_H / 2 sum_q s_q^2 + kappa_S / 2 s_S^2
    subject to  z_q - H(x_q, y_q) >= h_min + margin - s_q     at points on every arc and 15 on the manoeuvre,
                [Psi(p_N + h_n v_N) - Psi(p_N)] / (h_n beta) + 1 + epsilon <= s_S  (a_N = 0 in S_eps of Definition A.1),
                |v_i| <= v_max, |a_i| <= a_max, |(0, 0, w) - v_N| <= M a_max,
                p_N and the manoeuvre's end on the map, 0 <= w <= v_max.

H is the cubic spline of the terrain. The bounds are Euclidean, unlike the L-infinity boxes of the thesis as printed,
because Psi is: in a box the best speed is its corner's. Sum h_i beta is constant on a given grid and left out. Near the
target the terminal cost gives way to the terminal constraint p_N = p_f, with fewer arcs, so that the vehicle arrives
exactly. For an arrival at a given time the term kappa_L / 2 (Psi(p_N) / psi - L)^2 drives the length to go at p_N to L,
psi being the cost of a metre: in place of Psi and the row of S_eps, or, as a mere penalty, in addition to them.

The grid of the thesis as printed is uniform; there, each arc is checked at 4 points. A stretched one, h_{i+1} = r h_i,
reaches further ahead with as many unknowns: fine over what is flown before the next plan, coarse over what will be
planned again. Its long arcs need more points: as many as leave 125 m of path between two at v_max, which is what 4 do
on an arc of 5/3 s. The certificate examines arcs of any length, so the guarantees hold on either.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from mathnavi.controllers.flight import spline
from mathnavi.controllers.flight.cost_to_go import REFERENCE_SPEED, FactoredCost
from mathnavi.controllers.flight.kernels import problem_data
from mathnavi.controllers.flight.kernels.problem_data import ProblemData
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField

POINTS_PER_ARC = 4  # of a uniform grid
POINTS_ON_MANOEUVRE = 15
_PATH = 125.0  # [m] between the points of a stretched one, at most
_CLIMB_WEIGHT = 1e-3  # rho_w [1 / (m/s)^2 * cost]: without it w would be undetermined where the ground is far below
_APPROACH_WEIGHT = 1e5  # kappa_S
_LENGTH_WEIGHT = 10.0  # kappa_L [1/m^2 * cost]: a second saved or lost by effort is a metre's error


@dataclass(frozen=True)
class Parameters:
    """Parameters of the problem that stay the same over a mission."""

    lengths: tuple[float, ...]  # (n,) [s] h_1 ... h_n, n = N - 1
    speed_max: float  # [m/s] v_max left to the plan
    acceleration_max: float  # [m/s^2] a_max left to the plan
    beta: float  # [m^2/s^4] cost per second
    clearance: float  # [m] h_min + margin
    epsilon: float = 0.01  # of h_n beta

    @property
    def arcs(self) -> int:
        """Number of arcs n."""
        return len(self.lengths)

    @property
    def h(self) -> float:
        """h_1 [s]; the length of every arc on a uniform grid."""
        return self.lengths[0]

    @property
    def horizon(self) -> float:
        """T_p [s]."""
        return math.fsum(self.lengths)

    @property
    def points(self) -> tuple[int, ...]:
        """Number (n,) of points at which each arc is checked."""
        if min(self.lengths) == max(self.lengths):
            return self.arcs * (POINTS_PER_ARC,)
        return tuple(math.ceil(length * self.speed_max / _PATH) for length in self.lengths)

    @property
    def manoeuvre_duration(self) -> float:
        """M = N_bar h_1 [s], v_max / a_max or a little more."""
        return math.ceil(self.speed_max / (self.h * self.acceleration_max) - 1e-9) * self.h

    @cached_property
    def matrices(self) -> PredictionMatrices:
        """Prediction matrices of the horizon, computed once."""
        return prediction_matrices(self.lengths, self.points, self.manoeuvre_duration)

    @property
    def psi_per_metre(self) -> float:
        """Terminal cost psi of one metre to go."""
        return self.beta / REFERENCE_SPEED


def proportional(shares: Sequence[float], duration: float) -> tuple[float, ...]:
    """Lengths [s] of arcs that stand to each other as ``shares`` do and last ``duration`` [s] together."""
    relative = [share / shares[0] for share in shares]  # exactly 1 where all are alike
    whole = math.fsum(relative)
    return tuple(duration * share / whole for share in relative)


@dataclass(frozen=True, eq=False)
class PredictionMatrices:
    """Matrices of the constrained positions: p_q = p_1 + base_q v_1 + sum_j weights_qj a_j + climbs_q w e_z.

    The clearance points in time order, the last of them the manoeuvre's end; then p_N; then p_N + h_n v_N.
    """

    lengths: Array  # (n,) [s] of the arcs
    middles: Array  # (n,) [s]
    base: Array  # (Q,) [s]
    weights: Array  # (Q, n) [s^2]
    climbs: Array  # (Q,) [s]


@lru_cache(maxsize=64)
def prediction_matrices(
    lengths: tuple[float, ...], points: tuple[int, ...], manoeuvre_duration: float
) -> PredictionMatrices:
    """Prediction matrices of a horizon whose arcs have these ``lengths`` (n,) [s] and ``points`` (n,) on each."""
    h = np.array(lengths)
    # Sums are exact before they are rounded, so that equal arcs begin at k h to the last bit.
    begin = np.array([math.fsum(lengths[:k]) for k in range(len(lengths))])
    middles = np.array([math.fsum((*lengths[:k], 0.5 * h_k)) for k, h_k in enumerate(lengths)])
    times = [
        math.fsum(count * lengths[:k] + part * lengths[k : k + 1]) / count
        for k, count in enumerate(points)
        for part in range(1, count + 1)
    ]
    sigma = manoeuvre_duration * np.arange(1, POINTS_ON_MANOEUVRE + 1) / POINTS_ON_MANOEUVRE
    climbing = sigma * sigma / (2.0 * manoeuvre_duration)
    # A point is the vehicle's position at a time [s], and drifts on with the velocity of that time [s].
    ahead = POINTS_ON_MANOEUVRE + 2
    time = np.concatenate([times, np.full(ahead, math.fsum(lengths))])
    drift = np.concatenate([np.zeros(len(times)), sigma - climbing, [0.0, lengths[-1]]])
    climbs = np.concatenate([np.zeros(len(times)), climbing, [0.0, 0.0]])
    lag = time[:, None] - begin
    elapsed = np.clip(lag, 0.0, h)  # [s] for which each acceleration has acted
    weights = np.where(lag >= h, h * (time[:, None] - middles), 0.5 * elapsed**2) + drift[:, None] * elapsed
    return PredictionMatrices(h, middles, time + drift, np.ascontiguousarray(weights), climbs)


@dataclass(frozen=True, eq=False)
class PlanningEnvironment:
    """The ground in the optimiser's problem: a cubic spline of the heights, and the cost-to-go."""

    terrain: HeightField
    heights: Array  # spline coefficients [m]
    cost: FactoredCost

    @staticmethod
    def build(terrain: HeightField, cost: FactoredCost) -> PlanningEnvironment:
        """The environment of a terrain, its spline computed, and of a cost-to-go over it."""
        return PlanningEnvironment(terrain, spline.coefficients(terrain.z), cost)


@dataclass(frozen=True)
class LengthToGo:
    """Target for the length to go at p_N, by kappa_L / 2 (Psi(p_N) / psi - L)^2."""

    length: float  # [m] L
    weight: float = _LENGTH_WEIGHT  # kappa_L [1/m^2 * cost]
    instead: bool = True  # in place of Psi and the row of S_eps, not in addition


@dataclass(frozen=True, eq=False)
class Problem:
    """One instance of the problem: from one state, with or without the terminal constraint."""

    parameters: Parameters
    environment: PlanningEnvironment
    start: Array  # (6,) p_1 [m], v_1 [m/s]
    terminal_position: Array | None = None  # (3,) [m] of the terminal constraint p_N = p_f
    length_to_go: LengthToGo | None = None

    @property
    def arcs(self) -> int:
        """Number of arcs n."""
        return self.parameters.arcs

    @property
    def matrices(self) -> PredictionMatrices:
        """Prediction matrices of the horizon."""
        return self.parameters.matrices

    @property
    def terrain_weight(self) -> float:
        """Weight kappa_H [1/m^2]: a violation must stay within a few metres at any cost of a metre of progress."""
        return 10.0 * (1.0 + self.parameters.psi_per_metre)

    @property
    def packed(self) -> Array:
        """The numbers the kernels read, by their indices."""
        p, terrain, out = self.parameters, self.environment.terrain, np.zeros(problem_data.PACKED_SIZE)
        out[problem_data.MANOEUVRE], out[problem_data.FLOOR] = p.manoeuvre_duration, p.clearance
        out[problem_data.SPEED], out[problem_data.ACCELERATION] = p.speed_max, p.acceleration_max
        out[problem_data.BETA], out[problem_data.EPSILON] = p.beta, p.epsilon
        out[problem_data.PSI] = 0.0 if self.terminal_position is not None else p.psi_per_metre
        out[problem_data.WIDTH], out[problem_data.DEPTH] = terrain.width, terrain.depth
        out[problem_data.TERRAIN_WEIGHT], out[problem_data.APPROACH_WEIGHT] = self.terrain_weight, _APPROACH_WEIGHT
        out[problem_data.CLIMB_WEIGHT], out[problem_data.SPACING] = _CLIMB_WEIGHT, terrain.spacing
        if self.length_to_go is not None and self.terminal_position is None:
            length, weight = self.length_to_go.length, self.length_to_go.weight
            out[problem_data.LENGTH], out[problem_data.LENGTH_WEIGHT] = length, weight
            if self.length_to_go.instead:
                out[problem_data.PSI] = 0.0
        return out

    @property
    def data(self) -> ProblemData:
        """The problem as the kernels read it."""
        s, cost = self.matrices, self.environment.cost
        return ProblemData(
            start=self.start,
            lengths=s.lengths,
            base=s.base,
            weights=s.weights,
            climbs=s.climbs,
            terrain=self.environment.heights,
            ground=cost.ground,
            ratio=cost.ratio,
            scales=cost.scales,
            packed=self.packed,
        )


@dataclass(frozen=True, eq=False)
class PlanSolution:
    """Result of a solver: the unknowns, their cost and how they were found."""

    accelerations: Array  # (n, 3) [m/s^2]
    climb: float  # [m/s] w
    cost: float  # the objective, soft penalties included
    converged: bool
    iterations: int
    message: str = ""

    @property
    def unknowns(self) -> Array:
        """Unknowns (3 n + 1,): the accelerations [m/s^2], then the climb rate [m/s]."""
        return np.append(self.accelerations.ravel(), self.climb)
