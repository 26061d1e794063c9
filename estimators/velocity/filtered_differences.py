"""The plug-in ``filtered_differences``: the velocity without a model, from differences of readings.

    w_k = (y_k - y_{k-1}) / h,        v = Butterworth's low-pass of second order of w,

y_k - y_{k-1} being the coordinates of y_k about y_{k-1}. Where readings are missing h is the whole time between those
that are there, and the filter is given w once for each period of it. It filters the components of the vector as it is
stored, ambient on a curved space, where those in a frame would jump with it, and what is tangent of them is v.
Positions are the newest reading, moved on with v while it is old, but not beyond the time after which it is lost.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import butter, sosfilt

from mathnavi.estimators.velocity.position_observer import PositionObserver
from mathnavi.estimators.velocity.readings import OutlierCounter, SpeedGate, innovation
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.sim.interfaces.bounds import NonNegative, Positive, configuration
from mathnavi.sim.interfaces.errors import FieldError
from mathnavi.sim.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.sim.interfaces.protocols import Sensor
from mathnavi.sim.interfaces.signals import NOTHING, Array

_ORDER = 2


@configuration
class FilteredDifferencesConfig:
    """Fields of ``--estimator``."""

    cutoff: NonNegative = 20.0
    """where the filter's gain is 1 / sqrt(2) [Hz]; 0: the differences as they are"""
    timeout: Positive = 0.5
    """without a reading after which the estimate is lost [s]"""


class FilteredDifferences:
    """Estimator of the velocity by differences of readings through a low-pass."""

    Config = FilteredDifferencesConfig

    @staticmethod
    def build(config: FilteredDifferencesConfig, mission: LagrangianMission) -> PositionObserver:
        """Build the estimator of one run.

        Raises FieldError for a cutoff that is not below half the rate of the readings.
        """
        most = 0.5 / mission.period
        if config.cutoff >= most:
            raise FieldError(f"cutoff = {config.cutoff!r}; allowed: below half the rate of readings, {most:g} Hz")
        return PositionObserver(_Differences(config, mission), mission, config.timeout)

    @staticmethod
    def sensors(config: FilteredDifferencesConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: FilteredDifferencesConfig, mission: LagrangianMission) -> None:
        """Nothing is certified from it."""

    @staticmethod
    def properties(config: FilteredDifferencesConfig) -> ObserverProperties:
        """Table 2.1: it lags behind, by half a period or by what the filter adds to that."""
        return ObserverProperties(
            Domain.NONE, Rate.NONE, InputDependence.NON_UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
            stays_on_truth=False, note="without noise the error of v is its lag times the acceleration",
        )  # fmt: skip


class _Differences:
    """A ``VelocityLaw``."""

    extra: Mapping[str, Array] = NOTHING

    def __init__(self, config: FilteredDifferencesConfig, mission: LagrangianMission) -> None:
        self._mission, self._manifold = mission, mission.system.manifold
        self._timeout = config.timeout
        rate = 1.0 / mission.period
        self._sos = butter(_ORDER, config.cutoff, output="sos", fs=rate) if config.cutoff else None

    @property
    def state(self) -> Array:
        manifold = self._manifold
        w = manifold.components(self._y, self._w)
        x = manifold.point(self._y, min(self._age, self._timeout) * w) if self._age else self._y
        return np.concatenate([x, manifold.vector(x, manifold.components(x, self._w))])

    def start(self, y: Array) -> None:
        self._y, self._age = y, 0.0  # [s] since the newest reading
        self._w = np.zeros(self._manifold.vector_size)
        self._memory = np.zeros((_ORDER // 2, 2, self._manifold.vector_size))  # of the filter
        self._gate, self._outlier_counter = SpeedGate(self._mission, y), OutlierCounter()

    def predict(self, h: float, u: Array, y: Array | None) -> None:
        self._age += h

    def correct(self, y: Array, h: float) -> bool:
        moved = innovation(self._manifold, self._y, y)
        good = moved is not None and self._gate.passes(self._y, moved, h)
        if not self._outlier_counter.admits(good):
            return False
        if moved is None or not good or h > self._timeout:  # a difference over that would say nothing of v
            self.start(y)
            return True
        self._w = self._filtered(self._manifold.vector(self._y, moved / h), max(1, round(h / self._mission.period)))
        self._y, self._age = y, 0.0
        return True

    def _filtered(self, w: Array, periods: int) -> Array:
        """What the filter says at the end of so many periods of a difference w (vector_size,)."""
        if self._sos is None:
            return w
        out, self._memory = sosfilt(self._sos, np.tile(w, (periods, 1)), axis=0, zi=self._memory)
        last: Array = out[-1]
        return last
