"""True motion of a missile's target: along straight legs, at a constant velocity on each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.mission import Place, Target


@dataclass(frozen=True)
class TargetMotion:
    """The legs in order of time; the first is that of t = 0."""

    legs: tuple[Target, ...]

    @staticmethod
    def along(place: Place, velocity: Place, changes: Sequence[tuple[float, Place]] = ()) -> TargetMotion:
        """Motion from ``place`` (3,) [m] with ``velocity`` (3,) [m/s], Earth frame; ``changes`` hold times [s] and new
        velocities.
        """
        legs = [Target(place, velocity)]
        for t, after in sorted(changes):
            x, y, z = legs[-1].at(t).tolist()
            legs.append(Target((x, y, z), after, t))
        return TargetMotion(tuple(legs))

    def leg(self, t: float) -> Target:
        """Leg at time t [s]."""
        return [leg for leg in self.legs if leg.t <= max(t, 0.0)][-1]

    def at(self, t: float | Array) -> Array:
        """Place (3,) or (n, 3) [m] in the Earth frame at time t [s], a number or an array (n,)."""
        if isinstance(t, np.ndarray):
            return np.array([self.at(float(each)) for each in t]).reshape(-1, 3)
        return self.leg(t).at(t)

    def velocity(self, t: float) -> Array:
        """Velocity (3,) [m/s] in the Earth frame at time t [s]."""
        return np.array(self.leg(t).velocity)
