"""``missile-guidance``: a missile dives on a target that may move, and plans again while it flies (thesis B.4).

    sensors -> estimator -> faults(planner) -> autopilot -> limited, late thrusters -> MuJoCo

The user's frame is that of the world: x ahead, y to the left, z up. The mission, estimates and plans are in the thesis'
(z down, y to the right, velocities in the body frame).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from mathnavi.models.angles import wrapped
from mathnavi.models.missile.coordinates import COORDINATES, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL, TICK, Body
from mathnavi.models.missile.entity import build_model
from mathnavi.models.missile.mission import CASES, GustStrength, MissileMission, Place, Target
from mathnavi.models.missile.sensors import StateNoise
from mathnavi.models.missile.target import TargetMotion
from mathnavi.models.sensor_faults import Dropout
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.faults import ConstantWrench, Delayed, Disturbance, Disturbed, FailingSolver, Gusts
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.interfaces.protocols import Plant, Sensor
from mathnavi.sim.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest
from mathnavi.sim.metrics.missile import cost, missile_summary
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller, checked_estimator, checked_sensors, load
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, recorded
from mathnavi.sim.scenarios.missile_fields import Mismatch, MissileGuidanceConfig, Point
from mathnavi.sim.scenarios.requirements import Requirement, judged
from mathnavi.sim.scenarios.task import Inputs, Look, Task

VEHICLE = "missile"
_LONGEST = 600.0  # [s] of simulated time that is logged


class MissileGuidance:
    """A missile dives on a target that may move, and plans again while it flies."""

    Config = MissileGuidanceConfig
    controller = "missile"
    estimator = "full_state"

    @staticmethod
    def build(
        config: MissileGuidanceConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """The closed loop of one seed. Raises ValueError for a mission that no first plan is found for."""
        controller = controller or PluginSpec.of(load("controllers", MissileGuidance.controller))
        estimator = estimator or PluginSpec.of(load("estimators", MissileGuidance.estimator))
        sensing, gusting, losing, failing, delaying = np.random.default_rng(seed).spawn(5)
        truth = _target(config)
        mission = _mission(config, truth)
        first = _first_plan(mission, controller)

        planner, tracker = checked_controller(controller, mission)
        faults = config.faults
        if faults.solver_failure_rate > 0.0:
            planner = FailingSolver(planner, faults.solver_failure_rate, failing)
        if faults.late_plan_rate > 0.0:
            planner = Delayed(planner, faults.late_plan_latency, faults.late_plan_rate, delaying)

        sensors: list[Sensor] = list(checked_sensors(estimator, mission))
        if config.noise.dropout_rate > 0.0:
            sensors = [
                Dropout(sensor, config.noise.dropout_rate, rng)
                for sensor, rng in zip(sensors, losing.spawn(len(sensors)), strict=True)
            ]
        plant = _plant(config, mission, sensors, sensing, gusting)
        agent = Agent(
            checked_estimator(estimator, mission),
            planner,
            tracker,
            mission.coordinates.input_size,
            [Message(leg.t + config.target_told, "target watch", "target", leg) for leg in _news(config, truth)],
        )
        duration = math.ceil(2.0 * first.t_end / TICK) * TICK
        if duration > _LONGEST:
            raise ValueError(
                f"target = {config.target!r} is {first.t_end:.0f} s away; allowed: {0.5 * _LONGEST:.0f} s, so be nearer"
            )

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            figures = missile_summary(recording, VEHICLE, mission, truth, first.t_end, first.cost, seed, wall_seconds)
            near = Requirement("miss_m", most=config.miss_allowed)
            turned = Requirement("aspect_error_deg", most=config.aspect_allowed)
            return judged({"hit": not near.missed(figures), **figures}, [near, turned])

        record = _record(config, seed, controller, estimator, mission, truth)
        ended = _Referee(mission, truth).ended
        return ClosedLoop(plant, {VEHICLE: agent}, duration, ended, summarise, record, task=_task(mission))

    @staticmethod
    def errors(config: MissileGuidanceConfig, x: Array, truth: Array) -> dict[str, Array]:
        """The error of each state, named with its unit, of estimates (n, nx) to truths in joint coordinates (n, nx)."""
        coordinates = COORDINATES[config.dimension]
        off = x - coordinates.from_joints(truth)
        off[:, coordinates.angles] = wrapped(off[:, coordinates.angles])
        named = zip(coordinates.states, coordinates.units, strict=True)
        return {f"{state} [{unit}]": off[:, k] for k, (state, unit) in enumerate(named)}


def _task(mission: MissileMission) -> Task:
    """Thrusters that are commanded: L is the running cost of the mission's case (B.4), its integral by trapezia."""
    coordinates, limits = mission.coordinates, np.array(mission.input_max)
    units = {"F": "N", "M": "N m", "N": "N m"}
    names = tuple(f"{name} [{units[name[0]]}]" for name in coordinates.inputs)

    def stage_cost(begin: Look, end: Look, commands: Mapping[str, Array]) -> float:
        x = coordinates.from_joints(np.array([begin.truths[VEHICLE], end.truths[VEHICLE]]))
        u = np.tile(np.clip(commands[VEHICLE], -limits, limits), (2, 1))
        return cost(np.array([begin.t, end.t]), x, u, mission, end.t)

    return Task({VEHICLE: Inputs.within(names, limits)}, stage_cost)


class _Referee:
    """Ends a flight once the missile has passed the target, and leaves it behind, or has reached the ground."""

    def __init__(self, mission: MissileMission, target: TargetMotion) -> None:
        self._coordinates, self._direction, self._target = mission.coordinates, mission.final_direction, target
        self._was_before, self._distance = False, math.inf

    def ended(self, t: float, truths: Mapping[str, Array]) -> bool:
        """The plane through the target across the final direction is passed when it was ahead and is behind."""
        place = self._coordinates.place(self._coordinates.from_joints(truths[VEHICLE]))
        offset = self._target.at(t) - place
        ahead, distance = float(offset @ self._direction), float(np.linalg.norm(offset))
        passed = self._was_before and ahead <= 0.0 and distance > self._distance
        self._distance = distance
        self._was_before |= ahead > 0.0
        under_ground = bool(place[2] > 0.0)
        return passed or under_ground


def _earth(point: Point) -> Place:
    """World frame to the thesis' Earth frame."""
    x, y, z = point
    return x, 0.0 - y, 0.0 - z  # no negative zeros


def _target(config: MissileGuidanceConfig) -> TargetMotion:
    changes = [(t, _earth((x, y, z))) for t, x, y, z in config.target_change]
    return TargetMotion.along(_earth(config.target), _earth(config.target_velocity), changes)


def _news(config: MissileGuidanceConfig, truth: TargetMotion) -> list[Target]:
    """The legs that the planner does not know of at the start."""
    known = config.target_told == 0.0 or not any(config.target_velocity)
    return list(truth.legs[1:] if known else truth.legs)


def _mission(config: MissileGuidanceConfig, truth: TargetMotion) -> MissileMission:
    coordinates, case = COORDINATES[config.dimension], CASES[config.case]
    x_e, y_e, z_e = _earth(config.start)
    start = {"u": case.speed, "psi": -math.radians(config.start_heading), "x_e": x_e, "y_e": y_e, "z_e": z_e}
    target = truth.legs[0]
    if config.target_told > 0.0:  # until then it seems to stand still
        target = Target(target.place)
    degree, noise, gust = math.radians(1.0), config.noise, config.gust
    return MissileMission(
        start=tuple(start.get(name, 0.0) for name in coordinates.states),
        target=target,
        case=case,
        coordinates=coordinates,
        aspect_angle=math.radians(config.aspect_angle),
        input_max=config.actuator.limits(coordinates),
        noise=StateNoise(noise.position, noise.velocity, degree * noise.angle, degree * noise.rate),
        gust=GustStrength(gust.force_rms, gust.torque_rms, gust.time_constant, gust.force_limit, gust.torque_limit),
        control_period=round(1.0 / (config.control_rate * TICK)) * TICK,
    )


def _first_plan(mission: MissileMission, controller: PluginSpec) -> Plan:
    """What a fresh planner answers at the start: how long the flight should take."""
    planner, _ = checked_controller(controller, mission)
    plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, mission.start_state), None))
    if not plan.ok:
        raise ValueError(
            f"target = {mission.target.place!r} (x_e, y_e, z_e) from start = {mission.start!r}: no first plan: "
            f"{plan.status.value} ({plan.message}); allowed: a mission that the controller finds a plan for"
        )
    return plan


def _plant(
    config: MissileGuidanceConfig,
    mission: MissileMission,
    sensors: list[Sensor],
    sensing: np.random.Generator,
    gusting: np.random.Generator,
) -> Plant:
    """The true missile, with what disturbs it."""
    start = mission.coordinates.to_joints(mission.start_state)
    equipment = VehicleSetup(start, tuple(sensors), np.array(mission.input_max), config.actuator.delay)
    body = MujocoPlant(_model(mission.coordinates, mission.input_max, config.mismatch), {VEHICLE: equipment}, sensing)
    gust = config.gust
    disturbances: list[Disturbance] = []
    if any(gust.force) or any(gust.torque):
        disturbances.append(ConstantWrench(gust.force, gust.torque))
    if gust.force_rms > 0.0 or gust.torque_rms > 0.0:
        strength = (gust.force_rms, gust.time_constant, gust.force_limit)
        turning = {"moment_rms": gust.torque_rms, "moment_limit": gust.torque_limit}
        disturbances.append(Gusts(*strength, gusting, **turning))
    return Disturbed(body, disturbances) if disturbances else body


@lru_cache(maxsize=4)
def _model(coordinates: Coordinates, input_max: tuple[float, ...], mismatch: Mismatch) -> mujoco.MjModel:
    true = Body(
        mismatch.mass * NOMINAL.mass,
        mismatch.inertia * NOMINAL.inertia,
        mismatch.inertia * NOMINAL.axial_inertia,
        NOMINAL.gravity,
    )
    return build_model(
        coordinates, input_max, true, name=VEHICLE, force_factor=mismatch.force, moment_factor=mismatch.moment
    )


def _record(
    config: MissileGuidanceConfig,
    seed: int,
    controller: PluginSpec,
    estimator: PluginSpec,
    mission: MissileMission,
    truth: TargetMotion,
) -> dict[str, Any]:
    """What config.json holds beside the versions; the mission is in the thesis' frame."""
    return recorded(
        "missile-guidance", "mathnavi.renders.missile.drawing", seed, config, controller, estimator,
        mission={
            "dimension": mission.coordinates.name,
            "start": mission.start,
            "target": [dataclasses.asdict(leg) for leg in truth.legs],
            "aspect_angle": mission.aspect_angle,
            "input_max": mission.input_max,
            "case": dataclasses.asdict(mission.case),
            "miss_allowed": config.miss_allowed,
            "aspect_allowed": config.aspect_allowed,
        },
    )  # fmt: skip
