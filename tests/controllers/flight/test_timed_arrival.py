"""Arrival at a time that is asked for: sooner, later, changed on the way, and by the stored plan alone."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.completion import ArcList, complete
from mathnavi.controllers.flight.planner import ARRIVAL, ASSURED, StopAndHover, braking_time
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.plan_status import FlightPhase
from tests import flight

MISSION = flight.mission()
H = 5.0 / 3.0  # [s]
SCHEDULE = FlightConfig()
NATURAL = 64.8  # [s] the arrival that nobody asks to be another


class FailsFrom:
    """A planner whose solver gives up from a time [s] on."""

    def __init__(self, planner: Planner, t: float) -> None:
        self.period, self._planner, self._t = planner.period, planner, t

    def plan(self, request: PlanRequest) -> Plan:
        plan = self._planner.plan(request)
        return plan if request.t < self._t else Plan.failure(Status.SOLVER_FAILED)


def arrival(
    asked: Callable[[float], float | None], fails_from: float = math.inf, config: FlightConfig = SCHEDULE
) -> tuple[float, list[Plan]]:
    """When a vehicle on its plans arrives [s], which is asked for ``asked(t)`` from the second request on."""
    raw, tracker = FlightController.build(config, MISSION)
    certificate = Certificate.for_mission(MISSION, tracker.bound)
    planner = Certified(
        FailsFrom(raw, fails_from), partial(StopAndHover, period=raw.period), certificate, tracker.bound, 4.0
    )
    current = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, flight.at_rest(MISSION.start)), None))
    t, announced, plans = 0.0, None, [current]
    while t < 400.0:
        for moment in np.linspace(t, t + planner.period, 50, endpoint=False):
            if math.dist(state_at(current, moment)[:3], MISSION.target) <= MISSION.arrival_radius:
                return float(moment), plans
        wanted = asked(t)
        messages = () if wanted == announced or wanted is None else (Message(t, "fleet", ARRIVAL, wanted),)
        announced = wanted
        x = state_at(current, t)
        answer = planner.plan(PlanRequest(t, t + planner.period, Estimate(t, x), current, messages))
        current = answer if answer.ok else current
        plans.append(answer)
        t += planner.period
    return math.inf, plans


def test_nothing_changes_where_nothing_is_asked_for() -> None:
    assert arrival(lambda t: None)[0] == pytest.approx(NATURAL, abs=0.1)


@pytest.mark.parametrize("asked", [48.0, 60.0, 80.0, 120.0])
def test_it_arrives_when_it_is_asked_to(asked: float) -> None:
    found, plans = arrival(lambda t: asked)
    assert abs(found - asked) < 0.5 * H
    assert all(plan.ok for plan in plans)


@pytest.mark.parametrize("asked", [48.0, 60.0])
def test_by_a_13_as_a_constraint_it_arrives_as_soon_as_it_is_asked_to(asked: float) -> None:
    found, plans = arrival(lambda t: asked, config=FlightConfig(incorporation="constraint"))
    assert abs(found - asked) < 0.5 * H
    assert all(plan.ok for plan in plans)


def test_a_13_as_a_constraint_cannot_be_kept_where_it_is_asked_to_wait() -> None:
    """It has the vehicle as far away as if it flew on at v_max, so it would have to fly backwards."""
    _, plans = arrival(lambda t: 120.0, config=FlightConfig(incorporation="constraint"))
    failed = [plan for plan in plans if not plan.ok]
    assert len(failed) > len(plans) / 2
    assert all(plan.status is Status.INFEASIBLE and "(A.13) is off by" in plan.message for plan in failed)


def test_the_larger_its_weight_the_nearer_to_its_time_a_penalty_brings_it() -> None:
    errors = [
        abs(arrival(lambda t: 48.0, config=FlightConfig(incorporation="penalty", arrival_weight=weight))[0] - 48.0)
        for weight in (10.0, 100.0, 1e4)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.5 * H


@pytest.mark.parametrize("change", [-5.0, 10.0])
def test_another_time_may_be_asked_for_on_the_way(change: float) -> None:
    found, _ = arrival(lambda t: 59.5 + (change if t > 20.0 else 0.0))
    assert abs(found - 59.5 - change) < 0.5 * H


def test_what_is_too_soon_is_flown_as_soon_as_can_be() -> None:
    found, _ = arrival(lambda t: 42.0)
    assert 42.0 < found < 50.0


@pytest.mark.parametrize("fails_from", [10.0, 30.0])
def test_the_stored_plan_waits_for_its_time(fails_from: float) -> None:
    """In hover, at the end of the manoeuvre, and then goes down onto the target."""
    found, plans = arrival(lambda t: 100.0, fails_from)
    assert abs(found - 100.0) < H
    flown = [plan for plan in plans if plan.ok][-1]
    assert FlightPhase.HOVER in flown.phase


def test_where_too_little_time_is_left_for_the_stored_plan_it_is_late_and_arrives() -> None:
    """To stop, climb, cross and come down takes longer than to fly on."""
    found, plans = arrival(lambda t: 100.0, 55.0)
    assert 100.0 + H < found < 115.0
    assert FlightPhase.HOVER not in [plan for plan in plans if plan.ok][-1].phase


def test_times_that_are_none_are_ignored() -> None:
    for nonsense in (math.nan, math.inf, "soon"):
        assert arrival(lambda t, it=nonsense: it)[0] == pytest.approx(NATURAL, abs=0.1)  # type: ignore[misc]


@pytest.mark.parametrize("beside", [(52.0, 0.0), (-20.0, 52.0), (0.0, 30.0)])
def test_no_phase_of_a_plan_passes_the_target_before_the_assured_time(beside: tuple[float, float]) -> None:
    """A vehicle that waits below its target, and has a level above it to climb to."""
    target = np.add(MISSION.target, (0.0, 0.0, 250.0))
    mission = flight.mission(cruise_level=float(target[2]) + 800.0)
    mission = dataclasses.replace(mission, target=tuple(target), start=tuple(np.add(target, (*beside, -250.0))))
    planner, tracker = FlightController.build(SCHEDULE, mission)
    assured, current = 250.0, None
    braking = braking_time(Certificate.for_mission(mission, tracker.bound))
    for t in np.arange(0.0, 100.0, planner.period):
        start = t if current is None else t + planner.period
        x = flight.at_rest(mission.start) if current is None else state_at(current, t)
        messages = (Message(t, "fleet", ASSURED, assured),) if t == 0.0 else ()
        plan = planner.plan(PlanRequest(t, start, Estimate(t, x), current, messages))
        if not plan.ok:
            continue
        moments = np.arange(plan.t_start, plan.t_end - 2.0 * braking, 0.02)
        nearest = min(math.dist(state_at(plan, moment)[:3], target) for moment in moments)
        assert nearest > mission.arrival_radius
        current = plan


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 500.0))
def test_waiting_puts_off_the_end_and_nothing_else(seed: int, wait: float) -> None:
    rng, terrain = np.random.default_rng(seed), flight.mountains()
    start = np.array([*rng.uniform(2_000.0, 8_000.0, 2), 2_000.0, 0.0, 0.0, rng.uniform(0.0, 50.0)])
    target = np.array([*rng.uniform(2_000.0, 8_000.0, 2), 1_800.0])

    def completed(end: float) -> Plan:
        arcs = ArcList.begin(3.0, start)
        complete(arcs, terrain, target, 50.0, 300.0, 40.0, end)
        return arcs.plan(0.0, 0.0)

    plain = completed(-math.inf)
    waiting = completed(plain.t_end + wait)
    assert waiting.t_end == pytest.approx(plain.t_end + wait, abs=1e-8)
    assert _path(waiting) == pytest.approx(_path(plain), abs=1e-6)
    assert np.isin(waiting.phase, list(FlightPhase)).all()
    ends = [state_at(waiting, float(t)) for t in waiting.t[1:]]
    assert np.array(ends) == pytest.approx(waiting.x[1:], abs=1e-6)


def _path(plan: Plan) -> Array:
    """Where the plan turns, hover left out."""
    kept = np.concatenate([[True], np.abs(np.diff(plan.x, axis=0)).max(axis=1) > 0.0])
    rows: Array = plan.x[kept]
    return rows
