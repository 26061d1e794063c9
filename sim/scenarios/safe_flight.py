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

from controllers.flight.certificate import TrackingBound
from controllers.flight.certified import Certified
from models.aerial.dynamics import TICK
from models.aerial.entity import build_model
from models.aerial.mission import FlightMission
from models.terrain.height_field import HeightField
from models.terrain.library import load_terrain, place_of
from sim.cockpit import Agent
from sim.faults import Disturbance, Disturbed, Gusts, PositionJumps
from sim.log import Recording
from sim.metrics.flight import flight_summary
from sim.plant import Equipment, MujocoPlant
from sim.plugins import Part, checked_controller, checked_estimator, load
from sim.protocols import Plant
from sim.scenarios.demands import Demand, judged
from sim.scenarios.experiment import Experiment
from sim.scenarios.flight_fields import SafeFlightConfig
from sim.scenarios.flight_parts import (
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
from sim.scenarios.information import TargetTrack, check_track
from sim.signals import Array, Plan

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
        config: SafeFlightConfig, seed: int, controller: Part | None = None, estimator: Part | None = None
    ) -> Experiment:
        """The closed loop of one seed.

        Raises ValueError for a start or target below h_min, off the map or without an initial certificate, for an
        unknown terrain, and for a radar, a hill or a target's path off the map; FileNotFoundError for a terrain file
        that is not there.
        """
        controller = controller or Part.of(load("controllers", SafeFlight.controller))
        estimator = estimator or Part.of(load("estimators", SafeFlight.estimator))
        draws, sensing, failing, corrupting, delaying, gusting, jumping, losing = np.random.default_rng(seed).spawn(8)
        charted = load_terrain(config.terrain)
        terrain = config.ground(charted)
        radars = config.tracks(charted)
        mission = mission_but_ends(config, charted, estimator, config.radars_at(0.0, charted))
        mission, first = _certified_mission(config, mission, controller, draws)
        track = TargetTrack(mission.target, terrain, config.target_path)
        true = dataclasses.replace(mission, terrain=terrain)
        check_above_ground("start", mission.start, true)
        check_above_ground("target", mission.target, true)
        check_track(track, config.report_period, lambda name, point: check_above_ground(name, point, true))
        deadline = config.deadline_factor * first.t_end
        # Past the deadline a missed pass may still be made good; twice the time is enough for any of them.
        duration = math.ceil((2.0 * deadline + track.ends) / TICK) * TICK
        if duration > _LONGEST:
            raise ValueError(
                f"deadline_factor = {config.deadline_factor:g} at speed_max = {config.speed_max:g} m/s lets the flight "
                f"take {duration:.0f} s; allowed: {_LONGEST:.0f} s, so be sooner or faster"
            )

        raw, tracker = checked_controller(controller, mission, TrackingBound)
        faults = config.faults
        flawed = faulty(raw, faults, (failing, corrupting, delaying))
        planner = certified(flawed, mission, tracker.bound) if wants_certificate(controller) else flawed
        sensors = mounted(estimator, mission, faults, losing)
        start = np.array([*mission.start, 0.0, 0.0, 0.0])
        body = MujocoPlant(
            _model(terrain, config.acceleration_max),
            {VEHICLE: Equipment(start, sensors, config.acceleration_max)},
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
            # The deadline counts from the plan that was flown first, which started from the estimate.
            flown = recording.agents[VEHICLE].plans[:1]
            promised = [t + config.deadline_factor * (plan.t_end - t) for t, plan in flown]
            due = min([*promised, 2.0 * deadline]) if isinstance(planner, Certified) else deadline
            if config.target_path and isinstance(planner, Certified):
                due = planner.promised  # a target that moves may have moved it
            flown_to = dataclasses.replace(true, target=track.at(float(recording.t[-1])))
            summary = flight_summary(recording, VEHICLE, flown_to, radars, tracker.bound, due, seed, wall_seconds)
            in_time = [Demand("arrival_time_s", most=due)] if summary["arrived"] else []
            safe = Demand("ground_contacts", most=0), Demand("min_clearance_m", least=mission.clearance_min)
            demands = [Demand("arrived", least=True), *in_time, *safe]
            return judged(summary, demands, told=[Demand("speed_max_m_s", most=mission.speed_max)])

        record = _record(config, seed, controller, estimator, true, tracker.bound)
        record["mission"]["target_path"] = [(t, *place) for t, place in track.reported(config.report_period)]
        ends = {"start": mission.start, "target": mission.target}
        task = flight_task((VEHICLE,), config.acceleration_max, controller, ends)
        return Experiment(plant, {VEHICLE: agent}, duration, finished, summarise, record, task=task)


@lru_cache(maxsize=2)
def _model(terrain: HeightField, acceleration_max: float) -> mujoco.MjModel:
    return build_model(terrain, (VEHICLE,), acceleration_max)


def _certified_mission(
    config: SafeFlightConfig, mission: FlightMission, controller: Part, rng: np.random.Generator
) -> tuple[FlightMission, Plan]:
    """The mission with its end points, and a first plan that proves it can be flown.

    End points that are given must be right; those that are not are redrawn until a first plan is certified.
    """
    for name in ("start", "target"):
        point = getattr(config, name)
        if point is not None:
            check_above_ground(name, point, mission)
    if config.start is not None and config.target is not None:
        if math.dist(config.start, config.target) <= mission.arrival_radius:
            raise ValueError(
                f"target = {config.target!r} is where the mission starts; "
                f"allowed: more than arrival_radius = {mission.arrival_radius:g} m away from the start"
            )
        fixed = dataclasses.replace(mission, start=config.start, target=config.target)
        plan = first_plan(fixed, controller)
        if not plan.ok:
            raise ValueError(
                f"start = {config.start!r}, target = {config.target!r}: no initial certificate: {plan.status.value} "
                f"({plan.message}); allowed: a start from which a first plan can be certified"
            )
        return fixed, plan
    side = max(mission.terrain.width, mission.terrain.depth)
    nearest, farthest = config.drawn_separation
    for _ in range(_DRAWS):
        start = config.start or drawn_point(mission, config.drawn_heights, rng)
        target = config.target or drawn_point(mission, config.drawn_heights, rng)
        if not nearest * side <= math.dist(start[:2], target[:2]) <= farthest * side:
            continue
        if math.dist(start, target) <= mission.arrival_radius:
            continue
        drawn = dataclasses.replace(mission, start=start, target=target)
        plan = first_plan(drawn, controller)
        if plan.ok:
            return drawn, plan
    raise ValueError(
        f"drawn_separation = {config.drawn_separation!r}: none of {_DRAWS} missions drawn for start = {config.start!r} "
        f"and target = {config.target!r} has its ends so far apart and an initial certificate; allowed: other shares "
        f"of the side, or both --start and --target"
    )


def _record(
    config: SafeFlightConfig,
    seed: int,
    controller: Part,
    estimator: Part,
    mission: FlightMission,
    bound: Any,
) -> dict[str, Any]:
    """What config.json holds beside the versions. A terrain file is recorded with its whole path."""
    terrain = mission.terrain
    place = place_of(config.terrain)
    resolved = dataclasses.replace(config, terrain=place, start=mission.start, target=mission.target)
    return {
        "scenario": "safe-flight",
        "seed": seed,
        "fields": dataclasses.asdict(resolved),
        "controller": {"name": controller.name, "fields": dataclasses.asdict(controller.config)},
        "estimator": {"name": estimator.name, "fields": dataclasses.asdict(estimator.config)},
        "terrain": {"name": terrain.name, "path": place, "digest": terrain.digest, "hills": config.uncharted},
        "mission": {
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
    }
