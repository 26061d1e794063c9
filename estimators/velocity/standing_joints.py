"""Joints whose encoders stand while the model moves them: an encoder that is dead, or a joint that is held.

A reading without noise may repeat itself while a joint stands. For a joint that has stood for half a second, the model
predicts four times a second how far it would move in a tenth of a second from there, under the input held:

    d = q_i(t + 0.1 s) - y_i(t).

A model that is slightly wrong has such a d at rest, too, but the same one. The joint is doubted where d has varied by
more than 20 steps or deviations of its encoder in two seconds, without the least and the greatest d: forces have
changed, and the reading has not.
"""

from __future__ import annotations

import copy
import math
from collections import deque

import numpy as np

from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import LagrangianSystem
from mathnavi.models.mechanism.geometry import MechanismManifold

_STANDS, _OFTEN, _AHEAD = 0.5, 0.25, 0.1  # [s] of a joint that stands, between two questions, and of a prediction
_ASKED, _FEWEST = 8, 4  # answers that are compared, at most and at least
_FAR, _LEAST = 20.0, 1e-4  # deviations of an encoder, and the least of these [rad, m]


class StandingJoints:
    """Comparison of the encoders that stand with the model."""

    def __init__(self, mission: LagrangianMission) -> None:
        self._mission, manifold = mission, mission.system.manifold
        self._joints = manifold.scalars if isinstance(manifold, MechanismManifold) else ()
        self._system: LagrangianSystem | None = None  # a copy, whose steps are not those of the observer
        self._far: deque[Array] = deque(maxlen=_ASKED)
        self._since = math.inf  # [s] since the last question

    def doubted(self, state: Array, y: Array, u: Array, h: float, repeats: Array, errors: Array) -> str:
        """Name of a joint that stands while the model moves it; "" if there is none.

        Args:
            state: (size + vector_size,) the estimate at the reading.
            y: (size,) the reading.
            u: (nu,) the input.
            h: time since the reading before [s].
            repeats: (k,) numbers of repetitions so far of the encoders of slides and hinges.
            errors: (k,) [rad, m] the larger of deviation and step of each.
        """
        stands = repeats * self._mission.period >= _STANDS
        if not stands.any():
            self._far.clear()
            return ""
        self._since += h
        if self._since < _OFTEN:
            return ""
        self._since = 0.0
        self._far.append(np.where(stands, self._moves(state, y, u, stands), np.nan))
        for i in np.flatnonzero(stands):
            far = sorted(each[i] for each in self._far if math.isfinite(each[i]))[1:-1]
            if len(far) >= _FEWEST - 2 and far[-1] - far[0] > _FAR * max(errors[i], _LEAST):
                return self._joints[i].name
        return ""

    def _moves(self, state: Array, y: Array, u: Array, stands: Flags) -> Array:
        """Displacements (k,) of the joints by the model from y (size,), where those that ``stands`` have no speed; NaN
        if it cannot say.
        """
        if self._system is None:
            self._system = copy.copy(self._mission.system)
        places = np.array([each.place for each in self._joints])
        coordinates = np.array([each.coordinate for each in self._joints])
        x = np.concatenate([y, state[len(y) :]])
        x[len(y) + coordinates[stands]] = 0.0
        try:
            for _ in range(max(1, round(_AHEAD / self._mission.period))):
                x = self._system.flow(x, u, self._mission.period)
        except (np.linalg.LinAlgError, ArithmeticError):
            return np.full(len(places), np.nan)
        return np.asarray(x[places] - y[places], dtype=np.float64)
