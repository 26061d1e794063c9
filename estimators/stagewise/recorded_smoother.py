"""Smoother of a finished run in place of its Kalman filter: the same sensors and model, but all readings.

A causal estimator uses the readings so far; this one uses the whole run, which it must get before its first estimate.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from mathnavi.estimators.stagewise.model import StageBuilder, StagewiseModel
from mathnavi.estimators.stagewise.smoother import SmoothedStates, batch_least_squares, rauch_tung_striebel
from mathnavi.estimators.stagewise.verdict import Sample, Verdict, contradictions, filter_verdict
from mathnavi.interfaces.bounds import Probability, configuration
from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.protocols import Estimator, Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.tolerances import TIME_TOLERANCE

_PATIENT = 60.0  # [s] without readings for which the run's filter is not lost: gaps are judged by the smoother
_LEFT_OUT = "left_out"  # extra array of a filter whose monitor leaves channels out


@configuration
class SmootherConfig:
    """Fields of the command line."""

    method: Literal["rts", "batch"] = "rts"
    """smoothing method: Rauch, Tung and Striebel's (rts), or batch least squares, which takes longer"""
    gate: Probability = 1e-4
    """probability that a good component of a reading is refused"""


class RecordedSmoother:
    """Estimator that uses a whole recorded run; call ``smooth`` before ``update``."""

    def __init__(
        self,
        config: SmootherConfig,
        model: StagewiseModel,
        period: float,
        timeout: float,
        recorded: Estimator | None = None,
    ) -> None:
        """``timeout`` is the longest gap [s] between readings that is declared; ``recorded`` the filter of the run,
        whose monitor says what is left out; None for a run without.
        """
        self.period, self._recorded = period, recorded
        self._verdict = Verdict(None, ())
        self._longest = max(timeout, 2.0 * period) + TIME_TOLERANCE
        self._read = np.empty(0)  # (k,) [s] times with readings
        self._config, self._model = config, model
        self._states: SmoothedStates | None = None
        by_filter: Mapping[str, tuple[str, ...]] = getattr(recorded, "figures", {})
        self._channels = {name: words for name, words in by_filter.items() if name == _LEFT_OUT}

    @property
    def figures(self) -> Mapping[str, tuple[str, ...]]:
        """Names of the further figures of its estimates."""
        named: Mapping[str, tuple[str, ...]] = getattr(self._model, "figures", {})
        return {**named, **self._channels}

    def smooth(self, samples: Iterable[Sample]) -> None:
        """Smooth a run.

        Raises ArgumentError if it has no reading to start at or batch least squares does not converge, LinAlgError if
        the filter diverges.
        """
        by_filter = None
        if self._recorded is not None:
            by_filter = filter_verdict(self._recorded, self._model, samples)
            samples, self._recorded = by_filter.samples, None
        prepare = getattr(self._model, "prepare", None)  # of a model that finds its start in the run
        if prepare is not None:
            samples = list(samples)
            prepare(samples)
        builder = StageBuilder(self._model)
        stages = [stage for sample in samples for stage in builder.add(*sample)]
        self._read = np.array([stage.t for stage in stages if stage.readings])
        smoothed = batch_least_squares if self._config.method == "batch" else rauch_tung_striebel
        self._states = smoothed(self._model, stages, self._config.gate)
        if not self._states.converged:
            raise ArgumentError("method = 'batch' did not converge on this run; allowed: 'rts'")
        self._verdict = Verdict(by_filter, contradictions(self._model, self._states))

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Smoothed estimate at t [s], independent of ``measurements``; before the first stage that of the first stage.

        INITIALISING before the first stage and in a run without readings, DEGRADED in a gap between readings that is
        longer than declared, where the run's filter is not sure, and where residuals contradict it (``verdict``).
        """
        assert self._states is not None, "the run was not smoothed yet"
        k = int(np.searchsorted(self._states.t, t + TIME_TOLERANCE, side="right")) - 1
        state, covariance = self._states.x[max(k, 0)], self._states.P[max(k, 0)]
        x, P = self._model.reported(state, covariance)
        if P is not None:
            P = 0.5 * (P + P.T)
        extra = dict(self._model.extra(state, covariance))
        doubt, out = self._verdict.at(t)
        if out is not None:
            extra[_LEFT_OUT] = out
        if k < 0 or not len(self._read):
            return Estimate(t, x, P, Status.INITIALISING, extra)
        return Estimate(t, x, P, Status.DEGRADED if doubt else self._status(t), extra, doubt)

    def _status(self, t: float) -> Status:
        """Status at t [s], which is after the first stage."""
        k = int(np.searchsorted(self._read, t + TIME_TOLERANCE, side="right"))
        if k == 0 or t <= self._read[k - 1] + TIME_TOLERANCE:  # before the first reading, or at one
            return Status.OK
        after = self._read[k] if k < len(self._read) else t
        return Status.DEGRADED if after - self._read[k - 1] > self._longest else Status.OK


class Smoothing:
    """Plug-in of a recorded run's smoother, with the sensors and the model of that run's Kalman filter."""

    Config = SmootherConfig

    def __init__(self, plugin: Any, config: Any) -> None:
        """``plugin`` is the recorded estimator, ``config`` its configuration; raises FieldError if it is not a Kalman
        filter.
        """
        self.__qualname__ = type(self).__qualname__
        self.plugin, self._config = plugin, config
        self._model_of = model_of(plugin)

    def build(self, config: SmootherConfig, mission: Any) -> RecordedSmoother:
        """Build the smoother of one run."""
        timeout = float(getattr(self._config, "timeout", np.inf))  # a filter of somebody else's may declare none
        patient = self._config
        if np.isfinite(timeout) and _is_own(self.plugin):  # what another one means by it is not known
            patient = replace(self._config, timeout=max(timeout, _PATIENT))
        recorded: Estimator = self.plugin.build(patient, mission)
        return RecordedSmoother(config, self._model_of(self._config, mission), recorded.period, timeout, recorded)

    def sensors(self, config: SmootherConfig, mission: Any) -> tuple[Sensor, ...]:
        """Sensors of the recorded estimator."""
        sensors: tuple[Sensor, ...] = self.plugin.sensors(self._config, mission)
        return sensors

    def quality(self, config: SmootherConfig, mission: Any) -> Any:
        """Quality of the recorded estimator; that of the smoother is at least as good."""
        return self.plugin.quality(self._config, mission)


def _is_own(plugin: Any) -> bool:
    return str(plugin.__module__).partition(".")[0] == "mathnavi"


def model_of(plugin: Any) -> Any:
    """Function (config, mission) -> ``StagewiseModel`` of a Kalman filter's plug-in.

    Raises FieldError for a plug-in that is neither one of mathnavi's Kalman filters nor has its own
    ``stagewise_model``.
    """
    if hasattr(plugin, "stagewise_model"):
        return plugin.stagewise_model
    name = plugin.__qualname__
    if _is_own(plugin):
        if name == "Kalman":
            from mathnavi.estimators.stagewise.flight import FlightModel

            return FlightModel.from_config
        if name == "MissileKalman":
            from mathnavi.estimators.stagewise.missile import MissileModel

            return MissileModel.from_config
        if name in ("RangeEkf", "RangeUkf"):
            from mathnavi.estimators.stagewise.ranging import RangingModel

            return lambda config, mission: RangingModel(mission)
        if name in ("LagrangianEkf", "LagrangianUkf"):
            from mathnavi.estimators.stagewise.lagrangian import LagrangianModel

            return lambda config, mission: LagrangianModel(mission, config.acceleration, config.noise_floor)
    raise FieldError(
        f"the run was flown with the estimator {name}; allowed: kalman, missile_kalman, range_ekf, range_ukf, "
        "lagrangian_ekf, lagrangian_ukf, moving_horizon, or a plug-in with a stagewise_model"
    )
