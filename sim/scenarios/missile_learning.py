"""Missile guidance as a learner's task: hit, missed, hit the ground; the distance to the target is the potential."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mathnavi.models.missile.mission import MissileMission
from mathnavi.models.missile.target import TargetMotion
from mathnavi.sim.interfaces.signals import Array, Estimate
from mathnavi.sim.scenarios.task import Outcome


@dataclass
class MissileTerms:
    """``LearningTerms`` of one flight: ``outcome`` is asked at every control step, in the order of time."""

    mission: MissileMission
    vehicle: str
    target: TargetMotion  # as it really moves
    miss_allowed: float  # [m]
    deadline: float  # [s]
    at_deadline: Outcome = Outcome.LATE
    hold: float | None = None  # [s]
    _before: Array = field(default_factory=lambda: np.full(3, math.nan))  # (3,) [m] to the target
    _nearest: float = math.inf  # [m]
    _was_ahead: bool = False

    @property
    def cost_max(self) -> float:
        """L (B.4) at full thrust and moments, and where the missile drifts as fast as it flies."""
        mission = self.mission
        inputs = np.array(mission.input_max)
        undrifted = mission.case.running_cost(mission.coordinates, mission.start_state, inputs, mission.body)
        return float(undrifted) + mission.case.k

    def outcome(self, t: float, truths: Mapping[str, Array]) -> Outcome | None:
        """The missile has passed the plane through the target across its final direction, or it hits the ground."""
        joints = truths[self.vehicle]
        if not np.isfinite(joints).all():
            return Outcome.DIVERGED
        offset = self._offset(t, joints)
        self._nearest = min(self._nearest, _least_length(self._before, offset))
        self._before = offset
        ahead = float(offset @ self.mission.final_direction) > 0.0
        passed, self._was_ahead = self._was_ahead and not ahead, self._was_ahead or ahead
        hit = self._nearest <= self.miss_allowed
        if self._place(joints)[2] > 0.0:
            return Outcome.ARRIVED if hit else Outcome.CRASHED
        if passed:
            return Outcome.ARRIVED if hit else Outcome.MISSED
        return None

    def potential(self, t: float, truths: Mapping[str, Array]) -> float:
        """Distance to the target as a share of that at the start."""
        joints = truths[self.vehicle]
        if not np.isfinite(joints).all():
            return 0.0
        coordinates = self.mission.coordinates
        begin = self._offset(0.0, coordinates.to_joints(self.mission.start_state))
        return float(np.linalg.norm(self._offset(t, joints)) / np.linalg.norm(begin))

    def violated(self, t: float, truths: Mapping[str, Array]) -> bool:
        """False: there are no bounds on the state."""
        return False

    def clearance(self, t: float, truths: Mapping[str, Array]) -> float:
        """Height [m] above the ground."""
        return -float(self._place(truths[self.vehicle])[2])

    def view(self, t: float, name: str, estimate: Estimate) -> dict[str, Array]:
        """The estimated state, and from there to the target (3,) [m], Earth frame, as it is known at the start."""
        place = self.mission.coordinates.place(estimate.x)
        return {"x": np.array(estimate.x), "target": self.mission.target.at(t) - place}

    def _place(self, joints: Array) -> Array:
        place: Array = self.mission.coordinates.place(self.mission.coordinates.from_joints(joints))
        return place

    def _offset(self, t: float, joints: Array) -> Array:
        offset: Array = self.target.at(t) - self._place(joints)
        return offset


def _least_length(a: Array, b: Array) -> float:
    """Least length of the vectors between a and b (3,); of b where there is no a."""
    if not np.isfinite(a).all():
        return float(np.linalg.norm(b))
    d = b - a
    share = min(max(-float(a @ d) / max(float(d @ d), math.ulp(0.0)), 0.0), 1.0)
    return float(np.linalg.norm(a + share * d))
