"""``quadrotor-canyon``: a quadrotor flies through a winding canyon, the planner of the point mass above it.

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> rotors -> MuJoCo

The two time scales of Fig. A.9: what the planner moves is a double integrator, what flies is a body with four rotors.
How near the tracker keeps the one to the other enters the certificate.

**Clearance.** A plan is the path of the vehicle's centre, and its rotors reach ``REACH`` = 0.335 m from there, however
it tilts. So mission, certificate and summary have the ground of the map raised by what ``HeightField.inflated`` says of
a body of that reach: h_min is kept by every part of the vehicle, and ``min_clearance_m`` is that of the nearest part,
or a little less. No rotor leaves the map. MuJoCo's ground is that of the map.

**What the bound allows for.** Gusts as declared, a tenth more mass, a quarter more or less drag, and plans that take
over unforeseen, for which a_max is reduced to what the rotors have the moments for
(``mathnavi.controllers.quadrotor.turning``): some 2.3 m/s^2 in still air, 1.9 in gusts of .6. A weaker rotor or a
greater mismatch is not in it. Where the tracker does not keep its bound, that is an event, the planner is based anew
on the estimate, and where no plan is certified from there the loss of the guarantee is one.

The vehicle follows the canyon because that is the shorter way: over the plateau it would have to climb and to descend.
Nothing forbids that, and where a spur is in the way it may cross it, low, rather than go around.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import mujoco
import numpy as np

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.command_filter import TrackedCommandFilter
from mathnavi.controllers.quadrotor.bound import tracking_bound
from mathnavi.controllers.quadrotor.similarity import Similarity
from mathnavi.controllers.quadrotor.tracker import GeometricTracker
from mathnavi.models.aerial.mission import EstimateQuality
from mathnavi.models.quadrotor.dynamics import POSITION, ROTOR_COUNT, ROTORS, VELOCITY
from mathnavi.models.quadrotor.entity import REACH, RotorDrive, build_model
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.interfaces.errors import PluginError
from mathnavi.sim.interfaces.protocols import Planner
from mathnavi.sim.interfaces.signals import Array, Plan, Status
from mathnavi.sim.metrics.flight import Bound
from mathnavi.sim.metrics.quadrotor import point, quadrotor_summary
from mathnavi.sim.plugin.registry import PluginSpec, called, checked_quality
from mathnavi.sim.records.missions import Point, QuadrotorRecord
from mathnavi.sim.scenarios.assembler import Assembler, VehicleStack
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.flight_learning import FlightTerms
from mathnavi.sim.scenarios.flight_parts import (
    bare_mission,
    certified_ends,
    due,
    flight_record,
    longest_flight,
    terrain_record,
    verdict,
)
from mathnavi.sim.scenarios.quadrotor_fields import QuadrotorCanyonConfig, QuadrotorMismatch
from mathnavi.sim.scenarios.task import Inputs, Sample, Task

VEHICLE = "vehicle"
HOLD = 0.02
"""[s] for which a learner's thrusts are held"""
OBSERVED = "attitude", "rate"
"""of an estimate, what the rotors cannot be commanded without"""
_LONGEST = 3600.0  # [s] of simulated time that is logged
_DRAWS = 200
_BORDER = 0.03  # of the map's side, kept free of drawn starts and targets


class QuadrotorCanyon:
    """A quadrotor flies through a winding canyon to its target, certified as a point mass is."""

    Config = QuadrotorCanyonConfig
    name = "quadrotor-canyon"
    drawing = "mathnavi.renders.quadrotor.drawing"
    controller = "quadrotor"
    estimator = "quadrotor_state"
    streams = ("draws", "sensing", "solver_failures", "corrupted_plans", "late_plans", "gusts", "dropouts")

    @staticmethod
    def build(
        config: QuadrotorCanyonConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """The closed loop of one seed.

        Raises MissionError for a start or target below h_min, off the map or without an initial certificate;
        ValueError for bounds that gusts and noise leave nothing of; PluginError for an estimator that the tracker
        cannot fly from; TerrainError for an unknown terrain; FileNotFoundError for a terrain file that is not there.
        """
        parts = Assembler.for_scenario(QuadrotorCanyon, config, seed, controller, estimator)
        terrain = load_terrain(config.terrain)
        mission, first = _mission(config, terrain, parts)
        deadline = config.deadline_factor * first.t_end

        stack = parts.stack(mission, certified_flight=mission.flight)
        vehicle = config.mismatch.vehicle
        setup = VehicleSetup(mission.start_state, stack.sensors, drive=RotorDrive(vehicle))
        model = _model(terrain, config.mismatch)
        body = MujocoPlant(model, {VEHICLE: setup}, parts.streams["sensing"])
        # Sensors of its own: those of the flight may lose readings, and draw whether they do.
        faultless = dataclasses.replace(parts, faults=()).stack(mission)
        trial = dataclasses.replace(setup, sensors=faultless.sensors)
        _check_estimates(parts, faultless, MujocoPlant(model, {VEHICLE: trial}, np.random.default_rng(0)), first)
        # Past the deadline a missed pass may still be made good; twice the time is enough for any of them.
        duration = longest_flight(2.0 * deadline, config.deadline_factor, config.speed_max, _LONGEST)

        flight = TrueQuadrotorFlight(mission, deadline)
        start, target = mission.flight.start, mission.flight.target
        place = terrain_record(terrain, config.terrain)
        return parts.closed_loop(
            parts.disturbed(body, stack.planner.period, mass=vehicle.mass),
            {VEHICLE: stack.agent(ROTOR_COUNT)},
            duration,
            partial(finished, flight, body),
            partial(summarise, flight, stack.planner, stack.tracker.bound, parts.guaranteed, seed),
            mission=_record(mission, stack.tracker.bound),
            resolved=dataclasses.replace(config, terrain=place["path"], start=start, target=target),
            terrain=place,
            task=_task(flight, body, parts.controller, stack.planner.period),
        )

    @staticmethod
    def errors(config: QuadrotorCanyonConfig, x: Array, truth: Array) -> dict[str, Array]:
        """The error of each state of the point mass, named with its unit, of estimates (n, 6) to truths (n, 13)."""
        error = x - point(truth)
        names = ("x [m]", "y [m]", "z [m]", "v_x [m/s]", "v_y [m/s]", "v_z [m/s]")
        return {name: error[:, k] for k, name in enumerate(names)}


@dataclass(frozen=True, eq=False)
class TrueQuadrotorFlight:
    """A flight as its referee and its metrics see it."""

    mission: QuadrotorMission
    deadline: float  # [s] by the plan from the true start


def finished(flight: TrueQuadrotorFlight, body: MujocoPlant, t: float, truths: Mapping[str, Array]) -> bool:
    """The vehicle has arrived, or it has touched something; ``t`` [s], ``truths`` (13,) by vehicle."""
    return arrived(flight, t, truths) or body.contacts(VEHICLE) > 0


def arrived(flight: TrueQuadrotorFlight, t: float, truths: Mapping[str, Array]) -> bool:
    """The vehicle is at the target; ``t`` [s], ``truths`` (13,) by vehicle."""
    mission = flight.mission.flight
    return math.dist(truths[VEHICLE][POSITION].tolist(), mission.target) <= mission.arrival_radius


def summarise(
    flight: TrueQuadrotorFlight,
    planner: Planner,
    bound: Bound,
    guaranteed: bool,
    seed: int,
    recording: Recording,
    wall_seconds: float,
) -> tuple[dict[str, Any], bool]:
    """The summary, and whether the vehicle arrived by its deadline and touched nothing."""
    mission = flight.mission.flight
    deadline = due(recording, VEHICLE, planner, mission.deadline_factor, flight.deadline)
    summary = quadrotor_summary(recording, VEHICLE, flight.mission, bound, deadline, seed, wall_seconds, guaranteed)
    return verdict(summary, deadline, mission.clearance_min, mission.speed_max)


def _mission(config: QuadrotorCanyonConfig, terrain: HeightField, parts: Assembler) -> tuple[QuadrotorMission, Plan]:
    """The mission, over ground that is raised for the vehicle's centre, and its first plan."""
    over_raised = bare_mission(config, _raised(terrain))
    unrated = QuadrotorMission(dataclasses.replace(over_raised, reach=REACH, reach_in_terrain=True))
    quality = checked_quality(parts.estimator, unrated, EstimateQuality)
    bare = dataclasses.replace(unrated, flight=dataclasses.replace(unrated.flight, quality=quality))

    def between(start: Point, target: Point) -> QuadrotorMission:
        return dataclasses.replace(bare, flight=dataclasses.replace(bare.flight, start=start, target=target))

    def first_plan(start: Point, target: Point) -> Plan:
        mission = between(start, target)
        return parts.first_plan(mission, mission.flight)

    def draw() -> Point:
        return _drawn(config, terrain, parts.streams["draws"])

    start, target, first = certified_ends(config, bare.flight, draw, first_plan, _DRAWS)
    return between(start, target), first


def _drawn(config: QuadrotorCanyonConfig, terrain: HeightField, rng: np.random.Generator) -> Point:
    """A point (x, y, z) [m] above a node of the map's lowest ground."""
    border = math.ceil(_BORDER * max(terrain.z.shape))
    south, west = (min(border, (count - 1) // 2) for count in terrain.z.shape)  # a map may be long and narrow
    within = terrain.z[south : -south or None, west : -west or None]
    low = np.argwhere(within <= within.min() + config.drawn_lowest * np.ptp(within)) + np.array([south, west])
    row, column = low[rng.integers(len(low))]
    x, y = float(column) * terrain.spacing, float(row) * terrain.spacing
    above = config.clearance_min + float(rng.uniform(*config.drawn_heights))
    return x, y, float(_raised(terrain).height(x, y)) + above


def _check_estimates(parts: Assembler, stack: VehicleStack, plant: MujocoPlant, plan: Plan) -> None:
    """Raise PluginError for an estimator from whose estimates the tracker cannot fly."""
    estimate = stack.estimator.update(0.0, plant.sense(VEHICLE), np.zeros(ROTOR_COUNT))
    if estimate.status is not Status.OK:
        return  # it has not seen enough yet to say
    try:
        stack.tracker.command(0.0, estimate, plan)
    except ValueError as error:
        name = called("estimators", parts.estimator.name)
        raise PluginError(f"estimator = {name!r}: {error}, as those of quadrotor_state are") from None


def _task(flight: TrueQuadrotorFlight, body: MujocoPlant, controller: PluginSpec, period: float) -> Task | None:
    """Rotors that are commanded: L = |a|^2 + beta, the running cost of (A.2) for the point mass, at its own scale.

    a is the mean acceleration of the vehicle over a step, gusts included. None for a controller without a beta. What a
    safety filter is proposed are accelerations, held for the planner's ``period`` [s].
    """
    mission, beta = flight.mission, getattr(getattr(controller.config, "flight", None), "beta", None)
    if beta is None:
        return None
    own = float(beta) / Similarity.for_mission(mission.flight).scales[1] ** 2  # [m^2/s^4]
    rotors = tuple(f"thrust_{rotor} [N]" for rotor in ROTORS)
    inputs = Inputs(rotors, np.zeros(ROTOR_COUNT), np.full(ROTOR_COUNT, mission.vehicle.thrust_max))

    def cost(begin: Sample, end: Sample, commands: Mapping[str, Array]) -> float:
        h = end.t - begin.t
        a = (end.truths[VEHICLE][VELOCITY] - begin.truths[VEHICLE][VELOCITY]) / h
        return (float(a @ a) + own) * h

    ends = {"start": mission.flight.start, "target": mission.flight.target}
    bound = tracking_bound(controller.config.tracker, mission.vehicle, mission.flight)

    def filters() -> dict[str, TrackedCommandFilter]:
        tracker = GeometricTracker(mission.control_period, controller.config.tracker, mission.vehicle, bound)
        return {VEHICLE: TrackedCommandFilter(mission.flight, tracker, period)}

    accelerations = tuple(f"acceleration_{axis} [m/s^2]" for axis in "xyz")
    proposals = Inputs.within(accelerations, mission.flight.acceleration_max)
    strongest = ROTOR_COUNT * mission.vehicle.thrust_max / mission.vehicle.mass  # [m/s^2]
    terms = FlightTerms(
        {VEHICLE: mission.flight}, mission.flight.terrain, body, partial(arrived, flight), strongest**2 + own,
        flight.deadline, HOLD, VELOCITY.start, OBSERVED,
    )  # fmt: skip
    return Task({VEHICLE: inputs}, cost, OBSERVED, ends, filters, {VEHICLE: proposals}, terms)


def _record(mission: QuadrotorMission, bound: TrackingBound) -> QuadrotorRecord:
    """The mission as config.json holds it."""
    shared = flight_record(mission.flight, bound)
    return QuadrotorRecord(**shared, reach=REACH, thrust_max=mission.vehicle.thrust_max)


@lru_cache(maxsize=4)
def _model(terrain: HeightField, mismatch: QuadrotorMismatch) -> mujoco.MjModel:
    model = build_model(terrain, (VEHICLE,), mismatch.vehicle)
    model.actuator(f"{VEHICLE}/{ROTORS[0]}").gear[:] *= mismatch.rotor
    return model


@lru_cache(maxsize=4)
def _raised(terrain: HeightField) -> HeightField:
    """The ground for the vehicle's centre."""
    return terrain.inflated(REACH, REACH)
