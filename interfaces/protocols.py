"""Protocols of the components of a closed loop. Classes conform by shape; there is nothing to inherit.

Periods are in seconds and are whole multiples of the plant's tick; the loop checks that once, at the start. No
component has a reset(): a scenario builds new ones for every seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Array, Estimate, Event, Measurement, Message, Outbox, Plan, PlanRequest


class StateView(Protocol):
    """True state of one vehicle, as a plant shows it to the sensors of the vehicle."""

    @property
    def x(self) -> Array:
        """State (nx,), a copy."""
        ...

    @property
    def acceleration(self) -> Array:
        """Rate (nv,) of the velocities in the state over the last tick, disturbances included."""
        ...

    def sensed(self, name: str) -> Array:
        """Return a copy of the present reading of one of the vehicle's MuJoCo sensors, for example a rangefinder.

        Raises ValueError if the vehicle has none of that name.
        """
        ...


class Sensor(Protocol):
    """Sensor mounted on a vehicle. It has no clock: the plant reads it when a reading is due.

    It may also have ``partial``, True if single values of a reading may be NaN, ``quaternions``, the slices of a
    reading that are unit quaternions (w, x, y, z), ``numbers``, the "name [unit]" of each number of a reading, and
    ``check(reading)``, which raises ValueError for a malformed one.
    """

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
        """Rate [Hz] of its readings; None: one at every control step."""
        ...

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Return a reading (size,) with its noise drawn from ``rng``, or None if it was lost."""
        ...


class ActuatorModel(Protocol):
    """Model between the input of a vehicle and its joints and actuators, if these are not the same."""

    @property
    def input_size(self) -> int:
        """Length nu of the input."""
        ...

    def act(self, u: Array, q: Array, v: Array, control: Array, dt: float) -> None:
        """Set in place, before a tick of dt [s], the quantities that move the vehicle under the input u (nu,).

        These are the joint velocities v (nv,) of a vehicle that moves exactly as commanded, or the ``control`` (na,) of
        its actuators. q (nq,) are the joint positions, which must not be changed.
        """
        ...


@runtime_checkable
class Plant(Protocol):
    """Plant, the physical world: vehicles, sensors, disturbances."""

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
        """Return the true state (nx,) of one vehicle.

        For sensors, disturbances, log and metrics, never for a controller.
        """
        ...

    def state_names(self, name: str) -> tuple[str, ...]:
        """Return name and unit of each component of the state, for example "position_x [m]"."""
        ...

    def sensor_sizes(self, name: str) -> dict[str, int]:
        """Return the length of each sensor's reading, by sensor name."""
        ...

    def sensors(self, name: str) -> tuple[Sensor, ...]:
        """Return the mounted sensors, in the order in which they are read."""
        ...

    def sense(self, name: str) -> Sequence[Measurement]:
        """Return the readings that fell due since the last step began. Called once before each step."""
        ...

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        """Add a disturbance force (3,) [N] and torque (3,) [N m], world frame, on the body over the next step."""
        ...

    def displace(self, name: str, offset: Array) -> None:
        """Displace a vehicle by (3,) [m] at once: the jumps w of Table A.3."""
        ...

    def place(self, name: str, state: Array) -> None:
        """Put a vehicle into a state (nx,) at once; ValueError if it does not fit."""
        ...

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        """Advance by a number of ticks, inputs (nu,) by vehicle and forces held; return events, such as contacts.

        An event of the kind ``DIVERGED`` ends the run.
        """
        ...


@runtime_checkable
class PlantWithSignalNames(Plant, Protocol):
    """Plant that names the signals of its vehicles in addition to their states; the log has the names."""

    def signal_names(self, name: str) -> SignalNames:
        """Return the names of a vehicle's states, inputs and readings, and the groups in which they are drawn."""
        ...


@runtime_checkable
class PlantWithActivations(Plant, Protocol):
    """Plant whose actuators may have their own states, such as muscles and filters; the log has them."""

    def activation_names(self, name: str) -> tuple[str, ...]:
        """Return name and unit of each activation (na,) of a vehicle's actuators; none where no actuator has any."""
        ...

    def activations(self, name: str) -> Array:
        """Return the activations (na,) of a vehicle's actuators, a copy."""
        ...


@runtime_checkable
class Estimator(Protocol):
    """Estimator: from measurements to an estimate.

    It may also have ``numbers``, the "name [unit]" of each number of an estimate that is not of the whole state, and
    ``figures``, those of the numbers of each array in ``Estimate.extra``, by its key. One that reads numbers may have
    there its ``innovations`` (m,) and their standard deviations ``innovation_std`` (m,), both or neither
    (``interfaces.innovations``).
    """

    period: float  # [s]

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Return the estimate at ``t`` [s], from readings and the held input ``command`` (nu,) since the last call."""
        ...


@runtime_checkable
class Planner(Protocol):
    """Planner: from an estimate to a plan, at a low rate.

    If it also has ``monitor(request) -> Plan | None``, this is called at every control step between two planning
    instants, with the messages that have arrived: it returns a plan that must take over at once, or a failure that
    announces a loss. The next request contains these messages too.
    """

    period: float  # [s]

    def plan(self, request: PlanRequest) -> Plan:
        """Return a plan for ``request``, or a failed Plan whose status is the reason."""
        ...


@runtime_checkable
class Tracker(Protocol):
    """Tracker: from a plan to commands, at a high rate.

    If it also has ``events() -> Sequence[tuple[str, str]]``, this is called after each command and returns the kind and
    the message of each event to record.
    """

    period: float  # [s]

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """Return the input (nu,) to hold until t + period."""
        ...


@runtime_checkable
class Coordinator(Protocol):
    """Communication module of a vehicle, which exchanges messages with others between planning instants."""

    period: float  # [s]

    def exchange(self, t: float, received: Sequence[Message]) -> Outbox:
        """Answer the messages received since the last call; the returned outbox holds the messages to send."""
        ...

    def propose(self, t: float, plan: Plan) -> None:
        """Propose a plan of the vehicle's planner, to take over at its start; it replaces any proposed before."""
        ...

    def admits(self, t: float, plan: Plan) -> bool:
        """Return True if a proposed plan may take over now; one that may not is withdrawn.

        A plan that begins at the estimate because the one before was void ("rebased" in its notes) takes over whatever
        the answer is.
        """
        ...

    def adopted(self, t: float, plan: Plan) -> None:
        """Accept notice that the plan is flown from now on."""
        ...


@runtime_checkable
class Consensus(Protocol):
    """Consensus of a vehicle with its neighbours on a number, at a higher rate than it plans (thesis, A.8.2).

    The vehicles communicate in rounds: in each, every vehicle receives its messages and then sends to its neighbours.
    """

    period: float  # [s] between two rounds

    @property
    def value(self) -> float:
        """Value that the vehicle now takes as agreed; NaN while it knows nothing."""
        ...

    @property
    def outlier(self) -> bool:
        """True if the vehicle only follows: its own number does not take part now."""
        ...

    @property
    def refused(self) -> Mapping[str, int]:
        """Number of unused messages, by reason: "garbage", "stranger", "repeated", "from the future", ..."""
        ...

    def start(self, value: float, now: float = 0.0) -> None:
        """Set the vehicle's own number from now on; not finite if it has none. It is communicated in the next round.

        A time of arrival [s] refers to the clock that shows ``now`` [s]: it is ``value - now`` ahead. A time to go
        refers to a clock that shows 0.
        """
        ...

    def exchange(self, t: float, received: Sequence[Message]) -> Any:
        """Do one round at t [s]: receive the messages since the last, and return the payload for all neighbours.

        Each message carries its sender's time of sending. No received message raises an exception.
        """
        ...


class ControllerPlugin(Protocol):
    """Entry point of ``mathnavi.controllers``, which builds the pair (planner, tracker)."""

    Config: ClassVar[type[Any]]  # a frozen dataclass; its fields become --planner.FIELD

    @staticmethod
    def build(config: Any, mission: Any) -> tuple[Planner, Tracker]:
        """Build new components for one run. ``mission`` is the scenario's public description of the task.

        A scenario that certifies plans also needs ``tracker.bound``, the bound that the tracker keeps. The
        plug-in may declare ``certifier``: None for plans that are flown without a certificate, or a function
        ``certifier(planner, mission, tracker)`` that certifies in its own way and returns the planner to use.
        """
        ...


class EstimatorPlugin(Protocol):
    """Entry point of ``mathnavi.estimators``, which builds an estimator."""

    Config: ClassVar[type[Any]]  # a frozen dataclass; its fields become --estimator.FIELD

    @staticmethod
    def build(config: Any, mission: Any) -> Estimator:
        """Build a new estimator for one run."""
        ...

    @staticmethod
    def sensors(config: Any, mission: Any) -> tuple[Sensor, ...]:
        """Return the sensors that the estimator needs; the scenario mounts exactly these.

        An estimator that only runs over logs may return objects with ``name`` and ``size`` alone.
        """
        ...

    @staticmethod
    def quality(config: Any, mission: Any) -> Any:
        """Return the quality of its estimates in the scenario's terms, ``EstimateQuality`` for aerial missions.

        Only a scenario whose certificate of plans relies on the estimates needs it; otherwise it may be left out.
        """
        ...

    @staticmethod
    def properties(config: Any) -> ObserverProperties:
        """Return the declared properties, as in Table 2.1. A third-party plug-in may leave them out: "not declared"."""
        ...


class ConsensusPlugin(Protocol):
    """Entry point of ``mathnavi.consensus``, which builds a consensus protocol."""

    Config: ClassVar[type[Any]]  # a frozen dataclass; its fields are given by --consensus-with FIELD=VALUE
    within_starts: ClassVar[bool]  # whether the agreed value stays between the least and the largest start

    @staticmethod
    def build(config: Any, mission: Any) -> Consensus:
        """Build the protocol of a vehicle for one run; ``mission`` is a ``Neighbourhood``: all it knows of others."""
        ...
