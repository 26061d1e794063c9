"""Parts that scenarios of aerial vehicles share: mission, certified ends, verdict, task and record."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol

import numpy as np

from mathnavi.controllers.flight.certificate import TrackingBound, raised_ground
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.command_filter import CommandFilter
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.aerial.mission import EstimateQuality, FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.kernels import SIGHT_TOLERANCE
from mathnavi.models.terrain.library import load_terrain, place_of
from mathnavi.models.terrain.visibility import Radar
from mathnavi.sim.engine.input_bounds import input_bound
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.plugin.registry import PluginSpec, called, checked_quality, checked_sensors
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.fault_fields import AerialFaults
from mathnavi.sim.scenarios.flight_fields import FlightNoise
from mathnavi.sim.scenarios.flight_learning import FlightTerms
from mathnavi.sim.scenarios.requirements import Requirement, evaluate
from mathnavi.sim.scenarios.task import Inputs, Sample, Task

_BORDER = 0.02  # of the map's side, kept free of drawn starts and targets


class FlightFields(Protocol):
    """Fields of a scenario that determine the missions of its vehicles."""

    @property
    def clearance_min(self) -> float: ...
    @property
    def speed_max(self) -> float: ...
    @property
    def acceleration_max(self) -> float: ...
    @property
    def deadline_factor(self) -> float: ...
    @property
    def arrival_radius(self) -> float: ...
    @property
    def control_rate(self) -> float: ...
    @property
    def noise(self) -> FlightNoise: ...
    @property
    def faults(self) -> AerialFaults: ...


class Mapped(Protocol):
    """Fields of a scenario that state its map."""

    @property
    def terrain(self) -> str: ...
    @property
    def datum(self) -> str: ...


def map_of(config: Mapped) -> HeightField:
    """Map of a mission; errors as of ``load_terrain``.

    Raises MissionError unless its heights are measured from the surface that those of the ends are: ellipsoid and geoid
    are up to 100 m apart.
    """
    terrain = load_terrain(config.terrain)
    if config.datum != "map" and terrain.datum.partition(" ")[0] != config.datum:
        stated = (
            f"those of the map {terrain.name} from the {terrain.datum}"
            if terrain.datum
            else (f"the map {terrain.name} does not say what its own are measured from")
        )
        raise MissionError(
            f"datum = {config.datum!r}: heights of start and target are measured from the {config.datum}, and "
            f"{stated}; allowed: a map with the same datum, or map for heights as the map has them"
        )
    return terrain


def bare_mission(config: FlightFields, terrain: HeightField, radars: tuple[Radar, ...] = ()) -> FlightMission:
    """Mission of a vehicle without its start, its target, and the quality of its estimates."""
    control_period = round(1.0 / (config.control_rate * TICK)) * TICK
    return FlightMission(
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
        control_period=control_period,
        dropout_rate=config.faults.dropout_rate,
        gust=config.faults.declared_gusts.held(control_period),
        radars=radars,
    )


def mission_but_ends(
    config: FlightFields,
    terrain: HeightField,
    estimator: PluginSpec,
    radars: tuple[Radar, ...] = (),
    beacons: FlightBeacons | None = None,
) -> FlightMission:
    """Mission of a vehicle without its start and target; ``radars`` are known from the start.

    Raises MissionError for ``beacons`` that the estimator does not read, and for those that have to be seen and cannot.
    """
    mission = bare_mission(config, terrain, radars)
    if beacons is not None:
        check_sight(beacons, terrain)
        mission = dataclasses.replace(mission, beacons=beacons)
    if beacons is not None and not set(beacons.sensor_names) <= {
        each.name for each in checked_sensors(estimator, mission)
    }:
        name = called("estimators", estimator.name)
        raise MissionError(
            f"beacons.places = {beacons.places!r}: the estimator {name} does not read them; allowed: one that reads "
            "beacons, such as kalman"
        )
    return dataclasses.replace(mission, quality=checked_quality(estimator, mission, EstimateQuality))


def check_sight(beacons: FlightBeacons, terrain: HeightField) -> None:
    """MissionError for a beacon that needs sight and can never be seen: below the ground, or off the map."""
    for place in beacons.places if beacons.line_of_sight else ():
        if place is None:
            continue
        ground = float(terrain.height(place[0], place[1]))
        if not place[2] >= ground - SIGHT_TOLERANCE:
            where = "off the map" if math.isnan(ground) else f"below the ground, which is at {ground:.1f} m"
            raise MissionError(
                f"beacons.places = {place!r} is {where}; allowed: on or above the ground of the map, or "
                "beacons.line_of_sight = false"
            )


# ---- starts and targets


class Ends(Protocol):
    """Fields of a scenario that state its start and target, or how they are drawn."""

    @property
    def start(self) -> Point | None: ...
    @property
    def target(self) -> Point | None: ...
    @property
    def drawn_separation(self) -> tuple[float, float]: ...


def certified_ends(
    config: Ends,
    mission: FlightMission,
    draw: Callable[[], Point],
    first_plan: Callable[[Point, Point], Plan],
    draws: int,
) -> tuple[Point, Point, Plan]:
    """Start [m], target [m], and the plan from one to the other that proves that the mission can be flown.

    Given ends must be above the ground; others are drawn, ``draws`` times at most, until they are as far apart as the
    fields say and the first plan is certified. Raises MissionError if the given ones are wrong or none are found.
    """
    for name, given in (("start", config.start), ("target", config.target)):
        if given is not None:
            check_above_ground(name, given, mission)
    if config.start is not None and config.target is not None:
        if math.dist(config.start, config.target) <= mission.arrival_radius:
            raise MissionError(
                f"target = {config.target!r} is where the mission starts; "
                f"allowed: more than arrival_radius = {mission.arrival_radius:g} m away from the start"
            )
        plan = first_plan(config.start, config.target)
        if not plan.ok:
            raise MissionError(
                f"start = {config.start!r}, target = {config.target!r}: no initial certificate: {plan.status.value} "
                f"({plan.message}); allowed: a start from which a first plan can be certified"
            )
        return config.start, config.target, plan
    side = max(mission.terrain.width, mission.terrain.depth)
    nearest, farthest = config.drawn_separation
    for _ in range(draws):
        start, target = config.start or draw(), config.target or draw()
        separation = math.dist(start[:2], target[:2])
        if not nearest * side <= separation <= farthest * side or math.dist(start, target) <= mission.arrival_radius:
            continue
        plan = first_plan(start, target)
        if plan.ok:
            return start, target, plan
    raise MissionError(
        f"drawn_separation = {config.drawn_separation!r}: none of {draws} missions drawn for start = {config.start!r} "
        f"and target = {config.target!r} has its ends so far apart and an initial certificate; allowed: other shares "
        "of the side, other heights, or both start and target"
    )


def check_above_ground(name: str, point: Point, mission: FlightMission) -> None:
    """Raise MissionError for a point (x, y, z) [m] where the vehicle is off the mission's map, or lower than h_min
    above the ground below any of its parts.
    """
    terrain, (x, y, z) = mission.terrain, point
    if not terrain.contains(x, y):
        raise MissionError(
            f"{name} = {point!r} is off the map; allowed: 0 to {terrain.width:g} m east, 0 to {terrain.depth:g} m north"
        )
    below = raised_ground(terrain, 0.0 if mission.reach_in_terrain else mission.reach, 0.0)
    ground = float(below.height(x, y))
    if below.walled(x, y):
        raise MissionError(
            f"{name} = {point!r} is over ground that was filled, where no height is known; allowed: another place, or "
            "a map imported with --void-error"
        )
    if z < ground + mission.clearance_min:
        where = "under ground" if z < float(terrain.height(x, y)) else "below the least clearance"
        raise MissionError(
            f"{name} = {point!r} is {where}; the ground within {mission.reach:g} m is up to {ground:.1f} m high; "
            f"allowed: z >= {ground + mission.clearance_min:.1f} m"
        )
    room = min(x, y, terrain.width - x, terrain.depth - y)
    if room < mission.reach:
        raise MissionError(
            f"{name} = {point!r} is {room:g} m from the edge of the map; allowed: >= {mission.reach:g} m, the reach of "
            "the vehicle"
        )


def drawn_point(mission: FlightMission, heights: tuple[float, float], rng: np.random.Generator) -> Point:
    """Drawn point (x, y, z) [m], uniform over the map without its border, and over ``heights`` [m] above h_min."""
    terrain = mission.terrain
    margin = _BORDER * max(terrain.width, terrain.depth)
    east, north = min(margin, 0.25 * terrain.width), min(margin, 0.25 * terrain.depth)  # of a long map
    x = float(rng.uniform(east, terrain.width - east))
    y = float(rng.uniform(north, terrain.depth - north))
    return x, y, float(terrain.height(x, y)) + mission.clearance_min + float(rng.uniform(*heights))


# ---- verdict


def longest_flight(duration: float, deadline_factor: float, speed_max: float, most: float) -> float:
    """Duration [s] rounded up to whole ticks; MissionError if it is longer than can be logged, ``most`` [s]."""
    ticks = math.ceil(duration / TICK) * TICK
    if ticks > most:
        raise MissionError(
            f"deadline_factor = {deadline_factor:g} at speed_max = {speed_max:g} m/s lets the flight take {ticks:.0f} "
            f"s; allowed: {most:.0f} s: a smaller factor or a higher speed"
        )
    return ticks


def due(recording: Recording, name: str, planner: Planner, deadline_factor: float, deadline: float) -> float:
    """Time [s] by which a vehicle must have arrived.

    It is measured by the first flown plan, which started from the estimate; ``deadline`` [s] is that of the plan from
    the true start, and applies to a planner without a certificate.
    """
    if not isinstance(planner, Certified):
        return deadline
    flown = recording.agents[name].plans[:1]
    return min([*(t + deadline_factor * (plan.t_end - t) for t, plan in flown), 2.0 * deadline])


def verdict(
    summary: Mapping[str, Any], due: float, clearance_min: float, speed_max: float
) -> tuple[dict[str, Any], bool]:
    """Summary of a flight, with the requirements that it missed, and whether it arrived in time and touched nothing.

    ``due`` [s], ``clearance_min`` [m] and ``speed_max`` [m/s] are the limits.
    """
    in_time = [Requirement("arrival_time_s", most=due)] if summary["arrived"] else []
    safe = Requirement("ground_contacts", most=0), Requirement("min_clearance_m", least=clearance_min)
    requirements = [Requirement("arrived", least=True), *in_time, *safe]
    return evaluate(summary, requirements, reported=[Requirement("speed_max_m_s", most=speed_max)])


# ---- task and record


def flight_task(
    flights: Mapping[str, FlightMission],
    acceleration_max: float,
    controller: PluginSpec,
    mission: Mapping[str, Any],
    terms: Callable[[float], FlightTerms],
) -> Task | None:
    """Task of commanding point masses: L = sum |a|^2 + beta [m^2/s^4] of all vehicles, the running cost of (A.2).

    beta is the controller's; returns None for a controller without it. ``flights`` are the vehicles' missions,
    ``mission`` the fields with the drawn values, ``terms`` makes a learner's terms from the largest stage cost.
    """
    names = tuple(flights)
    beta = getattr(controller.config, "beta", None)
    if beta is None:
        return None
    inputs = Inputs.within(tuple(f"acceleration_{axis} [m/s^2]" for axis in "xyz"), acceleration_max)
    bounded = input_bound("", acceleration_max, 3)

    def cost(begin: Sample, end: Sample, commands: Mapping[str, Array]) -> float:
        acting = np.array([bounded(commands[name])[0] for name in names])
        return (float(np.square(acting).sum()) + len(names) * float(beta)) * (end.t - begin.t)

    def filters() -> dict[str, CommandFilter]:
        return {name: CommandFilter.for_mission(flight) for name, flight in flights.items()}

    commanded = dict.fromkeys(names, inputs)
    learning = partial(terms, len(names) * (acceleration_max**2 + float(beta)))
    return Task(commanded, cost, mission=mission, filters=filters, proposals=commanded, learning=learning)


def terrain_record(terrain: HeightField, name_or_path: str, **others: Any) -> dict[str, Any]:
    """Record of the terrain in config.json: a file with its whole path, and the digest of the terrain flown over."""
    return {"name": terrain.name, "path": place_of(name_or_path), "digest": terrain.digest, **others}


def flight_record(mission: FlightMission, bound: TrackingBound) -> dict[str, Any]:
    """Fields of a ``FlightRecord``."""
    return {
        "start": mission.start,
        "target": mission.target,
        "clearance_min": mission.clearance_min,
        "speed_max": mission.speed_max,
        "acceleration_max": mission.acceleration_max,
        "deadline_factor": mission.deadline_factor,
        "arrival_radius": mission.arrival_radius,
        "tracking_bound": dataclasses.asdict(bound),
    }
