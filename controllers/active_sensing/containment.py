"""Keeping within the wall, as surely as the estimate allows.

What is believed of the pose is made of seven poses: the estimate, and k standard deviations from it either way along
the axes of its covariance, drawn back where they are nearer to the wall than the margin, as the robot is not there. An
input keeps inside for as long as none of the seven comes nearer to the wall than the margin, or than it is where it is
nearer already; then the robot rests, which it can at once. So turning on the spot keeps inside whatever is believed,
and the less sure the estimate, the less else does.

An estimate that is nearer to the wall than half of the margin leaves no choice: the way back is slow, and straight away
from the wall. Where it is less sure than the margin, so that the wall may be on any side, the robot turns on the spot.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.input_sequence import InputSequence
from mathnavi.controllers.active_sensing.kernels import clearance, nodes_within, sigma_poses
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.interfaces.signals import Array, Integers, Phase

_SLOW = 0.2  # of the largest speed, on the way back
_AHEAD = math.pi / 4.0  # [rad] off the way back within which the robot drives
_TOO_NEAR = 0.5  # of the margin
_STEP = 0.01  # [m] between points whose clearances are compared


class Containment:
    """For how many of the ``nodes`` of a horizon [s] inputs keep inside, k being ``deviations``; and the way back."""

    def __init__(self, mission: RangingMission, horizon: float, nodes: int, deviations: float) -> None:
        self._wall = (mission.curve.table, mission.curve.polyline)
        self._margin, self._deviations = mission.margin, deviations
        self._horizon, self._nodes = horizon, nodes
        self._speed, self._turn_rate = _SLOW * mission.speed_max, mission.turn_rate_max

    def keeps(self, belief: Belief) -> bool:
        """Whether the estimate itself does."""
        return bool(clearance(*self._wall, *belief.pose[:2]) >= _TOO_NEAR * self._margin)

    def knows(self, belief: Belief) -> bool:
        """Whether the wall is where the estimate has it, by less than the margin: else there is no way back from it."""
        return belief.position_deviation < self._margin

    def nodes(self, belief: Belief, inputs: Array) -> Integers:
        """(m,) for each of ``inputs`` (m, 2)."""
        poses = sigma_poses(*self._wall, belief.pose, belief.covariance, self._deviations, self._margin)
        held: Integers = nodes_within(
            *self._wall, poses, self._margin, inputs, self._horizon / self._nodes, self._nodes
        )
        return held

    def back(self, belief: Belief) -> InputSequence:
        """A turn towards the inside or away from it, whichever is nearer, and slowly there."""
        x, y, phi = belief.pose
        slope = [
            clearance(*self._wall, x + _STEP * c, y + _STEP * s) - clearance(*self._wall, x - _STEP * c, y - _STEP * s)
            for c, s in ((1.0, 0.0), (0.0, 1.0))
        ]
        off = wrapped(math.atan2(slope[1], slope[0]) - phi)
        forwards = abs(off) <= 0.5 * math.pi
        off = off if forwards else wrapped(off + math.pi)
        speed = self._speed if abs(off) < _AHEAD else 0.0
        turn_rate = float(np.clip(off / self._horizon, -self._turn_rate, self._turn_rate))
        return self._held(speed if forwards else -speed, turn_rate, "way-back", "the estimate is too near to the wall")

    def turn(self) -> InputSequence:
        """On the spot, for when there is no estimate to plan with: it shows the sensors more of the wall."""
        return self._held(0.0, self._turn_rate, "blind", "there is no estimate to plan with")

    def _held(self, u_1: float, u_2: float, note: str, message: str) -> InputSequence:
        u = np.array([[u_1, u_2]])
        return InputSequence(np.array([self._horizon]), u, Phase.MANOEUVRE, note=note, message=message)
