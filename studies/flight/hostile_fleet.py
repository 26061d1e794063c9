"""Coordinators and consensus that misbehave, for the study ``hunt``: the vehicles of a fleet are written by others.

Each answers as the project's own part does, except at some of its calls, drawn at random: then it commits a misdeed. A
consensus is chosen by the fields of ``simultaneous-arrival``; coordinators are no plug-ins of a scenario, so that
``HostileArrival`` is that scenario with others in their place.

A coordinator that lies is left out: it acknowledges what it has not checked, or admits what no one acknowledged, and no
boundary can notice. The page on guarantees says so.
"""

from __future__ import annotations

import dataclasses
import math
import zlib
from collections.abc import Callable, Sequence
from typing import Any, Literal, get_args

import numpy as np

from mathnavi.controllers.arrival.inbox import ConsensusPayload
from mathnavi.controllers.arrival.maximum import MaximumConfig, MaximumConsensus
from mathnavi.controllers.arrival.separation import Proposal, SeparationReply
from mathnavi.controllers.arrival.separation_rule import TOPIC
from mathnavi.controllers.flight.planner import ARRIVAL
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.protocols import Coordinator
from mathnavi.interfaces.signals import Message, Outbox, Plan
from mathnavi.models.aerial.knowledge import TARGET, TERRAIN
from mathnavi.models.fleet.graph import Neighbourhood
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.fleet_fields import SimultaneousArrivalConfig
from mathnavi.sim.scenarios.simultaneous_arrival import SimultaneousArrival
from mathnavi.studies.flight.hostile_parts import Share

ConsensusMisdeed = Literal[
    "none", "raises", "raises-at-start", "exits", "nothing", "nan", "infinite", "huge", "text", "long-ago", "jumps",
    "never", "outlier-text", "object", "list", "spoilt", "forges", "keeps",
]  # fmt: skip
CoordinatorMisdeed = Literal[
    "none", "raises", "raises-after", "exits", "nothing", "list", "silent", "deaf", "nan-time", "future",
    "other-sender", "to-nobody", "object", "torn", "arrival-nan", "arrival-infinite", "arrival-now", "map",
    "target", "forged-events", "refuses", "text", "forgets", "moves-plans", "moves-messages",
]  # fmt: skip


@configuration
class HostileMaximumConfig(MaximumConfig):
    """Fields of the consensus."""

    misdeed: ConsensusMisdeed = "none"
    """misdeed of the consensus"""
    share: Share = 0.5
    """share of the rounds in which it is committed, 0 to 1"""
    draw: int = 0
    """seed by which these rounds are drawn"""


class HostileMaximum:
    """The consensus ``maximum``, misbehaving."""

    Config = HostileMaximumConfig
    within_starts = True
    only_rises = True

    @staticmethod
    def build(config: HostileMaximumConfig, mission: Neighbourhood) -> HostileConsensus:
        """Return the consensus of one vehicle."""
        return HostileConsensus(config, mission)


class HostileConsensus(MaximumConsensus):
    """Consensus of one vehicle that misbehaves."""

    guest = True

    def __init__(self, config: HostileMaximumConfig, neighbourhood: Neighbourhood) -> None:
        super().__init__(config, neighbourhood)
        self._config, self._rng = config, np.random.default_rng([config.draw, zlib.crc32(neighbourhood.name.encode())])
        self._now: ConsensusMisdeed = "none"  # of the present round
        self._kept: list[Any] = []

    @property
    def value(self) -> Any:
        """The agreed number, or another answer."""
        answers: dict[str, Any] = {
            "nan": math.nan, "infinite": -math.inf, "huge": 1e300, "text": "50", "long-ago": -1e6, "never": 1e9,
            "jumps": float(self._rng.uniform(0.0, 300.0)) if self._now == "jumps" else 0.0,
        }  # fmt: skip
        return answers.get(self._now, MaximumConsensus.value.__get__(self))

    @property
    def outlier(self) -> Any:
        """True if the vehicle only follows, or another answer."""
        return "no" if self._now == "outlier-text" else MaximumConsensus.outlier.__get__(self)

    def start(self, value: float, now: float = 0.0) -> None:
        """Set the vehicle's own number, or raise."""
        if self._config.misdeed == "raises-at-start" and self._rng.random() < self._config.share:
            raise RuntimeError("a bug")
        super().start(value, now)

    def exchange(self, t: float, received: Sequence[Message]) -> Any:
        """Exchange one round, or commit the misdeed."""
        for payload in self._kept:
            payload["trajectory"] = payload["value"] = None
        self._kept.clear()
        self._now = self._config.misdeed if self._rng.random() < self._config.share else "none"
        good = super().exchange(t, received)
        if self._now in ("raises", "exits"):
            raise RuntimeError("a bug") if self._now == "raises" else SystemExit(3)
        if self._now == "forges":
            for message in received:
                object.__setattr__(message, "topic", TOPIC)
                object.__setattr__(message, "payload", SeparationReply(int(self._rng.integers(1, 9)), clear=True))
        answers: dict[str, Callable[[], Any]] = {
            "nothing": lambda: None, "object": lambda: self, "list": lambda: [good.value, [good.valency]],
            "spoilt": lambda: ConsensusPayload(math.inf, -1.0), "keeps": lambda: self._keep({"value": good.value}),
        }  # fmt: skip
        return answers[self._now]() if self._now in answers else good

    def _keep(self, payload: dict[str, Any]) -> dict[str, Any]:
        self._kept.append(payload)
        return payload


@configuration(prefix="coordinator.")
class CoordinatorMisdeeds:
    """Misdeeds of the coordinators."""

    misdeed: CoordinatorMisdeed = "none"
    """misdeed of the coordinators"""
    share: Share = 0.5
    """share of the calls at which it is committed, 0 to 1"""
    draw: int = 0
    """seed by which these calls are drawn"""


@configuration
class HostileArrivalConfig(SimultaneousArrivalConfig):
    """Fields of the scenario."""

    coordinator: CoordinatorMisdeeds = dataclasses.field(default_factory=CoordinatorMisdeeds)


class HostileArrival(SimultaneousArrival):
    """``simultaneous-arrival`` with coordinators that misbehave."""

    Config = HostileArrivalConfig

    @staticmethod
    def build(
        config: SimultaneousArrivalConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """Closed loop of one seed; errors as of ``SimultaneousArrival``."""
        assert isinstance(config, HostileArrivalConfig)
        made = SimultaneousArrival.build(config, seed, controller, estimator)
        agents = {}
        for (name, agent), rng in zip(
            made.agents.items(), np.random.default_rng(config.coordinator.draw).spawn(len(made.agents)), strict=True
        ):
            assert agent.coordinator is not None
            strange = HostileCoordinator(name, agent.coordinator, config.coordinator, rng, config.terrain)
            agents[name] = dataclasses.replace(agent, coordinator=strange)
        return dataclasses.replace(made, agents=agents)


class HostileCoordinator:
    """Coordinator that misbehaves."""

    guest = True

    def __init__(
        self,
        name: str,
        coordinator: Coordinator,
        misdeeds: CoordinatorMisdeeds,
        rng: np.random.Generator,
        terrain: str,
    ) -> None:
        """``terrain`` is the name of the map, of which it claims that all ground is lower."""
        self.period, self._terrain = coordinator.period, terrain
        self._name, self._coordinator, self._misdeeds, self._rng = name, coordinator, misdeeds, rng

    def _misdeed(self) -> CoordinatorMisdeed:
        """Return the misdeed of this call."""
        return self._misdeeds.misdeed if self._rng.random() < self._misdeeds.share else "none"

    def exchange(self, t: float, received: Sequence[Message]) -> Any:
        """Exchange messages, or commit the misdeed."""
        misdeed = self._misdeed()
        if misdeed in ("raises", "exits"):
            raise RuntimeError("a bug") if misdeed == "raises" else SystemExit(3)
        good = self._coordinator.exchange(t, () if misdeed == "deaf" else received)
        if misdeed == "raises-after":
            raise RuntimeError("a bug")
        if misdeed == "moves-messages":
            for message in received:
                object.__setattr__(message, "payload", SeparationReply(1, clear=True))
        others = [message for _, message in good.messages]
        answers: dict[str, Callable[[], Any]] = {
            "nothing": lambda: None, "list": lambda: [*good.messages], "silent": Outbox,
            "nan-time": lambda: self._sent(good, t=math.nan), "future": lambda: self._sent(good, t=t + 10.0),
            "other-sender": lambda: self._sent(good, sender="vehicle_1" if self._name == "vehicle_2" else "vehicle_2"),
            "to-nobody": lambda: dataclasses.replace(good, messages=tuple(("nobody", each) for each in others)),
            "object": lambda: self._sent(good, payload=self), "torn": lambda: self._torn(good),
            "arrival-nan": lambda: self._told(t, ARRIVAL, math.nan), "arrival-now": lambda: self._told(t, ARRIVAL, t),
            "arrival-infinite": lambda: self._told(t, ARRIVAL, math.inf),
            "map": lambda: self._told(t, TERRAIN, self._lowered()),
            "target": lambda: self._told(t, TARGET, (*self._rng.uniform(100.0, 540.0, 2).tolist(), 1500.0)),
            "forged-events": lambda: dataclasses.replace(good, events=(("guarantee-held", ""), ("diverged", ""))),
        }  # fmt: skip
        return answers[misdeed]() if misdeed in answers else good

    def _sent(self, good: Outbox, **changes: Any) -> Outbox:
        return dataclasses.replace(
            good, messages=tuple((to, dataclasses.replace(each, **changes)) for to, each in good.messages)
        )

    def _told(self, t: float, topic: str, payload: Any) -> Outbox:
        return Outbox((), (Message(t, self._name, topic, payload),))

    def _lowered(self) -> HeightField:
        ground = load_terrain(self._terrain)
        return dataclasses.replace(ground, z=ground.z - 500.0)

    def _torn(self, good: Outbox) -> Outbox:
        for _, message in good.messages:
            if isinstance(message.payload, Proposal):
                torn = dataclasses.replace(message.payload)
                object.__setattr__(torn, "trajectory", dataclasses.replace(torn.trajectory))
                object.__setattr__(torn.trajectory, "u", torn.trajectory.u[1:])
                return self._sent(good, payload=torn)
        return good

    def propose(self, t: float, plan: Plan) -> Any:
        """Propose a plan, or commit the misdeed."""
        return self._about(t, plan, self._coordinator.propose)

    def admits(self, t: float, plan: Plan) -> Any:
        """Answer whether a plan may take over, or commit the misdeed."""
        return self._about(t, plan, self._coordinator.admits, ("text", "refuses"))

    def adopted(self, t: float, plan: Plan) -> Any:
        """Take note of a plan that is flown, or commit the misdeed."""
        return self._about(t, plan, self._coordinator.adopted, ("forgets",))

    def _about(self, t: float, plan: Plan, call: Callable[[float, Plan], Any], own: Sequence[str] = ()) -> Any:
        """Pass on a call about a plan, or commit the misdeed."""
        misdeed = self._misdeed()
        if misdeed in ("raises", "exits") or (misdeed == "forgets" and misdeed in own):
            raise SystemExit(3) if misdeed == "exits" else RuntimeError("a bug")
        answer = call(t, plan)
        if misdeed == "raises-after":
            raise RuntimeError("a bug")
        if misdeed == "moves-plans":
            object.__setattr__(plan, "x", plan.x - 300.0)
            object.__setattr__(plan, "notes", ("rebased",))
        if misdeed in own:
            return "no" if misdeed == "text" else False
        return 3 if misdeed == "nothing" else answer


MISDEEDS = {"consensus": get_args(ConsensusMisdeed), "coordinator": get_args(CoordinatorMisdeed)}
"""misdeeds by what commits them"""
