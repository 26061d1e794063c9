"""The observers of the Introduction: the plug-ins ``example_2_2``, ``output_injection`` and ``kazantzis_kravaris``.

**Example 2.2**, as printed: its error is linear under any input.

**Output injection**: Luenberger's observer in coordinates that are linear up to output injection (2.3).

    z' = A z - g(y, u) + L (y~ - C z),   x^ = T_1^{-1}(z),      d/dt (z - x~) = (A - L C)(z - x~)

**Kazantzis and Kravaris**: an observer whose error is linear in the coordinates x~ = T(x) (2.4).

With x~' = A x~ - g(y) and A Hurwitz, in these coordinates

    z' = A z - g(y),   x^ = T^{-1}(z),          d/dt (z - x~) = A (z - x~),

or in the original ones

    x^' = F(x^, u) + [dT/dx^]^{-1} [g(h(x^)) - g(y)].

The thesis prints (2.4) with the opposite sign, g(y) - g(h(x^)), which drives T(x^) away; this form can be run too. T is
exact if coordinates are known that are linear up to output injection, and otherwise a power series.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import casadi
import numpy as np

from mathnavi.estimators.textbook.sampled_observer import (
    ObserverLaw,
    Poles,
    RateOfError,
    SampledObserver,
    check_system,
    identity,
)
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.textbook.library import EXAMPLE_2_2, SYSTEMS, error_dynamics, observer
from mathnavi.models.textbook.maps import inverse, of_numbers
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.textbook.power_series import solved
from mathnavi.models.textbook.system import System


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

        slowest = -float(np.linalg.eigvals(error_dynamics(config.alpha, config.beta)).real.max())
        return SampledObserver(ObserverLaw(3, rate, identity, identity), mission, config.timeout, slowest)

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

        law, slowest = ObserverLaw(n, rate, of_numbers(form.T_1, n), found), -max(config.poles)
        return SampledObserver(law, mission, config.timeout, slowest)

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


Form = Literal["z", "corrected", "printed"]


@configuration
class KazantzisKravarisConfig:
    """Fields of ``--estimator``."""

    form: Form = "z"
    """form of the observer: in the coordinates x~, (2.4) with the sign corrected, or (2.4) as printed"""
    poles: Poles = (-2.0, -3.0)
    """eigenvalues of A [1/s]"""
    order: int = 9
    """order of the power series of T, which is used if T is not known exactly"""
    timeout: Positive = 0.5
    """time without a reading after which the estimate is lost [s]"""


@dataclass(frozen=True, eq=False)
class Immersion:
    """Immersion x~ = T(x) with x~' = A x~ - g(y, u)."""

    T: Callable[[casadi.SX], casadi.SX]  # (n,) -> (n,)
    A: Array  # (n, n)
    g: Callable[[casadi.SX, casadi.SX], casadi.SX]  # (y (m,), u (p,)) -> (n,)

    @staticmethod
    def for_system(system: System, poles: tuple[float, ...], order: int) -> Immersion:
        """Immersion in which A has the eigenvalues ``poles`` [1/s].

        Raises ValueError for a system or for poles that do not fit.
        """
        form = system.form
        if form is None:
            n = len(system.states)
            return Immersion(solved(system, poles, order), np.diag(poles), lambda y, u: -casadi.repmat(y, n, 1))
        L = casadi.DM(form.gain(poles))
        return Immersion(form.T_1, form.A - np.array(L) @ form.C, lambda y, u: form.g(y, u) - L @ form.T_2(y))


class KazantzisKravaris:
    """The observer of Kazantzis and Kravaris, in z or as (2.4)."""

    Config = KazantzisKravarisConfig

    @staticmethod
    def build(config: KazantzisKravarisConfig, mission: TextbookMission) -> SampledObserver:
        """Build the observer of one run.

        Raises ValueError for a system or for poles that do not fit.
        """
        system, n = mission.system, len(mission.system.states)
        immersion = Immersion.for_system(system, config.poles, config.order)
        T, A, g = immersion.T, casadi.DM(immersion.A), immersion.g
        x, u = casadi.SX.sym("x", n), casadi.SX.sym("u", len(system.inputs))
        y, slowest = casadi.SX.sym("y", len(system.outputs)), -max(config.poles)
        if config.form == "z":
            F = casadi.Function("F", [x, u, y], [A @ x - g(y, u)])  # x stands for z
            law = ObserverLaw(n, F, of_numbers(T, n), inverse(T, n))
            return SampledObserver(law, mission, config.timeout, slowest)
        correction = casadi.solve(casadi.jacobian(T(x), x), g(system.h(x, u), u) - g(y, u))
        sign = -1.0 if config.form == "printed" else 1.0
        F = casadi.Function("F", [x, u, y], [system.f(x, u) + sign * correction])
        decays = slowest if config.form == "corrected" else 0.0
        return SampledObserver(ObserverLaw(n, F, identity, identity), mission, config.timeout, decays)

    @staticmethod
    def sensors(config: KazantzisKravarisConfig, mission: TextbookMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: KazantzisKravarisConfig, mission: TextbookMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: KazantzisKravarisConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        series = "where T is a series, only near the origin and to its truncation"
        if config.form == "z":
            return ObserverProperties(
                Domain.GLOBAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.GLOBAL, Domain.LOCAL,
                note=f"in Z with the rates of its poles; {series}",
            )  # fmt: skip
        if config.form == "corrected":
            return ObserverProperties(
                Domain.LOCAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.LOCAL, Domain.LOCAL,
                note=f"as long as dT/dx is regular along x^; {series}",
            )  # fmt: skip
        return ObserverProperties(
            Domain.NONE, Rate.NONE, InputDependence.NON_UNIFORM, Domain.GLOBAL, Domain.LOCAL,
            note="(2.4) as printed: a sign is wrong, and the error does not decay",
        )  # fmt: skip
