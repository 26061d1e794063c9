"""Closed loop, for one vehicle or many.

    sensors -> estimator -> planner (slow) -> tracker (fast) -> actuators

Each component runs at its own rate, with a period of a whole number of physics ticks. The control step, and the sample
in the log, is the greatest common divisor of these; in between, the plant advances with the inputs held. A plan that is
requested at t takes over at its start time, one planning period later, if it is available by then; until then, and
whenever there is none, the vehicle flies the last adopted plan, which leads to rest. The loop uses only protocols: it
does not depend on the purpose of a plan.

``simulate`` runs it from beginning to end. A ``Loop`` is stepped from outside, by a caller that commands the actuators
instead of planner and tracker: sensors, estimators, disturbances and samples are those of a flight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Plant, PlantWithActivations
from mathnavi.interfaces.signals import DIVERGED, Array
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.agent_runner import Agent, AgentRunner
from mathnavi.sim.engine.answer_times import Latency
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.network import IdealNetwork, Network


def whole_ticks(period: float, dt: float, what: str) -> int:
    """Return ``period`` [s] in ticks of ``dt`` [s]; ArgumentError unless that is a positive whole number."""
    ticks = round(period / dt) if math.isfinite(period) else 0
    if ticks < 1 or abs(ticks * dt - period) > TIME_TOLERANCE * max(1.0, ticks):
        raise ArgumentError(f"{what} = {period!r} s is not a whole number of physics ticks of {dt!r} s")
    return ticks


def _rates(name: str, agent: Agent, dt: float) -> tuple[int, int, int, int]:
    """Return the ticks between calls of the estimator, the planner, the tracker and the coordinator; 0 for a missing
    one.

    Raises ArgumentError if the planner or the tracker would use an estimate of an earlier tick.
    """
    estimator = whole_ticks(agent.estimator.period, dt, f"{name}: the estimator's period")
    planner = whole_ticks(agent.planner.period, dt, f"{name}: the planner's period")
    tracker = whole_ticks(agent.tracker.period, dt, f"{name}: the tracker's period")
    for part, ticks, period in (
        ("planner", planner, agent.planner.period),
        ("tracker", tracker, agent.tracker.period),
    ):
        if ticks % estimator:
            raise ArgumentError(
                f"{name}: the estimator's period = {agent.estimator.period!r} s leaves the {part} with old estimates; "
                f"allowed: a whole fraction of the {part}'s period, {period!r} s"
            )
    coordinator = agent.coordinator
    exchanges = 0 if coordinator is None else whole_ticks(coordinator.period, dt, f"{name}: the coordinator's period")
    return estimator, planner, tracker, exchanges


class Loop:
    """Closed loop, step by step: ``control_step`` or ``observe``, then ``advance``, until ``over``.

    ``t`` [s] and ``truths``, (nx,) by vehicle, are those of the last sample; ``recording`` holds all samples so far.
    A sample at which the simulation has ``diverged`` is the last one: its states are NaN, and no agent sees it.
    """

    def __init__(
        self,
        plant: Plant,
        agents: Mapping[str, Agent],
        duration: float,
        network: Network | None = None,
        latency: Latency | None = None,
    ) -> None:
        """Begin at the plant's present time, for ``duration`` [s]. ``network`` carries the coordinators' messages;
        ``latency`` is the simulated time that plans take, none if not given.

        Raises ValueError if an agent has no vehicle, a period is not a whole number of ticks, or an estimator is slower
        than the components that use it.
        """
        if unknown := sorted(set(agents) - set(plant.names)):
            raise ArgumentError(f"agents {unknown} have no vehicle; the plant has {list(plant.names)}")
        dt = plant.dt
        self._steps = whole_ticks(duration, dt, "duration")
        self._plant, self._names = plant, plant.names
        rates = {name: _rates(name, agent, dt) for name, agent in agents.items()}
        self.stride = math.gcd(*(ticks for of_agent in rates.values() for ticks in of_agent)) or 1
        """number of ticks between two samples; gcd() is 0: no agents"""
        rows = -(-self._steps // self.stride) + 1
        self.recording = Recording.begin(plant, {name: agent.input_size for name, agent in agents.items()}, rows)
        carrier = IdealNetwork(list(agents)) if network is None else network
        self.runners = {
            name: AgentRunner(
                name,
                agent,
                *rates[name],
                carrier,
                self.recording.agents[name],
                np.zeros(agent.input_size) if agent.command is None else agent.command,
                latency,
                tuple(agents),
                undelivered=sorted(agent.messages, key=lambda message: message.t),
            )
            for name, agent in agents.items()
        }
        self._each = tuple(self.runners.values())
        self._row = self._tick = 0
        self.t = plant.t
        self.truths: dict[str, Array] = {}
        self.diverged = False
        """whether the plant has lost its state"""
        self._actuators = plant if isinstance(plant, PlantWithActivations) else None

    @property
    def over(self) -> bool:
        """Whether the duration has passed."""
        return self._tick == self._steps

    def control_step(self) -> None:
        """Sample the sensors, estimate, plan and track, each if it is due now."""
        row, k, t = self._begin()
        for runner in () if self.diverged else self._each:
            runner.control_step(row, k, t, self._plant.sense(runner.name))

    def observe(self) -> None:
        """Sample the sensors and estimate only; ``command`` sets the input until the next sample."""
        row, k, t = self._begin()
        for runner in () if self.diverged else self._each:
            runner.observe(row, k, t, self._plant.sense(runner.name))

    def command(self, name: str, u: Array) -> None:
        """Set the input (nu,) of a vehicle from this sample on, instead of its tracker, until the next command."""
        self.runners[name].hold(self._row, u)

    def advance(self) -> None:
        """Advance the plant under the commands to the next sample."""
        commands = {runner.name: runner.command for runner in self._each}
        ticks = min(self.stride, self._steps - self._tick)
        events = self._plant.step(commands, ticks)
        self.recording.events.extend(events)
        self.diverged |= any(event.kind == DIVERGED for event in events)
        self._tick += ticks
        self._row += 1

    def _begin(self) -> tuple[int, int, float]:
        """Log the truth; return the row of the log, the tick, and the time [s]."""
        plant = self._plant
        t = self.t = plant.t
        self.truths = {name: plant.state(name) for name in self._names}
        actuators, logged = self._actuators, self.recording.activation_names
        activations = {} if actuators is None else {name: actuators.activations(name) for name in logged}
        if self.diverged:
            for values in (*self.truths.values(), *activations.values()):
                values[:] = np.nan
        self.recording.truth(self._row, t, self.truths, activations)
        return self._row, self._tick, t


def simulate(
    plant: Plant,
    agents: Mapping[str, Agent],
    duration: float,
    finished: Callable[[float, Mapping[str, Array]], bool] | None = None,
    progress: Callable[[float], None] | None = None,
    network: Network | None = None,
    watch: Callable[[Loop], None] | None = None,
    latency: Latency | None = None,
) -> Recording:
    """Run the loop from the plant's present time for at most ``duration`` [s], or until ``finished(t, truths)``.

    It ends as well where the simulation diverges, which is an event of the kind ``DIVERGED``.

    ``finished`` is the referee: it sees the truth and belongs to the scenario, not to a controller. ``progress`` is
    called with the simulated time once every simulated second, ``watch`` with the loop after every control step.
    ``network`` carries the coordinators' messages, at once if none is given. ``latency`` is the simulated time that
    plans take, none if not given.

    Raises ValueError if an agent has no vehicle, a period is not a whole number of ticks, or an estimator is slower
    than the components that use it, and as ``Latency.delay`` does.
    """
    loop = Loop(plant, agents, duration, network, latency)
    reported = -math.inf  # [s]
    while True:
        loop.control_step()
        if watch is not None:
            watch(loop)
        if loop.over or loop.diverged or (finished is not None and finished(loop.t, loop.truths)):
            return loop.recording.end()
        loop.advance()
        if progress is not None and loop.t >= reported + 1.0:
            reported = loop.t
            progress(reported)
