"""The mode ``singular-value``: the input that tells the poses nearby apart best, at this instant.

Ranges and their rates tell apart what they have different values for. To first order that is a matter of

    O(x, u) = [d rho / dx; d rho_dot / dx],     rho_dot = (d rho / dx) f(x, u),

2 l by 3, whose kernel is the tangent of FS_y and OF_x^u together (Definitions C.9 and C.11): the condition (C.1) of
Proposition C.1 holds to first order where it has full rank. The input with the largest least singular value is taken.
"""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.kernels import smallest_singular_values
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.interfaces.signals import Array, Integers


class SingularValue:
    """Greedy: it looks no further than the pose at which the input begins."""

    def __init__(self, mission: RangingMission) -> None:
        self._wall, self._angles = (mission.curve.table, mission.curve.polyline), mission.alpha

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        values = smallest_singular_values(*self._wall, self._angles, belief.pose, inputs)
        k = int(np.argmax(values))
        return k, float(values[k])
