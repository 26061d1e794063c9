"""Exploration policy that chooses, among the inputs that keep within the wall, the one that a criterion prefers.

The candidates are a grid of speeds times a grid of turn rates, both symmetric about zero and up to the robot's limits;
standing still and turning on the spot are among them. Each is held for as long as it keeps within the wall, and then
the robot rests; one that does so for less than a node is left out.

**Containment.** Seven poses stand for the belief: the estimate, and k standard deviations from it either way along the
axes of its covariance, drawn back where they are nearer to the wall than the margin, as the robot is not there; and
with them the other poses that the estimator cannot rule out. An input is admissible for as long as none of them comes
nearer to the wall than the margin, or than it is where it is nearer already; then the robot rests, which it can at
once. So turning on the spot is always admissible, and the less certain the estimate, the less else is.

An estimate that is nearer to the wall than half of the margin leaves no choice: the robot returns slowly, straight away
from the wall. Where the position is less certain than the margin, so that the wall may be on any side, it turns on the
spot.

**Criteria** by which ``CandidateSearch`` prefers one input to another.

``ExpectedCovariance`` minimises the trace of the covariance that is expected at the end of the horizon,

    tr [F (P^-1 + sum_j F_j' H_j' (H_d / dt) R^-1 H_j F_j)^-1 F']                                (see ``kernels``),

in which a metre weighs as much as a radian, by the beacons where the mission has some. ``SmallestSingularValue``
maximises, at the pose where the input begins, the least singular value of

    O(x, u) = [d rho / dx; d rho_dot / dx],     rho_dot = (d rho / dx) f(x, u),

2 l by 3: ranges and their rates distinguish poses for which they differ, and the kernel of O is the tangent of FS_y and
OF_x^u together (Definitions C.9 and C.11), so that the condition (C.1) of Proposition C.1 holds to first order where O
has full rank. ``RandomChoice`` draws, for comparison.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.kernels import (
    DIFFERENCE,
    PredictionHorizon,
    RangeSensors,
    WallTable,
    clearance,
    expected_traces,
    nodes_within,
    sigma_poses,
    smallest_singular_values,
)
from mathnavi.controllers.active_sensing.policies import InputSequence
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.unicycle.beacons import BeaconFieldMission
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.models.unicycle.mission import LEAST_NOISE, DrivePhase, RangingMission


class InputCriterion(Protocol):
    """Ranks candidate inputs."""

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        """Index of the preferred of ``inputs`` (m, 2) [m/s, rad/s] for ``held`` (m,) nodes, m >= 1, and its score."""
        ...


class ExpectedCovariance:
    """The mode ``active``: the least trace of the covariance expected ``horizon`` [s] ahead, over ``nodes`` nodes."""

    def __init__(self, mission: RangingMission, horizon: float, nodes: int) -> None:
        absolute = float(np.hypot(mission.ranging.absolute, LEAST_NOISE))
        spacing = horizon / nodes
        self._wall = WallTable(mission.curve.table, mission.curve.polyline)
        self._beacons = _beacon_table(mission, spacing)
        rays = np.empty((0, 3)) if len(self._beacons) else mission.rays
        self._sensors = RangeSensors(rays, np.array([mission.ranging.relative, absolute]))
        self._horizon = PredictionHorizon(spacing, nodes, spacing / mission.period * (1.0 - mission.ranging.dropout))

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        traces = expected_traces(
            self._wall, self._sensors, self._horizon, belief.pose, belief.covariance, inputs, held, self._beacons
        )
        k = int(np.argmin(traces))
        return k, float(traces[k])


def _beacon_table(mission: RangingMission, spacing: float) -> Array:
    """Rows (m, 8), see ``expected_covariance``, of the readings of the mission's beacons at known places.

    Nodes are ``spacing`` [s] apart.
    """
    rows: list[list[float]] = []
    if isinstance(mission, BeaconFieldMission):
        beacons = mission.beacon_mission
        often = spacing / (beacons.interval or beacons.period)
        for kind, quality in enumerate(beacons.qualities):
            if quality is None:
                continue
            absolute, count = math.hypot(quality.absolute, LEAST_NOISE), often * (1.0 - quality.dropout)
            first = beacons.places[0]
            rows += [
                [kind, *place, *first, absolute, quality.relative, count]
                for place in beacons.places[int(kind == DIFFERENCE) :]
            ]
    table: Array = np.array(rows, np.float64).reshape(-1, 8)
    used = np.isfinite(table[:, 1:3]).all(axis=1) & ((table[:, 0] != DIFFERENCE) | np.isfinite(table[:, 3]))
    return np.asarray(table[used], np.float64)


class SmallestSingularValue:
    """The mode ``singular-value``: the largest least singular value of O(x, u), greedy."""

    def __init__(self, mission: RangingMission) -> None:
        mission.check_exact("the mode singular-value")
        self._wall, self._angles = WallTable(mission.curve.table, mission.curve.polyline), mission.alpha

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        values = smallest_singular_values(self._wall, self._angles, belief.pose, inputs)
        k = int(np.argmax(values))
        return k, float(values[k])


class RandomChoice:
    """The mode ``random``: each input as likely as any other."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        return int(self._rng.integers(len(inputs))), math.nan


SPEEDS = TURN_RATES = 5

_SLOW = 0.2  # of the largest speed, on the way back
_AHEAD = math.pi / 4.0  # [rad] between heading and way back within which the robot drives
_TOO_NEAR = 0.5  # of the margin
_STEP = 0.01  # [m] between points whose clearances are compared


class CandidateSearch:
    """Holds the preferred input for up to ``nodes`` nodes of ``spacing`` [s] each."""

    def __init__(
        self, criterion: InputCriterion, containment: Containment, mission: RangingMission, spacing: float
    ) -> None:
        self._criterion, self._containment, self._spacing = criterion, containment, spacing
        self._inputs = candidates(mission)

    def choose(self, t: float, belief: Belief) -> InputSequence:
        containment = self._containment
        if not (belief.is_found or len(belief.alternatives)):
            return containment.turn_on_the_spot()
        if not containment.is_inside(belief):
            can_return = containment.is_certain(belief)
            return containment.way_back(belief) if can_return else containment.turn_on_the_spot()
        held = containment.admissible_nodes(belief, self._inputs)
        inputs, held = self._inputs[held > 0], held[held > 0]
        k, score = self._criterion.best(belief, inputs, held)
        return InputSequence(np.array([self._spacing * held[k]]), inputs[k : k + 1], cost=score)


class Containment:
    """Time that inputs keep inside the wall, in ``nodes`` of a horizon [s], and the way back; k is ``deviations``."""

    def __init__(self, mission: RangingMission, horizon: float, nodes: int, deviations: float) -> None:
        self._wall = WallTable(mission.curve.table, mission.curve.polyline)
        self._margin, self._deviations = mission.margin, deviations
        self._horizon, self._nodes = horizon, nodes
        self._speed, self._turn_rate = _SLOW * mission.speed_max, mission.turn_rate_max

    def is_inside(self, belief: Belief) -> bool:
        """True if the estimate keeps half of the margin from the wall."""
        return bool(clearance(self._wall, *belief.pose[:2]) >= _TOO_NEAR * self._margin)

    def is_certain(self, belief: Belief) -> bool:
        """True if the position's standard deviation is less than the margin: else there is no way back to plan."""
        return belief.position_deviation < self._margin

    def admissible_nodes(self, belief: Belief, inputs: Array) -> Integers:
        """Number (m,) of nodes for which each of ``inputs`` (m, 2) may be held."""
        likely = sigma_poses(self._wall, belief.pose, belief.covariance, self._deviations, self._margin)
        poses = np.concatenate((likely, belief.alternatives))
        held: Integers = nodes_within(self._wall, poses, self._margin, inputs, self._horizon / self._nodes, self._nodes)
        return held

    def way_back(self, belief: Belief) -> InputSequence:
        """Inputs that turn the robot to face the inside or away from it, the nearer, and drive it there slowly."""
        x, y, phi = belief.pose
        slope = [
            clearance(self._wall, x + _STEP * c, y + _STEP * s) - clearance(self._wall, x - _STEP * c, y - _STEP * s)
            for c, s in ((1.0, 0.0), (0.0, 1.0))
        ]
        error = wrapped(math.atan2(slope[1], slope[0]) - phi)
        forwards = abs(error) <= 0.5 * math.pi
        error = error if forwards else wrapped(error + math.pi)
        speed = self._speed if abs(error) < _AHEAD else 0.0
        turn_rate = float(np.clip(error / self._horizon, -self._turn_rate, self._turn_rate))
        return self._held(speed if forwards else -speed, turn_rate, "way-back", "the estimate is too near to the wall")

    def turn_on_the_spot(self) -> InputSequence:
        """Turn on the spot, without an estimate to plan with: it shows the sensors more of the wall."""
        return self._held(0.0, self._turn_rate, "blind", "there is no estimate to plan with")

    def _held(self, u_1: float, u_2: float, note: str, message: str) -> InputSequence:
        u = np.array([[u_1, u_2]])
        return InputSequence(np.array([self._horizon]), u, DrivePhase.MANOEUVRE, note=note, message=message)


def candidates(mission: RangingMission) -> Array:
    """Candidate inputs (25, 2) [m/s, rad/s]."""
    speeds = np.linspace(-mission.speed_max, mission.speed_max, SPEEDS)
    turn_rates = np.linspace(-mission.turn_rate_max, mission.turn_rate_max, TURN_RATES)
    return np.array([(u_1, u_2) for u_1 in speeds for u_2 in turn_rates])
