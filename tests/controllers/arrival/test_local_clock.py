"""A coordinator on a clock of its own says everything in corrected time, and nothing until the clocks agree."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.controllers.arrival.clock import ClockConfig, ClockConsensus
from mathnavi.controllers.arrival.coordinator import FleetCoordinator
from mathnavi.controllers.arrival.local_clock import CLOCK, ClockedCoordinator, LocalClock
from mathnavi.controllers.arrival.maximum import Maximum, MaximumConfig
from mathnavi.controllers.arrival.separation import Separation
from mathnavi.controllers.arrival.separation_rule import TOPIC, Zone
from mathnavi.interfaces.signals import Message, Plan
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.fleet.graph import Graph
from mathnavi.sim.engine.network import single_messages

NAMES = ("a", "b")
GRAPH = Graph.line(NAMES)
PERIOD = 0.1  # [s]
OFFSETS = {"a": 7.0, "b": -4.0}  # [s]


def resting(place: float, t: float = 0.0) -> Plan:
    x = np.zeros((2, 6))
    x[:, 0] = place
    return Plan(np.array([t, t + 50.0]), x, np.zeros((1, 3)), np.array([FlightPhase.HOVER], np.int64))


def clocked(name: str, place: float, settling: float) -> ClockedCoordinator:
    def coordinator(stored: Plan, ahead: float) -> FleetCoordinator:
        other = [each for each in NAMES if each != name]
        separation = Separation(name, other, Zone(10.0, clock_error=0.1), stored, np.random.default_rng(0))
        consensus = Maximum.build(MaximumConfig(period=PERIOD), GRAPH.neighbourhood(name))
        return FleetCoordinator(separation, consensus, other, lambda plan, t: plan.t_end, 1.0, PERIOD)

    consensus = ClockConsensus(ClockConfig(period=PERIOD), GRAPH.neighbourhood(name))
    made = ClockedCoordinator(
        name, LocalClock(OFFSETS[name]), consensus, [n for n in NAMES if n != name], settling, 0.1, coordinator
    )
    made.adopted(0.0, resting(place))
    return made


def exchanged(
    settling: float, until: float, proposed: Plan | None = None
) -> tuple[dict[str, ClockedCoordinator], list[tuple[float, Message]]]:
    """Two vehicles that hear each other at once, and all that was said."""
    both = {"a": clocked("a", 0.0, settling), "b": clocked("b", 500.0, settling)}
    boxes: dict[str, list[Message]] = {name: [] for name in NAMES}
    said: list[tuple[float, Message]] = []
    for t in np.arange(0.0, until, PERIOD):
        if proposed is not None and abs(t - 5.0) < 1e-6:
            both["a"].propose(float(t), proposed)
        outbox = {name: both[name].exchange(float(t), boxes[name]) for name in NAMES}
        boxes = {name: [] for name in NAMES}
        for one in outbox.values():
            for receiver, message in single_messages(one.messages):
                boxes[receiver].append(message)
                said.append((float(t), message))
    return both, said


def test_until_the_clocks_agree_it_speaks_of_nothing_else_and_then_they_do_whatever_they_show() -> None:
    both, said = exchanged(2.0, 4.0)
    assert {message.topic for t, message in said if t < 1.9} == {CLOCK}
    assert {message.topic for t, message in said if t > 2.1} > {CLOCK}

    assert both["a"].corrected(4.0) == pytest.approx(both["b"].corrected(4.0), abs=1e-3)
    assert both["a"].corrected(4.0) == pytest.approx(4.0 + np.mean(list(OFFSETS.values())), abs=1e-3)


def test_a_plan_is_proposed_in_corrected_time_and_admitted_as_it_is_flown() -> None:
    plan = resting(0.0, 6.0)
    both, said = exchanged(2.0, 6.0, plan)
    ahead = both["a"].corrected(5.0) - 5.0
    proposals = [
        message.payload for _, message in said if message.topic == TOPIC and hasattr(message.payload, "trajectory")
    ]
    assert proposals
    assert proposals[0].trajectory.t[0] == pytest.approx(6.0 + ahead, abs=1e-3)
    assert both["a"].admits(6.0, plan)
    both["a"].adopted(6.0, plan)
    assert not both["a"].admits(6.0, resting(0.0, 6.0))  # which was never proposed


def test_a_clock_drifts_from_where_it_is_off() -> None:
    assert LocalClock(2.0, 1e-3)(100.0) == pytest.approx(102.1)
