"""Communication in a fleet: a coordinator for each vehicle, on a common clock or on the vehicle's own clock."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from mathnavi.controllers.arrival.clock import ClockConfig, ClockConsensus
from mathnavi.controllers.arrival.coordinator import AssuredArrival, FleetCoordinator
from mathnavi.controllers.arrival.delay_check import DelayCheck
from mathnavi.controllers.arrival.local_clock import ClockedCoordinator, LocalClock
from mathnavi.controllers.arrival.separation import Separation
from mathnavi.controllers.arrival.separation_rule import SeparationRule, Zone
from mathnavi.interfaces.errors import FieldError, PluginError
from mathnavi.interfaces.protocols import Coordinator
from mathnavi.interfaces.signals import Plan
from mathnavi.models.fleet.graph import Graph
from mathnavi.sim.plugin.registry import PluginSpec, checked_consensus, load, loadable
from mathnavi.sim.scenarios.assembler import RandomStreams
from mathnavi.sim.scenarios.fleet_fields import EXCHANGE_PERIOD, SimultaneousArrivalConfig
from mathnavi.sim.scenarios.fleet_start import StartedVehicle

_SHORTEST_MEMORY = 0.25  # [s]


def coordinators(
    config: SimultaneousArrivalConfig,
    fleet: Mapping[str, StartedVehicle],
    consensus: PluginSpec,
    zone: Zone,
    deadline: float,
    streams: RandomStreams,
) -> dict[str, Coordinator]:
    """Coordinators of all vehicles, by name; FieldError for an impossible graph or delay check.

    ``deadline`` [s] is that of the fleet.
    """
    graph = config.network_graph(streams["network"].spawn(1)[0])
    *ranks, ticking = streams["ranks"].spawn(len(fleet) + 1)
    made: dict[str, Coordinator] = {}
    for (name, vehicle), rank in zip(fleet.items(), ranks, strict=True):
        peers = [other for other in fleet if other != name]
        rule = _rule(config, name, peers, zone, vehicle.planner.period, rank)
        talker = partial(_talker, name, rule, vehicle, zone, graph, deadline, consensus)
        if config.clocks.agree:
            made[name] = talker(vehicle.stored, 0.0)
            continue
        clock = LocalClock(
            float(ticking.uniform(-config.clocks.offset, config.clocks.offset)),
            float(ticking.uniform(-config.clocks.drift, config.clocks.drift)),
        )
        memory = max(_SHORTEST_MEMORY, 4.0 * EXCHANGE_PERIOD + 2.0 * config.radio.delay[1])
        clocks = ClockConsensus(ClockConfig(period=EXCHANGE_PERIOD, memory=memory), graph.neighbourhood(name))
        made[name] = ClockedCoordinator(
            name, clock, clocks, graph.neighbours(name), config.clocks.settling, config.clocks.error, talker
        )
    return made


def consensus_of(config: SimultaneousArrivalConfig) -> PluginSpec:
    """Consensus by which the fleet agrees on a time.

    Raises PluginError for a plug-in whose result need not be a time between the vehicles' own, FieldError for a field
    that it refuses.
    """
    plugin = load("consensus", config.consensus)
    if not plugin.within_starts:
        fitting = [name for name, other in loadable("consensus").items() if other.within_starts]
        raise PluginError(
            f"consensus = {config.consensus!r}: its result need not lie between the vehicles' own times; "
            f"allowed: {', '.join(fitting)}, or another that declares within_starts"
        )
    return PluginSpec(plugin, config.consensus_config(plugin))


def _rule(
    config: SimultaneousArrivalConfig, name: str, peers: list[str], zone: Zone, period: float, rng: np.random.Generator
) -> Callable[[Plan], SeparationRule]:
    """Rule of separation of a vehicle with a planning period [s], given its stored plan.

    Raises FieldError for a delay check that is too long for the period.
    """
    if config.separation_rule == "agreement":
        return lambda stored: Separation(name, peers, zone, stored, rng)
    wait = period - config.delay_check - 3.0 * EXCHANGE_PERIOD
    if wait < 0.0:
        raise FieldError(
            f"delay_check = {config.delay_check!r}; allowed: <= {period - 3.0 * EXCHANGE_PERIOD:.4g}, the planning "
            "period less three exchanges of messages"
        )
    return lambda stored: DelayCheck(
        name, peers, zone, stored, rng, config.delay_check, wait=wait, step=EXCHANGE_PERIOD
    )


def _talker(
    name: str,
    rule: Callable[[Plan], SeparationRule],
    vehicle: StartedVehicle,
    zone: Zone,
    graph: Graph,
    deadline: float,
    consensus: PluginSpec,
    stored: Plan,
    ahead: float,
) -> FleetCoordinator:
    """Coordinator of one vehicle, whose clock is ``ahead`` [s] of the simulation's time."""
    neighbourhood: Any = dataclasses.replace(
        graph.neighbourhood(name, vehicle.planner.period, deadline + ahead), clock_error=zone.clock_error
    )
    # To defer is to request a later time of all; an average does not follow.
    follows = getattr(consensus.plugin, "only_rises", False)
    assured = AssuredArrival(vehicle.assured + ahead, vehicle.estimate.arrives, vehicle.braking) if follows else None
    return FleetCoordinator(
        rule(stored), checked_consensus(consensus, neighbourhood), graph.neighbours(name), vehicle.estimate,
        vehicle.planner.period, EXCHANGE_PERIOD, assured,
    )  # fmt: skip
