"""Excitation that looks where it drives: of the inputs that keep inside, the one that a criterion prefers.

The inputs are a grid of speeds times a grid of turn rates, both symmetric about nought and up to what the robot can do;
standing still and turning on the spot are among them. Each is held for as long as it keeps inside, and then the robot
rests; what keeps inside for less than a node is left out.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from controllers.exciting.belief import Belief
from controllers.exciting.excitation import Drive
from controllers.exciting.inside import Inside
from models.unicycle.mission import RangingMission
from sim.signals import Array, Integers

SPEEDS = TURN_RATES = 5


class Criterion(Protocol):
    """What makes an input a good one."""

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        """Which of ``inputs`` (m, 2), held for so many nodes (m,), is preferred, m >= 1, and what it scores."""
        ...


class Seeking:
    """Holds the preferred input for up to ``nodes`` nodes of ``node`` [s] each."""

    def __init__(self, criterion: Criterion, inside: Inside, mission: RangingMission, node: float) -> None:
        self._criterion, self._inside, self._node = criterion, inside, node
        self._inputs = candidates(mission)

    def drive(self, t: float, belief: Belief) -> Drive:
        if not belief.is_found:
            return self._inside.turn()
        if not self._inside.keeps(belief):
            return self._inside.back(belief) if self._inside.knows(belief) else self._inside.turn()
        held = self._inside.nodes(belief, self._inputs)
        inputs, held = self._inputs[held > 0], held[held > 0]
        k, score = self._criterion.best(belief, inputs, held)
        return Drive(np.array([self._node * held[k]]), inputs[k : k + 1], cost=score)


def candidates(mission: RangingMission) -> Array:
    """(25, 2) inputs [m/s, rad/s]."""
    speeds = np.linspace(-mission.speed_max, mission.speed_max, SPEEDS)
    turn_rates = np.linspace(-mission.turn_rate_max, mission.turn_rate_max, TURN_RATES)
    return np.array([(u_1, u_2) for u_1 in speeds for u_2 in turn_rates])
