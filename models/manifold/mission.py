"""What an observer of a Lagrangian system may know: the system, how its position is read, how fast it may be."""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from mathnavi.models.manifold.sensors import PositionQuality, PositionSensor, StateSensor
from mathnavi.models.manifold.system import LagrangianSystem
from mathnavi.sim.interfaces.bounds import Condition, Positive, configuration
from mathnavi.sim.interfaces.signals import Array


def _divides_a_second(period: float) -> bool:
    return math.isclose(1.0 / period, round(1.0 / period), rel_tol=1e-6)


Period = Annotated[Positive, Condition(_divides_a_second, "1 s over a whole number")]


@configuration(eq=False)
class LagrangianMission:
    """Find the velocity of a system from its position and its input. It holds no truth of a run.

    ``system`` is the system as it is believed to be. The state is (x, v), as ``system.states`` names it; v is nought
    for all that is known at the start, and x is what the first reading says.
    """

    system: LagrangianSystem
    reading: PositionQuality = field(default_factory=PositionQuality)
    period: Period = 1e-3  # [s] of readings, estimates and commands
    speed_max: Positive = 10.0  # sup |v|_g (Theorem D.2)

    @property
    def sensor(self) -> PositionSensor:
        """A fresh one for a run, of readings "position" (size,)."""
        return PositionSensor(self.system.manifold, self.reading, 1.0 / self.period)

    # ---- for the estimator ``full_state``, which is told the velocity

    @property
    def control_period(self) -> float:
        """[s] of the estimates."""
        return self.period

    @property
    def start_state(self) -> Array:
        """(origin, 0): nothing is known of the start."""
        manifold = self.system.manifold
        return np.concatenate([manifold.origin, np.zeros(manifold.vector_size)])

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """The state after the input u (nu,) was held for dt [s]."""
        return self.system.flow(x, u, dt)

    def full_state_sensor(self, rate: float | None) -> StateSensor:
        """The sensor "full_state"."""
        return StateSensor(len(self.system.states), rate or 1.0 / self.period)

    def full_state_covariance(self, age: float) -> Array:
        """A reading has no error; (n, n) of noughts."""
        n = len(self.system.states)
        return np.zeros((n, n))

    def full_state_quality(self) -> None:
        """Nothing is certified from it."""
