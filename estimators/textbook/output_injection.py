"""The plug-in ``output_injection``: Luenberger's observer in coordinates that are linear up to output injection (2.3).

z' = A z - g(y, u) + L (y~ - C z),   x^ = T_1^{-1}(z),      d/dt (z - x~) = (A - L C)(z - x~)
"""

from __future__ import annotations

import casadi
import numpy as np

from mathnavi.estimators.textbook.sampled_observer import ObserverLaw, Poles, SampledObserver, check_system
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.library import SYSTEMS
from mathnavi.models.textbook.maps import of_numbers
from mathnavi.models.textbook.mission import TextbookMission


@configuration
class OutputInjectionConfig:
    """Fields of ``--estimator``."""

    poles: Poles = (-2.0, -3.0)
    """eigenvalues of A - L C [1/s]"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


class OutputInjection:
    """Luenberger's observer where the dynamics are linear up to output injection (2.3)."""

    Config = OutputInjectionConfig

    @staticmethod
    def build(config: OutputInjectionConfig, mission: TextbookMission) -> SampledObserver:
        """Build the observer of one run.

        Raises FieldError for a system without such coordinates, and for poles that do not fit.
        """
        form = mission.system.form
        check_system(form is not None, mission, ", ".join(name for name, other in SYSTEMS.items() if other.form))
        assert form is not None
        L, n = form.gain(config.poles), len(form.A)
        to_x = of_numbers(form.T_1_inverse, n)

        def rate(z: casadi.SX, u: casadi.SX, y: casadi.SX) -> casadi.SX:
            return casadi.DM(form.A) @ z - form.g(y, u) + casadi.DM(L) @ (form.T_2(y) - casadi.DM(form.C) @ z)

        def found(z: Array, near: Array) -> Array | None:
            x = to_x(z)
            return x if np.isfinite(x).all() else None

        return SampledObserver(ObserverLaw(n, rate, of_numbers(form.T_1, n), found), mission, config.timeout)

    @staticmethod
    def sensors(config: OutputInjectionConfig, mission: TextbookMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: OutputInjectionConfig, mission: TextbookMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: OutputInjectionConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            Domain.GLOBAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.GLOBAL, Domain.GLOBAL,
            note="in Z with the rates of its poles, where T_1 is a diffeomorphism of the whole space",
        )  # fmt: skip
