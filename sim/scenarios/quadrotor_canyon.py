"""``quadrotor-canyon``: a quadrotor flies through a winding canyon, with the planner of a point mass.

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> rotors -> MuJoCo

The two time scales of Fig. A.9: the planner's model is a double integrator, the plant is a body with four rotors. The
bound on the deviation between them, from the tracker, enters the certificate.

**Clearance.** A plan is the path of the vehicle's centre, and its rotors reach ``REACH`` = 0.335 m from there at any
tilt. So mission, certificate and summary use the map's ground raised by ``HeightField.inflated`` for a body of that
reach: every part of the vehicle keeps h_min, and ``min_clearance_m`` is that of the nearest part, or a little less. No
rotor leaves the map. MuJoCo's ground is that of the map.

**The bound allows for** gusts as declared, a tenth more mass, a quarter more or less drag, and unforeseen changes of
plans, for which a_max is reduced to what the rotors' moments permit (``mathnavi.controllers.quadrotor.bound``): some
2.3 m/s^2 in still air, 1.9 in gusts of 0.6. It does not allow for a weaker rotor or a larger mismatch. If the tracker
does not keep its bound, that is an event, and the planner is rebased on the estimate; if no plan is certified from
there, the loss of the guarantee is another event.

The vehicle follows the canyon because that is the shorter way: over the plateau it would have to climb and to descend.
No rule forbids the plateau, and the vehicle may cross a spur low rather than fly around it.
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
from mathnavi.controllers.quadrotor.tracker import GeometricTracker, TrackerConfig, unflyable
from mathnavi.interfaces.boundary import Unusable, answered, usable_estimate
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.aerial.mission import EstimateQuality
from mathnavi.models.quadrotor.dynamics import ATTITUDE, POSITION, RATE, ROTOR_COUNT, ROTORS, VELOCITY
from mathnavi.models.quadrotor.entity import REACH, RotorDrive, build_model
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.metrics.flight import Bound
from mathnavi.sim.metrics.quadrotor import point, quadrotor_summary
from mathnavi.sim.plugin.registry import PluginSpec, called, checked_quality
from mathnavi.sim.records.missions import Point, QuadrotorRecord
from mathnavi.sim.scenarios.assembler import Assembler, VehicleStack
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.flight_assurance import FirstPlans, FlightAssurance
from mathnavi.sim.scenarios.flight_learning import FlightTerms
from mathnavi.sim.scenarios.flight_parts import (
    bare_mission,
    certified_ends,
    due,
    flight_record,
    longest_flight,
    map_of,
    terrain_record,
    verdict,
)
from mathnavi.sim.scenarios.quadrotor_fields import QuadrotorCanyonConfig, QuadrotorMismatch
from mathnavi.sim.scenarios.task import Inputs, Sample, Task

VEHICLE = "vehicle"
HOLD = 0.02
"""time for which a learner's thrusts are held [s]"""
OBSERVED = "attitude", "rate"
"""extra arrays of an estimate that commanding the rotors requires"""
_LONGEST = 3600.0  # [s] of simulated time that is logged
_DRAWS = 200
_BORDER = 0.03  # of the map's side, kept free of drawn starts and targets


class QuadrotorCanyon:
    """A quadrotor flies through a winding canyon to its target, certified like a point mass."""

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
        """Closed loop of one seed.

        Raises MissionError for a start or target below h_min, off the map or without an initial certificate; ValueError
        if gusts and noise use up the bounds; PluginError for an estimator without the estimates that the tracker needs;
        TerrainError for an unknown terrain; FileNotFoundError for a missing terrain file.
        """
        parts = Assembler.for_scenario(QuadrotorCanyon, config, seed, controller, estimator)
        terrain = map_of(config)
        mission, first = _mission(config, terrain, parts)
        deadline = config.deadline_factor * first.t_end

        assurance = FlightAssurance.for_mission(parts, mission.flight)
        stack = parts.stack(mission, assurance=assurance)
        vehicle = config.mismatch.vehicle
        setup = VehicleSetup(mission.start_state, stack.sensors, drive=RotorDrive(vehicle))
        model = _model(terrain, config.mismatch)
        body = MujocoPlant(model, {VEHICLE: setup}, parts.streams["sensing"])
        # Separate sensors: those of the flight may lose readings at random.
        faultless = dataclasses.replace(parts, faults=()).stack(mission)
        trial = dataclasses.replace(setup, sensors=faultless.sensors)
        _check_estimates(parts, faultless, MujocoPlant(model, {VEHICLE: trial}, np.random.default_rng(0)))
        # Past the deadline a missed pass may still be made good; twice the time is enough for any of them.
        duration = longest_flight(2.0 * deadline, config.deadline_factor, config.speed_max, _LONGEST)

        flight = TrueQuadrotorFlight(mission, deadline)
        start, target = mission.flight.start, mission.flight.target
        place = terrain_record(terrain, config.terrain)
        return parts.closed_loop(
            parts.disturbed(body, stack.planner.period, mass=vehicle.mass),
            {VEHICLE: stack.agent(ROTOR_COUNT, **_assured(mission, stack.tracker))},
            duration,
            partial(finished, flight, body),
            partial(summarise, flight, stack.planner, stack.tracker.bound, seed),
            mission=_record(mission, stack.tracker.bound),
            resolved=dataclasses.replace(config, terrain=place["path"], start=start, target=target),
            terrain=place,
            task=_task(flight, body, parts.controller, stack.planner.period),
        )

    @staticmethod
    def errors(config: QuadrotorCanyonConfig, x: Array, truth: Array) -> dict[str, Array]:
        """Error of each state of the point mass, named with its unit, of estimates (n, 6) to truths (n, 13)."""
        error = x - point(truth)
        names = ("x [m]", "y [m]", "z [m]", "v_x [m/s]", "v_y [m/s]", "v_z [m/s]")
        return {name: error[:, k] for k, name in enumerate(names)}


@dataclass(frozen=True, eq=False)
class TrueQuadrotorFlight:
    """True flight, for the referee and the metrics."""

    mission: QuadrotorMission
    deadline: float  # [s] by the plan from the true start


def finished(flight: TrueQuadrotorFlight, body: MujocoPlant, t: float, truths: Mapping[str, Array]) -> bool:
    """True if the vehicle has arrived, or has touched something; ``t`` [s], ``truths`` (13,) by vehicle."""
    return arrived(flight, t, truths) or body.contacts(VEHICLE) > 0


def arrived(flight: TrueQuadrotorFlight, t: float, truths: Mapping[str, Array]) -> bool:
    """True if the vehicle is at the target; ``t`` [s], ``truths`` (13,) by vehicle."""
    mission = flight.mission.flight
    return math.dist(truths[VEHICLE][POSITION].tolist(), mission.target) <= mission.arrival_radius


def summarise(
    flight: TrueQuadrotorFlight,
    planner: Planner,
    bound: Bound,
    seed: int,
    recording: Recording,
    wall_seconds: float,
) -> tuple[dict[str, Any], bool]:
    """Summary, and whether the vehicle arrived by its deadline and touched nothing."""
    mission = flight.mission.flight
    deadline = due(recording, VEHICLE, planner, mission.deadline_factor, flight.deadline)
    summary = quadrotor_summary(recording, VEHICLE, flight.mission, bound, deadline, seed, wall_seconds)
    return verdict(summary, deadline, mission.clearance_min, mission.speed_max)


def _mission(config: QuadrotorCanyonConfig, terrain: HeightField, parts: Assembler) -> tuple[QuadrotorMission, Plan]:
    """Mission, over ground raised for the vehicle's centre, and its first plan."""
    over_raised = bare_mission(config, _raised(terrain))
    unrated = QuadrotorMission(dataclasses.replace(over_raised, reach=REACH, reach_in_terrain=True))
    quality = checked_quality(parts.estimator, unrated, EstimateQuality)
    bare = dataclasses.replace(unrated, flight=dataclasses.replace(unrated.flight, quality=quality))

    def between(start: Point, target: Point) -> QuadrotorMission:
        return dataclasses.replace(bare, flight=dataclasses.replace(bare.flight, start=start, target=target))

    plans = FirstPlans(parts)

    def first_plan(start: Point, target: Point) -> Plan:
        mission = between(start, target)
        return plans.plan(mission, mission.flight)

    def draw() -> Point:
        return _drawn(config, terrain, parts.streams["draws"])

    start, target, first = certified_ends(config, bare.flight, draw, first_plan, _DRAWS)
    return between(start, target), first


def _assured(mission: QuadrotorMission, tracker: Any) -> dict[str, Any]:
    """Fields of the agent by which it flies on without its estimator, and without its tracker.

    A missing estimate is moved on as a rigid body, with its attitude and rate, under the thrusts that the rotors can
    have. A plan is tracked with the tracker's own bound; before there is one, the vehicle hovers.
    """

    def estimate_of(x: Array, extra: Mapping[str, Array]) -> dict[str, Any]:
        parts = {"attitude": x[ATTITUDE].copy(), "rate": x[RATE].copy()}
        return {"x": np.concatenate([x[POSITION], x[VELOCITY]]), "extra": {**extra, **parts}}

    def flow(estimate: Estimate, u: Array, dt: float) -> Estimate:
        attitude, rate = estimate.extra["attitude"], estimate.extra["rate"]
        x = np.concatenate([estimate.x[:3], attitude / np.linalg.norm(attitude), estimate.x[3:], rate])
        moved = mission.flow(x, np.clip(u, 0.0, mission.vehicle.thrust_max), dt)
        return dataclasses.replace(estimate, **estimate_of(moved, estimate.extra))

    period = mission.control_period
    spare = GeometricTracker(period, TrackerConfig.held_for(period), mission.vehicle, tracker.bound)
    start = Estimate(0.0, **estimate_of(mission.start_state, {}))
    hover = np.full(ROTOR_COUNT, mission.vehicle.hover_thrust)
    return {
        "start": start, "flow": flow, "unflyable": unflyable, "spare": spare, "estimate_age": 0.0, "command": hover,
    }  # fmt: skip


def _drawn(config: QuadrotorCanyonConfig, terrain: HeightField, rng: np.random.Generator) -> Point:
    """Drawn point (x, y, z) [m] above a node of the map's lowest ground."""
    border = math.ceil(_BORDER * max(terrain.z.shape))
    south, west = (min(border, (count - 1) // 2) for count in terrain.z.shape)  # a map may be long and narrow
    within = terrain.z[south : -south or None, west : -west or None]
    low = np.argwhere(within <= within.min() + config.drawn_lowest * np.ptp(within)) + np.array([south, west])
    row, column = low[rng.integers(len(low))]
    x, y = float(column) * terrain.spacing, float(row) * terrain.spacing
    above = config.clearance_min + float(rng.uniform(*config.drawn_heights))
    return x, y, float(_raised(terrain).height(x, y)) + above


def _check_estimates(parts: Assembler, stack: VehicleStack, plant: MujocoPlant) -> None:
    """Raise PluginError for an estimator without the estimates that a tracker needs."""
    first = answered(lambda: stack.estimator.update(0.0, plant.sense(VEHICLE), np.zeros(ROTOR_COUNT)))
    estimate = first if isinstance(first, Unusable) else usable_estimate(first, 0.0)
    if isinstance(estimate, Unusable) or not estimate.status.usable:
        return  # an answer that cannot be used, or not enough readings yet to decide
    if reason := unflyable(estimate):
        name = called("estimators", parts.estimator.name)
        raise PluginError(f"estimator = {name!r}: {reason}, as those of quadrotor_state are")


def _task(flight: TrueQuadrotorFlight, body: MujocoPlant, controller: PluginSpec, period: float) -> Task | None:
    """Task of commanding the rotors: L = |a|^2 + beta, the running cost of (A.2) for the point mass, at its own scale.

    a is the mean acceleration of the vehicle over a step, gusts included. Returns None for a controller without a beta.
    The commands proposed to a safety filter are accelerations, held for the planner's ``period`` [s].
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
    terms = partial(
        FlightTerms, {VEHICLE: mission.flight}, mission.flight.terrain, body, partial(arrived, flight),
        strongest**2 + own, flight.deadline, HOLD, VELOCITY.start, OBSERVED,
    )  # fmt: skip
    return Task({VEHICLE: inputs}, cost, OBSERVED, ends, filters, {VEHICLE: proposals}, terms)


def _record(mission: QuadrotorMission, bound: TrackingBound) -> QuadrotorRecord:
    """Record of the mission in config.json."""
    shared = flight_record(mission.flight, bound)
    return QuadrotorRecord(**shared, reach=REACH, thrust_max=mission.vehicle.thrust_max)


@lru_cache(maxsize=4)
def _model(terrain: HeightField, mismatch: QuadrotorMismatch) -> mujoco.MjModel:
    model = build_model(terrain, (VEHICLE,), mismatch.vehicle)
    model.actuator(f"{VEHICLE}/{ROTORS[0]}").gear[:] *= mismatch.rotor
    return model


@lru_cache(maxsize=4)
def _raised(terrain: HeightField) -> HeightField:
    """Ground raised for the vehicle's centre."""
    return terrain.inflated(REACH, REACH)
