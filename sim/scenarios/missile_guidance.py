"""``missile-guidance``: a missile dives on a target that may move, and replans while it flies (thesis B.4).

    sensors -> estimator -> faults(planner) -> autopilot -> limited, late thrusters -> MuJoCo

The user's frame is that of the world: x ahead, y to the left, z up. The mission, estimates and plans are in the thesis'
(z down, y to the right, velocities in the body frame), and X_e is rotated away from x if a heading, or a target to the
side, would lead to the singular attitude (``mathnavi.models.missile.mission``); the same holds for the true
states and the pictures.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest
from mathnavi.models.angles import wrapped
from mathnavi.models.missile.coordinates import COORDINATES, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL, TICK, Body
from mathnavi.models.missile.entity import build_model
from mathnavi.models.missile.mission import (
    CASES,
    GustStrength,
    MissileMission,
    MissionFrame,
    Place,
    StateNoise,
    Target,
    TargetMotion,
)
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.metrics.missile import cost, missile_summary
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller
from mathnavi.sim.records.missile_missions import MissileRecord
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.assembler import Assembler
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.missile_fields import MissileGuidanceConfig, MissileMismatch
from mathnavi.sim.scenarios.missile_learning import MissileTerms
from mathnavi.sim.scenarios.requirements import Requirement, evaluate
from mathnavi.sim.scenarios.task import Inputs, Sample, Task


class TurnedPlant(Disturbed):
    """Plant in the frame of a mission: it rotates external forces, torques and displacements and nothing else."""

    def __init__(self, plant: Plant, frame: MissionFrame) -> None:
        super().__init__(plant, ())
        self._axes = frame.axes

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        self.plant.apply_wrench(name, self._axes @ force, None if torque is None else self._axes @ torque)

    def displace(self, name: str, offset: Array) -> None:
        self.plant.displace(name, self._axes @ offset)


VEHICLE = "missile"
_DOUBLINGS, _BISECTIONS = 6, 5  # of the distance to a target that is out of reach
_LONGEST = 600.0  # [s] of simulated time that is logged


class MissileGuidance:
    """A missile dives on a target that may move, and replans while it flies."""

    Config = MissileGuidanceConfig
    name = "missile-guidance"
    drawing = "mathnavi.renders.missile.drawing"
    controller = "missile"
    estimator = "full_state"
    streams = ("sensing", "gusts", "dropouts", "solver_failures", "late_plans")

    @staticmethod
    def build(
        config: MissileGuidanceConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """Closed loop of one seed. Raises MissionError if no first plan is found for the mission."""
        parts = Assembler.for_scenario(MissileGuidance, config, seed, controller, estimator)
        frame = _frame(config)
        target = _target(config, frame)
        mission = _mission(config, target, frame)
        first = _first_plan(config, mission, parts.controller)

        stack = parts.stack(mission)
        start = mission.coordinates.to_joints(mission.start_state)
        limits = np.array(mission.input_max)
        setup = VehicleSetup(start, stack.sensors, limits, config.actuator.delay)
        model = _model(mission.coordinates, mission.input_max, config.mismatch)
        body = MujocoPlant(model, {VEHICLE: setup}, parts.streams["sensing"])
        duration = _duration(config, first)
        outside = TurnedPlant(body, frame) if frame.azimuth else body
        return parts.closed_loop(
            parts.disturbed(outside, stack.planner.period, mass=config.mismatch.mass * mission.body.mass),
            {VEHICLE: stack.agent(mission.coordinates.input_size, _messages(config, target))},
            duration,
            PassedTarget(mission, target).finished,
            partial(summarise, config, mission, target, first, seed),
            mission=_record(config, mission, target, frame),
            task=_task(mission, partial(MissileTerms, mission, VEHICLE, target, config.miss_allowed, duration)),
        )

    @staticmethod
    def errors(config: MissileGuidanceConfig, x: Array, truth: Array) -> dict[str, Array]:
        """Error of each state, named with its unit, of estimates (n, nx) to truths in joint coordinates (n, nx)."""
        coordinates = COORDINATES[config.dimension]
        error = x - coordinates.from_joints(truth)
        error[:, coordinates.angles] = wrapped(error[:, coordinates.angles])
        named = zip(coordinates.states, coordinates.units, strict=True)
        return {f"{state} [{unit}]": error[:, k] for k, (state, unit) in enumerate(named)}


class PassedTarget:
    """Referee that ends a flight once the missile has passed the target, or has reached the ground."""

    def __init__(self, mission: MissileMission, target: TargetMotion) -> None:
        self._mission, self._direction, self._target = mission, mission.final_direction, target
        self._was_before, self._distance = False, math.inf

    def finished(self, t: float, truths: Mapping[str, Array]) -> bool:
        """True if the target was ahead and is behind, by the plane through it across the final direction; ``t`` [s]."""
        place = _place(self._mission, truths[VEHICLE])
        offset = self._target.at(t) - place
        ahead, distance = float(offset @ self._direction), float(np.linalg.norm(offset))
        passed = self._was_before and ahead <= 0.0 and distance > self._distance
        self._distance = distance
        self._was_before |= ahead > 0.0
        return passed or _is_under_ground(place)


def _place(mission: MissileMission, joints: Array) -> Array:
    """Place (3,) [m] in the Earth frame of a missile with joint coordinates and rates (nx,)."""
    return mission.coordinates.place(mission.coordinates.from_joints(joints))


def _is_under_ground(place: Array) -> bool:
    """True if the middle of a missile at a place (3,) [m] in the Earth frame is below the ground, z = 0."""
    return bool(place[2] > 0.0)


def summarise(
    config: MissileGuidanceConfig,
    mission: MissileMission,
    target: TargetMotion,
    first: Plan,
    seed: int,
    recording: Recording,
    wall_seconds: float,
) -> tuple[dict[str, Any], bool]:
    """Summary, and whether the missile hit the target under the aspect angle."""
    figures = missile_summary(recording, VEHICLE, mission, target, first.t_end, first.cost, seed, wall_seconds)
    near = Requirement("miss_m", most=config.miss_allowed)
    aligned = Requirement("aspect_error_deg", most=config.aspect_allowed)
    hit = not near.missed(figures)
    grounded = not hit and _is_under_ground(_place(mission, recording.truths[VEHICLE][-1]))
    if grounded:
        end = float(recording.t[-1])
        text = f"the missile hit the ground; it came no nearer to the target than {figures['miss_m']:.4g} m"
        recording.agents[VEHICLE].event(end, "ground-impact", text)
    above = Requirement("hit_ground", most=False)
    return evaluate({"hit": hit, "hit_ground": grounded, **figures}, [near, aligned, above])


def _frame(config: MissileGuidanceConfig) -> MissionFrame:
    """Frame of the mission, in which no attitude is singular."""
    planar = config.dimension == "planar"
    return MissionFrame.for_flight(
        config.start_heading, config.start, config.target, config.aspect_angle, planar=planar
    )


def _earth(point: Point, frame: MissionFrame) -> Place:
    """Point in the mission's frame, the thesis' Earth frame, from one in the world frame."""
    x, y, z = frame.turned(point)
    return x, 0.0 - y, 0.0 - z  # no negative zeros


def _target(config: MissileGuidanceConfig, frame: MissionFrame) -> TargetMotion:
    """True motion of the target."""
    changes = [(t, _earth((x, y, z), frame)) for t, x, y, z in config.target_change]
    return TargetMotion.along(_earth(config.target, frame), _earth(config.target_velocity, frame), changes)


def _messages(config: MissileGuidanceConfig, target: TargetMotion) -> list[Message]:
    """Messages to the planner: the legs of the target's motion that are not known at the start."""
    known = config.target_announcement_delay == 0.0 or not any(config.target_velocity)
    legs = target.legs[1:] if known else target.legs
    return [Message(leg.t + config.target_announcement_delay, "target watch", "target", leg) for leg in legs]


def _mission(config: MissileGuidanceConfig, motion: TargetMotion, frame: MissionFrame) -> MissileMission:
    """Mission as known at the start."""
    coordinates, case = COORDINATES[config.dimension], CASES[config.case]
    x_e, y_e, z_e = _earth(config.start, frame)
    heading = float(wrapped(math.radians(config.start_heading - frame.azimuth)))
    start = {"u": case.speed, "psi": -heading, "x_e": x_e, "y_e": y_e, "z_e": z_e}
    target = motion.legs[0]
    if config.target_announcement_delay > 0.0:  # until then it seems to stand still
        target = Target(target.place)
    degree, noise, gust = math.radians(1.0), config.noise, config.gust
    return MissileMission(
        start=tuple(start.get(name, 0.0) for name in coordinates.states),
        target=target,
        case=case,
        coordinates=coordinates,
        aspect_angle=math.radians(config.aspect_angle),
        aspect_azimuth=math.radians(frame.azimuth),
        input_max=config.actuator.limits(coordinates),
        noise=StateNoise(noise.position, noise.velocity, degree * noise.angle, degree * noise.rate),
        gust=GustStrength(gust.force_rms, gust.torque_rms, gust.time_constant, gust.force_limit, gust.torque_limit),
        input_delay=config.actuator.known_delay,
        control_period=round(1.0 / (config.control_rate * TICK)) * TICK,
    )


def _first_plan(config: MissileGuidanceConfig, mission: MissileMission, controller: PluginSpec) -> Plan:
    """First plan of the mission; without one, MissionError states the reach on the line to the target."""
    plan = _plan_from_start(mission, controller)
    if not plan.ok:
        raise MissionError(
            f"target = {config.target!r} from start = {config.start!r} is out of reach: no first plan: "
            f"{plan.status.value} ({plan.message}); allowed: {_reach(mission, controller)}"
        )
    return plan


def _plan_from_start(mission: MissileMission, controller: PluginSpec) -> Plan:
    """Plan of a new planner at the start."""
    planner, _ = checked_controller(controller, mission)
    return planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, mission.start_state), None))


def _reach(mission: MissileMission, controller: PluginSpec) -> str:
    """Text on the reach along the line to the target, from first plans to nearer and farther targets."""
    start = mission.coordinates.place(mission.start_state)
    line = np.array(mission.target.place) - start
    distance = float(np.linalg.norm(line))

    def within(share: float) -> bool:
        x, y, z = (start + share * line).tolist()
        if z > 0.0:  # below the ground
            return False
        other = dataclasses.replace(mission, target=dataclasses.replace(mission.target, place=(x, y, z)))
        return _plan_from_start(other, controller).ok

    for factor, words in ((0.5, "at most"), (2.0, "at least")):
        for k in range(1, _DOUBLINGS + 1):
            if within(found := factor**k):
                failed = found / factor
                for _ in range(_BISECTIONS):
                    middle = 0.5 * (found + failed)
                    found, failed = (middle, failed) if within(middle) else (found, middle)
                return f"{words} {found * distance:.4g} m away on this line, and it is {distance:.4g} m away"
    nearest, farthest = 0.5**_DOUBLINGS * distance, 2.0**_DOUBLINGS * distance
    return f"another line: no target from {nearest:.3g} to {farthest:.3g} m away on this one is in reach"


def _duration(config: MissileGuidanceConfig, first: Plan) -> float:
    """Longest flight [s]: twice the first plan; MissionError if that is longer than can be logged."""
    duration = math.ceil(2.0 * first.t_end / TICK) * TICK
    if duration > _LONGEST:
        raise MissionError(
            f"target = {config.target!r} is {first.t_end:.0f} s away; allowed: {0.5 * _LONGEST:.0f} s: a nearer target"
        )
    return duration


def _task(mission: MissileMission, terms: Callable[[], MissileTerms]) -> Task:
    """Task of commanding the thrusters: L is the running cost of the mission's case (B.4), integrated by trapezia."""
    coordinates, limits = mission.coordinates, np.array(mission.input_max)
    units = {"F": "N", "M": "N m", "N": "N m"}
    names = tuple(f"{name} [{units[name[0]]}]" for name in coordinates.inputs)

    def stage_cost(begin: Sample, end: Sample, commands: Mapping[str, Array]) -> float:
        x = coordinates.from_joints(np.array([begin.truths[VEHICLE], end.truths[VEHICLE]]))
        u = np.tile(np.clip(commands[VEHICLE], -limits, limits), (2, 1))
        return cost(np.array([begin.t, end.t]), x, u, mission, end.t)

    return Task({VEHICLE: Inputs.within(names, limits)}, stage_cost, learning=terms)


def _record(
    config: MissileGuidanceConfig, mission: MissileMission, target: TargetMotion, frame: MissionFrame
) -> MissileRecord:
    """Record of the mission in config.json, in the thesis' frame."""
    return MissileRecord(
        dimension=mission.coordinates.name,
        start=mission.start,
        target=target.legs,
        aspect_angle=mission.aspect_angle,
        input_max=mission.input_max,
        case=mission.case,
        miss_allowed=config.miss_allowed,
        aspect_allowed=config.aspect_allowed,
        azimuth=float(frame.azimuth),
    )


@lru_cache(maxsize=4)
def _model(coordinates: Coordinates, input_max: tuple[float, ...], mismatch: MissileMismatch) -> mujoco.MjModel:
    """MuJoCo model of the true missile."""
    true = Body(
        mismatch.mass * NOMINAL.mass,
        mismatch.inertia * NOMINAL.inertia,
        mismatch.inertia * NOMINAL.axial_inertia,
        NOMINAL.gravity,
    )
    return build_model(
        coordinates, input_max, true, name=VEHICLE, force_factor=mismatch.force, moment_factor=mismatch.moment
    )
