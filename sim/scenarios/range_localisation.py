"""``range-localisation``: a unicycle with range sensors finds itself within a wall that it knows (thesis C.4, C.5).

    rangefinders, odometry -> estimator -> planner -> tracker -> (u_1, u_2) -> ideal or differential drive -> MuJoCo

A run ends with its duration, or as a failure when the robot touches the wall.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from mathnavi.models.field.curve import Curve
from mathnavi.models.sensor_faults import Outage
from mathnavi.models.unicycle.drives import DifferentialDrive, IdealDrive
from mathnavi.models.unicycle.entity import FLOOR, RADIUS, DriveName, build_model
from mathnavi.models.unicycle.mission import KnownStart, RangingMission
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.interfaces.protocols import Sensor
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.ranging import ranging_summary
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller, checked_estimator, checked_sensors, load
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, recorded
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig
from mathnavi.sim.scenarios.requirements import Requirement, judged
from mathnavi.sim.scenarios.task import Inputs, Task, squared_error

VEHICLE = "robot"

SLIP: Mapping[DriveName, tuple[float, float]] = {"ideal": (0.0, 0.0), "differential": (0.01, 0.02)}
"""[m/s, rad/s] standard deviations of what the wheels miss while they grip, as a mission declares them"""

_DRAWS = 1000  # of a start whose nominal path keeps the margin
_LEAST_DEVIATION = 1e-3  # [m, rad] of a start that is told
_LOOKED_AT = 200  # poses of a nominal path


class RangeLocalisation:
    """A robot with range sensors finds itself within a wall that it knows."""

    Config = RangeLocalisationConfig
    controller = "active_sensing"
    estimator = "feasible_set_bank"

    @staticmethod
    def build(
        config: RangeLocalisationConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """The closed loop of one seed. Raises ValueError for a start outside the wall or too near to it."""
        controller = controller or PluginSpec.of(load("controllers", RangeLocalisation.controller))
        estimator = estimator or PluginSpec.of(load("estimators", RangeLocalisation.estimator))
        drawing, telling, sensing = np.random.default_rng(seed).spawn(3)
        mission = _mission(config)
        start = config.start or _drawn_start(mission, controller, drawing)
        pose = _pose(start)
        _check_start(start, pose, mission.curve)
        if config.start_known:
            mission = dataclasses.replace(mission, start=_told(config, pose, mission.curve, telling))

        planner, tracker = checked_controller(controller, mission)
        plant = _plant(config, mission, pose, _sensors(config, mission, estimator), sensing)
        agent = Agent(checked_estimator(estimator, mission), planner, tracker, 2)
        duration = round(config.duration / mission.period) * mission.period

        def finished(t: float, truths: Mapping[str, Array]) -> bool:
            return plant.contacts(VEHICLE) > 0

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            summary = ranging_summary(recording, VEHICLE, mission, seed, wall_seconds)
            return judged(summary, [Requirement("converged", least=True), Requirement("touched_wall", most=False)])

        record = _record(dataclasses.replace(config, start=start), seed, controller, estimator, mission, pose)
        return ClosedLoop(plant, {VEHICLE: agent}, duration, finished, summarise, record, task=_task(mission))

    @staticmethod
    def errors(config: RangeLocalisationConfig, x: Array, truth: Array) -> dict[str, Array]:
        """The error of the pose, named with its unit, of estimates (n, 3) to truths (n, nx), modulo symmetry."""
        mission = _mission(config)
        off = np.array([mission.difference(pose, true[:3]) for pose, true in zip(x, truth, strict=True)])
        return {name: off[:, k] for k, name in enumerate(("x_1 [m]", "x_2 [m]", "phi [rad]"))}


def _task(mission: RangingMission) -> Task:
    """Wheels that are commanded: L is the squared error of the pose, modulo symmetry, a metre for a radian.

    Its expectation is the trace that the way to excite ``active`` has least (C.5).
    """
    limits = np.array([mission.speed_max, mission.turn_rate_max])
    error = squared_error(VEHICLE, lambda x, truth: mission.difference(x, truth[:3]))
    return Task({VEHICLE: Inputs.within(("u_1 [m/s]", "u_2 [rad/s]"), limits)}, error)


def _mission(config: RangeLocalisationConfig) -> RangingMission:
    """What everybody may know; nothing of the start."""
    return RangingMission(
        curve=config.field.curve(),
        angles=tuple(math.radians(angle) for angle in config.sensors),
        ranging=config.noise.ranging(),
        odometry=config.noise.odometry(SLIP[config.drive]),
        speed_max=config.speed_max,
        turn_rate_max=config.turn_rate_max,
        margin=config.margin,
    )


def _pose(start: tuple[float, float, float]) -> Array:
    """(3,) [m, m, rad] of a start in degrees."""
    return np.array([start[0], start[1], math.radians(start[2])])


def _drawn_start(
    mission: RangingMission, controller: PluginSpec, rng: np.random.Generator
) -> tuple[float, float, float]:
    """A start from which the nominal path of the controller, if it declares one, keeps the margin; [m, m, deg]."""
    curve, margin = mission.curve, mission.margin
    nominal_path = getattr(controller.plugin, "nominal_path", None)
    for _ in range(_DRAWS):
        try:
            x, y, heading = curve.draw(rng, margin)
        except ValueError as error:
            raise ValueError(f"margin = {margin!r}: {error}") from None
        start = float(x), float(y), math.degrees(heading)
        if nominal_path is None:
            return start
        path = np.asarray(nominal_path(controller.config, mission, _pose(start)))
        if all(curve.contains(place, margin) for place in path[:: max(1, len(path) // _LOOKED_AT), :2]):
            return start
    raise ValueError(
        f"margin = {margin!r}: from none of {_DRAWS} starts drawn within the {curve.name} does the path of the "
        f"controller {controller.name} keep it; allowed: a smaller margin or path, a larger field, or a start given"
    )


def _check_start(start: tuple[float, float, float], pose: Array, curve: Curve) -> None:
    if not curve.contains(pose):
        raise ValueError(f"start = {start!r} is outside the {curve.name}; allowed: within it")
    if (away := curve.distance(pose[:2])) <= RADIUS:
        raise ValueError(f"start = {start!r} is {away:.3f} m from the wall; allowed: more than the robot's {RADIUS} m")


def _told(config: RangeLocalisationConfig, pose: Array, curve: Curve, rng: np.random.Generator) -> KnownStart:
    """The start as an estimator is told it: off by a Gaussian, but within the wall."""
    x, y, heading = config.start_error
    deviation = np.array([x, y, math.radians(heading)])
    for _ in range(_DRAWS):
        told = pose + deviation * rng.standard_normal(3)
        if curve.contains(told):
            sure = np.maximum(deviation, _LEAST_DEVIATION)
            return KnownStart(_three(told), _three(sure))
    raise ValueError(f"start_error = {config.start_error!r} leads out of the {curve.name}; allowed: smaller ones")


def _three(values: Array) -> tuple[float, float, float]:
    a, b, c = values.tolist()
    return a, b, c


def _sensors(config: RangeLocalisationConfig, mission: RangingMission, estimator: PluginSpec) -> tuple[Sensor, ...]:
    sensors = checked_sensors(estimator, mission)
    if not config.outage:
        return sensors
    return tuple(Outage(sensor, config.outage) if sensor.name == "ranges" else sensor for sensor in sensors)


def _plant(
    config: RangeLocalisationConfig,
    mission: RangingMission,
    pose: Array,
    sensors: tuple[Sensor, ...],
    rng: np.random.Generator,
) -> MujocoPlant:
    model = _model(mission.curve, mission.angles, config.drive, config.friction)
    start = np.zeros(2 * model.nq)
    start[:3] = pose
    equipment = VehicleSetup(
        start,
        sensors,
        np.array([mission.speed_max, mission.turn_rate_max]),
        drive=IdealDrive() if config.drive == "ideal" else DifferentialDrive(),
        ignored_contacts=(FLOOR,) if config.drive == "differential" else (),
    )
    return MujocoPlant(model, {VEHICLE: equipment}, rng)


@lru_cache(maxsize=8)
def _model(curve: Curve, angles: tuple[float, ...], drive: DriveName, friction: float) -> mujoco.MjModel:
    return build_model(curve, angles, drive, friction, name=VEHICLE)


def _record(
    config: RangeLocalisationConfig,
    seed: int,
    controller: PluginSpec,
    estimator: PluginSpec,
    mission: RangingMission,
    pose: Array,
) -> dict[str, Any]:
    """What config.json holds beside the versions; angles of the mission are in radians."""
    return recorded(
        "range-localisation", "mathnavi.renders.ranging.drawing", seed, config, controller, estimator,
        mission={
            "field": mission.curve.name,
            "coefficients": mission.curve.coefficients,
            "angles": mission.angles,
            "ranging": dataclasses.asdict(mission.ranging),
            "odometry": dataclasses.asdict(mission.odometry),
            "start": pose.tolist(),
            "known_start": None if mission.start is None else dataclasses.asdict(mission.start),
            "speed_max": mission.speed_max,
            "turn_rate_max": mission.turn_rate_max,
            "margin": mission.margin,
            "period": mission.period,
            "drive": config.drive,
            "friction": config.friction,
            "outage": config.outage,
        },
    )  # fmt: skip
