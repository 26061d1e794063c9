"""Estimator that takes the state from a sensor of the full state, for simulations that are not about estimation.

The newest reading of the sensor "full_state" is the estimate. Between readings the estimate is propagated by the
vehicle's declared motion under the held input ((A.2), B.4); the effect of gusts in between is unknown and widens the
covariance. The mission says what kind of vehicle it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

from mathnavi.estimators.timeout_monitor import FARTHEST, TimeoutMonitor, waiting
from mathnavi.estimators.velocity.possible import possible_or_lost
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status


@runtime_checkable
class FullStateMission(Protocol):
    """Mission of a vehicle with nx states and nu inputs, as this estimator needs it."""

    @property
    def control_period(self) -> float:
        """Period [s] of the estimates."""
        ...

    @property
    def start_state(self) -> Array:
        """State (nx,) at t = 0."""
        ...

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """State (nx,) after the input u (nu,) was held for dt [s] from x (nx,)."""
        ...

    def full_state_sensor(self, rate: float | None) -> Sensor:
        """Sensor "full_state", read ``rate`` times a second, or at every control step if it is None."""
        ...

    def full_state_covariance(self, age: float) -> Array:
        """Covariance (nx, nx) of a reading propagated for ``age`` [s]."""
        ...

    def full_state_quality(self, rate: float | None, timeout: float) -> Any:
        """Quality of readings at ``rate`` [Hz], lost after ``timeout`` [s], in the scenario's terms."""
        ...


@configuration
class FullStateConfig:
    """Fields of the command line."""

    rate: Positive | None = None
    """rate of the readings [Hz]; that of the estimates if not given"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


class FullState:
    """Estimator that passes the newest full-state reading on."""

    Config = FullStateConfig

    def __init__(self, config: FullStateConfig, mission: FullStateMission) -> None:
        self.period = mission.control_period
        self._timeout_monitor = TimeoutMonitor(config.timeout, 0.0, settling=0.0)  # a reading is the state
        self._counts = ReadingCounts()
        self._mission = mission
        self._fresh = mission.full_state_covariance(0.0)  # covariance of a reading of age 0
        self._x = mission.start_state
        self._t = -math.inf  # [s] of _x

    @staticmethod
    def build(config: FullStateConfig, mission: FullStateMission) -> FullState:
        """Build the estimator of one run."""
        return FullState(config, mission)

    @staticmethod
    def sensors(config: FullStateConfig, mission: FullStateMission) -> tuple[Sensor, ...]:
        """Sensors that the vehicle has to carry for this estimator."""
        return (mission.full_state_sensor(config.rate),)

    @staticmethod
    def quality(config: FullStateConfig, mission: FullStateMission) -> Any:
        """Quality of the readings, as the mission states it."""
        return mission.full_state_quality(config.rate, config.timeout)

    @staticmethod
    def properties(config: FullStateConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1): the first reading is the state."""
        return ObserverProperties(
            Domain.GLOBAL, Rate.FINITE_TIME, InputDependence.UNIFORM, Domain.LOCAL, Domain.GLOBAL,
            note="a reading is the state: there is nothing to observe",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate x (nx,) at t [s] from the readings since the last call, ``command`` (nu,) held in between.

        ``extra`` counts the readings that were not used.
        """
        for reading in measurements:
            if reading.name != "full_state":
                self._counts.add(Unused.UNKNOWN_SENSOR)
            elif not math.isfinite(float(reading.value.dot(reading.value))):
                self._counts.add(Unused.NOT_FINITE)
            elif reading.t <= self._timeout_monitor.t:
                self._counts.add(Unused.LATE)
            else:
                self._x, self._t = reading.value, reading.t
                self._timeout_monitor.note(reading.t)
        if self._t == -math.inf:
            self._t = t  # nothing is known but the mission's start
        if t > self._t:
            if t - self._t <= FARTHEST:
                self._x = self._mission.flow(self._x, command, t - self._t)
            self._t = t
        status, age = self._timeout_monitor.status(t), t - self._timeout_monitor.t
        if status is Status.INITIALISING:
            message = waiting(status, "a reading of full_state")
            return Estimate(t, self._x.copy(), status=status, extra=self._counts.extra, message=message)
        covariance = self._mission.full_state_covariance(age) if age > 0.0 else self._fresh.copy()
        return possible_or_lost(
            self._mission,
            Estimate(t, self._x.copy(), covariance, status, self._counts.extra, self._timeout_monitor.message),
        )
