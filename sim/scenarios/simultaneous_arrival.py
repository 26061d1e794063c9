"""``simultaneous-arrival``: a fleet crosses real mountains, keeps apart, and arrives at one time (thesis A.8).

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> MuJoCo        of each vehicle alone
    plans, times of arrival <-> coordinator <-> network                              all that they know of each other

Each vehicle has its own slot on a ring about the target and a level of its own on which its stored plan crosses. The
fleet's deadline is D = gamma max V_0, V_0 the duration of each vehicle's first plan.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from mathnavi.models.aerial.entity import build_model
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain, place_of
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.faults import Disturbance, Disturbed, Gusts
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.interfaces.protocols import Plant
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.fleet import fleet_summary
from mathnavi.sim.plugin.registry import PluginSpec, checked_estimator, load
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, recorded
from mathnavi.sim.scenarios.fleet_coordination import consensus_of, coordinators
from mathnavi.sim.scenarios.fleet_fields import SimultaneousArrivalConfig
from mathnavi.sim.scenarios.fleet_start import Vehicle, started_fleet, zone_of
from mathnavi.sim.scenarios.flight_parts import check_above_ground, flight_task, mission_but_ends, mounted
from mathnavi.sim.scenarios.flight_verdict import longest_flight
from mathnavi.sim.scenarios.requirements import Requirement, judged

_LONGEST = 7200.0  # [s]


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
        config: SimultaneousArrivalConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """The closed loop of one seed.

        Raises ValueError for starts or slots below h_min, off the map or too close to each other, and where no plans
        can be stored that keep apart; FileNotFoundError for a terrain file that is not there.
        """
        controller = controller or PluginSpec.of(load("controllers", SimultaneousArrival.controller))
        estimator = estimator or PluginSpec.of(load("estimators", SimultaneousArrival.estimator))
        draws, sensing, failing, gusting, talking, ranking, losing = np.random.default_rng(seed).spawn(7)
        charted, names, consensus = load_terrain(config.terrain), config.names, consensus_of(config)
        terrain = config.ground(charted)
        common = mission_but_ends(config, charted, estimator, config.radars_at(0.0, charted))
        fleet = started_fleet(config, common, controller, draws, failing)
        bound = next(iter(fleet.values())).tracker.bound
        zone = zone_of(config, bound)
        for name, vehicle in fleet.items():
            for place in ("start", "target"):
                true = dataclasses.replace(vehicle.mission, terrain=terrain)
                check_above_ground(f"{place} of {name}", getattr(vehicle.mission, place), true)
        deadline = config.deadline_factor * max(vehicle.stored.t_end for vehicle in fleet.values())
        duration = longest_flight(1.5 * deadline, config.deadline_factor, config.speed_max, _LONGEST)
        news = config.messages(charted, duration)
        agents, equipment = {}, {}
        talkers = coordinators(config, fleet, consensus, zone, deadline, talking, ranking)
        for (name, vehicle), lost in zip(fleet.items(), losing.spawn(len(names)), strict=True):
            vehicle.planner.deadline = deadline
            sensors = mounted(estimator, vehicle.mission, config.faults, lost)
            start = np.array([*vehicle.mission.start, 0.0, 0.0, 0.0])
            equipment[name] = VehicleSetup(start, sensors, config.acceleration_max)
            agents[name] = Agent(
                checked_estimator(estimator, vehicle.mission), vehicle.planner, vehicle.tracker,
                messages=news, coordinator=talkers[name], stored=vehicle.stored,
            )  # fmt: skip
        body = MujocoPlant(_model(terrain, names, config.acceleration_max), equipment, sensing)
        faults = config.faults
        disturbances: list[Disturbance] = []
        if faults.gust_rms > 0.0:
            disturbances.append(Gusts(faults.gust_rms, faults.gust_time_constant, faults.gust_limit, gusting))
        plant: Plant = Disturbed(body, disturbances) if disturbances else body
        missions = {name: dataclasses.replace(vehicle.mission, terrain=terrain) for name, vehicle in fleet.items()}
        radars = config.tracks(charted)
        arrived: set[str] = set()

        def finished(t: float, truths: Mapping[str, Array]) -> bool:
            arrived.update(
                name
                for name, mission in missions.items()
                if math.dist(truths[name][:3].tolist(), mission.target) <= mission.arrival_radius
            )
            return len(arrived) == len(names) or any(body.contacts(name) > 0 for name in names)

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            summary = fleet_summary(recording, missions, radars, deadline, config.separation, seed, wall_seconds)
            late = [Requirement("arrival_time_s", most=deadline)] if summary["arrived"] else []
            requirements = [
                Requirement("arrived", least=True), *late, Requirement("ground_contacts", most=0),
                Requirement("min_clearance_m", least=config.clearance_min),
                Requirement("separation_min_m", least=config.separation),
                *([Requirement("spread_s", most=config.spread)] if summary["arrived"] else []),
            ]  # fmt: skip
            return judged(summary, requirements)

        record = _record(config, seed, controller, estimator, fleet, terrain, deadline)
        network = config.radio.network(names, talking)
        ends = {
            "start": tuple(vehicle.mission.start for vehicle in fleet.values()),
            "target": next(iter(fleet.values())).centre,
        }
        task = flight_task(names, config.acceleration_max, controller, ends)
        return ClosedLoop(plant, agents, duration, finished, summarise, record, network, task)


@lru_cache(maxsize=2)
def _model(terrain: HeightField, names: tuple[str, ...], acceleration_max: float) -> mujoco.MjModel:
    return build_model(terrain, names, acceleration_max)


def _record(
    config: SimultaneousArrivalConfig,
    seed: int,
    controller: PluginSpec,
    estimator: PluginSpec,
    fleet: Mapping[str, Vehicle],
    terrain: HeightField,
    deadline: float,
) -> dict[str, Any]:
    """What config.json holds beside the versions. A terrain file is recorded with its whole path."""
    missions = [vehicle.mission for vehicle in fleet.values()]
    place = place_of(config.terrain)
    resolved = dataclasses.replace(config, terrain=place, start=tuple(mission.start for mission in missions))
    return recorded(
        "simultaneous-arrival", "mathnavi.renders.fleet.drawing", seed, resolved, controller, estimator,
        terrain={"name": terrain.name, "path": place, "digest": terrain.digest, "hills": config.uncharted},
        mission={
            "vehicles": {name: {"start": v.mission.start, "target": v.mission.target} for name, v in fleet.items()},
            **config.recorded(terrain),
            "clearance_min": config.clearance_min,
            "separation": config.separation,
            "speed_max": config.speed_max,
            "acceleration_max": config.acceleration_max,
            "arrival_radius": config.arrival_radius,
            "deadline": deadline,
            "tracking_bound": dataclasses.asdict(next(iter(fleet.values())).tracker.bound),
        },
    )  # fmt: skip
