"""The way on from vertical flight: it rests on the target, keeps the bounds and clears the ground."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.controllers.flight.completion import ArcList, complete, highest_ground
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.terrain.height_field import HeightField
from tests import flight

CLEARANCE, SPEED, ACCELERATION = 50.0, 300.0, 40.0

inside = st.floats(1.0, flight.SIDE - 1.0)  # on the border itself, rounding may lead off the map
place = st.tuples(inside, inside)
height = st.floats(CLEARANCE, 3000.0)


def completed(x: Array, target: Array, end: float = -math.inf) -> Plan:
    arcs = ArcList.begin(12.0, x)
    complete(arcs, flight.mountains(), target, CLEARANCE, SPEED, ACCELERATION, end)
    return arcs.plan(math.nan, math.nan)


def point(where: tuple[float, float], up: float) -> Array:
    return np.array(flight.above(flight.mountains(), where, up))


@given(start=place, up=height, target=place, target_up=height, climb=st.floats(0.0, SPEED))
def test_it_rests_on_the_target_keeps_the_bounds_and_clears_the_ground(
    start: tuple[float, float], up: float, target: tuple[float, float], target_up: float, climb: float
) -> None:
    p_f = point(target, target_up)
    plan = completed(np.array([*point(start, up), 0.0, 0.0, climb]), p_f)
    if len(plan.u) == 0:  # nothing to do
        np.testing.assert_allclose(plan.x[-1, :3], p_f, atol=1e-6)
        return
    flight.assert_well_formed(plan)
    np.testing.assert_allclose(plan.x[-1, :3], p_f, rtol=0.0, atol=1e-6)
    assert np.linalg.norm(plan.x[:, 3:], axis=1).max() <= SPEED + 1e-9
    assert np.linalg.norm(plan.u, axis=1).max() <= ACCELERATION + 1e-9
    clearance = flight.mountains().path_clearance(plan.x[:-1, :3], plan.x[:-1, 3:], plan.u, np.diff(plan.t))
    assert clearance.min() >= CLEARANCE - 1e-6


def test_its_phases_follow_each_other_and_it_waits_at_the_first_rest() -> None:
    start, target = np.array([*point(flight.START, 100.0), 0.0, 0.0, 60.0]), point(flight.TARGET, 100.0)
    plan, late = completed(start, target), completed(start, target, 500.0)
    order = [list(dict.fromkeys(FlightPhase(phase) for phase in each.phase)) for each in (plan, late)]
    assert order[0] == [FlightPhase.MANOEUVRE, FlightPhase.CLIMB, FlightPhase.CRUISE, FlightPhase.DESCENT]
    assert order[1] == [FlightPhase.MANOEUVRE, FlightPhase.HOVER, *order[0][1:]]
    assert plan.t_end < late.t_end == 500.0
    flight.assert_well_formed(late)


def test_it_is_as_fast_as_its_bounds_allow() -> None:
    plain = HeightField(np.zeros((3, 3)), 20_000.0)
    arcs = ArcList.begin(0.0, flight.at_rest((1000.0, 1000.0, 100.0)))
    complete(arcs, plain, np.array([31_000.0, 1000.0, 100.0]), CLEARANCE, SPEED, ACCELERATION)
    assert arcs.t[-1] == 30_000.0 / SPEED + SPEED / ACCELERATION


@given(a=place, b=place)
def test_the_highest_ground_is_that_of_the_straight_line(a: tuple[float, float], b: tuple[float, float]) -> None:
    terrain = flight.mountains()
    s = np.linspace(0.0, 1.0, 400)[:, np.newaxis]
    line = (1.0 - s) * np.array(a) + s * np.array(b)
    sampled = float(terrain.height(line[:, 0], line[:, 1]).max())
    assert sampled - 1e-6 <= highest_ground(terrain, np.array(a), np.array(b)) <= sampled + 100.0


def test_off_the_map_the_ground_is_infinitely_high() -> None:
    assert highest_ground(flight.mountains(), np.array([100.0, 100.0]), np.array([-100.0, 100.0])) == math.inf


def test_arcs_join_exactly() -> None:
    rng, count = np.random.default_rng(4), 20_000
    far = rng.choice([0.0, 10.0, 1e4], (count, 1))  # from the origin no larger number hides a last digit
    start, u = far * rng.standard_normal((count, 6)), rng.uniform(-40.0, 40.0, (count, 3))
    duration = rng.uniform(0.01, 20.0, count)
    ends = np.empty_like(start)
    for k, lasting in enumerate(duration.tolist()):
        arcs = ArcList.begin(3.0, start[k])
        arcs.add(u[k], 0.0, FlightPhase.OPTIMISED)  # an arc of no length is no arc
        arcs.add(u[k], lasting, FlightPhase.OPTIMISED)
        _, ends[k] = arcs.x
    np.testing.assert_array_equal(ends, flow(start, u, duration[:, np.newaxis]))


def test_level_flight_is_at_the_given_level_unless_the_ground_is_higher() -> None:
    terrain, start, target = flight.mountains(), np.array([3e3, 3e3, 900.0]), np.array([9e3, 9e3, 800.0])
    highest = highest_ground(terrain, start[:2], target[:2])
    for level, expected in ((highest + 700.0, highest + 700.0), (0.0, highest + 51.0)):
        arcs = ArcList.begin(0.0, np.concatenate([start, np.zeros(3)]))
        complete(arcs, terrain, target, 50.0, 300.0, 40.0, level=level)
        plan = arcs.plan(0.0, 0.0)
        cruising = plan.x[:-1][plan.phase == FlightPhase.CRUISE]
        assert cruising[:, 2] == pytest.approx(expected)
        assert plan.x[-1, :3] == pytest.approx(target)
