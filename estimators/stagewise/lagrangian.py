"""A Lagrangian system as a ``StagewiseModel``: (x, v) on its tangent bundle, readings of the position.

The model of ``mathnavi.estimators.velocity.error_state``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mathnavi.estimators.stagewise.model import Piece
from mathnavi.estimators.velocity.error_state import StateErrors, acceleration_noise
from mathnavi.estimators.velocity.reading_errors import ReadingErrors
from mathnavi.estimators.velocity.readings import PositionReader, innovation, reading_variance
from mathnavi.estimators.velocity.refusals import refusal
from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import NOTHING, Array, Measurement
from mathnavi.models.manifold.mission import LagrangianMission

NOISE_FLOOR = 1e-4
"""least standard deviation that an estimator assumes for a reading [rad, m]"""
_STEP = 1e-6  # of an error, in its unit


class LagrangianModel:
    """Model of the state (x, v) (size + vector_size,) with errors (a, b) (2 n,)."""

    def __init__(self, mission: LagrangianMission, acceleration: float, noise_floor: float) -> None:
        """``acceleration`` is the square root of the density of its noise, ``noise_floor`` the least deviation of a
        reading.
        """
        self._mission, self._system = mission, mission.system
        self._manifold = mission.system.manifold
        self._reader = PositionReader(self._manifold)
        self._acceleration, self._floor = acceleration, noise_floor
        self._errors = StateErrors(self._manifold)
        self.rows = self._manifold.dimension
        self.size = 2 * self.rows
        self._sigma: Array | None = None  # (n,) of a reading
        self.reading_errors = ReadingErrors(mission)
        """errors of the readings so far"""
        self._newest = -np.inf  # [s] of them

    @staticmethod
    def as_declared(mission: LagrangianMission) -> LagrangianModel:
        """Model with the noise that the mission declares and no other: no noise of the acceleration."""
        return LagrangianModel(mission, 0.0, 0.0)

    def start(self, reading: Array | None) -> tuple[Array, Array] | None:
        if reading is None:
            return None
        velocity = np.full(self.rows, self._mission.speed_max)
        P = np.diag(np.square(np.concatenate([self.deviation(reading), velocity])))
        return np.concatenate([reading, np.zeros(self._manifold.vector_size)]), P

    def inputs(self, begin: float, end: float, measurements: Sequence[Measurement], command: Array) -> Sequence[Piece]:
        return ((end - begin, command.copy()),)

    def reading(self, measurement: Measurement) -> Array | None:
        y = self._reader.read(measurement)
        if y is not None and measurement.t > self._newest:
            self._newest = measurement.t
            if self.reading_errors.read(measurement.t, y, None):
                self._sigma = np.maximum(np.sqrt(self.reading_errors.variance), self._floor)
        return y

    def transition(self, x: Array, u: Array, h: float) -> tuple[Array, Array, Array]:
        after = self._system.flow(x, u, h)
        columns = [
            self._errors.difference(self._system.flow(self._errors.sum(x, _STEP * axis), u, h), after)
            for axis in np.eye(self.size)
        ]
        return after, np.stack(columns, axis=1) / _STEP, acceleration_noise(self._acceleration, self.rows, h)

    def residual(self, x: Array, y: Array) -> tuple[Array, Array]:
        sigma = self.deviation(y)
        moved = innovation(self._manifold, x[: self._manifold.size], y)
        if moved is None:
            moved = np.full(self.rows, np.nan)
        return moved / sigma, np.eye(self.rows, self.size) / sigma[:, np.newaxis]

    def noise(self, x: Array, y: Array) -> Array:
        return self.deviation(y)

    def deviation(self, y: Array) -> Array:
        """Standard deviations (n,) of a reading's coordinates: as found, or as declared near the first, y (size,)."""
        if self._sigma is None:
            self._sigma = np.maximum(np.sqrt(reading_variance(self._mission, y)), self._floor)
        return self._sigma

    def sum(self, x: Array, e: Array) -> Array:
        return self._errors.sum(x, e)

    def difference(self, other: Array, x: Array) -> Array:
        return self._errors.difference(other, x)

    def limits(self, x: Array) -> tuple[Array, Array]:
        """Infinite limits: an estimate that is too fast is not OK, instead of one at the limit that is."""
        high = np.full(self.size, np.inf)
        return -high, high

    def extra(self, x: Array, P: Array) -> Mapping[str, Array]:
        return NOTHING

    def reported(self, x: Array, P: Array) -> tuple[Array, Array | None]:
        return x.copy(), None if np.isnan(P).any() else self._errors.state_covariance(x, P)

    def unused(self, measurement: Measurement) -> Unused | None:
        return refusal(self._manifold, measurement)

    def restart(self) -> bool:
        return True
