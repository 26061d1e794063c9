"""The plug-in ``riemannian_observer``: velocities from positions and forces, without coordinates (Paper D)."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Le

from mathnavi.estimators.riemannian.gains import (
    DEFAULT_BANDWIDTH,
    BandwidthTuning,
    CurvatureName,
    GainName,
    IntrinsicGains,
)
from mathnavi.estimators.riemannian.sampled import SampledIntrinsicObserver
from mathnavi.estimators.velocity.chain_opening import ChainOpening, residual_of
from mathnavi.estimators.velocity.gain_covariance import GainCovariance, Residual
from mathnavi.estimators.velocity.model_learning import ModelLearning
from mathnavi.estimators.velocity.position_observer import TIME_CONSTANTS, PositionObserver
from mathnavi.estimators.velocity.readings import (
    OutlierCounter,
    SpeedGate,
    innovation,
    reading_variance,
    rounding_steps,
)
from mathnavi.estimators.velocity.safe_answer import SafeAnswer
from mathnavi.interfaces.bounds import Positive, PositiveFraction, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.system import MODEL_FREE_ESTIMATORS, Step, require_modelled, stepped, uncertain_parameters

_FASTEST = 1e4  # [1/s]


@configuration
class RiemannianObserverConfig:
    """Fields of ``--estimator``."""

    kernels: ClassVar[str] = "mathnavi.estimators.velocity.ahead"  # compiled before the first run

    bandwidth: Annotated[Positive, Le(_FASTEST)] | None = None
    """bandwidth omega of the constant gains A = 2 zeta omega and B = omega^2 [1/s]; tuned, or 10, if not given"""
    tuning: Literal["auto", "innovations", "none"] = "auto"
    """tuning of bandwidths by the innovations; auto: if bandwidth is not given and the model has servos, damping,
    limits, contacts or friction"""
    damping: Positive = 1.0
    """damping ratio zeta of the constant gains"""
    gains: GainName = "constant"
    """gains A and B: constant, or as printed in the example of D.5"""
    curvature: CurvatureName = "minus-one"
    """gain C of the curvature term: -1, that of Theorem D.2 (matched), zero or 1"""
    disturbance: bool = False
    """whether a force that the model lacks is estimated too, and transported; always if bandwidths are tuned"""
    share: PositiveFraction = 0.9
    """share of the injectivity radius within which readings are used"""
    timeout: Positive = 0.5
    """time without a usable reading after which the estimate is lost [s]"""

    def __post_init__(self) -> None:
        special = self.gains != "constant" or self.damping != 1.0
        if self.disturbance and special:
            raise FieldError(
                f"disturbance = True with gains = {self.gains} and damping = {self.damping:g}; allowed: with constant "
                "gains and damping = 1"
            )
        if self.tuning == "innovations" and (special or self.bandwidth is not None):
            raise FieldError(
                f"tuning = 'innovations' with gains = {self.gains}, damping = {self.damping:g} and bandwidth = "
                f"{self.bandwidth}; allowed: with constant gains, damping = 1 and no bandwidth"
            )

    def tuned(self, mission: LagrangianMission) -> bool:
        """True if bandwidths are tuned by the innovations of this mission."""
        if self.tuning != "auto":
            return self.tuning == "innovations"
        special = self.gains != "constant" or self.damping != 1.0
        may_err = mission.system.velocity_dependent or stepped(mission.system) is not None
        return may_err and self.bandwidth is None and not special


class RiemannianObserver:
    """The intrinsic observer (D.6) of a Lagrangian system."""

    Config = RiemannianObserverConfig

    @staticmethod
    def build(config: RiemannianObserverConfig, mission: LagrangianMission) -> PositionObserver:
        """Build the estimator of one run.

        Raises FieldError for the matched C on a space without constant curvature, for a tuning where vectors are not
        stored as their components, and for a system with parts that are not modelled.
        """
        require_modelled(mission.system, "estimator = riemannian_observer", MODEL_FREE_ESTIMATORS)
        judged = config.tuned(mission) or stepped(mission.system) is not None
        safe = SafeAnswer(mission, config.timeout) if judged else None
        return PositionObserver(_Intrinsic(config, mission), mission, config.timeout, safe)

    @staticmethod
    def sensors(config: RiemannianObserverConfig, mission: LagrangianMission) -> tuple[Sensor, ...]:
        """Sensors that the system has to carry for this estimator."""
        return (mission.sensor,)

    @staticmethod
    def quality(config: RiemannianObserverConfig, mission: LagrangianMission) -> None:
        """Return None: no plan is certified from these estimates."""

    @staticmethod
    def properties(config: RiemannianObserverConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        if config.gains == "printed":
            return ObserverProperties(
                Domain.NONE, Rate.NONE, InputDependence.NON_UNIFORM, Domain.LOCAL, Domain.GLOBAL,
                note="the position converges; A ~ S^(-1/2) makes S = 0 a sliding set on which the velocity error stays",
            )  # fmt: skip
        if config.curvature in ("none", "plus-one"):
            return ObserverProperties(
                Domain.LOCAL, Rate.EXPONENTIAL, InputDependence.SEMI_UNIFORM, Domain.LOCAL, Domain.GLOBAL,
                note="without C = -1 it converges up to a speed of the motion only, lower on a more curved space",
            )  # fmt: skip
        return ObserverProperties(
            Domain.SEMI_GLOBAL, Rate.EXPONENTIAL, InputDependence.SEMI_UNIFORM, Domain.LOCAL, Domain.GLOBAL,
            note="from xi = x and any velocity up to about 3 omega, within the injectivity radius",
        )  # fmt: skip


class _Intrinsic:
    """A ``VelocityLaw``.

    Readings that the system cannot have reached, or that are beyond the share of the injectivity radius, are refused
    unless they persist.
    """

    state_covariance: Array | None = None

    def __init__(self, config: RiemannianObserverConfig, mission: LagrangianMission) -> None:
        manifold = mission.system.manifold
        if config.curvature == "matched" and manifold.kappa is None:
            raise FieldError(
                f"curvature = 'matched' on {manifold.name}; allowed where the curvature is not constant: minus-one, "
                "none, plus-one"
            )
        self._tuned = config.tuned(mission)
        if self._tuned and manifold.vector_size != manifold.dimension:
            raise FieldError(f"tuning = 'innovations' on {manifold.name}; allowed: on mechanisms and attitudes")
        kappa = manifold.kappa or 0.0
        self._config, self._mission, self._manifold = config, mission, manifold
        omega = config.bandwidth or DEFAULT_BANDWIDTH
        self._gains = IntrinsicGains(omega, config.damping, config.gains, config.curvature, kappa)
        self.settling = 0.0 if self._tuned else TIME_CONSTANTS / (omega * min(config.damping, 1.0 / config.damping))
        if config.gains == "printed":  # its velocity does not converge
            self.settling = np.inf
        self._observer: SampledIntrinsicObserver | None = None
        self._distance = np.nan
        self._tuning: BandwidthTuning | None = None
        self._errors = GainCovariance(manifold.dimension)
        self._opening = ChainOpening.of(mission.system, mission.period)
        uncertain = uncertain_parameters(mission.system) if self._tuned else None
        self._learning = None if uncertain is None else ModelLearning(uncertain)
        self._learned_step: Step | None = None
        self._t, self._u = 0.0, np.zeros(len(mission.system.inputs))  # [s] of the last prediction, and its input
        self.residual: Residual | None = None
        self._learned: tuple[Array, Array] | None = None  # variance and steps (n,), if they are not the declared ones

    @property
    def state(self) -> Array:
        assert self._observer is not None
        if self._opening is not None:
            return self._opening.added(self._observer.xi, self._observer.eta)
        return np.concatenate([self._observer.xi, self._observer.eta])

    @property
    def extra(self) -> dict[str, Array]:
        """The distance between the last reading and its prediction, the disturbance and the bandwidths."""
        delta = None if self._observer is None else self._observer.delta
        nothing = np.zeros(self._manifold.vector_size)
        found = {"innovation": np.array([self._distance]), "disturbance": nothing if delta is None else delta}
        if not self._tuned:
            return found
        omega = np.full(self._manifold.dimension, np.nan) if self._tuning is None else self._tuning.omega
        return {**found, "bandwidth": omega}

    @property
    def deviation(self) -> Array:
        """Standard deviations (2 n,) of the components of position and velocity, by the gains and the noise alone."""
        known = self._errors.deviation
        return known if self._opening is None else self._opening.deviation(known)

    def start(self, y: Array) -> None:
        config = self._config
        self._distance, self._since, self._y = 0.0, 0.0, y  # the last reading that was used, and how old it is [s]
        mission, disturbed = self._mission, config.disturbance or self._tuned
        variance, steps = self._learned or (reading_variance(mission, y), rounding_steps(mission, y))
        self._gate, self._outlier_counter = SpeedGate(mission, y, variance), OutlierCounter()
        self._errors.start(variance, steps, mission.speed_max)
        if self._opening is not None:
            self._opening.start(variance, steps)
        self.residual = None
        if self._tuned:
            self._tuning = BandwidthTuning(mission.period, variance, steps)
        self._observer = SampledIntrinsicObserver(
            mission.system, self._gains, y, disturbed=disturbed, share=config.share, tuning=self._tuning
        )
        if self._learning is not None and self._learned_step is not None:  # it may be what was learned that was wrong
            self._learning, self._learned_step = ModelLearning(self._learning.parameters), None

    def learn(self, variance: Array, steps: Array) -> None:
        """Assume these errors of a reading from now on."""
        self._learned = (variance, steps)
        self._errors.learn(variance, steps)
        self._gate.learn(variance)
        if self._opening is not None:
            self._opening.learn(variance, steps)
        if self._tuning is not None:
            self._tuning.learn(variance, steps)

    def predict(self, h: float, u: Array, y: Array | None) -> None:
        assert self._observer is not None
        self._since += h
        reached = y is not None and self._is_reached(y)
        self._observer.predict(h, u, y if reached else None)
        self._errors.predict(h, self._observer.constraint_acceleration)
        if self._opening is not None:
            self._opening.predict(h)
        if self._learning is not None:
            self._learning.touch(self._observer.touching)
        self._t, self._u = self._t + h, u

    def correct(self, y: Array, h: float) -> bool:
        assert self._observer is not None
        reached = self._is_reached(y)
        before, rate = self._observer.xi, self._observer.eta
        found = self._observer.correct(y, h) if reached else None
        self.residual = None
        self._distance = self._manifold.distance(self._observer.xi, y) if found is None else found.distance
        good = found is not None and found.accepted
        if not self._outlier_counter.admits(good):
            return False
        if found is not None and found.components is not None:
            alpha, beta, gamma = (
                each if isinstance(each, np.ndarray) else np.full(len(found.components), each) for each in found.weights
            )
            rate = self._manifold.components(before, rate)
            self._errors.correct(found.components, (alpha, beta, gamma), rate, h)
            opened = None
            if self._opening is not None and found.across is not None:
                opened = self._opening.correct(before, found.across, rate, h)
            self.residual = residual_of(found.components, self._errors.predicted, alpha, opened)
            self._learn_model(y)
            self._y, self._since = y, 0.0
        else:
            self.start(y)
        return True

    @property
    def doubt(self) -> str:
        """Assumption that the readings contradict and have not shown enough of; "" if there is nothing."""
        doubted = self._learning is not None and self._learning.found and not self._learning.known
        return "has a model whose gains, friction or load are not those of the readings" if doubted else ""

    def _learn_model(self, y: Array) -> None:
        """Learn the parameters of the model from a reading y (size,), and use them once they are known."""
        step = None if self._learning is None else self._learning.read(self._t, y, self._u)
        if step is not None and self._observer is not None:
            self._learned_step = step
            self._observer.use(step)

    def _is_reached(self, y: Array) -> bool:
        """True if the system can have reached y since the last reading."""
        moved = innovation(self._manifold, self._y, y)
        return moved is not None and self._gate.passes(moved, self._since)
