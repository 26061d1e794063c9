"""Plug-ins that misbehave, for the study ``hunt``: planner, tracker and estimator of another author.

Each answers as the project's own part does, except at some of its calls, drawn at random: then it commits a misdeed. It
is a guest at the boundary of plug-ins (``mathnavi.interfaces.boundary``), and not installed.

What no boundary can notice is left out: an estimate that is wrong and consistent. The page on guarantees says so.
"""

from __future__ import annotations

import asyncio
import dataclasses
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, get_args

import numpy as np
from annotated_types import Interval

from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.quadrotor.plugin import QuadrotorConfig, QuadrotorFlight
from mathnavi.estimators.full_state import FullState, FullStateConfig
from mathnavi.estimators.quadrotor_state import QuadrotorState
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Plan, PlanRequest, Status
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.quadrotor.dynamics import NOMINAL, ROTOR_COUNT
from mathnavi.models.quadrotor.mission import QuadrotorMission

Share = Annotated[float, Interval(ge=0.0, le=1.0)]
PlannerMisdeed = Literal[
    "none", "raises", "exits", "cancelled", "none-at-all", "lists", "nan", "torn", "other-status", "never-ready",
    "elsewhere", "dive", "moves-estimate", "moves-plan", "forges", "keeps",
]  # fmt: skip
TrackerMisdeed = Literal[
    "none", "raises", "cancelled", "lists", "nan", "another-size", "huge", "dive", "random", "moves-estimate",
    "moves-plan", "widens-bound",
]  # fmt: skip
EstimatorMisdeed = Literal[
    "none", "raises", "cancelled", "none-at-all", "lists", "text", "masked", "nan", "nine", "covariance-lists",
    "covariance-nan", "covariance-torn", "covariance-nine", "negative", "stale", "future", "other-status", "gust",
    "words", "half", "bare", "blank", "jumps", "far", "unsure", "lost", "moves-command", "keeps",
]  # fmt: skip


class Instants:
    """Calls at which a misdeed is committed: from instants drawn at random on, for a number of calls."""

    def __init__(self, share: float, calls: int, rng: np.random.Generator) -> None:
        self._share, self._calls, self._rng, self._left = share, calls, rng, 0

    def now(self) -> bool:
        """Return True if it is committed at this call."""
        if not self._left and self._rng.random() < self._share:
            self._left = self._calls
        committed = self._left > 0
        self._left -= committed
        return committed


Commands = Callable[[np.random.Generator], dict[str, Array]]


class OtherStatus:
    """A status of no kind that is known."""

    name = "GUARANTEE_HELD"
    value = "held"


@configuration
class Misdeeds:
    """Fields of a controller that misbehaves."""

    misdeed: PlannerMisdeed = "none"
    """misdeed of the planner"""
    tracker_misdeed: TrackerMisdeed = "none"
    """misdeed of the tracker"""
    share: Share = 0.5
    """share of the calls at which it begins to be committed, 0 to 1"""
    calls: Count = 1
    """number of calls running at which it is committed then"""
    draw: int = 0
    """seed by which these calls are drawn"""


@configuration
class HostileFlightConfig(Misdeeds, FlightConfig):
    """Fields of the controller."""


class HostileFlight(FlightController):
    """The controller ``flight`` with a planner and a tracker that misbehave."""

    Config = HostileFlightConfig

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        """Return planner and tracker."""
        assert isinstance(config, HostileFlightConfig)
        return _misbehaving(FlightController.build(config, mission), config, _point_mass)


def _misbehaving(parts: tuple[Planner, Any], config: Misdeeds, others: Commands) -> tuple[Planner, Tracker]:
    """Return planner and tracker that misbehave, in place of ``parts``; ``others`` as of ``HostileTracker``."""
    planner, tracker = parts
    rng = np.random.default_rng(config.draw)
    return HostilePlanner(planner, config, rng), HostileTracker(tracker, config, rng, others)


def _point_mass(rng: np.random.Generator) -> dict[str, Array]:
    """Accelerations (3,) [m/s^2] down, and in any direction."""
    return {"dive": np.array([0.0, 0.0, -50.0]), "random": 20.0 * rng.normal(size=3)}


@configuration
class HostileQuadrotorConfig(Misdeeds, QuadrotorConfig):
    """Fields of the controller."""


class HostileQuadrotor(QuadrotorFlight):
    """The controller ``quadrotor`` with a planner and a tracker that misbehave."""

    Config = HostileQuadrotorConfig

    @staticmethod
    def build(config: QuadrotorConfig, mission: QuadrotorMission) -> tuple[Planner, Tracker]:
        """Return planner and tracker."""
        assert isinstance(config, HostileQuadrotorConfig)
        return _misbehaving(QuadrotorFlight.build(config, mission), config, _rotors)


def _rotors(rng: np.random.Generator) -> dict[str, Array]:
    """Thrusts (4,) [N] of rotors that stand still, and any, also beyond their bounds."""
    return {"dive": np.zeros(ROTOR_COUNT), "random": NOMINAL.thrust_max * rng.normal(0.5, 0.5, ROTOR_COUNT)}


def _write(values: Any, offset: float) -> None:
    """Change an array in place by every way that a plug-in might try."""
    for array in (values, getattr(values, "base", None)):
        if isinstance(array, np.ndarray):
            try:
                array.setflags(write=True)
                array += offset
            except ValueError:
                pass


class HostilePlanner:
    """Planner that misbehaves."""

    guest = True

    def __init__(self, planner: Planner, config: Misdeeds, rng: np.random.Generator) -> None:
        self.period = planner.period
        self._planner, self._config = planner, config
        self._instants = Instants(config.share, config.calls, rng)
        self._kept: list[Plan] = []

    def __getattr__(self, name: str) -> Any:
        """Other attributes of the planner, for instance for a fleet."""
        return getattr(self._planner, name)

    def plan(self, request: PlanRequest) -> Any:
        """Return a plan, or commit the misdeed."""
        misdeed = self._config.misdeed
        for plan in self._kept:
            plan.x[..., 2] -= 1000.0
        self._kept.clear()
        if misdeed == "none" or not self._instants.now():
            return self._planner.plan(request)
        if misdeed == "moves-estimate":
            _write(request.estimate.x, 300.0)
            object.__setattr__(request.estimate, "x", request.estimate.x + 300.0)
        if misdeed == "moves-plan" and request.current is not None:
            _write(request.current.x, -300.0)
            object.__setattr__(request.current, "x", request.current.x - 300.0)
        return self._spoilt(self._planner.plan(request), misdeed)

    def _spoilt(self, plan: Plan, misdeed: PlannerMisdeed) -> Any:
        if misdeed == "raises":
            raise RuntimeError("a bug")
        if misdeed == "cancelled":
            raise asyncio.CancelledError
        if misdeed == "exits":
            raise SystemExit(3)
        if misdeed == "none-at-all":
            return None
        if misdeed == "lists" or not plan.ok:
            return dataclasses.replace(plan, t=plan.t.tolist(), x=plan.x.tolist(), u=plan.u.tolist())
        x = plan.x.copy()
        answers: dict[str, Callable[[], Any]] = {
            "nan": lambda: dataclasses.replace(plan, x=np.full_like(x, np.nan)),
            "torn": lambda: dataclasses.replace(plan, u=plan.u[1:]),
            "other-status": lambda: dataclasses.replace(plan, status=OtherStatus()),  # type: ignore[arg-type]
            "never-ready": lambda: dataclasses.replace(plan, ready=np.inf),
            "elsewhere": lambda: dataclasses.replace(plan, x=x + np.array([50.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
            "dive": lambda: dataclasses.replace(plan, x=x - np.outer(np.linspace(0.0, 500.0, len(x)), np.eye(6)[2])),
            "forges": lambda: Plan.failure(Status.SOLVER_FAILED, notes=("guarantee-held", "rebased", "fallback-plan")),
            "keeps": lambda: self._keep(dataclasses.replace(plan, x=x)),
        }
        return answers[misdeed]() if misdeed in answers else plan

    def _keep(self, plan: Plan) -> Plan:
        self._kept.append(plan)
        return plan


class HostileTracker:
    """Tracker that misbehaves."""

    guest = True

    def __init__(
        self,
        tracker: Any,
        config: Misdeeds,
        rng: np.random.Generator,
        others: Commands,
    ) -> None:
        """``others`` are commands of the vehicle that lead elsewhere, by the misdeed."""
        self.period, self.bound, self.held = tracker.period, tracker.bound, getattr(tracker, "held", None)
        self._tracker, self._config, self._rng, self._others = tracker, config, rng, others
        self._instants = Instants(config.share, config.calls, rng)

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Any:
        """Return a command, or commit the misdeed."""
        misdeed = self._config.tracker_misdeed
        u = self._tracker.command(t, estimate, plan)
        if misdeed == "none" or not self._instants.now():
            return u
        if misdeed == "raises":
            raise RuntimeError("a bug")
        if misdeed == "cancelled":
            raise asyncio.CancelledError
        if misdeed == "moves-estimate":
            _write(estimate.x, 300.0)
            object.__setattr__(estimate, "x", estimate.x + 300.0)
        if misdeed == "moves-plan":
            _write(plan.x, -300.0)
            object.__setattr__(plan, "x", plan.x - 300.0)
        others = self._others(self._rng)
        if misdeed == "widens-bound":  # and uses it
            object.__setattr__(self.bound, "horizontal", 1e9)
            object.__setattr__(self.bound, "vertical", 1e9)
            return others["dive"]
        answers: dict[str, Any] = {
            "lists": u.tolist(), "nan": u * np.nan, "another-size": np.zeros(len(u) + 1), "huge": u + 1e6,
            **others,
        }  # fmt: skip
        return answers.get(misdeed, u)


class _Misdeeds:
    """The misbehaviour of an estimator, in place of its answer."""

    def __init__(self, config: HostileFullStateConfig) -> None:
        self._misdeed, self._rng = config.misdeed, np.random.default_rng(config.draw)
        self._instants = Instants(config.share, config.calls, self._rng)
        self._past: list[Estimate] = []
        self._jumps = 0

    def answer(self, t: float, good: Estimate, command: Array) -> Any:
        """Return the good estimate, or commit the misdeed."""
        self._past.append(good)
        misdeed = self._misdeed
        if misdeed == "none" or not self._instants.now():
            return good
        if misdeed == "raises":
            raise RuntimeError("a bug")
        if misdeed == "cancelled":
            raise asyncio.CancelledError
        if misdeed == "moves-command":
            _write(command, -50.0)
        if misdeed == "keeps" and len(self._past) > 1:
            _write(self._past[-2].x, 300.0)
        n = len(good.x)
        self._jumps += 1  # each to a place of its own: two that agree are a consistent lie
        P = np.eye(n) if good.covariance is None else good.covariance
        stale = next((each for each in reversed(self._past) if each.t <= t - 1.0), self._past[0])
        answers: dict[str, Any] = {
            "none-at-all": None,
            "lists": dataclasses.replace(good, x=good.x.tolist()),
            "text": dataclasses.replace(good, x=good.x.astype(str)),
            "masked": dataclasses.replace(good, x=np.ma.masked_array(good.x, np.arange(n) == 2)),
            "nan": dataclasses.replace(good, x=good.x * np.nan),
            "nine": dataclasses.replace(good, x=np.zeros(9)),
            "covariance-lists": dataclasses.replace(good, covariance=P.tolist()),
            "covariance-nan": dataclasses.replace(good, covariance=P * np.nan),
            "covariance-torn": dataclasses.replace(good, covariance=P + np.triu(np.ones(P.shape), 1)),
            "covariance-nine": dataclasses.replace(good, covariance=np.eye(9)),
            "negative": dataclasses.replace(good, covariance=-P - np.eye(len(P))),
            "stale": stale,
            "future": dataclasses.replace(good, t=t + 1.0),
            "other-status": dataclasses.replace(good, status=OtherStatus()),  # type: ignore[arg-type]
            "gust": dataclasses.replace(good, extra={**good.extra, "gust": np.zeros(2)}),
            "words": dataclasses.replace(good, extra={**good.extra, "gust": np.array(["a", "b", "c"])}),
            "half": dataclasses.replace(good, extra={**good.extra, "gust": np.zeros(3, np.float16)}),
            "bare": dataclasses.replace(good, extra={}),
            "blank": dataclasses.replace(good, extra={name: np.zeros_like(each) for name, each in good.extra.items()}),
            "jumps": dataclasses.replace(good, x=good.x + 100.0 * self._jumps * np.eye(n)[self._rng.integers(3)]),
            "far": dataclasses.replace(good, x=good.x + 1e200),
            "unsure": dataclasses.replace(good, covariance=P + 1e4 * np.eye(len(P))),
            "lost": dataclasses.replace(good, status=Status.LOST),
        }
        return answers.get(misdeed, good)


@configuration
class HostileFullStateConfig(FullStateConfig):
    """Fields of the estimator."""

    misdeed: EstimatorMisdeed = "none"
    """misdeed of the estimator"""
    share: Share = 0.5
    """share of the calls at which it begins to be committed, 0 to 1"""
    calls: Count = 1
    """number of calls running at which it is committed then"""
    draw: int = 0
    """seed by which these calls are drawn"""


class HostileFullState(FullState):
    """The estimator ``full_state``, misbehaving."""

    Config = HostileFullStateConfig
    guest = True

    def __init__(self, config: HostileFullStateConfig, mission: Any) -> None:
        super().__init__(config, mission)
        self._misdeeds = _Misdeeds(config)

    @staticmethod
    def build(config: FullStateConfig, mission: Any) -> HostileFullState:
        """Build the estimator of one run."""
        assert isinstance(config, HostileFullStateConfig)
        return HostileFullState(config, mission)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Any:
        """Return the estimate, or commit the misdeed."""
        return self._misdeeds.answer(t, super().update(t, measurements, command), command)


class HostileQuadrotorState(QuadrotorState):
    """The estimator ``quadrotor_state``, misbehaving."""

    Config = HostileFullStateConfig
    guest = True

    def __init__(self, config: HostileFullStateConfig, mission: Any) -> None:
        super().__init__(config, mission)
        self._misdeeds = _Misdeeds(config)

    @staticmethod
    def build(config: FullStateConfig, mission: Any) -> HostileQuadrotorState:
        """Build the estimator of one run."""
        assert isinstance(config, HostileFullStateConfig)
        return HostileQuadrotorState(config, mission)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Any:
        """Return the estimate, or commit the misdeed."""
        return self._misdeeds.answer(t, super().update(t, measurements, command), command)


MISDEEDS = {
    "planner.misdeed": get_args(PlannerMisdeed),
    "planner.tracker_misdeed": get_args(TrackerMisdeed),
    "estimator.misdeed": get_args(EstimatorMisdeed),
}
"""misdeeds by the field that asks for them"""
