"""``simultaneous-arrival``: a fleet crosses real mountains, keeps apart, and arrives at one time (thesis A.8).

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> MuJoCo        of each vehicle alone
    plans, times of arrival <-> coordinator <-> network                              their only knowledge of each other

A ``certifier`` that the controller declares stands in the place of ``Certified``; None is refused.

Each vehicle has its own slot on a ring about the target and its own level on which its stored plan crosses. The fleet's
deadline is D = gamma max V_0, V_0 the duration of each vehicle's first plan. Each has a coordinator, on a common clock
or on the vehicle's own.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any

import mujoco
import numpy as np

from mathnavi.controllers.arrival.clock import ClockConfig, ClockConsensus
from mathnavi.controllers.arrival.coordinator import AssuredArrival, FleetCoordinator
from mathnavi.controllers.arrival.delay_check import DelayCheck
from mathnavi.controllers.arrival.local_clock import ClockedCoordinator, LocalClock
from mathnavi.controllers.arrival.separation import Separation
from mathnavi.controllers.arrival.separation_rule import SeparationRule, Zone
from mathnavi.controllers.flight.certified import Certified
from mathnavi.interfaces.errors import FieldError, PluginError
from mathnavi.interfaces.protocols import Coordinator
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.entity import build_model
from mathnavi.models.aerial.mission import AccelerationSensor, FlightMission
from mathnavi.models.fleet.graph import Graph
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import RadarTrack
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.metrics.fleet import fleet_summary
from mathnavi.sim.plugin.registry import PluginSpec, checked_consensus, load, loadable
from mathnavi.sim.records.missions import FleetRecord
from mathnavi.sim.scenarios.assembler import Assembler, RandomStreams
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.fleet_fields import EXCHANGE_PERIOD, SimultaneousArrivalConfig
from mathnavi.sim.scenarios.fleet_start import StartedVehicle, started_fleet, zone_of
from mathnavi.sim.scenarios.flight_assurance import assured
from mathnavi.sim.scenarios.flight_learning import HOLD, FlightTerms
from mathnavi.sim.scenarios.flight_parts import (
    check_above_ground,
    flight_task,
    longest_flight,
    map_of,
    mission_but_ends,
    terrain_record,
)
from mathnavi.sim.scenarios.requirements import Requirement, evaluate

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


_LONGEST = 7200.0  # [s]


class SimultaneousArrival:
    """A fleet crosses real mountains, keeps apart, and arrives at one time."""

    Config = SimultaneousArrivalConfig
    name = "simultaneous-arrival"
    drawing = "mathnavi.renders.fleet.drawing"
    controller = "flight"
    estimator = "full_state"
    streams = ("draws", "sensing", "planner_faults", "gusts", "network", "ranks", "dropouts")

    @staticmethod
    def build(
        config: SimultaneousArrivalConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """Closed loop of one seed.

        Raises MissionError for starts or slots below h_min, off the map or too close to each other, and if no stored
        plans keep apart; FileNotFoundError for a missing terrain file.
        """
        parts = Assembler.for_scenario(SimultaneousArrival, config, seed, controller, estimator)
        charted, consensus = map_of(config), consensus_of(config)
        common = mission_but_ends(config, charted, parts.estimator, config.radars_at(0.0, charted))
        fleet = started_fleet(config, common, parts)
        flight = _flight(config, charted, fleet)
        duration = longest_flight(1.5 * flight.deadline, config.deadline_factor, config.speed_max, _LONGEST)

        bound = next(iter(fleet.values())).tracker.bound
        talkers = coordinators(config, fleet, consensus, zone_of(config, bound), flight.deadline, parts.streams)
        messages = config.messages(charted, duration)
        agents, setups = {}, {}
        for (name, vehicle), streams in zip(fleet.items(), parts.streams.split("dropouts", len(fleet)), strict=True):
            mission = vehicle.mission
            if isinstance(vehicle.planner, Certified):
                vehicle.planner.arrive_by(flight.deadline)
            sensors = parts.sensors(mission, AccelerationSensor(), streams=streams)
            setups[name] = VehicleSetup(mission.start_state, sensors, config.acceleration_max)
            agents[name] = Agent(
                parts.observer(mission), vehicle.planner, vehicle.tracker,
                messages=messages, coordinator=talkers[name], stored=vehicle.stored, sensors=parts.asked(mission),
                **assured(mission, vehicle.tracker),
            )  # fmt: skip
        model = _model(flight.terrain, config.names, config.acceleration_max)
        body = MujocoPlant(model, setups, parts.streams["sensing"])
        network = config.radio.network(config.names, parts.streams["network"], partial(_distance, body))

        starts = tuple(vehicle.mission.start for vehicle in fleet.values())
        terrain = terrain_record(flight.terrain, config.terrain, hills=config.uncharted)
        ends = {"start": starts, "target": next(iter(fleet.values())).centre}
        period = next(iter(fleet.values())).planner.period
        return parts.closed_loop(
            parts.disturbed(body, period, mass=1.0),
            agents,
            duration,
            partial(finished, flight, body),
            partial(summarise, flight, config, seed),
            mission=_record(config, flight, dataclasses.asdict(bound)),
            resolved=dataclasses.replace(config, terrain=terrain["path"], start=starts),
            terrain=terrain,
            network=network,
            task=flight_task(
                {name: vehicle.mission for name, vehicle in fleet.items()},
                config.acceleration_max,
                parts.controller,
                ends,
                partial(_terms, flight, fleet, body),
            ),
        )


@dataclass(frozen=True, eq=False)
class FleetFlight:
    """True flights of a fleet, for the referee and the metrics: over the true ground."""

    terrain: HeightField
    missions: Mapping[str, FlightMission]  # by vehicle, with the true ground
    radars: tuple[RadarTrack, ...]
    deadline: float  # [s] D
    arrived: set[str] = field(default_factory=set)  # vehicles that have been at their slots


def finished(flight: FleetFlight, body: MujocoPlant, t: float, truths: Mapping[str, Array]) -> bool:
    """True if all vehicles have arrived, or one has touched something; ``t`` [s], ``truths`` (6,) by vehicle."""
    return arrived(flight, t, truths) or any(body.contacts(name) > 0 for name in flight.missions)


def arrived(flight: FleetFlight, t: float, truths: Mapping[str, Array]) -> bool:
    """True if all vehicles have been at their slots; ``t`` [s], ``truths`` (6,) by vehicle."""
    flight.arrived.update(
        name
        for name, mission in flight.missions.items()
        if math.dist(truths[name][:3].tolist(), mission.target) <= mission.arrival_radius
    )
    return len(flight.arrived) == len(flight.missions)


def summarise(
    flight: FleetFlight, config: SimultaneousArrivalConfig, seed: int, recording: Recording, wall_seconds: float
) -> tuple[dict[str, Any], bool]:
    """Summary, and whether all arrived by the deadline and at one time, kept apart and touched nothing."""
    summary = fleet_summary(
        recording, flight.missions, flight.radars, flight.deadline, config.separation, seed, wall_seconds
    )
    in_time = [Requirement("arrival_time_s", most=flight.deadline)] if summary["arrived"] else []
    at_one_time = [Requirement("spread_s", most=config.spread)] if summary["arrived"] else []
    requirements = [
        Requirement("arrived", least=True), *in_time, Requirement("ground_contacts", most=0),
        Requirement("min_clearance_m", least=config.clearance_min),
        Requirement("separation_min_m", least=config.separation), *at_one_time,
    ]  # fmt: skip
    return evaluate(summary, requirements)


def _flight(
    config: SimultaneousArrivalConfig, charted: HeightField, fleet: Mapping[str, StartedVehicle]
) -> FleetFlight:
    """Flights over the true ground; MissionError if a start or a slot is too near to it."""
    terrain = config.ground(charted)
    missions = {name: dataclasses.replace(vehicle.mission, terrain=terrain) for name, vehicle in fleet.items()}
    for name, mission in missions.items():
        check_above_ground(f"start of {name}", mission.start, mission)
        check_above_ground(f"target of {name}", mission.target, mission)
    deadline = config.deadline_factor * max(vehicle.stored.t_end for vehicle in fleet.values())
    return FleetFlight(terrain, missions, config.tracks(charted), deadline)


def _terms(flight: FleetFlight, fleet: Mapping[str, StartedVehicle], body: MujocoPlant, cost_max: float) -> FlightTerms:
    """Learning terms with the common deadline of the fleet."""
    known = {name: vehicle.mission for name, vehicle in fleet.items()}
    return FlightTerms(known, flight.terrain, body, partial(arrived, flight), cost_max, flight.deadline, HOLD)


def _record(config: SimultaneousArrivalConfig, flight: FleetFlight, bound: dict[str, float | None]) -> FleetRecord:
    """Record of the mission in config.json."""
    return FleetRecord(
        vehicles={name: {"start": each.start, "target": each.target} for name, each in flight.missions.items()},
        radars=config.radar_records(flight.terrain),
        charted_at=config.charted_at,
        clearance_min=config.clearance_min,
        separation=config.separation,
        speed_max=config.speed_max,
        acceleration_max=config.acceleration_max,
        arrival_radius=config.arrival_radius,
        deadline=flight.deadline,
        tracking_bound=bound,
    )


def _distance(body: MujocoPlant, one: str, other: str) -> float:
    """Distance [m] between two vehicles now."""
    return math.dist(body.state(one)[:3].tolist(), body.state(other)[:3].tolist())


@lru_cache(maxsize=2)
def _model(terrain: HeightField, names: tuple[str, ...], acceleration_max: float) -> mujoco.MjModel:
    return build_model(terrain, names, acceleration_max)
