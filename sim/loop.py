"""The closed loop, for one vehicle or many.

    sensors -> estimator -> planner (slow) -> tracker (fast) -> actuators

Each part runs at its own rate, a whole number of physics ticks. The loop looks, and logs, at the greatest common
divisor of these; the ticks between two looks are one step of the plant with the inputs held. A plan asked for at t
takes over at its own start time, one planning period later, if it is at hand by then; until then, and whenever there is
none, the vehicle flies the last plan that was adopted, which leads to rest. The loop knows protocols only: it never
asks what a plan is for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from sim.cockpit import Agent, Cockpit
from sim.log import Recording
from sim.network import Air, Network
from sim.protocols import Plant
from sim.signals import Array

_SIMULTANEOUS = 1e-9  # [s] two times closer than this are the same tick


def whole_ticks(period: float, dt: float, what: str) -> int:
    """``period`` [s] as a number of ticks of ``dt`` [s]; ValueError if it is not a whole positive number of them."""
    ticks = round(period / dt) if math.isfinite(period) else 0
    if ticks < 1 or abs(ticks * dt - period) > _SIMULTANEOUS * max(1.0, ticks):
        raise ValueError(f"{what} = {period!r} s is not a whole number of physics ticks of {dt!r} s")
    return ticks


def _rates(name: str, agent: Agent, dt: float) -> tuple[int, int, int, int]:
    """Ticks between calls of the estimator, the planner, the tracker and the companion; 0 for one that is not there.

    ValueError if the planner or the tracker would be given an estimate of an earlier tick.
    """
    estimator = whole_ticks(agent.estimator.period, dt, f"{name}: the estimator's period")
    planner = whole_ticks(agent.planner.period, dt, f"{name}: the planner's period")
    tracker = whole_ticks(agent.tracker.period, dt, f"{name}: the tracker's period")
    for part, ticks, period in (
        ("planner", planner, agent.planner.period),
        ("tracker", tracker, agent.tracker.period),
    ):
        if ticks % estimator:
            raise ValueError(
                f"{name}: the estimator's period = {agent.estimator.period!r} s leaves the {part} with old estimates; "
                f"allowed: a whole fraction of the {part}'s period, {period!r} s"
            )
    companion = agent.companion
    talks = 0 if companion is None else whole_ticks(companion.period, dt, f"{name}: the companion's period")
    return estimator, planner, tracker, talks


def simulate(
    plant: Plant,
    agents: Mapping[str, Agent],
    duration: float,
    finished: Callable[[float, Mapping[str, Array]], bool] | None = None,
    progress: Callable[[float], None] | None = None,
    network: Network | None = None,
) -> Recording:
    """Run the loop from the plant's present time for at most ``duration`` [s], or until ``finished(t, truths)``.

    ``finished`` is the referee: it sees the truth and belongs to the scenario, not to a controller. ``progress`` is
    told the simulated time once a simulated second. ``network`` carries what companions say, at once if none is given.

    Raises ValueError if an agent has no vehicle, a rate is not a whole number of ticks, or an estimator is slower
    than the parts that use it.
    """
    if unknown := sorted(set(agents) - set(plant.names)):
        raise ValueError(f"agents {unknown} have no vehicle; the plant has {list(plant.names)}")
    dt, steps = plant.dt, whole_ticks(duration, plant.dt, "duration")
    names = plant.names
    rates = {name: _rates(name, agent, dt) for name, agent in agents.items()}
    stride = math.gcd(*(ticks for of_agent in rates.values() for ticks in of_agent)) or 1  # gcd() is 0: no agents
    rows = -(-steps // stride) + 1
    recording = Recording.begin(plant, {name: agent.input_size for name, agent in agents.items()}, rows)
    carrier = Air(list(agents)) if network is None else network
    cockpits = [
        Cockpit(
            name,
            agent,
            *rates[name],
            carrier,
            recording.agents[name],
            np.zeros(agent.input_size),
            undelivered=sorted(agent.messages, key=lambda message: message.t),
        )
        for name, agent in agents.items()
    ]
    told = -math.inf  # [s]
    for row, k in enumerate((*range(0, steps, stride), steps)):
        t = plant.t
        truths = {name: plant.state(name) for name in names}
        recording.truth(row, t, truths)
        for cockpit in cockpits:
            cockpit.look(row, k, t, plant.sense(cockpit.name))
        if k == steps or (finished is not None and finished(t, truths)):
            break
        commands = {cockpit.name: cockpit.command for cockpit in cockpits}
        recording.events.extend(plant.step(commands, min(stride, steps - k)))
        if progress is not None and t >= told + 1.0:
            told = t
            progress(t)
    return recording.end()
