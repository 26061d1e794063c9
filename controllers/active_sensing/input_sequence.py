"""What a way to excite is asked, and what it answers: the one protocol behind ``--planner.mode``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.sim.interfaces.signals import Array, Phase


@dataclass(frozen=True)
class InputSequence:
    """Inputs that are held one after the other; after the last the robot rests."""

    duration: Array  # (K,) [s] > 0
    u: Array  # (K, 2) [m/s, rad/s]
    phase: Phase = Phase.OPTIMISED
    cost: float = math.nan  # of what was chosen, in the mode's own terms
    note: str = ""  # the kind of an event to record whenever it begins
    message: str = ""  # behind the note


class ExplorationPolicy(Protocol):
    """How a robot is driven so that its estimator learns."""

    def drive(self, t: float, belief: Belief) -> InputSequence:
        """The inputs from t [s] on, given what is believed of the pose then."""
        ...
