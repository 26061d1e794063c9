"""``safe-flight``: one aerial vehicle crosses real mountains, plans on line, and arrives (thesis A.1 to A.7).

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> MuJoCo

Every plan is certified before it is flown, whoever made it, unless its plug-in declares ``certified = False`` (the
planner of the print does, for comparison).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from controllers.flight.certificate import Certified, TrackingBound
from models.aerial.dynamics import CONTROL_TICKS, TICK
from models.aerial.entity import build_model
from models.aerial.mission import FlightMission
from models.terrain.height_field import HeightField
from models.terrain.library import load_terrain, place_of
from models.terrain.visibility import Radar
from sim.checks import check, check_rate
from sim.cockpit import Agent
from sim.faults import Disturbance, Disturbed, Gusts, PositionJumps
from sim.log import Recording
from sim.metrics import TimedRadar, flight_summary
from sim.plant import Equipment, MujocoPlant
from sim.plugins import Part, checked_controller, checked_estimator, load
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
    first_plan,
    mission_but_ends,
    mounted,
    wants_certificate,
)
from sim.signals import Array, Message, Plan

VEHICLE = "vehicle"
_LONGEST = 36_000.0  # [s] of simulated time that is logged
_DRAWS = 500
_DIAGONAL = 1.5  # beyond that of a square map, in shares of its side


@dataclass(frozen=True)
class SafeFlightConfig:
    """Fields of the scenario."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    start: Point | None = None
    """x, y, z [m] on the map; drawn from the seed if not given"""
    target: Point | None = None
    """x, y, z [m] on the map; drawn from the seed if not given"""
    drawn_heights: tuple[float, float] = (50.0, 450.0)
    """heights above h_min between which a start or target is drawn [m]"""
    drawn_separation: tuple[float, float] = (0.8, 1.5)
    """shares of the map's side between which the distance of a drawn start and target lies"""
    clearance_min: float = 50.0
    """h_min, least height above ground [m]"""
    speed_max: float = 300.0
    """v_max [m/s]"""
    acceleration_max: float = 40.0
    """a_max [m/s^2]"""
    deadline_factor: float = 1.3
    """gamma: the deadline over the duration of the first plan"""
    arrival_radius: float = 50.0
    """r_f, how near to the target counts as arrived [m]"""
    control_rate: float = 1.0 / (CONTROL_TICKS * TICK)
    """of estimator, tracker and log [Hz]; the physics runs at 300 Hz"""
    radar: tuple[tuple[float, float, float, float], ...] = ()
    """X Y RADIUS WEIGHT [m, m, m, -] of a radar; may be given several times"""
    radar_time: float = 0.0
    """when the radars are switched on [s]; the planner learns of them then"""
    radar_known: bool = True
    """whether the planner is told of the radars at all"""
    noise: Noise = field(default_factory=Noise)
    faults: Faults = field(default_factory=Faults)

    def __post_init__(self) -> None:
        for name in ("start", "target"):
            point = getattr(self, name)
            if point is not None and not all(math.isfinite(c) for c in point):
                raise ValueError(f"{name} = {point!r}; allowed: three finite numbers")
        for name, largest in (("drawn_heights", LARGEST), ("drawn_separation", _DIAGONAL)):
            low, high = getattr(self, name)
            if not 0.0 <= low <= high <= largest:
                raise ValueError(
                    f"{name} = {(low, high)!r}; allowed: two finite numbers, 0 <= low <= high <= {largest:g}"
                )
        check(self.clearance_min, "clearance_min", 0.0, LARGEST)
        for name in ("speed_max", "acceleration_max", "arrival_radius"):
            check(getattr(self, name), name, 0.0, LARGEST, open_low=True)
        check(self.deadline_factor, "deadline_factor", 1.0, LARGEST)
        check(self.radar_time, "radar_time", 0.0)
        check_rate(self.control_rate, "control_rate", TICK)
        for radar in self.radar:
            Radar(*radar)


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
        unknown terrain and for a radar off the map; FileNotFoundError for a terrain file that is not there.
        """
        controller = controller or Part.of(load("controllers", SafeFlight.controller))
        estimator = estimator or Part.of(load("estimators", SafeFlight.estimator))
        draws, sensing, failing, corrupting, delaying, gusting, jumping, losing = np.random.default_rng(seed).spawn(8)
        terrain = load_terrain(config.terrain)
        radars = tuple(TimedRadar(Radar(*radar), config.radar_time) for radar in config.radar)
        for timed in radars:
            timed.radar.position(terrain)
        known = tuple(r.radar for r in radars if config.radar_known and r.time <= 0.0)
        mission = mission_but_ends(config, terrain, estimator, known)
        mission, first = _certified_mission(config, mission, controller, draws)

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

        late = [r for r in radars if config.radar_known and r.time > 0.0]
        messages = [Message(r.time, "radar warning", "radar", r.radar) for r in late]
        agent = Agent(checked_estimator(estimator, mission), planner, tracker, messages=messages)
        deadline = config.deadline_factor * first.t_end
        target = mission.target

        def finished(t: float, truths: Mapping[str, Array]) -> bool:
            away = math.dist(truths[VEHICLE][:3].tolist(), target)
            return away <= mission.arrival_radius or body.contacts(VEHICLE) > 0

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            # The deadline counts from the plan that was flown first, which started from the estimate.
            flown = recording.agents[VEHICLE].plans[:1]
            promised = [t + config.deadline_factor * (plan.t_end - t) for t, plan in flown]
            due = min([*promised, 2.0 * deadline]) if isinstance(planner, Certified) else deadline
            summary = flight_summary(recording, VEHICLE, mission, radars, tracker.bound, due, seed, wall_seconds)
            in_time = [Demand("arrival_time_s", most=due)] if summary["arrived"] else []
            safe = Demand("ground_contacts", most=0), Demand("min_clearance_m", least=mission.clearance_min)
            demands = [Demand("arrived", least=True), *in_time, *safe]
            return judged(summary, demands, told=[Demand("speed_max_m_s", most=mission.speed_max)])

        # Past the deadline a missed pass may still be made good; twice the time is enough for any of them.
        duration = math.ceil(2.0 * deadline / TICK) * TICK
        if duration > _LONGEST:
            raise ValueError(
                f"deadline_factor = {config.deadline_factor:g} at speed_max = {config.speed_max:g} m/s lets the flight "
                f"take {duration:.0f} s; allowed: {_LONGEST:.0f} s, so be sooner or faster"
            )
        record = _record(config, seed, controller, estimator, mission, radars, tracker.bound)
        return Experiment(plant, {VEHICLE: agent}, duration, finished, summarise, record)


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
    radars: tuple[TimedRadar, ...],
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
        "terrain": {"name": terrain.name, "path": place, "digest": terrain.digest},
        "mission": {
            "start": mission.start,
            "target": mission.target,
            "clearance_min": mission.clearance_min,
            "speed_max": mission.speed_max,
            "acceleration_max": mission.acceleration_max,
            "deadline_factor": mission.deadline_factor,
            "arrival_radius": mission.arrival_radius,
            "tracking_bound": dataclasses.asdict(bound),
            "radars": [{**dataclasses.asdict(r.radar), "time": r.time} for r in radars],
        },
    }
