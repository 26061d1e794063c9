"""Whether the pose of an observer that only improves one is that of the robot, or another that explains its readings.

Ranges and rates agree with the images of the pose under the symmetries of a wall, and for seconds with poses near
those of one that is nearly symmetric. So where the observer was told no start, was lost, or may have been anywhere by
its own covariance, an estimator that begins with no pose at all takes the readings along, until it has found one and
the observer is there too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scipy.special import chdtri

from mathnavi.estimators.integrity.pose_protection import square
from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBank, pose_finder
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission

_ANYWHERE = 0.1  # of the longest range, that the deviation of a place is at most where it is known
_ALIKE = float(chdtri(3, 1e-3))  # d' P^-1 d of two estimates of the same pose at most


class UniquePose:
    """Comparison of an observer with an estimator that has to find the pose itself."""

    def __init__(self, mission: RangingMission) -> None:
        self._mission = replace(mission, start=None)
        self._widest = (_ANYWHERE * RangeModel(mission).longest) ** 2
        self._finder: FeasibleSetBank | None = None
        if mission.start is None:
            self.doubt()

    def doubt(self) -> None:
        """Doubt the pose from now on."""
        if self._finder is None:
            self._finder = pose_finder(self._mission)

    def judge(
        self, estimate: Estimate, measurements: Sequence[Measurement], command: Array, *, measured: bool
    ) -> Status:
        """Take the readings since the last update, after which the observer has made an ``estimate``, and return its
        status as far as the pose may be another one; ``measured`` is whether there are ranges among them.
        """
        P = estimate.covariance
        wide = P is None or float(P[0, 0] + P[1, 1]) > self._widest
        if (wide and measured) or estimate.status is Status.LOST:  # without ranges nothing is explained by them
            self.doubt()
        if self._finder is None:
            return Status.OK
        found = self._finder.update(estimate.t, measurements, command)
        if Status.OK is not found.status or found.covariance is None:
            return Status.DEGRADED
        if Status.OK is not estimate.status or P is None or wide:
            return Status.DEGRADED
        if square(found.covariance + P, self._mission.difference(estimate.x, found.x)) > _ALIKE:
            return Status.LOST
        self._finder = None
        return Status.OK
