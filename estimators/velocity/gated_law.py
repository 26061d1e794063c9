"""Law of constant gains that refuses readings that the system cannot have reached, unless they persist."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from mathnavi.estimators.velocity.readings import OutlierCounter, SpeedGate, innovation
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission


class GatedLaw(ABC):
    """Base of a ``VelocityLaw`` that starts it and accepts or refuses its readings."""

    def __init__(self, mission: LagrangianMission) -> None:
        self._mission, self._manifold = mission, mission.system.manifold

    @property
    def state(self) -> Array:
        """State (size + vector_size,) (x, v)."""
        return self._state

    def start(self, y: Array) -> None:
        """Start at the point y (size,) with v = 0."""
        self._state = np.concatenate([y, np.zeros(self._manifold.vector_size)])
        self._y = y  # the last reading that was used
        self._gate, self._outlier_counter = SpeedGate(self._mission, y), OutlierCounter()

    def correct(self, y: Array, h: float) -> bool:
        """Condition on a reading y (size,), h [s] after the last that was used; True if it was used."""
        manifold, size = self._manifold, self._manifold.size
        x, v = self._state[:size], self._state[size:]
        moved, L = innovation(manifold, self._y, y), innovation(manifold, x, y)
        good = moved is not None and L is not None and self._gate.passes(self._y, moved, h)
        if not self._outlier_counter.admits(good):
            return False
        if L is None or not good:
            self.start(y)
            return True
        self._state = self._corrected(x, v, L, h)
        self._y = y
        return True

    @abstractmethod
    def _corrected(self, x: Array, v: Array, L: Array, h: float) -> Array:
        """State (size + vector_size,) after the innovation L (n,) at x (size,), v (vector_size,)."""
