"""The parts of a closed loop. They conform by shape; there is nothing to inherit.

Periods are in seconds and are whole multiples of the plant's tick; the loop checks that once, at the start. No part has
a reset(): a scenario builds fresh parts for every seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from mathnavi.sim.interfaces.observer_properties import ObserverProperties
from mathnavi.sim.interfaces.signals import Array, Estimate, Event, Measurement, Message, Outbox, Plan, PlanRequest


class StateView(Protocol):
    """The truth of one vehicle, as a plant shows it to the vehicle's own sensors."""

    @property
    def x(self) -> Array:
        """(nx,) the state, a copy."""
        ...

    @property
    def acceleration(self) -> Array:
        """(nv,) the rate of the velocities in the state over the last tick, disturbances included."""
        ...

    def sensed(self, name: str) -> Array:
        """The present reading of one of the vehicle's MuJoCo sensors, a rangefinder or an encoder for one; a copy.

        ValueError if the vehicle has none of that name, or none that follows from the positions alone.
        """
        ...


class Sensor(Protocol):
    """A sensor mounted on a vehicle. It keeps no time: the plant reads it when a reading falls due."""

    @property
    def name(self) -> str:
        """Name of its readings."""
        ...

    @property
    def size(self) -> int:
        """Length of a reading."""
        ...

    @property
    def rate(self) -> float | None:
        """[Hz]; None: at every control step."""
        ...

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """A reading (size,) with its noise drawn from ``rng``, or None if it was lost."""
        ...


class ActuatorModel(Protocol):
    """The model between the input of a vehicle and its joints and actuators, where these are not the same."""

    @property
    def input_size(self) -> int:
        """nu."""
        ...

    def act(self, u: Array, q: Array, v: Array, control: Array, dt: float) -> None:
        """Before a tick of dt [s]: set, in place, what moves the vehicle under the input u (nu,).

        That is the joint velocities v (nv,) of a vehicle that moves exactly as commanded, or the ``control`` (na,) of
        its actuators. q (nq,) are the joint positions, which are not to be changed.
        """
        ...


@runtime_checkable
class Plant(Protocol):
    """The physical world: vehicles, sensors, disturbances."""

    dt: float  # [s] the physics tick

    @property
    def t(self) -> float:
        """Time [s]."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        ...

    def state(self, name: str) -> Array:
        """The truth of one vehicle, (nx,). For log and metrics only, never for a controller."""
        ...

    def state_names(self, name: str) -> tuple[str, ...]:
        """Name and unit of each component of the state, "position_x [m]" for one."""
        ...

    def sensor_sizes(self, name: str) -> dict[str, int]:
        """Length of each sensor's reading, by sensor name."""
        ...

    def sensors(self, name: str) -> tuple[Sensor, ...]:
        """The mounted sensors, in the order in which they are read."""
        ...

    def sense(self, name: str) -> Sequence[Measurement]:
        """The readings that fell due since the last step began. Called once before each step."""
        ...

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        """Add a disturbance force (3,) [N] and torque (3,) [N m], world frame, on the body over the next step."""
        ...

    def displace(self, name: str, offset: Array) -> None:
        """Move a vehicle by (3,) [m] at once: the jumps w of Table A.3."""
        ...

    def place(self, name: str, state: Array) -> None:
        """Put a vehicle into a state (nx,) at once; ValueError if it does not fit."""
        ...

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        """Advance by so many ticks with inputs (nu,) by vehicle and forces held; returns events, contacts for one."""
        ...


@runtime_checkable
class Estimator(Protocol):
    """Measurements to estimate."""

    period: float  # [s]

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """The estimate at ``t`` [s], by the readings since the last call and the input ``command`` (nu,) held since."""
        ...


@runtime_checkable
class Planner(Protocol):
    """Estimate to plan, slowly.

    One that also has ``monitor(request) -> Plan | None`` is asked that at every control step between two planning
    instants, with the messages that have arrived: for a plan that has to take over at once, or a failure that announces
    a loss. Those messages are the next request's too.
    """

    period: float  # [s]

    def plan(self, request: PlanRequest) -> Plan:
        """A plan for ``request``, or a Plan whose status says why there is none."""
        ...


@runtime_checkable
class Tracker(Protocol):
    """Plan to command, fast.

    One that also has ``events() -> Sequence[tuple[str, str]]`` is asked after each command for the kind and the message
    of what is to be recorded.
    """

    period: float  # [s]

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """The input (nu,) to hold until t + period."""
        ...


@runtime_checkable
class Coordinator(Protocol):
    """The communication module of a vehicle: exchanges messages with others between planning instants."""

    period: float  # [s]

    def exchange(self, t: float, received: Sequence[Message]) -> Outbox:
        """Answer the messages received since the last call; the outbox holds what is to be sent."""
        ...

    def propose(self, t: float, plan: Plan) -> None:
        """The vehicle's planner has a plan, which is to take over at its start; it stands for any proposed before."""
        ...

    def admits(self, t: float, plan: Plan) -> bool:
        """True if a proposed plan may take over now; one that may not is withdrawn."""
        ...

    def adopted(self, t: float, plan: Plan) -> None:
        """The plan is the one that is flown from now on."""
        ...


@runtime_checkable
class Consensus(Protocol):
    """Agreement of a vehicle with its neighbours on a number, faster than it plans (thesis, A.8.2).

    The vehicles communicate in rounds: in each, every one takes in its messages and then sends to its neighbours.
    """

    period: float  # [s] between two rounds

    @property
    def value(self) -> float:
        """The value that the vehicle takes as agreed now; NaN while it knows nothing."""
        ...

    @property
    def outlier(self) -> bool:
        """True if the vehicle only follows: its own number takes no part now."""
        ...

    @property
    def refused(self) -> Mapping[str, int]:
        """Number of messages that were not used, by why: "garbage", "stranger", "repeated", "from the future", ..."""
        ...

    def start(self, value: float, now: float = 0.0) -> None:
        """The vehicle's own number from now on; not finite if it has none. It is communicated in the next round.

        A time of arrival [s] is one of the clock that shows ``now`` [s]: it is ``value - now`` ahead. A time to go is
        one of a clock that shows 0.
        """
        ...

    def exchange(self, t: float, received: Sequence[Message]) -> Any:
        """One round at t [s]: take in what arrived since the last, and return the payload for all neighbours.

        Each message carries its sender's time of sending. Nothing that is received raises.
        """
        ...


class ControllerPlugin(Protocol):
    """An entry point of ``mathnavi.controllers``: builds the pair (planner, tracker)."""

    Config: ClassVar[type[Any]]  # a frozen dataclass; its fields become --planner.FIELD

    @staticmethod
    def build(config: Any, mission: Any) -> tuple[Planner, Tracker]:
        """Fresh parts for one run. ``mission`` is the scenario's public description of the task.

        A scenario that certifies plans also needs ``tracker.bound``, what the tracker keeps. It certifies unless the
        plug-in has an attribute ``certified`` that is False; one that is a function, ``certified(planner, mission,
        tracker)``, certifies in its own way: it returns the planner that is asked.
        """
        ...


class EstimatorPlugin(Protocol):
    """An entry point of ``mathnavi.estimators``."""

    Config: ClassVar[type[Any]]  # a frozen dataclass; its fields become --estimator.FIELD

    @staticmethod
    def build(config: Any, mission: Any) -> Estimator:
        """A fresh estimator for one run."""
        ...

    @staticmethod
    def sensors(config: Any, mission: Any) -> tuple[Sensor, ...]:
        """The sensors that the estimator needs; the scenario mounts exactly these."""
        ...

    @staticmethod
    def quality(config: Any, mission: Any) -> Any:
        """Quality of its estimates, in the terms of the scenario (``EstimateQuality`` for an aerial mission)."""
        ...

    @staticmethod
    def properties(config: Any) -> ObserverProperties:
        """Declared properties, as in Table 2.1. A third-party plug-in may leave them out: "not declared"."""
        ...


class ConsensusPlugin(Protocol):
    """An entry point of ``mathnavi.consensus``."""

    Config: ClassVar[type[Any]]  # a frozen dataclass; its fields are given by --consensus-with FIELD=VALUE
    within_starts: ClassVar[bool]  # whether what is agreed stays between the least and the largest start

    @staticmethod
    def build(config: Any, mission: Any) -> Consensus:
        """The protocol of one vehicle, for one run; ``mission``, a ``Node``, is what it may know of its fleet."""
        ...
