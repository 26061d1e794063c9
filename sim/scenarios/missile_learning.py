"""Missile guidance as a learning task: hit, missed, hit the ground; the distance to the target is the potential."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mathnavi.interfaces.signals import Array, Estimate
from mathnavi.models.missile.mission import MissileMission, TargetMotion
from mathnavi.sim.scenarios.task import Outcome


@dataclass
class MissileTerms:
    """``LearningTerms`` of one flight: ``outcome`` must be called at every control step, in the order of time."""

    mission: MissileMission
    vehicle: str
    target: TargetMotion  # its true motion
    miss_allowed: float  # [m]
    deadline: float  # [s]
    at_deadline: Outcome = Outcome.LATE
    hold: float | None = None  # [s]
    _before: Array = field(default_factory=lambda: np.full(3, math.nan))  # (3,) [m] to the target
    _nearest: float = math.inf  # [m]
    _was_ahead: bool = False

    @property
    def cost_max(self) -> float:
        """Largest stage cost: L (B.4) at full thrust and moments, with the missile drifting as fast as it flies."""
        mission = self.mission
        inputs = np.array(mission.input_max)
        undrifted = mission.case.running_cost(mission.coordinates, mission.start_state, inputs, mission.body)
        return float(undrifted) + mission.case.k

    def outcome(self, t: float, truths: Mapping[str, Array]) -> Outcome | None:
        """Outcome at t [s], once the missile has passed the target's plane across the final direction or hit the
        ground.
        """
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
        """Distance to the target as a share of the initial distance."""
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
        """Estimated state, and the vector (3,) [m] from there to the target as known at the start, Earth frame."""
        place = self.mission.coordinates.place(estimate.x)
        return {"x": np.array(estimate.x), "target": self.mission.target.at(t) - place}

    def _place(self, joints: Array) -> Array:
        place: Array = self.mission.coordinates.place(self.mission.coordinates.from_joints(joints))
        return place

    def _offset(self, t: float, joints: Array) -> Array:
        offset: Array = self.target.at(t) - self._place(joints)
        return offset


def _least_length(a: Array, b: Array) -> float:
    """Least length of the vectors between a and b (3,); that of b if a is NaN."""
    if not np.isfinite(a).all():
        return float(np.linalg.norm(b))
    d = b - a
    share = min(max(-float(a @ d) / max(float(d @ d), math.ulp(0.0)), 0.0), 1.0)
    return float(np.linalg.norm(a + share * d))
