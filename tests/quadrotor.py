"""Shared by the quadrotor's tests: hills, plans of a few arcs, and a flight of the tracker alone in MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import mujoco
import numpy as np

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.quadrotor.tracker import GeometricTracker, TrackerConfig
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.quadrotor.dynamics import ATTITUDE, NOMINAL, POSITION, RATE, VELOCITY, Quadrotor, at_rest
from mathnavi.models.quadrotor.entity import RotorDrive, build_model
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.faults import Disturbance
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup

TICKS = 2  # of the physics to one command
PERIOD = TICKS / 300.0  # [s]
ANY_BOUND = TrackingBound(1.0, 1.0, 1.0, 0.0)
HIGH = np.array([200.0, 200.0, 80.0])  # [m]


@cache
def plain() -> HeightField:
    return HeightField(np.zeros((41, 41)), 10.0, name="plain")


@cache
def hills(seed: int = 3, highest: float = 40.0) -> HeightField:
    """400 m square at 4 m: round hills on rough ground."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(4.0 * np.arange(101), 4.0 * np.arange(101))
    z = rng.uniform(0.0, 0.6, x.shape)
    for _ in range(14):
        (east, north), width, share = rng.uniform(40.0, 360.0, 2), rng.uniform(25.0, 55.0), rng.uniform(0.3, 1.0)
        z += share * highest * np.exp(-((x - east) ** 2 + (y - north) ** 2) / width**2)
    return HeightField(z, 4.0, name="test hills")


@cache
def built(terrain: HeightField, vehicle: Quadrotor) -> mujoco.MjModel:
    return build_model(terrain, ("quad",), vehicle)


def plan_of(arcs: Sequence[tuple[Sequence[float], float]], start: Array = HIGH) -> Plan:
    """A plan from rest of arcs (acceleration [m/s^2], duration [s])."""
    flown = ArcList.begin(0.0, np.array([*start, 0.0, 0.0, 0.0]))
    for a, duration in arcs:
        flown.add(np.array(a, dtype=float), duration, FlightPhase.OPTIMISED)
    return flown.plan(0.0, 0.0)


def hovering(start: Array = HIGH) -> Plan:
    return plan_of([((0.0, 0.0, 0.0), 1.0)], start)


def turning(rng: np.random.Generator, a: float, speed: float, arcs: int = 12, h: float = 0.5) -> Plan:
    """Arcs of full acceleration in directions drawn anew for each, within a speed [m/s]; at the end, rest."""
    flown = ArcList.begin(0.0, np.array([*HIGH, 0.0, 0.0, 0.0]))
    while len(flown.u) < arcs:
        direction = rng.standard_normal(3)
        u = a * direction / np.linalg.norm(direction)
        if np.linalg.norm(flown.x[-1][3:] + h * u) <= speed:
            flown.add(u, h, FlightPhase.OPTIMISED)
    v = flown.x[-1][3:]
    length = float(np.linalg.norm(v))
    flown.add(-a * v / length, length / a, FlightPhase.MANOEUVRE)
    flown.rest()
    return flown.plan(0.0, 0.0)


def estimate_of(x: Array, t: float = 0.0) -> Estimate:
    """Estimate of a state (13,), exact."""
    extra = {"attitude": x[ATTITUDE], "rate": x[RATE]}
    return Estimate(t, np.concatenate([x[POSITION], x[VELOCITY]]), extra=extra)


def flown(
    plan: Plan,
    duration: float,
    *,
    true: Quadrotor = NOMINAL,
    config: TrackerConfig | None = None,
    start: Array | None = None,
    disturbance: Disturbance | None = None,
) -> tuple[Array, Array, Array]:
    """A flight over the plain: states (n, 13), deviations from the plan (n, 6), thrusts asked for (n, 4)."""
    config = TrackerConfig() if config is None else config
    x = at_rest(plan.x[0, :3]) if start is None else start
    plant = MujocoPlant(
        built(plain(), true), {"quad": VehicleSetup(x, drive=RotorDrive(true))}, np.random.default_rng(0)
    )
    tracker = GeometricTracker(PERIOD, config, NOMINAL, ANY_BOUND)
    states, deviation, asked = [], [], []
    for _ in range(round(duration / PERIOD)):
        t, x = plant.t, plant.state("quad")
        estimate = estimate_of(x, t)
        u = tracker.command(t, estimate, plan)
        if disturbance is not None:
            disturbance.act(plant, TICKS)
        plant.step({"quad": u}, TICKS)
        states.append(x)
        deviation.append(estimate.x - state_at(plan, t))
        asked.append(u)
    assert plant.contacts("quad") == 0
    return np.array(states), np.array(deviation), np.array(asked)


def flight_mission(
    terrain: HeightField, start: Sequence[float], target: Sequence[float], **fields: object
) -> FlightMission:
    """Between two places (2,) [m], 12 m above ground, at a quadrotor's speeds."""
    points = [(float(x), float(y), float(terrain.height(x, y)) + 12.0) for x, y in (start, target)]
    known: dict[str, object] = {
        "clearance_min": 4.0, "speed_max": 14.0, "acceleration_max": 5.0, "arrival_radius": 2.5,
        "control_period": PERIOD,
    }  # fmt: skip
    return FlightMission(terrain, *points, **(known | fields))  # type: ignore[arg-type]
