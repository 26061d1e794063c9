"""A start that is too fast is slowed down; its excess is not allowed for the rest of the plan."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.flight.certificate import Certificate, TrackingBound
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.flight.planner import StopAndHover, complete_by
from mathnavi.controllers.flight.plugin import FlightConfig, planner
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from tests import flight

BOUND = TrackingBound(2.0, 3.0, 0.0, 0.0)
MISSION = dataclasses.replace(flight.mission(), speed_max=100.0, acceleration_max=20.0)
CERTIFICATE = Certificate.for_mission(MISSION, BOUND)
STOP = 100.0 / 20.0  # [s] v_max / a_max
NORTH_EAST = np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)


def begun(speed: float) -> Array:
    """High above the start, on the way to the target (6,)."""
    x, y, z = MISSION.start
    return np.array([x, y, z + 2500.0, *(speed * NORTH_EAST)])


def slowed(speed: float, *arcs: tuple[float, float]) -> Plan:
    """A plan of (deceleration [m/s^2], duration [s]) from a speed [m/s], then to rest and to the target."""
    way = ArcList.begin(0.0, begun(speed))
    for deceleration, duration in arcs:
        way.add(-deceleration * NORTH_EAST, duration, FlightPhase.CRUISE)
    v = way.x[-1][3:]
    fast = float(np.linalg.norm(v))
    way.add(-20.0 * v / max(fast, 1e-3), fast / 20.0, FlightPhase.MANOEUVRE)
    way.rest()
    complete_by(way, CERTIFICATE)
    return way.plan(0.0, 0.0)


@pytest.mark.parametrize(
    ("speed", "arcs"),
    [
        (110.0, [(0.0, 20.0)]),  # keeps its excess
        (110.0, [(0.5, 20.0)]),  # one long arc, whose end alone is within the bound
        (110.0, [(-1.0, 0.5), (4.0, 4.0)]),  # first becomes faster
        (110.0, [(20.0, 0.5), (-2.0, 5.0)]),  # within the bound, and then no longer
        (180.0, [(4.0, 20.0)]),  # falls, at less than a quarter of a_max
    ],
)
def test_a_plan_that_keeps_an_excess_of_speed_is_refused(speed: float, arcs: list[tuple[float, float]]) -> None:
    refusal = CERTIFICATE.check(slowed(speed, *arcs))
    assert refusal is not None
    assert refusal.status is FlightStatus.BOUNDS
    assert f"from {speed:.2f} at the start to 100.00 within" in refusal.message


@pytest.mark.parametrize(
    ("speed", "arcs"),
    [(110.0, [(2.0, STOP)]), (110.0, [(4.0, 2.0), (1.0, 2.0)]), (180.0, [(5.0, 16.0)]), (100.0, [(0.0, 5.0)])],
)
def test_a_plan_whose_excess_falls_in_time_is_certified(speed: float, arcs: list[tuple[float, float]]) -> None:
    assert CERTIFICATE.check(slowed(speed, *arcs)) is None


def test_speed_within_the_bounds_is_judged_as_ever() -> None:
    refusal = CERTIFICATE.check(slowed(90.0, (-2.0, 6.0)))
    assert refusal is not None
    assert refusal.message == "|v| reaches 102.00 m/s; allowed 100.00"


@given(speed=st.floats(60.0, 250.0), deceleration=st.integers(-200, 200), duration=st.floats(0.1, 30.0))
@settings(deadline=None, max_examples=50)
def test_of_a_certified_plan_the_excess_falls_at_every_instant(
    speed: float, deceleration: int, duration: float
) -> None:
    plan = slowed(speed, (0.1 * deceleration, duration))
    if CERTIFICATE.check(plan) is not None:
        return
    t = np.linspace(0.0, plan.t_end, 400)
    excess = np.linalg.norm(state_at(plan, t)[:, 3:], axis=1) - 100.0
    fall = max(STOP, 4.0 * max(excess[0], 0.0) / 20.0)
    assert (excess <= max(excess[0], 0.0) * np.maximum(0.0, 1.0 - t / fall) + 1e-5).all()


def request(x: Array) -> PlanRequest:
    return PlanRequest(0.0, 0.0, Estimate(0.0, x), None)


@pytest.mark.parametrize("speed", [100.001, 101.0, 110.0, 125.0])
def test_the_planners_own_plans_from_a_fast_start_are_certified(speed: float) -> None:
    plan = planner(FlightConfig(), MISSION, BOUND).plan(request(begun(speed)))
    assert plan.ok, plan.message
    assert CERTIFICATE.check(plan) is None


@pytest.mark.parametrize("speed", [100.001, 130.0, 250.0])
def test_stopping_at_once_from_a_fast_start_is_certified(speed: float) -> None:
    assert CERTIFICATE.check(StopAndHover(CERTIFICATE, 2.0).plan(request(begun(speed)))) is None
