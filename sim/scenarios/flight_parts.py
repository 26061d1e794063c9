"""What scenarios of aerial vehicles share: noise and faults, sensors, certified planners, where a flight may begin."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Protocol

import numpy as np
from annotated_types import Interval, Le

from mathnavi.controllers.flight.certificate import Certificate, TrackingBound
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.planner import StopAndHover
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.aerial.mission import EstimateQuality, FlightMission, GustModel
from mathnavi.models.aerial.sensors import AccelerationSensor
from mathnavi.models.sensor_faults import Dropout
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar
from mathnavi.sim.engine.faults import CorruptedPlan, Delayed, FailingSolver
from mathnavi.sim.engine.input_bounds import input_bound
from mathnavi.sim.interfaces.bounds import (
    FINITE,
    THREE_FINITE_NUMBERS,
    Condition,
    Fraction,
    NonNegative,
    Positive,
    TickRate,
    configuration,
)
from mathnavi.sim.interfaces.protocols import Planner, Sensor
from mathnavi.sim.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller, checked_quality, checked_sensors
from mathnavi.sim.scenarios.task import Inputs, Look, Task

LARGEST = 1e5  # of any field in SI units: beyond it there is no such flight, and numbers begin to overflow
_BORDER = 0.02  # of the map's side, kept free of drawn starts and targets

Point = tuple[float, float, float]
FinitePoint = Annotated[Point, THREE_FINITE_NUMBERS]
Magnitude = Annotated[NonNegative, Le(LARGEST)]
PositiveMagnitude = Annotated[Positive, Le(LARGEST)]


def drawn_between(largest: float) -> Condition:
    """Condition for the two ends, 0 <= low <= high <= ``largest``, that something is drawn between."""
    return Condition(
        lambda ends: 0.0 <= ends[0] <= ends[1] <= largest,
        f"two finite numbers, 0 <= low <= high <= {largest:g}",
    )


@configuration(prefix="noise.")
class Noise:
    """How the sensors err."""

    position: Magnitude = 0.0
    """standard deviation of a position reading on each axis [m]"""
    position_rate: Annotated[float, TickRate(TICK)] = 10.0
    """position fixes a second [Hz]"""


@configuration(prefix="faults.")
class Faults:
    """What goes wrong on purpose."""

    solver_failure_rate: Fraction = 0.0
    """fraction of the requests on which the solver gives up"""
    corrupted_plan_rate: Fraction = 0.0
    """fraction of the requests answered with NaN"""
    late_plan_rate: Fraction = 0.0
    """fraction of the requests answered too late to be of use"""
    late_plan_latency: Magnitude = 2.0
    """simulated time that a late answer takes [s]"""
    position_jump: Magnitude = 0.0
    """half-width w of the jump p := p + w once a planning period [m] (Table A.3); carries no guarantee"""
    gust_rms: Magnitude = 0.0
    """force per mass on each axis [m/s^2]"""
    gust_time_constant: Annotated[float, Interval(ge=TICK, le=LARGEST), FINITE] = 3.0
    """of the gusts' first-order model [s]"""
    gust_limit: PositiveMagnitude = 4.0
    """longest gust [m/s^2]"""
    dropout_rate: Fraction = 0.0
    """fraction of the sensors' readings that are lost"""


def wants_certificate(controller: PluginSpec) -> bool:
    return bool(getattr(controller.plugin, "certified", True))


def certified(planner: Planner, mission: FlightMission, bound: Any) -> Certified:
    certificate = Certificate.of(mission, bound)
    return Certified(planner, partial(StopAndHover, period=planner.period), certificate, bound, mission.deadline_factor)


def check_above_ground(name: str, point: Point, mission: FlightMission) -> None:
    terrain, (x, y, z) = mission.terrain, point
    if not terrain.contains(x, y):
        raise ValueError(
            f"{name} = {point!r} is off the map; allowed: 0 to {terrain.width:g} m east, 0 to {terrain.depth:g} m north"
        )
    ground = float(terrain.height(x, y))
    if z < ground + mission.clearance_min:
        where = "under ground" if z < ground else "below the least clearance"
        raise ValueError(
            f"{name} = {point!r} is {where}; the ground there is {ground:.1f} m high; "
            f"allowed: z >= {ground + mission.clearance_min:.1f} m"
        )


def drawn_point(mission: FlightMission, heights: tuple[float, float], rng: np.random.Generator) -> Point:
    terrain = mission.terrain
    margin = _BORDER * max(terrain.width, terrain.depth)
    x = float(rng.uniform(margin, terrain.width - margin))
    y = float(rng.uniform(margin, terrain.depth - margin))
    return x, y, float(terrain.height(x, y)) + mission.clearance_min + float(rng.uniform(*heights))


def first_plan(mission: FlightMission, controller: PluginSpec) -> Plan:
    """What the certified planner answers at the start; a planner without a certificate is held to it here too."""
    planner, tracker = checked_controller(controller, mission, TrackingBound)
    x = np.array([*mission.start, 0.0, 0.0, 0.0])
    request = PlanRequest(0.0, 0.0, Estimate(0.0, x), None)
    return certified(planner, mission, tracker.bound).plan(request)


class FlightFields(Protocol):
    """Fields of a scenario that every mission of its vehicles follows from."""

    @property
    def clearance_min(self) -> float: ...
    @property
    def speed_max(self) -> float: ...
    @property
    def acceleration_max(self) -> float: ...
    @property
    def deadline_factor(self) -> float: ...
    @property
    def arrival_radius(self) -> float: ...
    @property
    def control_rate(self) -> float: ...
    @property
    def noise(self) -> Noise: ...
    @property
    def faults(self) -> Faults: ...


def bare_mission(config: FlightFields, terrain: HeightField, radars: tuple[Radar, ...] = ()) -> FlightMission:
    """The mission of a vehicle but for its start, its target, and how good its estimates are."""
    return FlightMission(
        terrain=terrain,
        start=(math.nan,) * 3,
        target=(math.nan,) * 3,
        clearance_min=config.clearance_min,
        speed_max=config.speed_max,
        acceleration_max=config.acceleration_max,
        deadline_factor=config.deadline_factor,
        arrival_radius=config.arrival_radius,
        position_noise=config.noise.position,
        position_rate=config.noise.position_rate,
        control_period=round(1.0 / (config.control_rate * TICK)) * TICK,
        gust=GustModel(config.faults.gust_rms, config.faults.gust_time_constant, config.faults.gust_limit),
        radars=radars,
    )


def mission_but_ends(
    config: FlightFields, terrain: HeightField, estimator: PluginSpec, radars: tuple[Radar, ...] = ()
) -> FlightMission:
    """The mission of a vehicle but for its start and target; ``radars`` are known from the start."""
    mission = bare_mission(config, terrain, radars)
    return dataclasses.replace(mission, quality=checked_quality(estimator, mission, EstimateQuality))


def faulty(planner: Planner, faults: Faults, rngs: Sequence[np.random.Generator]) -> Planner:
    """The planner with its solver's failures, corrupted and late plans; a generator for each of the three."""
    failing, corrupting, delaying = rngs
    if faults.solver_failure_rate > 0.0:
        planner = FailingSolver(planner, faults.solver_failure_rate, failing)
    if faults.corrupted_plan_rate > 0.0:
        planner = CorruptedPlan(planner, faults.corrupted_plan_rate, corrupting)
    if faults.late_plan_rate > 0.0:
        planner = Delayed(planner, faults.late_plan_latency, faults.late_plan_rate, delaying)
    return planner


def mounted(
    estimator: PluginSpec, mission: FlightMission, faults: Faults, rng: np.random.Generator
) -> tuple[Sensor, ...]:
    """The sensors that an estimator asks for, and one of the acceleration, with their dropouts."""
    return with_dropouts((*checked_sensors(estimator, mission), AccelerationSensor()), faults, rng)


def with_dropouts(sensors: Sequence[Sensor], faults: Faults, rng: np.random.Generator) -> tuple[Sensor, ...]:
    """Sensors that lose a share of their readings, if any is to be lost."""
    if faults.dropout_rate <= 0.0:
        return tuple(sensors)
    return tuple(
        Dropout(sensor, faults.dropout_rate, one) for sensor, one in zip(sensors, rng.spawn(len(sensors)), strict=True)
    )


def flight_task(
    names: Sequence[str], acceleration_max: float, controller: PluginSpec, mission: Mapping[str, Any]
) -> Task | None:
    """Point masses that are commanded: L = sum |a|^2 + beta [m^2/s^4] of all vehicles, the running cost of (A.2).

    beta is the controller's; None for one without.
    """
    beta = getattr(controller.config, "beta", None)
    if beta is None:
        return None
    inputs = Inputs.within(tuple(f"acceleration_{axis} [m/s^2]" for axis in "xyz"), acceleration_max)
    bounded = input_bound("", acceleration_max, 3)

    def cost(begin: Look, end: Look, commands: Mapping[str, Array]) -> float:
        acting = np.array([bounded(commands[name])[0] for name in names])
        return (float(np.square(acting).sum()) + len(names) * float(beta)) * (end.t - begin.t)

    return Task(dict.fromkeys(names, inputs), cost, mission=mission)
