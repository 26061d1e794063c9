"""The mode ``random``: any of the inputs that keep inside, whatever it teaches."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.sim.interfaces.signals import Array, Integers


class RandomInputs:
    """Draws one of the inputs, each as likely as any other."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def best(self, belief: Belief, inputs: Array, held: Integers) -> tuple[int, float]:
        return int(self._rng.integers(len(inputs))), math.nan
