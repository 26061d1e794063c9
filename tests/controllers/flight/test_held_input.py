"""A stranger's plan that changes faster than commands are held: certified only if the tracker follows it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.flight.held_input import NO_LAG, HeldInput
from mathnavi.controllers.flight.planner import StopAndHover, complete_by
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import OPTIMISED, Estimate, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import flow, state_at
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from tests import flight

PERIOD = 1.0 / 60.0  # [s] of the commands
MISSION = flight.mission()
BOUND = tracking_bound(0.8, MISSION)
TRACKER = CriticallyDamped(PERIOD, 0.8, BOUND)
CERTIFICATE = Certificate.for_mission(MISSION, BOUND, TRACKER.held)


def pulses(count: int, acceleration: float, length: float) -> Plan:
    """The way up and down ``count`` times, by pulses of a length [s], and then to the target."""
    arcs = ArcList.begin(0.0, MISSION.start_state)
    arcs.add(np.zeros(3), 1.0, FlightPhase.HOVER)
    for _ in range(count):
        for sign in (1.0, -1.0):
            arcs.add(np.array([0.0, 0.0, sign * acceleration]), length, FlightPhase.CRUISE)
    arcs.rest()
    complete_by(arcs, CERTIFICATE)
    return arcs.plan(0.0, 0.0)


def flown_lag(plan: Plan, tracker: CriticallyDamped, duration: float, finer: int = 4) -> float:
    """Greatest distance [m] of the tracked vehicle from its plan, without noise and gusts."""
    x, greatest = plan.x[0].copy(), 0.0
    for k in range(math.ceil(duration / tracker.period)):
        t = plan.t_start + k * tracker.period
        u = tracker.command(t, Estimate(t, x), plan)
        for j in range(1, finer + 1):
            s = j * tracker.period / finer
            error = flow(x, u, s)[:3] - state_at(plan, t + s)[:3]
            greatest = max(greatest, float(np.linalg.norm(error)))
        x = flow(x, u, tracker.period)
    return greatest


def test_pulses_within_a_control_period_are_refused() -> None:
    plan = pulses(400, MISSION.acceleration_max * 0.9, PERIOD / 2.0)
    refusal = CERTIFICATE.check(plan)
    assert refusal is not None
    assert refusal.status is FlightStatus.NOT_TRACKABLE
    # a h / (2 omega), which the mean loses for good, is more than the whole bound.
    assert flown_lag(plan, TRACKER, 15.0) > BOUND.vertical


@given(
    seed=st.integers(0, 2**32 - 1),
    arcs=st.integers(1, 25),
    shortest=st.sampled_from([1e-4, PERIOD / 3.0, PERIOD, 0.3]),
    bandwidth=st.sampled_from([0.3, 0.8, 3.0]),
)
@settings(max_examples=15)
def test_the_lag_is_that_of_the_vehicle(seed: int, arcs: int, shortest: float, bandwidth: float) -> None:
    rng = np.random.default_rng(seed)
    length = shortest * rng.uniform(1.0, 3.0, arcs)
    u = rng.uniform(-20.0, 20.0, (arcs, 3))
    t, x = np.concatenate([[0.0], np.cumsum(length)]), [MISSION.start_state]
    for a, d in zip(u, length, strict=True):
        x.append(flow(x[-1], a, float(d)))
    x.append(flow(x[-1], -x[-1][3:] / 5.0, 5.0))
    plan = Plan(np.append(t, t[-1] + 5.0), np.array(x), np.vstack([u, -x[-2][3:] / 5.0]), np.full(arcs + 1, OPTIMISED))
    bound = tracking_bound(bandwidth, MISSION)
    generous = type(bound)(1e3, 1e3, 1e3, 1e3, 1e3)
    tracker = CriticallyDamped(PERIOD, bandwidth, generous)
    assert tracker.held is not None
    foreseen, flown = tracker.held.greatest(plan), flown_lag(plan, tracker, plan.t_end + 1.0)
    assert flown <= foreseen * (1.0 + 1e-6) + 1e-7
    if shortest >= PERIOD:  # tight: what happens between two commands is less than what adds up
        assert foreseen <= 3.0 * flown + 1e-6


@pytest.mark.parametrize("bandwidth", [5e-324, 1e-6, 10.0])
def test_a_tracker_that_is_too_slow_or_too_fast_for_its_period_is_refused(bandwidth: float) -> None:
    with pytest.raises(FieldError, match=r"bandwidth = .*; allowed: 0\.0006 to 6 rad/s at a control_rate of 60 Hz"):
        CriticallyDamped(PERIOD, bandwidth, BOUND)
    slowest = CriticallyDamped(PERIOD, 0.0006, BOUND).held
    assert slowest is not None
    assert 0.0 < slowest.greatest(pulses(1, 10.0, 1.0)) < 1.0  # its periods can be counted


@pytest.mark.parametrize("hover", [1e8, 1e19])
def test_a_plan_without_end_is_refused_and_not_counted(hover: float) -> None:
    plan = pulses(1, 10.0, 1.0)
    later = dataclasses.replace(plan, t=np.append(plan.t, plan.t[-1] + hover), x=np.vstack([plan.x, plan.x[-1]]))
    later = dataclasses.replace(later, u=np.vstack([plan.u, np.zeros(3)]), phase=np.append(plan.phase, plan.phase[-1]))
    refusal = CERTIFICATE.check(later)
    assert refusal is not None
    assert refusal.status is FlightStatus.NOT_TRACKABLE


def test_a_lag_is_carried_from_plan_to_plan() -> None:
    held = HeldInput(PERIOD, 0.8, 1.0)
    plan = pulses(60, 30.0, PERIOD / 2.0)
    middle = 1.0 + 30 * PERIOD
    begun = held.after(plan, NO_LAG, 0.0, middle)
    np.testing.assert_allclose(
        held.after(plan, begun, middle, middle + 1.0), held.after(plan, NO_LAG, 0.0, middle + 1.0), atol=1e-9
    )
    assert np.linalg.norm(begun[:3]) > 1e-3


@pytest.mark.parametrize("nodes", [7, 13])
def test_the_planners_own_plans_are_trackable(nodes: int) -> None:
    planner, _ = FlightController.build(FlightConfig(nodes=nodes), MISSION)
    certificate = Certificate.for_mission(MISSION, BOUND, TRACKER.held)
    fallback = StopAndHover(certificate, planner.period)
    held = TRACKER.held
    assert held is not None
    plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, MISSION.start_state), None))
    greatest: list[float] = []
    for k in range(8):
        t = k * planner.period
        request = PlanRequest(t, t + planner.period, Estimate(t, state_at(plan, t)), plan)
        for answer in (planner.plan(request), fallback.plan(request)):
            assert answer.ok
            greatest.append(held.greatest(answer))
        plan = planner.plan(request)
    assert max(greatest) <= held.allowed
    assert max(greatest) > 0.1 * held.allowed
