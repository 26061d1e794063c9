"""``safe-flight``: one aerial vehicle crosses real mountains, plans on line, and arrives (thesis A.1 to A.7).

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> MuJoCo

Every plan is certified before it is flown, whoever made it, unless its plug-in declares ``certified = False`` (the
planner of the print does, for comparison).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.certified import Certified
from mathnavi.models.aerial.entity import build_model
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain, place_of
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.faults import Disturbance, Disturbed, Gusts, PositionJumps
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.interfaces.protocols import Plant
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.flight import flight_summary
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller, checked_estimator, load
from mathnavi.sim.scenarios.certified_ends import certified_ends
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, recorded
from mathnavi.sim.scenarios.flight_fields import SafeFlightConfig
from mathnavi.sim.scenarios.flight_parts import (
    certified,
    check_above_ground,
    drawn_point,
    faulty,
    first_plan,
    flight_task,
    mission_but_ends,
    mounted,
    wants_certificate,
)
from mathnavi.sim.scenarios.flight_verdict import due, longest_flight, verdict
from mathnavi.sim.scenarios.information import TargetTrack, check_track

VEHICLE = "vehicle"
_LONGEST = 36_000.0  # [s] of simulated time that is logged
_DRAWS = 500


class SafeFlight:
    """One aerial vehicle crosses real mountains, plans on line, and arrives."""

    Config = SafeFlightConfig
    controller = "flight"
    estimator = "full_state"

    @staticmethod
    def inputs(config: SafeFlightConfig) -> dict[str, str]:
        """Digests of what the configuration names: what a result depends on beside the fields."""
        return {"terrain": load_terrain(config.terrain).digest}

    @staticmethod
    def build(
        config: SafeFlightConfig, seed: int, controller: PluginSpec | None = None, estimator: PluginSpec | None = None
    ) -> ClosedLoop:
        """The closed loop of one seed.

        Raises ValueError for a start or target below h_min, off the map or without an initial certificate, for an
        unknown terrain, and for a radar, a hill or a target's path off the map; FileNotFoundError for a terrain file
        that is not there.
        """
        controller = controller or PluginSpec.of(load("controllers", SafeFlight.controller))
        estimator = estimator or PluginSpec.of(load("estimators", SafeFlight.estimator))
        draws, sensing, failing, corrupting, delaying, gusting, jumping, losing = np.random.default_rng(seed).spawn(8)
        charted = load_terrain(config.terrain)
        terrain = config.ground(charted)
        radars = config.tracks(charted)
        mission = mission_but_ends(config, charted, estimator, config.radars_at(0.0, charted))
        start, target, first = certified_ends(
            config,
            charted,
            lambda name, point: check_above_ground(name, point, mission),
            lambda: drawn_point(mission, config.drawn_heights, draws),
            lambda start, target: first_plan(dataclasses.replace(mission, start=start, target=target), controller),
            _DRAWS,
        )
        mission = dataclasses.replace(mission, start=start, target=target)
        track = TargetTrack(mission.target, terrain, config.target_path)
        true = dataclasses.replace(mission, terrain=terrain)
        check_above_ground("start", mission.start, true)
        check_above_ground("target", mission.target, true)
        check_track(track, config.report_period, lambda name, point: check_above_ground(name, point, true))
        deadline = config.deadline_factor * first.t_end
        # Past the deadline a missed pass may still be made good; twice the time is enough for any of them.
        duration = longest_flight(2.0 * deadline + track.ends, config.deadline_factor, config.speed_max, _LONGEST)

        raw, tracker = checked_controller(controller, mission, TrackingBound)
        faults = config.faults
        flawed = faulty(raw, faults, (failing, corrupting, delaying))
        planner = certified(flawed, mission, tracker.bound) if wants_certificate(controller) else flawed
        sensors = mounted(estimator, mission, faults, losing)
        at_rest = np.array([*mission.start, 0.0, 0.0, 0.0])
        body = MujocoPlant(
            _model(terrain, config.acceleration_max),
            {VEHICLE: VehicleSetup(at_rest, sensors, config.acceleration_max)},
            sensing,
        )
        disturbances: list[Disturbance] = []
        if faults.gust_rms > 0.0:
            disturbances.append(Gusts(faults.gust_rms, faults.gust_time_constant, faults.gust_limit, gusting))
        if faults.position_jump > 0.0:
            disturbances.append(PositionJumps(faults.position_jump, planner.period, jumping))
        plant: Plant = Disturbed(body, disturbances) if disturbances else body

        news = [*config.messages(charted, duration), *track.messages(config.report_period)]
        agent = Agent(checked_estimator(estimator, mission), planner, tracker, messages=news)

        def finished(t: float, truths: Mapping[str, Array]) -> bool:
            away = math.dist(truths[VEHICLE][:3].tolist(), track.at(t))
            return away <= mission.arrival_radius or body.contacts(VEHICLE) > 0

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            if config.target_path and isinstance(planner, Certified):
                by = planner.promised  # a target that moves may have moved it
            else:
                by = due(recording, VEHICLE, planner, config.deadline_factor, deadline)
            flown_to = dataclasses.replace(true, target=track.at(float(recording.t[-1])))
            summary = flight_summary(recording, VEHICLE, flown_to, radars, tracker.bound, by, seed, wall_seconds)
            return verdict(summary, by, mission.clearance_min, mission.speed_max)

        record = _record(config, seed, controller, estimator, true, tracker.bound)
        record["mission"]["target_path"] = [(t, *place) for t, place in track.reported(config.report_period)]
        ends = {"start": mission.start, "target": mission.target}
        task = flight_task((VEHICLE,), config.acceleration_max, controller, ends)
        return ClosedLoop(plant, {VEHICLE: agent}, duration, finished, summarise, record, task=task)


@lru_cache(maxsize=2)
def _model(terrain: HeightField, acceleration_max: float) -> mujoco.MjModel:
    return build_model(terrain, (VEHICLE,), acceleration_max)


def _record(
    config: SafeFlightConfig,
    seed: int,
    controller: PluginSpec,
    estimator: PluginSpec,
    mission: FlightMission,
    bound: Any,
) -> dict[str, Any]:
    """What config.json holds beside the versions. A terrain file is recorded with its whole path."""
    terrain = mission.terrain
    place = place_of(config.terrain)
    resolved = dataclasses.replace(config, terrain=place, start=mission.start, target=mission.target)
    return recorded(
        "safe-flight", "mathnavi.renders.flight.drawing", seed, resolved, controller, estimator,
        terrain={"name": terrain.name, "path": place, "digest": terrain.digest, "hills": config.uncharted},
        mission={
            "start": mission.start,
            "target": mission.target,
            "clearance_min": mission.clearance_min,
            "speed_max": mission.speed_max,
            "acceleration_max": mission.acceleration_max,
            "deadline_factor": mission.deadline_factor,
            "arrival_radius": mission.arrival_radius,
            "tracking_bound": dataclasses.asdict(bound),
            **config.recorded(terrain),
        },
    )  # fmt: skip
