"""The plug-in ``example_2_2``: the observer of Example 2.2, as printed. Its error is linear under any input."""

from __future__ import annotations

import casadi

from mathnavi.estimators.textbook.sampled_observer import (
    ObserverLaw,
    RateOfError,
    SampledObserver,
    check_system,
    identity,
)
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.models.textbook.library import EXAMPLE_2_2, observer
from mathnavi.models.textbook.mission import TextbookMission


@configuration
class Example22Config:
    """Fields of ``--estimator``."""

    alpha: RateOfError = 2.0
    """gain of the correction of x_1; the observer converges for alpha > 0 and beta > 0"""
    beta: RateOfError = 3.0
    """gain of the correction of x_2"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


class Example22:
    """The observer of Example 2.2."""

    Config = Example22Config

    @staticmethod
    def build(config: Example22Config, mission: TextbookMission) -> SampledObserver:
        """Build the observer of one run.

        Raises FieldError for a system other than that of the example.
        """
        check_system(mission.system is EXAMPLE_2_2, mission, EXAMPLE_2_2.name)

        def rate(z: casadi.SX, u: casadi.SX, y: casadi.SX) -> casadi.SX:
            return observer(z, u, y, config.alpha, config.beta)

        return SampledObserver(ObserverLaw(3, rate, identity, identity), mission, config.timeout)

    @staticmethod
    def sensors(config: Example22Config, mission: TextbookMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: Example22Config, mission: TextbookMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: Example22Config) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        if config.alpha > 0.0 and config.beta > 0.0:
            return ObserverProperties(
                Domain.GLOBAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
                note="as long as the solution has not escaped",
            )  # fmt: skip
        return ObserverProperties(
            Domain.NONE, Rate.NONE, InputDependence.NON_UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
            note="alpha or beta is not positive: the error does not decay",
        )  # fmt: skip
