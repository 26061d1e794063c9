"""``missile-guidance``: a missile dives on a target that may move, and plans again while it flies (thesis B.4).

    sensors -> estimator -> faults(planner) -> autopilot -> limited, late thrusters -> MuJoCo

The user's frame is that of the world: x ahead, y to the left, z up. The mission, estimates and plans are in the thesis'
(z down, y to the right, velocities in the body frame).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal

import mujoco
import numpy as np

from models.aerial.sensors import Dropout
from models.missile.coordinates import COORDINATES, Coordinates
from models.missile.dynamics import NOMINAL, TICK, Body
from models.missile.entity import build_model
from models.missile.mission import CASES, GustStrength, MissileMission, Place, Target
from models.missile.sensors import StateNoise
from models.missile.target import TargetMotion
from sim.faults import ConstantWrench, Delayed, Disturbance, Disturbed, FailingSolver, Gusts
from sim.log import Recording
from sim.loop import Agent
from sim.missile_metrics import missile_summary
from sim.plant import Equipment, MujocoPlant
from sim.plugins import Part, checked_controller, checked_estimator, checked_sensors, load
from sim.protocols import Plant, Sensor
from sim.scenarios.checks import check, check_rate
from sim.scenarios.experiment import Experiment
from sim.signals import Array, Estimate, Message, Plan, PlanRequest

VEHICLE = "missile"
_LARGEST = 1e6  # of any field in SI units
_LONGEST = 600.0  # [s] of simulated time that is logged

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Mismatch:
    """The true missile over the declared one."""

    mass: float = 1.0
    """factor of the mass"""
    inertia: float = 1.0
    """factor of the moments of inertia"""
    force: float = 1.0
    """factor of what the thrusters give as a force"""
    moment: float = 1.0
    """factor of what they give as a moment"""

    def __post_init__(self) -> None:
        for name in ("mass", "inertia", "force", "moment"):
            check(getattr(self, name), f"mismatch.{name}", 0.1, 10.0)


@dataclass(frozen=True)
class Gust:
    """What acts on the missile beside its thrusters, in the frame of the world."""

    force: Point = (0.0, 0.0, 0.0)
    """constant force [N]"""
    torque: Point = (0.0, 0.0, 0.0)
    """constant torque [N m]; one about y turns the nose down"""
    force_rms: float = 0.0
    """of the random force on each axis [N]"""
    torque_rms: float = 0.0
    """of the random torque about each axis [N m]"""
    time_constant: float = 1.0
    """of both random ones' first-order model [s]"""
    force_limit: float = 2000.0
    """largest random force [N]"""
    torque_limit: float = 200.0
    """largest random torque [N m]"""

    def __post_init__(self) -> None:
        for name in ("force", "torque"):
            _check_point(getattr(self, name), f"gust.{name}")
        for name in ("force_rms", "torque_rms"):
            check(getattr(self, name), f"gust.{name}", 0.0, _LARGEST)
        check(self.time_constant, "gust.time_constant", TICK, _LARGEST)
        for name in ("force_limit", "torque_limit"):
            check(getattr(self, name), f"gust.{name}", 0.0, _LARGEST, open_low=True)


@dataclass(frozen=True)
class Actuator:
    """Limits of the thrusters, known to the controller, and how late they are, which is not."""

    axial: float = 20_000.0
    """largest force along the missile [N]"""
    normal: float = 60_000.0
    """largest force on each axis across it [N]"""
    moment: float = 3_000.0
    """largest moment about each axis across it [N m]"""
    delay: float = 0.0
    """from a command to what the thrusters do [s], whole milliseconds"""

    def __post_init__(self) -> None:
        for name in ("axial", "normal", "moment"):
            check(getattr(self, name), f"actuator.{name}", 0.0, 1e9, open_low=True)
        check(self.delay, "actuator.delay", 0.0, 1.0)
        if abs(self.delay / TICK - round(self.delay / TICK)) > 1e-6:
            raise ValueError(f"actuator.delay = {self.delay!r}; allowed: a whole number of physics ticks of {TICK:g} s")

    def limits(self, coordinates: Coordinates) -> tuple[float, ...]:
        """(nu,) on the magnitude of each input."""
        by_input = {"F_x": self.axial, "F_y": self.normal, "F_z": self.normal, "M": self.moment, "N": self.moment}
        return tuple(by_input[name] for name in coordinates.inputs)


@dataclass(frozen=True)
class Noise:
    """How the readings of the state err: standard deviations on each axis."""

    position: float = 0.0
    """[m]"""
    velocity: float = 0.0
    """[m/s], along the axes of the body"""
    angle: float = 0.0
    """[deg]"""
    rate: float = 0.0
    """of the angular velocity [deg/s]"""
    dropout_rate: float = 0.0
    """fraction of the readings that are lost"""

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "angle", "rate"):
            check(getattr(self, name), f"noise.{name}", 0.0, _LARGEST)
        check(self.dropout_rate, "noise.dropout_rate", 0.0, 1.0)


@dataclass(frozen=True)
class Faults:
    """What goes wrong with the planner on purpose."""

    solver_failure_rate: float = 0.0
    """fraction of the requests on which the solver gives up"""
    late_plan_rate: float = 0.0
    """fraction of the requests answered late_plan_latency too late to be of use"""
    late_plan_latency: float = 1.0
    """simulated time that a late answer takes [s]"""

    def __post_init__(self) -> None:
        for name in ("solver_failure_rate", "late_plan_rate"):
            check(getattr(self, name), f"faults.{name}", 0.0, 1.0)
        check(self.late_plan_latency, "faults.late_plan_latency", 0.0, _LARGEST)


@dataclass(frozen=True)
class MissileGuidanceConfig:
    """Fields of the scenario."""

    case: Literal["SM", "SM2", "SM3", "FAST"] = "SM"
    """the problem that is optimised: speed at the start and weights of the cost"""
    dimension: Literal["planar", "spatial"] = "planar"
    """the pitch plane, as the thesis has it, or space"""
    start: Point = (0.0, 0.0, 10.0)
    """x, y, z [m]"""
    start_heading: float = 0.0
    """of the level start, from x to the left [deg]"""
    target: Point = (700.0, 0.0, 0.0)
    """x, y, z [m]"""
    target_velocity: Point = (0.0, 0.0, 0.0)
    """[m/s]"""
    target_change: tuple[tuple[float, float, float, float], ...] = ()
    """TIME VX VY VZ [s, m/s]: a velocity that the target takes up later; may be given several times"""
    target_told: float = 0.0
    """how long after the target has taken up a velocity the planner is told of it [s]"""
    aspect_angle: float = -90.0
    """of the nose and the velocity at the target over the horizontal [deg]"""
    miss_allowed: float = 1.0
    """how near to the target counts as a hit [m]"""
    aspect_allowed: float = 2.0
    """how far the nose may then be off the aspect angle [deg]"""
    control_rate: float = 250.0
    """of estimator, autopilot and log [Hz]; the physics runs at 1 kHz"""
    mismatch: Mismatch = field(default_factory=Mismatch)
    gust: Gust = field(default_factory=Gust)
    actuator: Actuator = field(default_factory=Actuator)
    noise: Noise = field(default_factory=Noise)
    faults: Faults = field(default_factory=Faults)

    def __post_init__(self) -> None:
        for name in ("start", "target", "target_velocity"):
            _check_point(getattr(self, name), name)
        for change in self.target_change:
            _check_point(change[1:], "target_change")
            check(change[0], "target_change", 0.0, _LARGEST, open_low=True)
        for name in ("start", "target"):
            check(getattr(self, name)[2], f"{name}: its height z", 0.0, _LARGEST)
        if math.dist(self.start, self.target) <= self.miss_allowed:
            raise ValueError(f"target = {self.target!r} is where the missile starts; allowed: another place")
        check(self.start_heading, "start_heading", -80.0, 80.0)
        check(self.aspect_angle, "aspect_angle", -90.0, 90.0)
        check(self.target_told, "target_told", 0.0, _LARGEST)
        for name in ("miss_allowed", "aspect_allowed"):
            check(getattr(self, name), name, 0.0, _LARGEST, open_low=True)
        check_rate(self.control_rate, "control_rate", TICK)
        if self.dimension == "planar":
            self._check_plane()

    def _check_plane(self) -> None:
        """What leads out of the plane would be lost without a word."""
        across = {
            "start: its y": self.start[1],
            "target: its y": self.target[1],
            "start_heading": self.start_heading,
            "target_velocity: its y": self.target_velocity[1],
            "target_change: its y": next((change[2] for change in self.target_change if change[2] != 0.0), 0.0),
            "gust.force: its y": self.gust.force[1],
            "gust.torque: its x or z": self.gust.torque[0] or self.gust.torque[2],
        }
        for name, value in across.items():
            if value != 0.0:
                raise ValueError(f"{name} = {value!r} leads out of the pitch plane; allowed: 0, or dimension = spatial")


class MissileGuidance:
    """A missile dives on a target that may move, and plans again while it flies."""

    Config = MissileGuidanceConfig
    controller = "missile"
    estimator = "full_state"

    @staticmethod
    def build(
        config: MissileGuidanceConfig, seed: int, controller: Part | None = None, estimator: Part | None = None
    ) -> Experiment:
        """The closed loop of one seed. Raises ValueError for a mission that no first plan is found for."""
        controller = controller or Part.of(load("controllers", MissileGuidance.controller))
        estimator = estimator or Part.of(load("estimators", MissileGuidance.estimator))
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
            hit = figures["miss_m"] <= config.miss_allowed
            success = hit and figures["aspect_error_deg"] <= config.aspect_allowed
            return {"hit": hit, **figures}, success

        record = _record(config, seed, controller, estimator, mission, truth)
        return Experiment(plant, {VEHICLE: agent}, duration, _Referee(mission, truth).ended, summarise, record)


class _Referee:
    """Ends a flight once the missile has passed the target or the ground."""

    def __init__(self, mission: MissileMission, target: TargetMotion) -> None:
        self._coordinates, self._direction, self._target = mission.coordinates, mission.final_direction, target
        self._was_before = False

    def ended(self, t: float, truths: Mapping[str, Array]) -> bool:
        """The plane through the target across the final direction is passed when it was ahead and is behind."""
        place = self._coordinates.place(self._coordinates.from_joints(truths[VEHICLE]))
        ahead = float((self._target.at(t) - place) @ self._direction)
        passed = self._was_before and ahead <= 0.0
        self._was_before |= ahead > 0.0
        under_ground = bool(place[2] > 0.0)
        return passed or under_ground


def _check_point(point: tuple[float, ...], name: str) -> None:
    if not all(math.isfinite(c) and abs(c) <= _LARGEST for c in point):
        raise ValueError(f"{name} = {point!r}; allowed: three finite numbers, at most {_LARGEST:g}")


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


def _first_plan(mission: MissileMission, controller: Part) -> Plan:
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
    equipment = Equipment(start, tuple(sensors), np.array(mission.input_max), config.actuator.delay)
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
    controller: Part,
    estimator: Part,
    mission: MissileMission,
    truth: TargetMotion,
) -> dict[str, Any]:
    """What config.json holds beside the versions; the mission is in the thesis' frame."""
    return {
        "scenario": "missile-guidance",
        "drawing": "renders.missile.drawing",
        "seed": seed,
        "fields": dataclasses.asdict(config),
        "controller": {"name": controller.name, "fields": dataclasses.asdict(controller.config)},
        "estimator": {"name": estimator.name, "fields": dataclasses.asdict(estimator.config)},
        "mission": {
            "dimension": mission.coordinates.name,
            "start": mission.start,
            "target": [dataclasses.asdict(leg) for leg in truth.legs],
            "aspect_angle": mission.aspect_angle,
            "input_max": mission.input_max,
            "case": dataclasses.asdict(mission.case),
            "miss_allowed": config.miss_allowed,
            "aspect_allowed": config.aspect_allowed,
        },
    }
