"""The flight planner above a quadrotor in MuJoCo: missions over hills, certified, without and with gusts."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.planner import StopAndHover
from mathnavi.controllers.quadrotor.plugin import QuadrotorConfig, QuadrotorFlight
from mathnavi.estimators.quadrotor_state import QuadrotorState
from mathnavi.interfaces.protocols import Plant
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import DeclaredGusts
from mathnavi.models.quadrotor.dynamics import NOMINAL, POSITION, VELOCITY, Quadrotor
from mathnavi.models.quadrotor.entity import RotorDrive
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.sim.engine.faults import Disturbed, Gusts
from mathnavi.sim.engine.loop import Agent, simulate
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from tests.quadrotor import built, flight_mission, hills


def mission_flown(true: Quadrotor = NOMINAL, gust: DeclaredGusts | None = None) -> dict[str, Any]:
    """Results of a mission across the hills, flown as a scenario would."""
    gust = gust or DeclaredGusts()
    flight = flight_mission(hills(), (40.0, 50.0), (250.0, 240.0), gust=gust)
    mission, sensing, gusting = QuadrotorMission(flight), *np.random.default_rng(5).spawn(2)
    raw, tracker = QuadrotorFlight.build(QuadrotorConfig(), mission)
    bound = tracker.bound  # type: ignore[attr-defined]
    certificate = Certificate.for_mission(flight, bound)
    planner = Certified(raw, partial(StopAndHover, period=raw.period), certificate, bound, flight.deadline_factor)
    config = QuadrotorState.Config()
    setup = VehicleSetup(mission.start_state, QuadrotorState.sensors(config, mission), drive=RotorDrive(true))
    body = MujocoPlant(built(flight.terrain, true), {"quad": setup}, sensing)
    m = true.mass
    plant: Plant = body
    if gust.rms > 0.0:
        plant = Disturbed(body, [Gusts(m * gust.rms, gust.time_constant, m * gust.limit, gusting)])
    agent = Agent(QuadrotorState.build(config, mission), planner, tracker, input_size=4)
    target = np.array(flight.target)
    recording = simulate(
        plant, {"quad": agent}, 80.0, lambda _, x: bool(np.linalg.norm(x["quad"][POSITION] - target) <= 2.5)
    )
    x, plans = recording.truths["quad"], recording.agents["quad"].plans
    begun = np.array([t for t, _ in plans])
    followed = [plans[int(np.searchsorted(begun, t + 1e-9, side="right")) - 1][1] for t in recording.t]
    planned = np.array([state_at(plan, float(t)) for plan, t in zip(followed, recording.t, strict=True)])
    return {
        "bound": bound,
        "deviation": np.hstack([x[:, POSITION], x[:, VELOCITY]]) - planned,
        "clearance": float((x[:, 2] - flight.terrain.height(x[:, 0], x[:, 1])).min()),
        "speed": float(np.linalg.norm(x[:, VELOCITY], axis=1).max()),
        "arrived": float(np.linalg.norm(x[-1, POSITION] - target)),
        "time": float(recording.t[-1]),
        "deadline": planner.deadline,
        "contacts": body.contacts("quad"),
        "plans": len(plans),
        "events": [event.kind for event in recording.events],
        "flight": flight,
    }


@pytest.mark.parametrize(
    ("true", "gust"),
    [(NOMINAL, None), (dataclasses.replace(NOMINAL, mass=1.32, motor_lag=0.035), DeclaredGusts(0.6, 3.0, 1.5))],
    ids=["still air", "gusts, mass and lag"],
)
def test_a_mission_across_hills_is_safe_in_time_and_within_the_bound(
    true: Quadrotor, gust: DeclaredGusts | None
) -> None:
    came = mission_flown(true, gust)
    bound, deviation, flight = came["bound"], came["deviation"], came["flight"]
    assert came["contacts"] == 0
    assert came["clearance"] >= flight.clearance_min
    assert came["arrived"] <= flight.arrival_radius
    assert came["time"] <= came["deadline"]
    assert came["speed"] <= flight.speed_max
    assert came["plans"] > 1.8 * came["time"]  # replanned nearly every half second
    assert "tracking-breach" not in came["events"]
    assert np.hypot(deviation[:, 0], deviation[:, 1]).max() <= bound.horizontal
    assert np.abs(deviation[:, 2]).max() <= bound.vertical
    if gust is None:
        assert np.linalg.norm(deviation[:, :3], axis=1).max() < 0.06


def test_a_mission_too_slow_to_plan_with_is_refused() -> None:
    flight = flight_mission(hills(), (40.0, 50.0), (350.0, 340.0), speed_max=0.5)
    with pytest.raises(ValueError, match=r"speed_max = 0\.5 leaves nothing to plan with"):
        QuadrotorFlight.build(QuadrotorConfig(), QuadrotorMission(flight))
