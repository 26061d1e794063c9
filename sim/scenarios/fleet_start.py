"""Starts of a fleet: each vehicle with a slot, a level, and a stored plan that keeps apart from the others.

The stored plans arrive at one time, the assured time T_A, which is later than the last vehicle's own arrival. Until
then the vehicles wait above their slots. The fleet then agrees on an earlier time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist, pdist

from mathnavi.controllers.arrival.coordinator import ArrivalEstimate
from mathnavi.controllers.arrival.separation_rule import Zone, checked_start
from mathnavi.controllers.flight.certificate import Certificate, TrackingBound
from mathnavi.controllers.flight.planner import ASSURED, braking_time
from mathnavi.interfaces.errors import MissionError, PluginError
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Estimate, Message, Plan, PlanRequest
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.plugin.registry import checked_controller
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.assembler import Assembler, RandomStreams
from mathnavi.sim.scenarios.fault_fields import PLANNER_STREAMS
from mathnavi.sim.scenarios.fleet_fields import SimultaneousArrivalConfig, SlotAssignment
from mathnavi.sim.scenarios.flight_assurance import FlightAssurance
from mathnavi.sim.scenarios.flight_parts import check_above_ground, drawn_point

_DRAWS = 200
_TARGETS = 10_000
_TRIES = 5
_ROOM = 0.95  # of the widest ring that fits: drawn targets need some room
_SLACK = 1.05  # factor of the assured time: the flown path is longer than a straight line


@dataclass(frozen=True, eq=False)
class StartedVehicle:
    """Vehicle of the fleet, ready to fly."""

    mission: FlightMission
    centre: Point  # [m] of the slots
    planner: Planner  # with its certificate
    tracker: Any
    estimate: ArrivalEstimate
    stored: Plan
    braking: float  # [s] from within the arrival radius to rest at the slot

    @property
    def assured(self) -> float:
        """Time [s] at which the stored plan arrives."""
        return self.stored.t_end - self.braking


def zone_of(config: SimultaneousArrivalConfig, bound: TrackingBound) -> Zone:
    """Zone that each vehicle keeps free of the others' plans, for a tracking bound [m, m/s]."""
    return Zone(config.separation, math.hypot(bound.horizontal, bound.vertical), config.speed_max, config.clocks.error)


def started_fleet(
    config: SimultaneousArrivalConfig, common: FlightMission, parts: Assembler
) -> dict[str, StartedVehicle]:
    """Vehicles of the fleet, with stored plans that keep apart; values that are not given are drawn again until they
    do.

    Raises MissionError for impossible starts or slots, and if no possible ones are drawn.
    """
    rng, failing = parts.streams["draws"], parts.streams["planner_faults"]
    # Drawn ends from which no first plan can be certified are too low, and are drawn again.
    if config.target is not None:
        check_above_ground("target", config.target, common)
    for (one, a), (other, b) in combinations(zip(config.names, config.start, strict=False), 2):
        if math.dist(a, b) < config.separation:
            raise MissionError(
                f"start of {one} and of {other} are {math.dist(a, b):.2f} m apart; allowed: >= {config.separation:g} m"
            )
    for name, start in zip(config.names, config.start, strict=False):
        check_above_ground(f"start of {name}", start, common)
    reasons: list[str] = []
    given = bool(config.start) and config.target is not None
    ring = _checked_ring(config, common.terrain)
    for _ in range(1 if given else _DRAWS):
        try:
            target = config.target or _drawn_target(config, common, ring, rng)
            slots = _slots(common, target, ring)
            starts = config.start or _drawn_starts(config, common, target, rng)
            faults = failing.spawn(config.vehicles)
            _check_starts_apart(config, starts)
            ends = list(zip(config.names, starts, _assigned(config.slot_assignment, starts, slots), strict=True))
            farthest = sorted(ends, key=lambda each: -math.dist(each[1], each[2]))
            level = {name: _level(config, common, k) for k, (name, _, _) in enumerate(farthest)}
            missions = {
                name: dataclasses.replace(common, start=start, target=slot, cruise_level=level[name])
                for name, start, slot in ends
            }
            alone = {
                name: _vehicle(name, mission, target, parts, RandomStreams(own, PLANNER_STREAMS))
                for (name, mission), own in zip(missions.items(), faults, strict=True)
            }
            fleet = _together(alone)
            _check_apart(config, fleet)
        except _NoFleetError as error:
            if given:
                raise MissionError(str(error)) from None
            reasons.append(str(error))
        else:
            return fleet
    raise MissionError(
        f"drawn_distance = {config.drawn_distance!r}: none of {_DRAWS} fleets drawn can start; the last: "
        f"{reasons[-1]}; allowed: other shares of the side, fewer vehicles, a smaller separation, or start and "
        "target"
    )


class _NoFleetError(Exception):
    """Vehicles that cannot start like this, though others might."""


def _together(alone: Mapping[str, StartedVehicle]) -> dict[str, StartedVehicle]:
    """Vehicles with stored plans that arrive at one time, T_A = _SLACK (max eta + max (t_a - eta)).

    eta is the least time in which a vehicle can arrive, t_a the arrival time of its first plan. So a vehicle that flies
    slowly enough to arrive with the last one can still change to its level, wait above its slot and arrive at T_A.
    """
    least = {name: vehicle.estimate(vehicle.stored, 0.0) for name, vehicle in alone.items()}
    assured = _SLACK * (max(least.values()) + max(each.assured - least[name] for name, each in alone.items()))
    for _ in range(_TRIES):
        fleet = {
            name: dataclasses.replace(vehicle, stored=_stored(name, vehicle.planner, vehicle.mission, assured))
            for name, vehicle in alone.items()
        }
        latest = max(vehicle.assured for vehicle in fleet.values())
        if latest <= assured + TIME_TOLERANCE:
            return fleet
        assured = latest
    raise _NoFleetError(f"no first plans that arrive at one time, by {assured:.2f} s")


def _check_apart(config: SimultaneousArrivalConfig, fleet: Mapping[str, StartedVehicle]) -> None:
    zone = zone_of(config, next(iter(fleet.values())).tracker.bound)
    if config.slot_spacing < zone.required:
        raise MissionError(
            f"slot_spacing = {config.slot_spacing!r}; allowed: >= {zone.required:.6g}, the separation and the "
            "deviations of two vehicles from their plans"
        )
    try:
        checked_start(
            [(name, vehicle.stored) for name, vehicle in fleet.items()],
            {name: np.array(vehicle.mission.target) for name, vehicle in fleet.items()},
            zone,
        )
    except ValueError as error:
        raise _NoFleetError(str(error)) from None


def _checked_ring(config: SimultaneousArrivalConfig, terrain: HeightField) -> list[tuple[float, float]]:
    """Slots (x, y) [m] on their ring, relative to its middle; MissionError if they lie off the map for every middle."""
    n = config.vehicles
    radius = 0.5 * config.slot_spacing / math.sin(math.pi / n)
    ring = [(radius * math.cos(2.0 * math.pi * k / n), radius * math.sin(2.0 * math.pi * k / n)) for k in range(n)]
    east, north = np.ptp(ring, axis=0).tolist()
    if east > terrain.width or north > terrain.depth:
        most = config.slot_spacing * min(terrain.width / max(east, 1e-9), terrain.depth / max(north, 1e-9))
        if config.target is None:
            most *= _ROOM
        allowed = f"<= {math.floor(most)} m, or fewer vehicles" if most >= config.separation else "fewer vehicles"
        raise MissionError(
            f"slot_spacing = {config.slot_spacing!r}: the ring of {n} slots is {max(east, north):.0f} m across and "
            f"does not fit the map, {terrain.width:g} m by {terrain.depth:g} m, wherever the target is; allowed: "
            f"{allowed}"
        )
    if config.target is not None and not _holds(terrain, config.target, ring):
        raise MissionError(
            f"target = {config.target!r}: slots on a ring of {radius:.0f} m about it lie off the map; allowed: "
            f"{radius:.0f} m from its edge, or a smaller slot_spacing"
        )
    return ring


def _holds(terrain: HeightField, target: Point, ring: Sequence[tuple[float, float]]) -> bool:
    """True if all slots about a target are on the map."""
    return all(terrain.contains(target[0] + east, target[1] + north) for east, north in ring)


def _drawn_target(
    config: SimultaneousArrivalConfig,
    common: FlightMission,
    ring: Sequence[tuple[float, float]],
    rng: np.random.Generator,
) -> Point:
    """Drawn target whose slots are all on the map; MissionError if none of the draws is."""
    for _ in range(_TARGETS):
        target = drawn_point(common, config.drawn_heights, rng)
        if _holds(common.terrain, target, ring):
            return target
    raise MissionError(
        f"slot_spacing = {config.slot_spacing!r}: the slots about none of {_TARGETS} targets drawn are all on the map; "
        "allowed: a smaller one, fewer vehicles, or a target"
    )


def _slots(common: FlightMission, target: Point, ring: Sequence[tuple[float, float]]) -> list[Point]:
    """Slots (x, y, z) [m] on a ring about the target, at its height or higher if the ground requires it."""
    x, y, z = target
    height = z - float(common.terrain.height(x, y))
    places = [(x + east, y + north) for east, north in ring]
    return [(px, py, max(z, float(common.terrain.height(px, py)) + height)) for px, py in places]


def _check_starts_apart(config: SimultaneousArrivalConfig, starts: Sequence[Point]) -> None:
    """Raise _NoFleetError for starts that are less than the separation apart, before anything is planned."""
    apart = pdist(np.array(starts))
    nearest = int(apart.argmin())
    if apart[nearest] < config.separation:
        one, other = (config.names[ends[nearest]] for ends in np.triu_indices(len(starts), 1))
        raise _NoFleetError(
            f"start of {one} and of {other} are {apart[nearest]:.2f} m apart; allowed: >= {config.separation:g} m"
        )


def _assigned(assignment: SlotAssignment, starts: Sequence[Point], slots: Sequence[Point]) -> list[Point]:
    """Slot of each start.

    With the least sum of squared distances (x_i - x_j) . (g_i - g_j) >= 0 for any two vehicles with starts x and slots
    g. On straight lines that all begin and end at one time they then stay min(|x_i - x_j|, |g_i - g_j|) / sqrt(2) apart
    (Turpin, Michael and Kumar, "CAPT: concurrent assignment and planning of trajectories", 2014).
    """
    if assignment == "in_order":
        return list(slots)
    squared = cdist(np.array(starts), np.array(slots), "sqeuclidean")
    return [slots[k] for k in linear_sum_assignment(squared)[1]]


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
    """Level [m] on which the k-th vehicle's stored plans cross, well above the level before."""
    top = float(common.terrain.z.max()) + config.clearance_min
    return top + (k + 1) * 1.5 * config.separation


def _vehicle(
    name: str, mission: FlightMission, centre: Point, parts: Assembler, streams: RandomStreams
) -> StartedVehicle:
    raw, tracker = checked_controller(parts.controller, mission, TrackingBound)
    if not hasattr(raw, "length_to_go"):
        raise PluginError(
            f"controller = {parts.controller.name!r}: its planner has no length to go; allowed: one that has "
            "length_to_go(points), from which its vehicle estimates its arrival time"
        )
    assurance = FlightAssurance.for_mission(parts, mission)
    if not assurance.guaranteed:
        raise PluginError(
            f"controller = {parts.controller.name!r}: certifier = None; allowed in a fleet: a function, or none "
            "declared, for vehicles rely on the certified plans of others"
        )
    planner, tracker = assurance.around(parts.with_planner_faults(raw, streams), tracker)
    stored = _stored(name, planner, mission)
    estimate = ArrivalEstimate(raw.length_to_go, np.array(mission.target), mission.speed_max - tracker.bound.speed)
    braking = braking_time(Certificate.for_mission(mission, tracker.bound))
    return StartedVehicle(mission, centre, planner, tracker, estimate, stored, braking)


def _stored(name: str, planner: Planner, mission: FlightMission, assured: float | None = None) -> Plan:
    """First plan of a vehicle, to arrive at ``assured`` [s] if given; _NoFleetError if it cannot be certified."""
    messages = () if assured is None else (Message(0.0, name, ASSURED, assured),)
    stored = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, mission.start_state), None, messages))
    if not stored.ok:
        raise _NoFleetError(
            f"start of {name} = {mission.start!r}, slot = {mission.target!r}: no initial certificate: "
            f"{stored.status.value} ({stored.message}); allowed: a start from which a first plan can be certified"
        )
    return stored
