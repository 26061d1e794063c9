"""Criteria by which ``candidate_search`` prefers one input to another.

``ExpectedCovariance`` minimises the trace of the covariance that is expected at the end of the horizon,

    tr [F (P^-1 + sum_j F_j' H_j' (H_d / dt) R^-1 H_j F_j)^-1 F']                                (see ``kernels``),

in which a metre weighs as much as a radian. ``SmallestSingularValue`` maximises, at the pose where the input begins,
the least singular value of

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
    PredictionHorizon,
    RangeSensors,
    WallTable,
    expected_traces,
    smallest_singular_values,
)
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.unicycle.mission import LEAST_NOISE, RangingMission


class InputCriterion(Protocol):
    """Ranks candidate inputs."""

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        """Index of the preferred of ``inputs`` (m, 2) [m/s, rad/s] for ``held`` (m,) nodes, m >= 1, and its score."""
        ...


class ExpectedCovariance:
    """The mode ``active``: the least trace of the covariance expected ``horizon`` [s] ahead, over ``nodes`` nodes."""

    def __init__(self, mission: RangingMission, horizon: float, nodes: int) -> None:
        absolute = float(np.hypot(mission.ranging.absolute, LEAST_NOISE))
        node = horizon / nodes
        self._wall = WallTable(mission.curve.table, mission.curve.polyline)
        self._sensors = RangeSensors(mission.alpha, np.array([mission.ranging.relative, absolute]))
        self._horizon = PredictionHorizon(node, nodes, node / mission.period * (1.0 - mission.ranging.dropout))

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        traces = expected_traces(self._wall, self._sensors, self._horizon, belief.pose, belief.covariance, inputs, held)
        k = int(np.argmin(traces))
        return k, float(traces[k])


class SmallestSingularValue:
    """The mode ``singular-value``: the largest least singular value of O(x, u), greedy."""

    def __init__(self, mission: RangingMission) -> None:
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
