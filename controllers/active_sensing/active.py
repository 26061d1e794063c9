"""The mode ``active``: the input after which the estimate is expected to be the surest.

Of the inputs that keep inside the one is taken that minimises

    tr [F (P^-1 + sum_j F_j' H_j' (H_d / dt) R^-1 H_j F_j)^-1 F'],

the trace of the covariance that is expected at the end of the horizon (see ``kernels``). A metre weighs as much as a
radian.
"""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.kernels import expected_traces
from mathnavi.models.unicycle.mission import LEAST_NOISE, RangingMission
from mathnavi.sim.interfaces.signals import Array, Integers


class Active:
    """Looks ``horizon`` [s] ahead in ``nodes`` nodes."""

    def __init__(self, mission: RangingMission, horizon: float, nodes: int) -> None:
        self._wall, self._angles = (mission.curve.table, mission.curve.polyline), mission.alpha
        absolute = float(np.hypot(mission.ranging.absolute, LEAST_NOISE))
        self._noise = np.array([mission.ranging.relative, absolute])
        self._node, self._nodes = horizon / nodes, nodes
        self._readings = self._node / mission.period * (1.0 - mission.ranging.dropout)

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        traces = expected_traces(
            *self._wall, self._angles, self._noise, belief.pose, belief.covariance, inputs, held, self._node,
            self._nodes, self._readings,
        )  # fmt: skip
        k = int(np.argmin(traces))
        return k, float(traces[k])
