"""ExplorationPolicy that looks where it drives: of the inputs that keep inside, the one that a criterion prefers.

The inputs are a grid of speeds times a grid of turn rates, both symmetric about nought and up to what the robot can do;
standing still and turning on the spot are among them. Each is held for as long as it keeps inside, and then the robot
rests; what keeps inside for less than a node is left out.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.containment import Containment
from mathnavi.controllers.active_sensing.input_sequence import InputSequence
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.interfaces.signals import Array, Integers

SPEEDS = TURN_RATES = 5


class Criterion(Protocol):
    """What makes an input a good one."""

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        """Which of ``inputs`` (m, 2), held for so many nodes (m,), is preferred, m >= 1, and what it scores."""
        ...


class CandidateSearch:
    """Holds the preferred input for up to ``nodes`` nodes of ``node`` [s] each."""

    def __init__(self, criterion: Criterion, containment: Containment, mission: RangingMission, node: float) -> None:
        self._criterion, self._containment, self._node = criterion, containment, node
        self._inputs = candidates(mission)

    def drive(self, t: float, belief: Belief) -> InputSequence:
        if not belief.is_found:
            return self._containment.turn()
        if not self._containment.keeps(belief):
            return self._containment.back(belief) if self._containment.knows(belief) else self._containment.turn()
        held = self._containment.nodes(belief, self._inputs)
        inputs, held = self._inputs[held > 0], held[held > 0]
        k, score = self._criterion.best(belief, inputs, held)
        return InputSequence(np.array([self._node * held[k]]), inputs[k : k + 1], cost=score)


def candidates(mission: RangingMission) -> Array:
    """(25, 2) inputs [m/s, rad/s]."""
    speeds = np.linspace(-mission.speed_max, mission.speed_max, SPEEDS)
    turn_rates = np.linspace(-mission.turn_rate_max, mission.turn_rate_max, TURN_RATES)
    return np.array([(u_1, u_2) for u_1 in speeds for u_2 in turn_rates])
