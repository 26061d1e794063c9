"""``quadrotor-canyon``: a quadrotor flies through a winding canyon, the planner of the point mass above it.

    sensors -> estimator -> Certified(faults(planner)) -> tracker -> rotors -> MuJoCo

The two time scales of Fig. A.9: what the planner moves is a double integrator, what flies is a body with four rotors.
How near the tracker keeps the one to the other enters the certificate.

**Clearance.** A plan is the path of the vehicle's centre, and its rotors reach ``REACH`` = 0.335 m from there, however
it tilts. So mission, certificate and summary have the ground of the map raised by what ``HeightField.inflated`` says of
a body of that reach: h_min is kept by every part of the vehicle, and ``min_clearance_m`` is that of the nearest part,
or a little less. MuJoCo's ground is that of the map.

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
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.quadrotor.similarity import Similarity
from mathnavi.models.aerial.mission import EstimateQuality
from mathnavi.models.quadrotor.dynamics import POSITION, ROTOR_COUNT, ROTORS, VELOCITY
from mathnavi.models.quadrotor.entity import REACH, RotorDrive, build_model
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain, place_of
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.faults import Disturbed, Gusts
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.interfaces.protocols import Plant
from mathnavi.sim.interfaces.signals import Array, Estimate, Plan, PlanRequest, Status
from mathnavi.sim.metrics.quadrotor import point, quadrotor_summary
from mathnavi.sim.plugin.registry import (
    PluginSpec,
    called,
    checked_controller,
    checked_estimator,
    checked_quality,
    checked_sensors,
    load,
)
from mathnavi.sim.scenarios.certified_ends import certified_ends
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, recorded
from mathnavi.sim.scenarios.flight_parts import (
    Point,
    bare_mission,
    certified,
    check_above_ground,
    faulty,
    wants_certificate,
    with_dropouts,
)
from mathnavi.sim.scenarios.flight_verdict import due, longest_flight, verdict
from mathnavi.sim.scenarios.quadrotor_fields import Mismatch, QuadrotorCanyonConfig
from mathnavi.sim.scenarios.task import Inputs, Look, Task

VEHICLE = "vehicle"
_LONGEST = 3600.0  # [s] of simulated time that is logged
_DRAWS = 200
_BORDER = 0.03  # of the map's side, kept free of drawn starts and targets


class QuadrotorCanyon:
    """A quadrotor flies through a winding canyon to its target, certified as a point mass is."""

    Config = QuadrotorCanyonConfig
    controller = "quadrotor"
    estimator = "quadrotor_state"

    @staticmethod
    def inputs(config: QuadrotorCanyonConfig) -> dict[str, str]:
        """Digests of what the configuration names: what a result depends on beside the fields."""
        return {"terrain": load_terrain(config.terrain).digest}

    @staticmethod
    def build(
        config: QuadrotorCanyonConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """The closed loop of one seed.

        Raises ValueError for a start or target below h_min, off the map or without an initial certificate, for bounds
        that gusts and noise leave nothing of, and for an unknown terrain; FileNotFoundError for a terrain file that is
        not there.
        """
        controller = controller or PluginSpec.of(load("controllers", QuadrotorCanyon.controller))
        estimator = estimator or PluginSpec.of(load("estimators", QuadrotorCanyon.estimator))
        draws, sensing, failing, corrupting, delaying, gusting, losing = np.random.default_rng(seed).spawn(7)
        terrain = load_terrain(config.terrain)
        bare = _bare_mission(config, terrain, estimator)
        start, target, first = certified_ends(
            config,
            terrain,
            lambda name, place: check_above_ground(name, place, bare.flight),
            lambda: _drawn(config, terrain, draws),
            lambda start, target: _first_plan(_between(bare, start, target), controller),
            _DRAWS,
        )
        mission = _between(bare, start, target)
        flight, faults = mission.flight, config.faults

        raw, tracker = checked_controller(controller, mission, TrackingBound)
        flawed = faulty(raw, faults, (failing, corrupting, delaying))
        planner = certified(flawed, flight, tracker.bound) if wants_certificate(controller) else flawed
        true = config.mismatch.vehicle
        carried = with_dropouts(checked_sensors(estimator, mission), faults, losing)
        equipment = VehicleSetup(mission.start_state, carried, drive=RotorDrive(true))
        body = MujocoPlant(_model(terrain, config.mismatch), {VEHICLE: equipment}, sensing)
        plant: Plant = body
        if faults.gust_rms > 0.0:
            strength = true.mass * faults.gust_rms, faults.gust_time_constant, true.mass * faults.gust_limit
            plant = Disturbed(body, [Gusts(*strength, gusting)])
        # Sensors of its own: those of the flight may lose readings, and draw whether they do.
        sound = VehicleSetup(mission.start_state, checked_sensors(estimator, mission), drive=RotorDrive(true))
        trial = MujocoPlant(_model(terrain, config.mismatch), {VEHICLE: sound}, np.random.default_rng(0))
        _check_estimates(controller, estimator, mission, trial, first)
        agent = Agent(checked_estimator(estimator, mission), planner, tracker, ROTOR_COUNT)
        deadline = config.deadline_factor * first.t_end

        def finished(t: float, truths: Mapping[str, Array]) -> bool:
            away = math.dist(truths[VEHICLE][POSITION].tolist(), flight.target)
            return away <= flight.arrival_radius or body.contacts(VEHICLE) > 0

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            by = due(recording, VEHICLE, planner, config.deadline_factor, deadline)
            summary = quadrotor_summary(recording, VEHICLE, mission, tracker.bound, by, seed, wall_seconds)
            return verdict(summary, by, config.clearance_min, config.speed_max)

        # Past the deadline a missed pass may still be made good; twice the time is enough for any of them.
        duration = longest_flight(2.0 * deadline, config.deadline_factor, config.speed_max, _LONGEST)
        record = _record(config, seed, controller, estimator, mission, terrain, tracker.bound)
        task = _task(mission, controller)
        return ClosedLoop(plant, {VEHICLE: agent}, duration, finished, summarise, record, task=task)

    @staticmethod
    def errors(config: QuadrotorCanyonConfig, x: Array, truth: Array) -> dict[str, Array]:
        """The error of each state of the point mass, named with its unit, of estimates (n, 6) to truths (n, 13)."""
        off = x - point(truth)
        names = ("x [m]", "y [m]", "z [m]", "v_x [m/s]", "v_y [m/s]", "v_z [m/s]")
        return {name: off[:, k] for k, name in enumerate(names)}


def _check_estimates(
    controller: PluginSpec, estimator: PluginSpec, mission: QuadrotorMission, plant: MujocoPlant, plan: Plan
) -> None:
    """ValueError for an estimator from whose estimates the tracker cannot fly."""
    _, tracker = checked_controller(controller, mission, TrackingBound)
    estimate = checked_estimator(estimator, mission).update(0.0, plant.sense(VEHICLE), np.zeros(ROTOR_COUNT))
    if estimate.status is not Status.OK:
        return  # it has not seen enough yet to say
    try:
        tracker.command(0.0, estimate, plan)
    except ValueError as error:
        name = called("estimators", estimator.name)
        raise ValueError(f"estimator = {name!r}: {error}, as those of quadrotor_state are") from None


@lru_cache(maxsize=4)
def _model(terrain: HeightField, mismatch: Mismatch) -> mujoco.MjModel:
    model = build_model(terrain, (VEHICLE,), mismatch.vehicle)
    model.actuator(f"{VEHICLE}/{ROTORS[0]}").gear[:] *= mismatch.rotor
    return model


@lru_cache(maxsize=4)
def _raised(terrain: HeightField) -> HeightField:
    """The ground for the vehicle's centre."""
    return terrain.inflated(REACH, REACH)


def _bare_mission(config: QuadrotorCanyonConfig, terrain: HeightField, estimator: PluginSpec) -> QuadrotorMission:
    """The mission but for its start and target."""
    mission = QuadrotorMission(bare_mission(config, _raised(terrain)))
    quality = checked_quality(estimator, mission, EstimateQuality)
    return dataclasses.replace(mission, flight=dataclasses.replace(mission.flight, quality=quality))


def _between(mission: QuadrotorMission, start: Point, target: Point) -> QuadrotorMission:
    return dataclasses.replace(mission, flight=dataclasses.replace(mission.flight, start=start, target=target))


def _first_plan(mission: QuadrotorMission, controller: PluginSpec) -> Plan:
    """What the certified planner answers at the start; a planner without a certificate is held to it here too."""
    planner, tracker = checked_controller(controller, mission, TrackingBound)
    request = PlanRequest(0.0, 0.0, Estimate(0.0, mission.flight.start_state), None)
    return certified(planner, mission.flight, tracker.bound).plan(request)


def _drawn(config: QuadrotorCanyonConfig, terrain: HeightField, rng: np.random.Generator) -> Point:
    """Above a node of the map's lowest ground."""
    border = math.ceil(_BORDER * max(terrain.z.shape))
    within = terrain.z[border:-border, border:-border]
    low = np.argwhere(within <= within.min() + config.drawn_lowest * np.ptp(within)) + border
    row, column = low[rng.integers(len(low))]
    x, y = float(column) * terrain.spacing, float(row) * terrain.spacing
    above = config.clearance_min + float(rng.uniform(*config.drawn_heights))
    return x, y, float(_raised(terrain).height(x, y)) + above


def _task(mission: QuadrotorMission, controller: PluginSpec) -> Task | None:
    """Rotors that are commanded: L = |a|^2 + beta, the running cost of (A.2) for the point mass, at its own scale.

    a is the mean acceleration of the vehicle over a step, gusts included. None for a controller without a beta.
    """
    beta = getattr(getattr(controller.config, "flight", None), "beta", None)
    if beta is None:
        return None
    own = float(beta) / Similarity.of(mission.flight).scales[1] ** 2  # [m^2/s^4]
    rotors = tuple(f"thrust_{rotor} [N]" for rotor in ROTORS)
    inputs = Inputs(rotors, np.zeros(ROTOR_COUNT), np.full(ROTOR_COUNT, mission.vehicle.thrust_max))

    def cost(begin: Look, end: Look, commands: Mapping[str, Array]) -> float:
        h = end.t - begin.t
        a = (end.truths[VEHICLE][VELOCITY] - begin.truths[VEHICLE][VELOCITY]) / h
        return (float(a @ a) + own) * h

    ends = {"start": mission.flight.start, "target": mission.flight.target}
    return Task({VEHICLE: inputs}, cost, ("attitude", "rate"), ends)


def _record(
    config: QuadrotorCanyonConfig,
    seed: int,
    controller: PluginSpec,
    estimator: PluginSpec,
    mission: QuadrotorMission,
    terrain: HeightField,
    bound: TrackingBound,
) -> dict[str, Any]:
    """What config.json holds beside the versions. A terrain file is recorded with its whole path."""
    flight, place = mission.flight, place_of(config.terrain)
    resolved = dataclasses.replace(config, terrain=place, start=flight.start, target=flight.target)
    return recorded(
        "quadrotor-canyon", "mathnavi.renders.quadrotor.drawing", seed, resolved, controller, estimator,
        terrain={"name": terrain.name, "path": place, "digest": terrain.digest},
        mission={
            "start": flight.start,
            "target": flight.target,
            "clearance_min": flight.clearance_min,
            "speed_max": flight.speed_max,
            "acceleration_max": flight.acceleration_max,
            "deadline_factor": flight.deadline_factor,
            "arrival_radius": flight.arrival_radius,
            "reach": REACH,
            "thrust_max": mission.vehicle.thrust_max,
            "tracking_bound": dataclasses.asdict(bound),
        },
    )  # fmt: skip
