"""``simultaneous-arrival``: a fleet crosses real mountains, keeps apart, and arrives at one time (thesis A.8).

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> MuJoCo        of each vehicle alone
    plans, times of arrival <-> companion <-> network                              all that they know of each other

Each vehicle has its own slot on a ring about the target and a level of its own on which its stored plan crosses. The
fleet's deadline is D = gamma max V_0, V_0 the duration of each vehicle's first plan.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, get_args

import mujoco
import numpy as np

from controllers.arrival.companion import FleetCompanion
from controllers.arrival.estimate import ArrivalEstimate
from controllers.arrival.separation import Separation
from controllers.arrival.zone import Zone, checked_start
from controllers.flight.certificate import Certified, TrackingBound
from models.aerial.dynamics import CONTROL_TICKS, TICK
from models.aerial.entity import build_model
from models.aerial.mission import EstimateQuality, FlightMission, GustModel
from models.fleet.graph import Graph
from models.terrain.height_field import HeightField
from models.terrain.library import load_terrain, terrain_names
from sim.checks import check, check_rate
from sim.cockpit import Agent
from sim.faults import Disturbance, Disturbed, Gusts
from sim.fleet_metrics import fleet_summary
from sim.log import Recording
from sim.network import Air, DelayedLinks, LossyLinks, Network, Partition, partitioned
from sim.plant import Equipment, MujocoPlant
from sim.plugins import Part, checked_consensus, checked_controller, checked_estimator, checked_quality, load
from sim.protocols import Plant
from sim.scenarios.demands import Demand, judged
from sim.scenarios.experiment import Experiment
from sim.scenarios.flight_parts import (
    LARGEST,
    Faults,
    Noise,
    Point,
    certified,
    check_above_ground,
    drawn_point,
    faulty,
    mounted,
)
from sim.signals import Array, Estimate, Plan, PlanRequest

GraphName = Literal["line", "ring", "complete", "random"]

TALK = 1.0 / 12.0  # [s] between two rounds of talking, unless the consensus says else
_LONGEST = 7200.0  # [s]
_MOST = 64
_DRAWS = 200


@dataclass(frozen=True)
class Radio:
    """What becomes of messages on their way."""

    delay: tuple[float, float] = (0.0, 0.0)
    """least and most time that a message takes [s]"""
    loss: float = 0.0
    """fraction of the messages that are lost"""
    duplication: float = 0.0
    """fraction of those that arrive that arrive twice"""
    partition: tuple[float, float] = (0.0, 0.0)
    """from when to when the first half of the fleet does not hear the other [s]"""

    def __post_init__(self) -> None:
        check(self.delay[0], "radio.delay", 0.0)
        check(self.delay[1], "radio.delay", self.delay[0])
        check(self.loss, "radio.loss", 0.0, 1.0)
        check(self.duplication, "radio.duplication", 0.0, 1.0)
        check(self.partition[0], "radio.partition", 0.0)
        check(self.partition[1], "radio.partition", self.partition[0])

    def network(self, names: Sequence[str], rng: np.random.Generator) -> Network:
        """Between these vehicles."""
        delays, losses = rng.spawn(2)
        network: Network = LossyLinks(
            DelayedLinks(Air(names), *self.delay, delays), self.loss, self.duplication, losses
        )
        half = frozenset(names[: len(names) // 2])
        return partitioned(network, [Partition(*self.partition, half)])


@dataclass(frozen=True)
class SimultaneousArrivalConfig:
    """Fields of the scenario."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    vehicles: int = 4
    """how many"""
    starts: tuple[Point, ...] = ()
    """x, y, z [m] of every vehicle; drawn from the seed if not given"""
    target: Point | None = None
    """x, y, z [m] of the middle of the slots; drawn from the seed if not given"""
    slot_spacing: float = 1500.0
    """between neighbouring slots on their ring [m]"""
    separation: float = 200.0
    """d_s, what vehicles keep between them [m]"""
    drawn_heights: tuple[float, float] = (50.0, 450.0)
    """heights above h_min between which starts and the target are drawn [m]"""
    drawn_distance: tuple[float, float] = (0.4, 0.9)
    """shares of the map's side between which the distances of drawn starts from the target lie"""
    clearance_min: float = 50.0
    """h_min, least height above ground [m]"""
    speed_max: float = 300.0
    """v_max [m/s]"""
    acceleration_max: float = 40.0
    """a_max [m/s^2]"""
    deadline_factor: float = 1.5
    """gamma: the fleet's deadline over the longest of the first plans"""
    arrival_radius: float = 50.0
    """r_f, how near to its slot a vehicle has arrived [m]"""
    spread: float = 5.0 / 3.0
    """of the arrivals, which counts as one time [s]"""
    graph: GraphName = "ring"
    """who talks with whom about the time of arrival; of plans all tell all"""
    consensus: str = "maximum"
    """plug-in by which that is agreed"""
    control_rate: float = 1.0 / (CONTROL_TICKS * TICK)
    """of estimator, tracker and log [Hz]; the physics runs at 300 Hz"""
    radio: Radio = field(default_factory=Radio)
    noise: Noise = field(default_factory=Noise)
    faults: Faults = field(default_factory=Faults)

    def __post_init__(self) -> None:
        if not 2 <= self.vehicles <= _MOST:
            raise ValueError(f"vehicles = {self.vehicles!r}; allowed: a whole number from 2 to {_MOST}")
        if self.starts and len(self.starts) != self.vehicles:
            raise ValueError(f"starts = {len(self.starts)} points; allowed: {self.vehicles}, one for each vehicle")
        for point in (*self.starts, *((self.target,) if self.target is not None else ())):
            if not all(map(math.isfinite, point)):
                raise ValueError(f"point = {point!r}; allowed: three finite numbers")
        check(self.separation, "separation", 0.0, LARGEST, open_low=True)
        check(self.slot_spacing, "slot_spacing", self.separation, LARGEST)
        for name in ("drawn_heights", "drawn_distance"):
            low, high = getattr(self, name)
            if not 0.0 <= low <= high <= LARGEST:
                raise ValueError(f"{name} = {(low, high)!r}; allowed: two finite numbers, 0 <= low <= high")
        check(self.clearance_min, "clearance_min", 0.0, LARGEST)
        for name in ("speed_max", "acceleration_max", "arrival_radius", "spread"):
            check(getattr(self, name), name, 0.0, LARGEST, open_low=True)
        check(self.deadline_factor, "deadline_factor", 1.0, LARGEST)
        check_rate(self.control_rate, "control_rate", TICK)
        if self.graph not in get_args(GraphName):
            raise ValueError(f"graph = {self.graph!r}; allowed: {', '.join(get_args(GraphName))}")
        if self.graph == "ring" and self.vehicles < 3:
            raise ValueError("graph = 'ring' with vehicles = 2; allowed: with 3 at least")
        if self.faults.position_jump > 0.0:
            raise ValueError(f"faults.position_jump = {self.faults.position_jump!r}; allowed in a fleet: 0")

    @property
    def names(self) -> tuple[str, ...]:
        """Of the vehicles."""
        return tuple(f"vehicle_{k + 1}" for k in range(self.vehicles))


@dataclass(frozen=True, eq=False)
class _Vehicle:
    """One vehicle of the fleet, ready to fly."""

    mission: FlightMission
    planner: Certified
    tracker: Any
    estimate: ArrivalEstimate
    stored: Plan


class SimultaneousArrival:
    """A fleet crosses real mountains, keeps apart, and arrives at one time."""

    Config = SimultaneousArrivalConfig
    controller = "flight"
    estimator = "full_state"

    @staticmethod
    def inputs(config: SimultaneousArrivalConfig) -> dict[str, str]:
        """Digests of what the configuration names: what a result depends on beside the fields."""
        return {"terrain": load_terrain(config.terrain).digest}

    @staticmethod
    def build(
        config: SimultaneousArrivalConfig, seed: int, controller: Part | None = None, estimator: Part | None = None
    ) -> Experiment:
        """The closed loop of one seed.

        Raises ValueError for starts or slots below h_min, off the map or too close to each other, and where no plans
        can be stored that keep apart; FileNotFoundError for a terrain file that is not there.
        """
        controller = controller or Part.of(load("controllers", SimultaneousArrival.controller))
        estimator = estimator or Part.of(load("estimators", SimultaneousArrival.estimator))
        draws, sensing, failing, gusting, talking, ranking, losing = np.random.default_rng(seed).spawn(7)
        terrain, names = load_terrain(config.terrain), config.names
        common = _common(config, terrain, estimator)
        fleet = _fleet(config, common, controller, draws, failing)
        bound = next(iter(fleet.values())).tracker.bound
        zone = _zone(config, bound)
        deadline = config.deadline_factor * max(vehicle.stored.t_end for vehicle in fleet.values())
        plugin = load("consensus", config.consensus)
        graph = _graph(config, talking.spawn(1)[0])
        agents, equipment = {}, {}
        for (name, vehicle), rank, lost in zip(
            fleet.items(), ranking.spawn(len(names)), losing.spawn(len(names)), strict=True
        ):
            vehicle.planner.deadline = deadline
            separation = Separation(name, [other for other in names if other != name], zone, vehicle.stored, rank)
            node = graph.node(name, vehicle.planner.period, deadline)
            consensus = checked_consensus(Part(plugin, _at_rate(plugin.Config())), node)
            companion = FleetCompanion(
                separation, consensus, graph.neighbours(name), vehicle.estimate, vehicle.planner.period, TALK
            )
            sensors = mounted(estimator, vehicle.mission, config.faults, lost)
            start = np.array([*vehicle.mission.start, 0.0, 0.0, 0.0])
            equipment[name] = Equipment(start, sensors, config.acceleration_max)
            agents[name] = Agent(
                checked_estimator(estimator, vehicle.mission), vehicle.planner, vehicle.tracker,
                companion=companion, stored=vehicle.stored,
            )  # fmt: skip
        body = MujocoPlant(_model(terrain, names, config.acceleration_max), equipment, sensing)
        faults = config.faults
        disturbances: list[Disturbance] = []
        if faults.gust_rms > 0.0:
            disturbances.append(Gusts(faults.gust_rms, faults.gust_time_constant, faults.gust_limit, gusting))
        plant: Plant = Disturbed(body, disturbances) if disturbances else body
        missions = {name: vehicle.mission for name, vehicle in fleet.items()}
        arrived: set[str] = set()

        def finished(t: float, truths: Mapping[str, Array]) -> bool:
            arrived.update(
                name
                for name, mission in missions.items()
                if math.dist(truths[name][:3].tolist(), mission.target) <= mission.arrival_radius
            )
            return len(arrived) == len(names) or any(body.contacts(name) > 0 for name in names)

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            summary = fleet_summary(recording, missions, deadline, config.separation, seed, wall_seconds)
            late = [Demand("arrival_time_s", most=deadline)] if summary["arrived"] else []
            demands = [
                Demand("arrived", least=True), *late, Demand("ground_contacts", most=0),
                Demand("min_clearance_m", least=config.clearance_min),
                Demand("separation_min_m", least=config.separation),
                *([Demand("spread_s", most=config.spread)] if summary["arrived"] else []),
            ]  # fmt: skip
            return judged(summary, demands)

        duration = math.ceil(1.5 * deadline / TICK) * TICK
        if duration > _LONGEST:
            raise ValueError(
                f"deadline_factor = {config.deadline_factor:g} lets the flight take {duration:.0f} s; allowed: "
                f"{_LONGEST:.0f} s, so be sooner or faster"
            )
        record = _record(config, seed, controller, estimator, fleet, deadline)
        network = config.radio.network(names, talking)
        return Experiment(plant, agents, duration, finished, summarise, record, network)


def _at_rate(config: Any) -> Any:
    """The configuration of a consensus with the fleet's rounds, if it has a period."""
    return dataclasses.replace(config, period=TALK) if hasattr(config, "period") else config


def _zone(config: SimultaneousArrivalConfig, bound: TrackingBound) -> Zone:
    return Zone(config.separation, math.hypot(bound.horizontal, bound.vertical), config.speed_max)


def _graph(config: SimultaneousArrivalConfig, rng: np.random.Generator) -> Graph:
    names = config.names
    if config.graph == "random":
        return Graph.random_connected(names, 0.3, rng)
    return {"line": Graph.line, "ring": Graph.ring, "complete": Graph.complete}[config.graph](names)


@lru_cache(maxsize=2)
def _model(terrain: HeightField, names: tuple[str, ...], acceleration_max: float) -> mujoco.MjModel:
    return build_model(terrain, names, acceleration_max)


def _common(config: SimultaneousArrivalConfig, terrain: HeightField, estimator: Part) -> FlightMission:
    """What the missions of all vehicles have in common."""
    mission = FlightMission(
        terrain=terrain,
        start=(math.nan,) * 3,
        target=(math.nan,) * 3,
        clearance_min=config.clearance_min,
        speed_max=config.speed_max,
        acceleration_max=config.acceleration_max,
        deadline_factor=config.deadline_factor,
        arrival_radius=config.arrival_radius,
        position_noise=config.noise.position,
        position_rate=config.noise.position_rate,
        control_period=round(1.0 / (config.control_rate * TICK)) * TICK,
        gust=GustModel(config.faults.gust_rms, config.faults.gust_time_constant, config.faults.gust_limit),
    )
    return dataclasses.replace(mission, quality=checked_quality(estimator, mission, EstimateQuality))


def _fleet(
    config: SimultaneousArrivalConfig,
    common: FlightMission,
    controller: Part,
    rng: np.random.Generator,
    failing: np.random.Generator,
) -> dict[str, _Vehicle]:
    """All vehicles, with stored plans that keep apart; what is not given is drawn again until they do."""
    reasons: list[str] = []
    given = bool(config.starts) and config.target is not None
    for _ in range(1 if given else _DRAWS):
        try:
            target = config.target or drawn_point(common, config.drawn_heights, rng)
            slots = _slots(config, common, target)
            starts = config.starts or _drawn_starts(config, common, target, rng)
            missions = {
                name: dataclasses.replace(common, start=start, target=slot, cruise_level=_level(config, common, k))
                for k, (name, start, slot) in enumerate(zip(config.names, starts, slots, strict=True))
            }
            fleet = {
                name: _vehicle(config, name, mission, controller, rngs)
                for (name, mission), rngs in zip(missions.items(), failing.spawn(len(missions)), strict=True)
            }
            _check_apart(config, fleet)
        except _NoFleetError as error:
            if given:
                raise ValueError(str(error)) from None
            reasons.append(str(error))
        else:
            return fleet
    raise ValueError(
        f"drawn_distance = {config.drawn_distance!r}: none of {_DRAWS} fleets drawn can start; the last: "
        f"{reasons[-1]}; allowed: other shares of the side, fewer vehicles, a smaller separation, or --starts and "
        "--target"
    )


class _NoFleetError(Exception):
    """These vehicles cannot start so, but others might."""


def _check_apart(config: SimultaneousArrivalConfig, fleet: Mapping[str, _Vehicle]) -> None:
    zone = _zone(config, next(iter(fleet.values())).tracker.bound)
    if config.slot_spacing < zone.required:
        raise ValueError(
            f"slot_spacing = {config.slot_spacing!r}; allowed: >= {zone.required:.6g}, the separation and what two "
            "vehicles may deviate from their plans"
        )
    try:
        checked_start(
            [(name, vehicle.stored) for name, vehicle in fleet.items()],
            {name: np.array(vehicle.mission.target) for name, vehicle in fleet.items()},
            zone,
        )
    except ValueError as error:
        raise _NoFleetError(str(error)) from None


def _slots(config: SimultaneousArrivalConfig, common: FlightMission, target: Point) -> list[Point]:
    """On a ring about the target, at its height or as high as the ground asks for."""
    x, y, z = target
    check_above_ground("target", target, common)
    n = config.vehicles
    radius = 0.5 * config.slot_spacing / math.sin(math.pi / n)
    angles = [2.0 * math.pi * k / n for k in range(n)]
    places = [(x + radius * math.cos(angle), y + radius * math.sin(angle)) for angle in angles]
    inside = [place for place in places if common.terrain.contains(*place)]
    if len(inside) < n:
        raise _NoFleetError(
            f"target = {target!r}: slots on a ring of {radius:.0f} m lie off the map; allowed: a target further "
            "inside, or a smaller slot_spacing"
        )
    height = z - float(common.terrain.height(x, y))
    return [(px, py, max(z, float(common.terrain.height(px, py)) + height)) for px, py in places]


def _drawn_starts(
    config: SimultaneousArrivalConfig, common: FlightMission, target: Point, rng: np.random.Generator
) -> list[Point]:
    side = max(common.terrain.width, common.terrain.depth)
    nearest, farthest = config.drawn_distance
    found: list[Point] = []
    for _ in range(100 * config.vehicles):
        point = drawn_point(common, config.drawn_heights, rng)
        if nearest * side <= math.dist(point[:2], target[:2]) <= farthest * side:
            found.append(point)
        if len(found) == config.vehicles:
            return found
    raise _NoFleetError(f"no {config.vehicles} starts so far from {target!r} on the map")


def _level(config: SimultaneousArrivalConfig, common: FlightMission, k: int) -> float:
    """[m] the level on which the k-th vehicle's stored plans cross, each well above the one before."""
    top = float(common.terrain.z.max()) + config.clearance_min
    return top + (k + 1) * 1.5 * config.separation


def _vehicle(
    config: SimultaneousArrivalConfig,
    name: str,
    mission: FlightMission,
    controller: Part,
    rng: np.random.Generator,
) -> _Vehicle:
    check_above_ground(f"start of {name}", mission.start, mission)
    raw, tracker = checked_controller(controller, mission, TrackingBound)
    if not hasattr(raw, "length_to_go"):
        raise ValueError(
            f"controller = {controller.name!r}: its planner tells no length to go; allowed: one that has "
            "length_to_go(points), by which its vehicle knows when it can arrive"
        )
    planner = certified(faulty(raw, config.faults, rng.spawn(3)), mission, tracker.bound)
    start = np.array([*mission.start, 0.0, 0.0, 0.0])
    stored = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, start), None))
    if not stored.ok:
        raise _NoFleetError(
            f"start of {name} = {mission.start!r}, slot = {mission.target!r}: no initial certificate: "
            f"{stored.status.value} ({stored.message}); allowed: a start from which a first plan can be certified"
        )
    estimate = ArrivalEstimate(raw.length_to_go, np.array(mission.target), mission.speed_max - tracker.bound.speed)
    return _Vehicle(mission, planner, tracker, estimate, stored)


def _record(
    config: SimultaneousArrivalConfig,
    seed: int,
    controller: Part,
    estimator: Part,
    fleet: Mapping[str, _Vehicle],
    deadline: float,
) -> dict[str, Any]:
    """What config.json holds beside the versions. A terrain file is recorded with its whole path."""
    missions = [vehicle.mission for vehicle in fleet.values()]
    terrain = missions[0].terrain
    place = config.terrain if config.terrain in terrain_names() else str(Path(config.terrain).resolve())
    resolved = dataclasses.replace(config, terrain=place, starts=tuple(mission.start for mission in missions))
    return {
        "scenario": "simultaneous-arrival",
        "drawing": "renders.fleet.drawing",
        "seed": seed,
        "fields": dataclasses.asdict(resolved),
        "controller": {"name": controller.name, "fields": dataclasses.asdict(controller.config)},
        "estimator": {"name": estimator.name, "fields": dataclasses.asdict(estimator.config)},
        "terrain": {"name": terrain.name, "path": place, "digest": terrain.digest},
        "mission": {
            "vehicles": {name: {"start": v.mission.start, "target": v.mission.target} for name, v in fleet.items()},
            "clearance_min": config.clearance_min,
            "separation": config.separation,
            "speed_max": config.speed_max,
            "acceleration_max": config.acceleration_max,
            "arrival_radius": config.arrival_radius,
            "deadline": deadline,
            "tracking_bound": dataclasses.asdict(next(iter(fleet.values())).tracker.bound),
        },
    }
