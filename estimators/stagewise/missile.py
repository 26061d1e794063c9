"""The missile under disturbances as a ``StagewiseModel``: state and disturbance, with readings of the whole state.

The model of ``mathnavi.estimators.missile_kalman``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi
import numpy as np

from mathnavi.estimators.missile_kalman import (
    MissileKalmanConfig,
    disturbance_deviation,
    disturbing_input,
    start_deviation,
    transition,
)
from mathnavi.estimators.stagewise.model import Piece, refused
from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.angles import wrapped
from mathnavi.models.buffered_function import NumericFunction
from mathnavi.models.missile.coordinates import STEP
from mathnavi.models.missile.input_history import InputHistory
from mathnavi.models.missile.mission import MissileMission
from mathnavi.models.tolerances import TIME_TOLERANCE

_LARGEST = 6.0  # standard deviations of a disturbance


class MissileModel:
    """Model of the thesis' state (nx,), followed by the disturbance (nu,) [N, N m]."""

    def __init__(
        self, mission: MissileMission, disturbance: Array, time_constant: float, start: Array, reading: Array
    ) -> None:
        """``disturbance`` (nu,), ``start`` (nx,) and ``reading`` (nx,) are standard deviations."""
        self._mission, self._coordinates = mission, mission.coordinates
        self.rows, self._inputs = mission.coordinates.state_size, len(disturbance)
        self.size = self.rows + self._inputs
        self._disturbance, self._start, self._reading = disturbance, start, reading
        self._intensity = 2.0 * disturbance**2 / time_constant
        self._step: casadi.Function = transition(mission.coordinates, mission.body, time_constant)
        self._input_of = NumericFunction(disturbing_input(mission.coordinates))
        self._input_max = np.array(mission.input_max)
        self._history = InputHistory(mission.input_delay, self._inputs)
        self._is_known = True  # where the missile starts

    @staticmethod
    def from_config(config: MissileKalmanConfig, mission: MissileMission) -> MissileModel:
        """Model of the estimator ``missile_kalman`` with its configuration."""
        noise = np.maximum(mission.noise.deviations(mission.coordinates), config.noise_floor)
        return MissileModel(
            mission, disturbance_deviation(config, mission), config.time_constant, start_deviation(config, mission),
            noise,
        )  # fmt: skip

    @staticmethod
    def as_declared(mission: MissileMission) -> MissileModel:
        """Model with the gusts and the noise that the mission declares and no others; the start is exact."""
        coordinates, gust = mission.coordinates, mission.gust
        acting = np.array([gust.force if name.startswith("F") else gust.moment for name in coordinates.inputs])
        exact = np.zeros(coordinates.state_size)
        return MissileModel(mission, acting, gust.time_constant, exact, mission.noise.deviations(coordinates))

    def start(self, reading: Array | None) -> tuple[Array, Array] | None:
        if self._is_known:
            state, deviation = self._mission.start_state, self._start
        elif reading is None:
            return None
        else:
            state, deviation = reading, self._reading
        x = np.concatenate([state, np.zeros(self._inputs)])
        return x, np.diag(np.square(np.concatenate([deviation, self._disturbance])))

    def inputs(self, begin: float, end: float, measurements: Sequence[Measurement], command: Array) -> Sequence[Piece]:
        self._history.note(begin, np.clip(command, -self._input_max, self._input_max))
        pieces = []
        for duration, u in self._history.acting(begin, end):
            h = duration
            while h > TIME_TOLERANCE:
                pieces.append((min(h, STEP), u.copy()))
                h -= STEP
        return pieces

    def reading(self, measurement: Measurement) -> Array | None:
        return measurement.value.copy() if measurement.name == "full_state" else None

    def unused(self, measurement: Measurement) -> Unused | None:
        return refused(measurement, "full_state")

    def restart(self) -> bool:
        self._is_known = False
        return True

    def transition(self, x: Array, u: Array, h: float) -> tuple[Array, Array, Array]:
        after, F = (np.array(made) for made in self._step(x, u, h))
        noise = np.zeros(self.size)
        noise[self.rows :] = h * self._intensity
        return after.ravel(), F, F * noise @ F.T

    def residual(self, x: Array, y: Array) -> tuple[Array, Array]:
        error = y - x[: self.rows]
        angles = self._coordinates.angles
        error[angles] = wrapped(error[angles])
        return error / self._reading, np.eye(self.rows, self.size) / self._reading[:, np.newaxis]

    def noise(self, x: Array, y: Array) -> Array:
        return self._reading

    def sum(self, x: Array, e: Array) -> Array:
        return x + e

    def difference(self, other: Array, x: Array) -> Array:
        return other - x

    def limits(self, x: Array) -> tuple[Array, Array]:
        """Limits of the error: a disturbance is within six standard deviations."""
        high = np.full(self.size, np.inf)
        high[self.rows :] = _LARGEST * self._disturbance
        return -high - x, high - x

    def extra(self, x: Array, P: Array) -> Mapping[str, Array]:
        return {"disturbance": self._input_of(x)[0].ravel()}

    def reported(self, x: Array, P: Array) -> tuple[Array, Array]:
        return x[: self.rows].copy(), P[: self.rows, : self.rows].copy()
