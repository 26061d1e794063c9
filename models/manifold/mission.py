"""Mission of an observer of a Lagrangian system: the system, the quality of its position sensor, its greatest speed."""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from mathnavi.interfaces.bounds import Condition, Positive, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.sensors import ManifoldPositionSensor, PositionQuality, StateSensor
from mathnavi.models.manifold.system import LagrangianSystem


def _divides_a_second(period: float) -> bool:
    return math.isclose(1.0 / period, round(1.0 / period), rel_tol=1e-6)


Period = Annotated[Positive, Condition(_divides_a_second, "1 s over a whole number")]


@configuration(eq=False)
class LagrangianMission:
    """Mission: find the velocity of a system from its position and its input. It holds no truth of a run.

    ``system`` is the assumed system. The state is (x, v), as ``system.states`` names it; at the start v is assumed to
    be zero, and x is the first reading.

    Raises MissionError for a period that is not 1 s over a whole number.
    """

    system: LagrangianSystem
    reading: PositionQuality = field(default_factory=PositionQuality)
    period: Period = 1e-3  # [s] of readings, estimates and commands
    speed_max: Positive = 10.0  # sup |v|_g (Theorem D.2)

    @property
    def input_size(self) -> int:
        """Number nu of inputs."""
        return len(self.system.inputs)

    @property
    def sensor(self) -> ManifoldPositionSensor:
        """Sensor of one run, with readings "position" (size,)."""
        return ManifoldPositionSensor(self.system.manifold, self.reading, 1.0 / self.period)

    # ---- for the estimator ``full_state``, which reads the velocity

    @property
    def control_period(self) -> float:
        """Period [s] of the estimates."""
        return self.period

    @property
    def start_state(self) -> Array:
        """State (size + vector_size,) (origin, 0): nothing is known of the start."""
        manifold = self.system.manifold
        return np.concatenate([manifold.origin, np.zeros(manifold.vector_size)])

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """State after the input u (nu,) was held for dt [s] from x (size + vector_size,)."""
        return self.system.flow(x, u, dt)

    def full_state_sensor(self, rate: float | None) -> StateSensor:
        """Sensor "full_state" at ``rate`` [Hz]; once a period if it is None."""
        return StateSensor(len(self.system.states), rate or 1.0 / self.period)

    def full_state_covariance(self, age: float) -> Array:
        """Covariance (n, n) of a reading of any age: zero, for it has no error."""
        n = len(self.system.states)
        return np.zeros((n, n))

    def full_state_quality(self, rate: float | None, timeout: float) -> None:
        """None: the state is not certified."""
