"""``range-localisation``: a unicycle with range sensors localises itself within a known wall (thesis C.4, C.5).

    rangefinders, odometry -> estimator -> planner -> tracker -> (u_1, u_2) -> ideal or differential drive -> MuJoCo

A run ends with its duration, or as a failure when the robot touches the wall.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.beacon_names import SENSORS
from mathnavi.models.field.wall import Wall
from mathnavi.models.sensor_faults import Outage, Saturated
from mathnavi.models.unicycle.beacons import BeaconFieldMission
from mathnavi.models.unicycle.entity import FLOOR, RADIUS, DriveName, build_model
from mathnavi.models.unicycle.mission import DifferentialDrive, IdealDrive, RangingMission
from mathnavi.models.unicycle.quality import KnownStart
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.metrics.ranging import beacons_summary, ranging_summary
from mathnavi.sim.plugin.registry import PluginSpec, called
from mathnavi.sim.records.range_missions import RangingRecord, wall_record
from mathnavi.sim.scenarios.assembler import Assembler
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig
from mathnavi.sim.scenarios.requirements import Requirement, evaluate
from mathnavi.sim.scenarios.task import Endurance, Inputs, Outcome, Task, squared_error

POSE = ("x_1 [m]", "x_2 [m]", "phi [rad]")  # names of what is estimated
VEHICLE = "robot"

SLIP: Mapping[DriveName, tuple[float, float]] = {"ideal": (0.0, 0.0), "differential": (0.01, 0.02)}
"""standard deviations of the slip of wheels that grip, as a mission declares them [m/s, rad/s]"""

_DRAWS = 1000  # of starts, until the nominal path keeps the margin
_LEAST_DEVIATION = 1e-3  # [m, rad] of a start that is known
_SAMPLES = 200  # poses of a nominal path


class RangeLocalisation:
    """A robot with range sensors localises itself within a known wall."""

    Config = RangeLocalisationConfig
    name = "range-localisation"
    drawing = "mathnavi.renders.ranging.drawing"
    controller = "active_sensing"
    estimator = "feasible_set_bank"
    streams = ("draws", "start_errors", "sensing")

    @staticmethod
    def build(
        config: RangeLocalisationConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """Closed loop of one seed. Raises MissionError for a start outside the wall or too near to it."""
        parts = Assembler.for_scenario(RangeLocalisation, config, seed, controller, estimator)
        mission = _mission(config)
        start = config.start or _drawn_start(mission, parts)
        pose = _pose(start)
        _check_start(start, pose, mission.curve)
        if config.start_known:
            known = _known_start(config, pose, mission.curve, parts.streams["start_errors"])
            mission = dataclasses.replace(mission, start=known)

        stack = parts.stack(_as_read(mission, parts))
        duration = round(config.duration / mission.period) * mission.period
        sensors = parts.sensors(_as_it_is(mission, config))
        _check_unknown(config, sensors, parts.estimator)
        body = _body(config, mission, pose, _with_faults(sensors, config), parts.streams["sensing"])
        return parts.closed_loop(
            parts.disturbed(body, stack.planner.period, mass=1.0),
            {VEHICLE: stack.agent(2)},
            duration,
            partial(finished, body),
            partial(summarise, mission, seed, config.beacons.places),
            mission=_record(config, mission, pose),
            resolved=dataclasses.replace(config, start=start),
            task=_task(mission, body, duration),
        )

    @staticmethod
    def estimands(config: RangeLocalisationConfig, truth: Array) -> dict[str, Array]:
        """Pose, by "name [unit]", of true states (n, nx): of the body and the wheels nothing more is estimated."""
        return dict(zip(POSE, truth[:, :3].T, strict=True))

    @staticmethod
    def errors(config: RangeLocalisationConfig, x: Array, truth: Array) -> dict[str, Array]:
        """Error of the pose, named with its unit, of estimates (n, 3) to truths (n, nx), modulo symmetry."""
        mission = _mission(config)
        error = np.array([mission.difference(pose, true[:3]) for pose, true in zip(x, truth, strict=True)])
        return dict(zip(POSE, error.T, strict=True))


def _as_read(mission: RangingMission, parts: Assembler) -> RangingMission:
    """Mission of the estimator and its planner: without beacons that the estimator does not read."""
    if not isinstance(mission, BeaconFieldMission) or _reads_beacons(parts.asked(mission)):
        return mission
    return mission.wall_mission


def _reads_beacons(sensors: Sequence[str]) -> bool:
    return not set(sensors).isdisjoint(SENSORS.values())


def _check_unknown(config: RangeLocalisationConfig, sensors: Sequence[Sensor], estimator: PluginSpec) -> None:
    """MissionError for beacons at unknown places that an estimator does not read."""
    if config.beacons.unknown and not _reads_beacons([each.name for each in sensors]):
        raise MissionError(
            f"beacons.unknown = {config.beacons.unknown!r}: the estimator {called('estimators', estimator.name)} does "
            "not read beacons; allowed: one that does, such as beacon_bank"
        )


def finished(body: MujocoPlant, t: float, truths: Mapping[str, Array]) -> bool:
    """True if the robot has touched the wall; ``t`` [s], ``truths`` by vehicle."""
    return body.contacts(VEHICLE) > 0


def summarise(
    mission: RangingMission,
    seed: int,
    beacons: Sequence[tuple[float, float]],
    recording: Recording,
    wall_seconds: float,
) -> tuple[dict[str, Any], bool]:
    """Summary, and whether the estimate converged and the robot did not touch the wall; ``beacons`` are at those places
    [m].
    """
    summary = ranging_summary(recording, VEHICLE, mission, seed, wall_seconds)
    if isinstance(mission, BeaconFieldMission):
        summary |= beacons_summary(recording, VEHICLE, mission.beacons, beacons)
    return evaluate(summary, [Requirement("converged", least=True), Requirement("touched_wall", most=False)])


def _task(mission: RangingMission, body: MujocoPlant, duration: float) -> Task:
    """Task of commanding the wheels: L is the squared error of the pose, modulo symmetry, a radian counted as a metre.

    Its expectation is the trace that the exploration policy ``active`` minimises (C.5).
    """
    limits = np.array([mission.speed_max, mission.turn_rate_max])
    error = squared_error(VEHICLE, lambda x, truth: mission.difference(x, truth[:3]))
    curve = mission.curve
    across = float(np.linalg.norm(np.ptp(curve.polyline, axis=0)))  # no error of the position is greater

    def ends(t: float, truths: Mapping[str, Array]) -> Outcome | None:
        if not np.isfinite(truths[VEHICLE]).all():
            return Outcome.DIVERGED
        return Outcome.CRASHED if finished(body, t, truths) else None

    def to_wall(truths: Mapping[str, Array]) -> float:
        return curve.distance(truths[VEHICLE][:2]) - RADIUS

    terms = partial(Endurance, across**2 + math.pi**2, duration, ends, to_wall)
    return Task({VEHICLE: Inputs.within(("u_1 [m/s]", "u_2 [rad/s]"), limits)}, error, learning=terms)


def _mission(config: RangeLocalisationConfig) -> RangingMission:
    """Mission without the knowledge of the start."""
    beacons = config.beacons.mission()
    kind: Any = RangingMission if beacons is None else partial(BeaconFieldMission, beacons=beacons)
    mission: RangingMission = kind(
        curve=config.field.curve(),
        angles=tuple(math.radians(angle) for angle in config.sensors),
        mounting=config.mounting,
        ranging=config.noise.ranging(),
        odometry=config.noise.odometry(SLIP[config.drive]),
        speed_max=config.speed_max,
        turn_rate_max=config.turn_rate_max,
        margin=config.margin,
    )
    return mission


def _as_it_is(mission: RangingMission, config: RangeLocalisationConfig) -> RangingMission:
    """Mission with the true errors of the sensors in place of the declared ones, and all beacons where they are."""
    ranging, odometry = config.mismatch.ranging(mission.ranging), config.mismatch.odometry(mission.odometry)
    true = dataclasses.replace(mission, ranging=ranging, odometry=odometry)
    if isinstance(true, BeaconFieldMission):
        true = dataclasses.replace(true, beacons=dataclasses.replace(true.beacons, beacons=config.beacons.places))
    return true


# ---- the start


def _pose(start: tuple[float, float, float]) -> Array:
    """Pose (3,) [m, m, rad] of a start [m, m, deg]."""
    return np.array([start[0], start[1], math.radians(start[2])])


def _drawn_start(mission: RangingMission, parts: Assembler) -> tuple[float, float, float]:
    """Drawn start [m, m, deg] from which the controller's nominal path, if it declares one, keeps the margin."""
    curve, margin, controller = mission.curve, mission.margin, parts.controller
    nominal_path = getattr(controller.plugin, "nominal_path", None)
    for _ in range(_DRAWS):
        try:
            x, y, heading = curve.draw(parts.streams["draws"], margin)
        except ValueError as error:
            raise MissionError(f"margin = {margin!r}: {error}") from None
        start = float(x), float(y), math.degrees(heading)
        if nominal_path is None:
            return start
        path = np.asarray(nominal_path(controller.config, mission, _pose(start)))
        if all(curve.contains(place, margin) for place in path[:: max(1, len(path) // _SAMPLES), :2]):
            return start
    raise MissionError(
        f"margin = {margin!r}: from none of {_DRAWS} starts drawn within the {curve.name} does the path of the "
        f"controller {controller.name} keep it; allowed: a smaller margin or path, a larger field, or a start given"
    )


def _check_start(start: tuple[float, float, float], pose: Array, curve: Wall) -> None:
    """Raise MissionError for a start outside the wall, or where the robot touches it."""
    if not curve.contains(pose):
        raise MissionError(f"start = {start!r} is outside the {curve.name}; allowed: within it")
    if (distance := curve.distance(pose[:2])) <= RADIUS:
        raise MissionError(
            f"start = {start!r} is {distance:.3f} m from the wall; allowed: more than the robot's {RADIUS} m"
        )


def _known_start(config: RangeLocalisationConfig, pose: Array, curve: Wall, rng: np.random.Generator) -> KnownStart:
    """Start as known to an estimator, with a Gaussian error, within the wall; ``pose`` (3,) is the true one."""
    x, y, heading = config.start_error
    deviation = np.array([x, y, math.radians(heading)])
    for _ in range(_DRAWS):
        known = pose + deviation * rng.standard_normal(3)
        if curve.contains(known):
            return KnownStart(_three(known), _three(np.maximum(deviation, _LEAST_DEVIATION)))
    raise MissionError(f"start_error = {config.start_error!r} leads out of the {curve.name}; allowed: smaller ones")


def _three(values: Array) -> tuple[float, float, float]:
    a, b, c = values.tolist()
    return a, b, c


# ---- the robot


def _with_faults(sensors: tuple[Sensor, ...], config: RangeLocalisationConfig) -> tuple[Sensor, ...]:
    """Sensors, their ranges up to the saturation of the fields, and without any, nor beacons, during the outages."""
    outage, most = config.outage, config.mismatch.range_saturation

    def faulty(sensor: Sensor) -> Sensor:
        saturated = Saturated(sensor, most) if most is not None and sensor.name == "ranges" else sensor
        return Outage(saturated, outage) if outage else saturated

    read = ("ranges", *SENSORS.values())
    return tuple(faulty(sensor) if sensor.name in read else sensor for sensor in sensors)


def _body(
    config: RangeLocalisationConfig,
    mission: RangingMission,
    pose: Array,
    sensors: tuple[Sensor, ...],
    rng: np.random.Generator,
) -> MujocoPlant:
    """Plant of the robot at rest at a pose (3,)."""
    turned = math.radians(config.mismatch.mounting)
    rays = tuple((angle + turned, x, y) for angle, x, y in mission.rays.tolist())
    model = _model(mission.curve, rays, config.drive, config.friction, config.beacons.places)
    start = np.zeros(2 * model.nq)
    start[:3] = pose
    setup = VehicleSetup(
        start,
        sensors,
        np.array([mission.speed_max, mission.turn_rate_max]),
        drive=IdealDrive() if config.drive == "ideal" else DifferentialDrive(),
        ignored_contacts=(FLOOR,) if config.drive == "differential" else (),
    )
    return MujocoPlant(model, {VEHICLE: setup}, rng)


@lru_cache(maxsize=8)
def _model(
    curve: Wall,
    rays: tuple[tuple[float, float, float], ...],
    drive: DriveName,
    friction: float,
    beacons: tuple[tuple[float, float], ...],
) -> mujoco.MjModel:
    return build_model(curve, np.array(rays), drive, friction, name=VEHICLE, beacons=beacons)


def _record(config: RangeLocalisationConfig, mission: RangingMission, pose: Array) -> RangingRecord:
    """Record of the mission in config.json, with angles in radians."""
    return RangingRecord(
        field=mission.curve.name,
        **wall_record(mission.curve),
        angles=mission.angles,
        mounting=mission.mounting,
        ranging=mission.ranging,
        odometry=mission.odometry,
        start=_three(pose),
        known_start=mission.start,
        speed_max=mission.speed_max,
        turn_rate_max=mission.turn_rate_max,
        margin=mission.margin,
        period=mission.period,
        drive=config.drive,
        friction=config.friction,
        beacons=mission.beacons if isinstance(mission, BeaconFieldMission) else None,
        beacon_places=config.beacons.places,
        outage=config.outage,
    )
