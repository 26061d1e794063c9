"""The plug-in ``filtered_differences``: the velocity without a model, see ``differences``."""

from __future__ import annotations

from mathnavi.estimators.velocity.differences import Differences
from mathnavi.estimators.velocity.position_observer import PositionObserver
from mathnavi.interfaces.bounds import NonNegative, Positive, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.models.manifold.mission import LagrangianMission


@configuration
class FilteredDifferencesConfig:
    """Fields of ``--estimator``."""

    cutoff: NonNegative = 20.0
    """frequency at which the filter's gain is 1 / sqrt(2) [Hz]; 0 for unfiltered differences"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


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
        return PositionObserver(Differences(config.cutoff, config.timeout, mission), mission, config.timeout)

    @staticmethod
    def sensors(config: FilteredDifferencesConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: FilteredDifferencesConfig, mission: LagrangianMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: FilteredDifferencesConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1): it lags by half a period and by the lag of the filter."""
        return ObserverProperties(
            Domain.NONE, Rate.NONE, InputDependence.NON_UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
            stays_on_truth=False, note="without noise the error of v is its lag times the acceleration",
        )  # fmt: skip
