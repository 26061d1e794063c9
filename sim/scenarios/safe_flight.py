"""``safe-flight``: one aerial vehicle crosses real mountains, plans online, and arrives (thesis A.1 to A.7).

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> MuJoCo

Every plan of any planner is certified before it is flown, unless its plug-in declares ``certifier = None`` (the
planner of the thesis as printed does, for comparison). With ``filter`` every command is filtered instead, and plans are
not certified.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import mujoco

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.command_filter import FilteredTracker
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.entity import build_model
from mathnavi.models.aerial.mission import AccelerationSensor, FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import RadarTrack
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.metrics.flight import flight_summary
from mathnavi.sim.metrics.flight_beacons import place_figures
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.missions import ChangingFlightRecord
from mathnavi.sim.scenarios.assembler import Assembler
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.flight_assurance import FirstPlans, FlightAssurance, assured
from mathnavi.sim.scenarios.flight_fields import SafeFlightConfig
from mathnavi.sim.scenarios.flight_learning import HOLD, FlightTerms
from mathnavi.sim.scenarios.flight_parts import (
    certified_ends,
    check_above_ground,
    check_sight,
    drawn_point,
    due,
    flight_record,
    flight_task,
    longest_flight,
    map_of,
    mission_but_ends,
    terrain_record,
    verdict,
)
from mathnavi.sim.scenarios.information import TargetTrack, check_track

VEHICLE = "vehicle"
_LONGEST = 36_000.0  # [s] of simulated time that is logged
_DRAWS = 500


class SafeFlight:
    """One aerial vehicle crosses real mountains, plans online, and arrives."""

    Config = SafeFlightConfig
    name = "safe-flight"
    drawing = "mathnavi.renders.flight.drawing"
    controller = "flight"
    estimator = "full_state"
    streams = (
        "draws", "sensing", "solver_failures", "corrupted_plans", "late_plans", "gusts", "position_jumps", "dropouts",
    )  # fmt: skip

    @staticmethod
    def build(
        config: SafeFlightConfig, seed: int, controller: PluginSpec | None = None, estimator: PluginSpec | None = None
    ) -> ClosedLoop:
        """Closed loop of one seed.

        Raises MissionError for a start or target below h_min, off the map or without an initial certificate;
        TerrainError for an unknown terrain; ValueError for a radar, a hill or a target's path off the map;
        FileNotFoundError for a missing terrain file.
        """
        parts = Assembler.for_scenario(SafeFlight, config, seed, controller, estimator)
        mission, first = _mission(config, parts)
        flight = _flight(config, mission, first)
        duration = longest_flight(
            # Past the deadline a missed pass may still be made good; twice the time is enough for any of them.
            2.0 * flight.deadline + flight.track.ends, mission.deadline_factor, mission.speed_max, _LONGEST,
        )  # fmt: skip

        assurance = FlightAssurance.for_mission(parts, mission)
        stack = parts.stack(mission, AccelerationSensor(), assurance=assurance)
        sensors = stack.sensors
        if config.beacons.unknown:  # their sensors know where they are
            sensors = parts.sensors(dataclasses.replace(mission, beacons=flight.mission.beacons), AccelerationSensor())
        setup = VehicleSetup(mission.start_state, sensors, mission.acceleration_max)
        model = _model(flight.mission.terrain, mission.acceleration_max)
        body = MujocoPlant(model, {VEHICLE: setup}, parts.streams["sensing"])
        messages = [*config.messages(mission.terrain, duration), *flight.track.messages(config.report_period)]

        ends = {"start": mission.start, "target": mission.target}
        terrain = terrain_record(flight.mission.terrain, config.terrain, hills=config.uncharted)
        return parts.closed_loop(
            parts.disturbed(body, stack.planner.period, mass=1.0),
            {
                VEHICLE: stack.agent(
                    messages=messages, **assured(mission, stack.tracker, guaranteed=assurance.guaranteed)
                )
            },
            duration,
            partial(finished, flight, body),
            partial(summarise, flight, stack.planner, stack.tracker, seed),
            mission=_record(config, flight, stack.tracker.bound),
            resolved=dataclasses.replace(config, terrain=terrain["path"], start=mission.start, target=mission.target),
            terrain=terrain,
            task=flight_task(
                {VEHICLE: mission},
                mission.acceleration_max,
                parts.controller,
                ends,
                partial(_terms, config, flight, mission, body),
            ),
        )


@dataclass(frozen=True, eq=False)
class TrueFlight:
    """True flight, for the referee and the metrics: over the true ground, to the target's true place."""

    mission: FlightMission  # with the true ground
    track: TargetTrack
    radars: tuple[RadarTrack, ...]
    deadline: float  # [s] by the plan from the true start
    target_moves: bool
    unknown: tuple[int, ...] = ()  # beacons whose places the estimator is not given


def arrived(flight: TrueFlight, t: float, truths: Mapping[str, Array]) -> bool:
    """True if the vehicle is at the target; ``t`` [s], ``truths`` (6,) by vehicle."""
    return math.dist(truths[VEHICLE][:3].tolist(), flight.track.at(t)) <= flight.mission.arrival_radius


def finished(flight: TrueFlight, body: MujocoPlant, t: float, truths: Mapping[str, Array]) -> bool:
    """True if the vehicle has arrived, or has touched something; ``t`` [s], ``truths`` (6,) by vehicle."""
    return arrived(flight, t, truths) or body.contacts(VEHICLE) > 0


def summarise(
    flight: TrueFlight,
    planner: Planner,
    tracker: Any,
    seed: int,
    recording: Recording,
    wall_seconds: float,
) -> tuple[dict[str, Any], bool]:
    """Summary, and whether the vehicle arrived by its deadline and touched nothing."""
    if flight.target_moves and isinstance(planner, Certified):
        deadline = planner.promised  # changed by a target that moved
    else:
        deadline = due(recording, VEHICLE, planner, flight.mission.deadline_factor, flight.deadline)
    flown_to = dataclasses.replace(flight.mission, target=flight.track.at(float(recording.t[-1])))
    summary = flight_summary(recording, VEHICLE, flown_to, flight.radars, tracker.bound, deadline, seed, wall_seconds)
    if flight.mission.beacons is not None:
        summary |= place_figures(recording, VEHICLE, flight.mission.beacons, flight.unknown)
    if isinstance(tracker, FilteredTracker):
        summary |= tracker.figures()
    return verdict(summary, deadline, flight.mission.clearance_min, flight.mission.speed_max)


def _mission(config: SafeFlightConfig, parts: Assembler) -> tuple[FlightMission, Plan]:
    """Mission as known at the start, and its first plan."""
    charted = map_of(config)
    radars, beacons = config.radars_at(0.0, charted), config.beacons.given()
    bare = mission_but_ends(config, charted, parts.estimator, radars, beacons)

    plans = FirstPlans(parts)

    def first_plan(start: tuple[float, float, float], target: tuple[float, float, float]) -> Plan:
        mission = dataclasses.replace(bare, start=start, target=target)
        return plans.plan(mission, mission)

    def draw() -> tuple[float, float, float]:
        return drawn_point(bare, config.drawn_heights, parts.streams["draws"])

    start, target, first = certified_ends(config, bare, draw, first_plan, _DRAWS)
    return dataclasses.replace(bare, start=start, target=target), first


def _flight(config: SafeFlightConfig, mission: FlightMission, first: Plan) -> TrueFlight:
    """Flight over the true ground; MissionError if start, target or the target's path is too near to it."""
    beacons = config.beacons.declared()
    if beacons is not None:
        check_sight(beacons, mission.terrain)
    true = dataclasses.replace(mission, terrain=config.ground(mission.terrain), beacons=beacons)
    track = TargetTrack(mission.target, true.terrain, config.target_path)
    check_above_ground("start", mission.start, true)
    check_above_ground("target", mission.target, true)
    check_track(track, config.report_period, lambda name, point: check_above_ground(name, point, true))
    deadline = mission.deadline_factor * first.t_end
    unknown = config.beacons.unknown
    return TrueFlight(true, track, config.tracks(mission.terrain), deadline, bool(config.target_path), unknown)


def _terms(
    config: SafeFlightConfig, flight: TrueFlight, mission: FlightMission, body: MujocoPlant, cost_max: float
) -> FlightTerms:
    """Learning terms; the deadline counts from the time at which a moving target has come to rest."""
    return FlightTerms(
        {VEHICLE: mission}, flight.mission.terrain, body, partial(arrived, flight), cost_max,
        deadline=flight.deadline + flight.track.ends, hold=HOLD,
        reported=tuple(flight.track.reported(config.report_period)),
    )  # fmt: skip


def _record(config: SafeFlightConfig, flight: TrueFlight, bound: TrackingBound) -> ChangingFlightRecord:
    """Record of the mission in config.json."""
    mission = flight.mission
    return ChangingFlightRecord(
        **flight_record(mission, bound),
        radars=config.radar_records(mission.terrain),
        charted_at=config.charted_at,
        beacons=mission.beacons,
        target_path=tuple((t, *place) for t, place in flight.track.reported(config.report_period)),
    )


@lru_cache(maxsize=2)
def _model(terrain: HeightField, acceleration_max: float) -> mujoco.MjModel:
    return build_model(terrain, (VEHICLE,), acceleration_max)
