"""What the vehicles of a fleet say to each other: a companion for each, on a clock in common or on its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from controllers.arrival.clock import ClockConfig, ClockConsensus
from controllers.arrival.companion import FleetCompanion
from controllers.arrival.local_clock import ClockedCompanion, LocalClock
from controllers.arrival.separation import Separation
from controllers.arrival.zone import Zone
from models.fleet.graph import Graph
from sim.plugins import Part, checked_consensus, load, names
from sim.protocols import Companion
from sim.scenarios.fleet_fields import TALK, SimultaneousArrivalConfig
from sim.scenarios.fleet_start import Vehicle
from sim.signals import Plan

_SHORTEST_MEMORY = 0.25  # [s]


def companions(
    config: SimultaneousArrivalConfig,
    fleet: Mapping[str, Vehicle],
    consensus: Part,
    zone: Zone,
    deadline: float,
    talking: np.random.Generator,
    ranking: np.random.Generator,
) -> dict[str, Companion]:
    """Of every vehicle; ValueError for a graph that cannot be."""
    graph = config.network_graph(talking.spawn(1)[0])
    *ranks, ticking = ranking.spawn(len(fleet) + 1)
    made: dict[str, Companion] = {}
    for (name, vehicle), rank in zip(fleet.items(), ranks, strict=True):
        talker = partial(_talker, name, list(fleet), vehicle, zone, graph, deadline, consensus, rank)
        if config.clocks.agree:
            made[name] = talker(vehicle.stored, 0.0)
            continue
        clock = LocalClock(
            float(ticking.uniform(-config.clocks.offset, config.clocks.offset)),
            float(ticking.uniform(-config.clocks.drift, config.clocks.drift)),
        )
        memory = max(_SHORTEST_MEMORY, 4.0 * TALK + 2.0 * config.radio.delay[1])
        clocks = ClockConsensus(ClockConfig(period=TALK, memory=memory), graph.node(name))
        made[name] = ClockedCompanion(
            name, clock, clocks, graph.neighbours(name), config.clocks.settling, config.clocks.error, talker
        )
    return made


def consensus_of(config: SimultaneousArrivalConfig) -> Part:
    """By what the fleet agrees on a time; ValueError for a plug-in that agrees on none, or a field that it refuses."""
    plugin = load("consensus", config.consensus)
    if not plugin.within_starts:
        fitting = [name for name in names("consensus") if load("consensus", name).within_starts]
        raise ValueError(
            f"consensus = {config.consensus!r}: what it agrees on need not lie between the vehicles' own times; "
            f"allowed: {', '.join(fitting)}, or another that says within_starts"
        )
    return Part(plugin, config.consensus_config(plugin))


def _talker(
    name: str,
    names: list[str],
    vehicle: Vehicle,
    zone: Zone,
    graph: Graph,
    deadline: float,
    consensus: Part,
    rng: np.random.Generator,
    stored: Plan,
    ahead: float,
) -> FleetCompanion:
    """What talks of plans and arrivals in a time that is ``ahead`` [s] of the simulation's."""
    separation = Separation(name, [other for other in names if other != name], zone, stored, rng)
    node: Any = dataclasses.replace(
        graph.node(name, vehicle.planner.period, deadline + ahead), clock_error=zone.clock_error
    )
    return FleetCompanion(
        separation, checked_consensus(consensus, node), graph.neighbours(name), vehicle.estimate,
        vehicle.planner.period, TALK,
    )  # fmt: skip
