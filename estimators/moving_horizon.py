"""Moving-horizon estimation as a plug-in for ranges, the missile, the flight by fixes, and mechanisms.

The models are those of the Kalman filters ``range_ekf``, ``missile_kalman``, ``kalman`` and ``lagrangian_ekf`` with
their standard fields; see ``mathnavi.estimators.stagewise.horizon`` for the method. Every failure is a status: if the
programme was not solved the estimate is the prediction, with ``SOLVER_FAILED``; if no reading has agreed with the
estimate for the timeout, or its state cannot be propagated, the status is ``LOST``, and in the latter case the
estimator starts again at the next reading. Predictions are tested by the readings that follow, as those of the Kalman
filters are: of the missile and the flight by ``integrity.innovations``, of mechanisms the noise of their readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, cast

import numpy as np
from annotated_types import Interval

from mathnavi.estimators.flight_leap_filters import FixRows
from mathnavi.estimators.flight_leaps import Leaps
from mathnavi.estimators.flight_model import AxisModel, KalmanConfig
from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.kalman import Kalman
from mathnavi.estimators.ranging.reader import RangeReader
from mathnavi.estimators.stagewise.horizon import MovingHorizon, Predicted
from mathnavi.estimators.stagewise.model import CountedModel, SmootherStage, StageBuilder
from mathnavi.estimators.timeout_monitor import FARTHEST, InnovationMean, TimeoutMonitor, waiting, worst
from mathnavi.estimators.velocity.possible import possible_or_lost
from mathnavi.estimators.velocity.reading_errors import ReadingErrors
from mathnavi.interfaces.bounds import FINITE, Positive, configuration
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Estimator, Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.manifold.manifold import CutLocusError
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import MODEL_FREE_ESTIMATORS, require_modelled
from mathnavi.models.missile.mission import MissileMission
from mathnavi.models.unicycle.mission import RangingMission

if TYPE_CHECKING:
    from mathnavi.estimators.stagewise.ranging import RangingModel

_MOST = 16.0  # square of a residual that counts
_LASTING = 10  # readings in a row that are off by more than chance allows
HorizonMission = RangingMission | MissileMission | FlightMission | LagrangianMission


@configuration
class MovingHorizonConfig:
    """Fields of the command line."""

    kernels: ClassVar[str] = "mathnavi.estimators.integrity.innovations_ahead"  # compiled before the first run

    stages: Annotated[int, Interval(ge=2, le=200), FINITE] = 6
    """number of stages of the window: times with readings, and the newest time"""
    iterations: Annotated[int, Interval(ge=1, le=20), FINITE] = 1
    """number of Gauss-Newton iterations at each reading; 1 is the real-time iteration"""
    slope: Positive = 1.5
    """threshold of Huber's loss, in standard deviations: a larger residual counts by its size, not by its square"""
    acceleration: Positive = 0.1
    """square root of the density of the acceleration that a mechanism's model lacks [rad/s^1.5, m/s^1.5]"""
    timeout: Positive = 0.5
    """time without a reading that agrees with the estimate after which the estimate is lost [s]"""


class MovingHorizonEstimator:
    """Estimator by least squares over the last readings, with an arrival cost for all readings before."""

    Config = MovingHorizonConfig

    def __init__(
        self, config: MovingHorizonConfig, model: CountedModel, mission: HorizonMission, unknown: Array
    ) -> None:
        """``unknown`` is the state that is returned before there is an estimate."""
        self.period = _period(mission)
        self._mission = mission
        self._model, self._builder = model, StageBuilder(model)
        self._horizon = MovingHorizon(model, config.stages, config.iterations, config.slope)
        interval = 1.0 / mission.position_rate if isinstance(mission, FlightMission) else self.period
        self._timeout_monitor = TimeoutMonitor(config.timeout, interval, of="readings that agree")
        self._reader = RangeReader(mission, config.timeout) if isinstance(mission, RangingMission) else None
        self._ranging = cast("RangingModel", model) if isinstance(mission, RangingMission) else None
        self._counts = ReadingCounts() if self._reader is None else self._reader.counts
        self._residuals = InnovationMean(_MOST)
        self._innovations = np.full((2, model.rows), np.nan)  # of the last call, and their deviations
        self._t: float | None = None  # [s] of the last call
        self._unknown = unknown
        self._errors: ReadingErrors | None = getattr(model, "reading_errors", None)  # of positions
        self._noisy = isinstance(mission, FlightMission) and mission.position_noise > 0.0
        self._monitor: InnovationMonitor | None = None  # a robot that reads ranges has one for each of them
        self._leaps: Leaps | None = None  # of a flight
        if isinstance(mission, FlightMission):
            axis = AxisModel.from_config(KalmanConfig(), mission)
            self._leaps = Leaps(axis, FixRows(axis.fix_std**2), interval)
        if isinstance(mission, MissileMission | FlightMission):
            what = "fixes" if isinstance(mission, FlightMission) else "readings"
            self._monitor = InnovationMonitor(what, model.rows, interval)

    @staticmethod
    def build(config: MovingHorizonConfig, mission: HorizonMission) -> Estimator:
        """Build the estimator of one run; of a robot that reads ranges with its monitor of integrity."""
        if isinstance(mission, RangingMission):
            from mathnavi.estimators.integrity.ranging import guarded
            from mathnavi.estimators.ranging.feasible_set_bank import pose_finder

            finder = partial(pose_finder, timeout=config.timeout)
            return guarded(partial(MovingHorizonEstimator._built, config), mission, finder=finder, most_out=0)
        return MovingHorizonEstimator._built(config, mission)

    @staticmethod
    def _built(config: MovingHorizonConfig, mission: HorizonMission) -> MovingHorizonEstimator:
        model = MovingHorizonEstimator.stagewise_model(config, mission)
        if isinstance(mission, LagrangianMission):
            return MovingHorizonEstimator(config, model, mission, mission.start_state)
        start = model.start(None)
        assert start is not None
        return MovingHorizonEstimator(config, model, mission, start[0])

    @staticmethod
    def stagewise_model(config: MovingHorizonConfig, mission: HorizonMission) -> CountedModel:
        """Model with noise of the mission's vehicle. Raises FieldError for a mechanism with parts that it lacks."""
        if isinstance(mission, LagrangianMission):
            from mathnavi.estimators.stagewise.lagrangian import NOISE_FLOOR, LagrangianModel

            require_modelled(mission.system, "estimator = moving_horizon", MODEL_FREE_ESTIMATORS)
            return LagrangianModel(mission, config.acceleration, NOISE_FLOOR)
        if isinstance(mission, RangingMission):
            from mathnavi.estimators.stagewise.ranging import RangingModel

            return RangingModel(mission)
        if isinstance(mission, MissileMission):
            from mathnavi.estimators.missile_kalman import MissileKalmanConfig
            from mathnavi.estimators.stagewise.missile import MissileModel

            return MissileModel.from_config(MissileKalmanConfig(), mission)
        from mathnavi.estimators.stagewise.flight import FlightModel

        return FlightModel.from_config(KalmanConfig(), _by_fixes(mission))

    @staticmethod
    def sensors(config: MovingHorizonConfig, mission: HorizonMission) -> tuple[Sensor, ...]:
        """Sensors that the vehicle has to carry for this estimator."""
        if isinstance(mission, RangingMission):
            return mission.sensors_carried()
        if isinstance(mission, MissileMission):
            return (mission.full_state_sensor(None),)
        if isinstance(mission, FlightMission):
            return Kalman.sensors(KalmanConfig(), _by_fixes(mission))
        return (mission.sensor,)

    @staticmethod
    def quality(config: MovingHorizonConfig, mission: HorizonMission) -> Any:
        """Quality in the mission's terms: that of the Kalman filter with the same model."""
        if isinstance(mission, RangingMission):
            return mission.ranging
        if isinstance(mission, MissileMission):
            return mission.full_state_covariance(0.0)
        return (
            Kalman.quality(KalmanConfig(timeout=config.timeout), _by_fixes(mission))
            if isinstance(mission, FlightMission)
            else None
        )

    @staticmethod
    def properties(config: MovingHorizonConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            Domain.LOCAL, Rate.ASYMPTOTIC, InputDependence.NON_UNIFORM, Domain.LOCAL, Domain.GLOBAL,
            note="as far as one Gauss-Newton iteration for each reading converges",
        )  # fmt: skip

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate at t [s] from the readings since the last call, ``command`` (nu,) held in between.

        ``extra["deviation"]`` (d,) are standard deviations of the model's errors, NaN before there are any;
        ``extra["innovations"]`` (m,) and ``extra["innovation_std"]`` (m,) are those of the numbers last read
        (``interfaces.innovations``), by the prediction from the newest stage before, whose covariance is that of the
        whole window with its arrival cost. ``extra`` also counts the readings that were not used.
        """
        horizon, lost = self._horizon, False
        self._innovations[:] = np.nan
        measurements = self._used(t, measurements, command)
        gone = self._t is not None and t - self._t > max(FARTHEST, 100.0 * self.period)
        astray = self._monitor is not None and self._monitor.in_a_row > _LASTING
        if (gone or astray) and self._model.restart():
            horizon.forget()
            self._builder.restart()
            if self._monitor is not None:
                self._monitor.begin_again()
        self._t = t
        try:
            for stage in self._builder.add(t, measurements, command):
                fresh = not horizon.started and self._model.start(None) is None  # it starts at a reading
                horizon.add(stage)
                self._test(stage, command, fresh=fresh)
                agreed = bool(stage.readings) and horizon.started and not horizon.failure and horizon.agrees
                if agreed:
                    fits = self._residuals.fits(np.square(horizon.residual), self._timeout_monitor.converged)
                    self._timeout_monitor.note(stage.t, agrees=fits)
        except (CutLocusError, np.linalg.LinAlgError, ArithmeticError):
            horizon.forget()
            lost = True
        if horizon.started:
            self._unknown = horizon.x
        P = horizon.P if horizon.started else np.full_like(horizon.P, np.nan)
        x, covariance = self._model.reported(self._unknown, 0.5 * (P + P.T))
        if not horizon.started:
            covariance = None
        status = self._timeout_monitor.status(t, covariance)
        if self._reader is not None:
            status = worst(status, self._reader.odometry_status(t))
        message = waiting(status, "readings that agree")
        if horizon.failure and status.usable:
            status, message = Status.SOLVER_FAILED, f"could not be solved: {horizon.failure}"
        elif (lost or not horizon.started) and status is not Status.INITIALISING:
            status, message = Status.LOST, "has no state that explains its readings"
        if self._ranging is not None:
            status, message = self._ranging.fit.judged(status), message or self._ranging.fit.doubt
        deviation = np.sqrt(np.maximum(np.diag(P), 0.0))
        extra = {"deviation": deviation, **published(self._innovations)}
        extra |= {**self._model.extra(self._unknown, P), **self._counts.extra}
        if self._monitor is not None:
            status, extra["integrity"] = worst(status, self._monitor.status(t)), np.array([self._monitor.ratio])
            covariance = None if covariance is None else self._monitor.inflation * covariance
            message = message or self._monitor.message
        if self._leaps is not None and self._monitor is not None:
            state = (self._unknown, P) if horizon.started else None
            alarming, surprising = self._monitor.alarming, self._monitor.surprising
            self._leaps.follow(t, command, None, lambda: state, alarming=alarming, surprising=surprising)
            if status is Status.OK and (doubt := self._leaps.doubt("fixes")):
                status, message = Status.DEGRADED, doubt
            if covariance is not None and (leapt := self._leaps.covariance) is not None:
                covariance = covariance.copy()
                covariance[:3, :3] += leapt
        message = message or self._timeout_monitor.message or ("" if self._reader is None else self._reader.message)
        estimate = Estimate(t, x, covariance, status, extra, message)
        if self._errors is not None:
            estimate = self._errors.doubted(estimate)
        return possible_or_lost(self._mission, estimate)

    def _test(self, stage: SmootherStage, command: Array, *, fresh: bool) -> None:
        """Test what was predicted for the readings of a stage, to which ``command`` (nu,) led; of one that was
        ``fresh`` the first predicts itself.
        """
        for k, (y, predicted) in enumerate(zip(stage.readings, self._horizon.predicted, strict=False)):
            if not fresh or k:
                self._keep_innovations(predicted)
            if self._ranging is not None:
                self._ranging.compare(self._horizon.x, self._horizon.P, y)
            if self._errors is not None:
                self._errors.expect(y, predicted.x[: len(y)])
            if self._monitor is not None and len(predicted.r) == self._model.rows:
                self._monitor.note(stage.t, predicted.r, predicted.S, np.eye(len(predicted.r)))
                if self._leaps is not None:
                    self._leaps.step(stage.t, command, y)

    def _keep_innovations(self, predicted: Predicted) -> None:
        noise = self._model.noise(predicted.x, predicted.y)
        known = predicted.known
        self._innovations[:, known] = noise[known] * predicted.r, noise[known] * np.sqrt(predicted.S.diagonal())

    def _used(self, t: float, measurements: Sequence[Measurement], command: Array) -> Sequence[Measurement]:
        """The readings but fixes that repeat one again and again; count those that are not used."""
        if self._reader is not None:
            self._reader.read(t, measurements, command)
        used = []
        for reading in measurements:
            reason = self._model.unused(reading)
            if reason is None and self._builder.is_late(reading.t):
                reason = Unused.LATE
            elif reason is None and self._noisy and self._monitor is not None:
                reason = Unused.OUTLIER if self._monitor.note_value(reading.t, reading.value) else None
            if reason is not None:
                self._counts.add(reason)
            if reason is not Unused.OUTLIER:
                used.append(reading)
        return used


def _by_fixes(mission: FlightMission) -> FlightMission:
    """Mission without the beacons that it may have: a window does not tell which image of a place is right."""
    return mission if mission.beacons is None else replace(mission, beacons=None)


def _period(mission: HorizonMission) -> float:
    """Time between two estimates [s]."""
    return mission.period if isinstance(mission, RangingMission | LagrangianMission) else mission.control_period
