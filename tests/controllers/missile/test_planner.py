"""The planner: from the estimate to where the target will be, again and again, until it lets the last plan fly."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.missile.autopilot import FeedbackLinearisation
from mathnavi.controllers.missile.optimiser import MissileTrajectory, flown
from mathnavi.controllers.missile.planner import MissilePlanner
from mathnavi.controllers.missile.problem import TerminalCondition
from mathnavi.controllers.missile.shooting import Failed
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest, Status
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL
from mathnavi.models.missile.mission import MissileMission, Target
from tests.controllers.missile.flights import built, deviation, miss, mission

PERIOD = 0.1


class Scripted:
    """An optimiser that records its requests and fails on command."""

    def __init__(self) -> None:
        self.asked: list[tuple[float, Array, TerminalCondition]] = []
        self.fails = False

    def optimise(self, t: float, start: Array, condition: TerminalCondition) -> MissileTrajectory | Failed:
        self.asked.append((t, start.copy(), condition))
        if self.fails:
            return Failed("failure on command", infeasible=False)
        breaks = np.linspace(0.0, 2.0, 11)
        u = np.tile([100.0, -2000.0, 0.0], (10, 1))
        return MissileTrajectory(breaks, flown(start, breaks, u, PLANAR, mission().body), u, 1.0)


def planner(optimiser: Scripted, guidance: MissileMission | None = None, **fields: Any) -> MissilePlanner:
    guidance = guidance or mission()
    return MissilePlanner(
        guidance, optimiser, FeedbackLinearisation(guidance, 8.0), PERIOD, **{"commit": 0.3, "lead": True} | fields
    )


def request(plan: Plan | None, t: float, x: Array, *messages: Message) -> PlanRequest:
    start = t if plan is None else t + PERIOD
    return PlanRequest(t, start, Estimate(t, x), plan, messages)


def started(optimiser: Scripted, guidance: MissileMission | None = None, **fields: Any) -> tuple[MissilePlanner, Plan]:
    """A planner and its first plan."""
    made = planner(optimiser, guidance, **fields)
    return made, made.plan(request(None, 0.0, mission().start_state))


def test_the_first_plan_starts_from_the_estimate() -> None:
    optimiser, x = Scripted(), mission().start_state + 1.0
    plan = planner(optimiser).plan(request(None, 3.0, x))
    assert plan.ok
    assert plan.t_start == 3.0
    np.testing.assert_array_equal(plan.x[0], x)


def test_a_later_plan_starts_from_where_the_estimate_will_be_and_not_from_the_plan() -> None:
    optimiser, guidance = Scripted(), mission()
    made, plan = started(optimiser)
    offset = deviation(guidance, 1.0)
    made.plan(request(plan, 0.5, guidance.coordinates.state_at(plan, 0.5) + offset))
    t, start, _ = optimiser.asked[-1]
    there = guidance.coordinates.state_at(plan, 0.6)
    assert t == pytest.approx(0.6)
    # Part of the offset is corrected by then.
    assert 0.1 < np.linalg.norm((start - there)[4:]) / np.linalg.norm(offset[4:]) < 1.0


def test_it_aims_where_the_target_will_be() -> None:
    optimiser, guidance = Scripted(), mission(target=Target((700.0, 0.0, 0.0), (20.0, 0.0, 0.0)))
    made, plan = started(optimiser, guidance)
    made.plan(request(plan, 0.5, guidance.coordinates.state_at(plan, 0.5)))
    (_, _, first), (_, _, second) = optimiser.asked
    np.testing.assert_allclose(first.place, (700.0, 0.0, 0.0))
    np.testing.assert_allclose(second.place, (712.0, 0.0, 0.0))
    np.testing.assert_allclose(second.after(2.0), (752.0, 0.0, 0.0))


def test_without_lead_it_aims_where_the_target_is() -> None:
    optimiser, guidance = Scripted(), mission(target=Target((700.0, 0.0, 0.0), (20.0, 0.0, 0.0)))
    planner(optimiser, guidance, lead=False).plan(request(None, 0.0, guidance.start_state))
    np.testing.assert_allclose(optimiser.asked[0][2].after(2.0), (700.0, 0.0, 0.0))


def test_it_listens_to_whoever_watches_the_target_and_to_nothing_else() -> None:
    optimiser, guidance = Scripted(), mission()
    made = planner(optimiser)
    moved = Target((650.0, 0.0, 0.0), (-10.0, 0.0, 0.0), 0.4)
    plan = made.plan(
        request(
            None,
            0.0,
            guidance.start_state,
            Message(0.0, "x", "target", "nonsense"),
            Message(0.0, "x", "weather", moved),
        )
    )
    np.testing.assert_allclose(optimiser.asked[-1][2].place, (700.0, 0.0, 0.0))
    made.plan(request(plan, 0.5, plan.x[2], Message(0.5, "target watch", "target", moved)))
    np.testing.assert_allclose(optimiser.asked[-1][2].place, (648.0, 0.0, 0.0))


def test_a_failure_is_a_status_and_the_next_request_is_another_try() -> None:
    optimiser = Scripted()
    made, plan = started(optimiser)
    optimiser.fails = True
    failed = made.plan(request(plan, 0.1, plan.x[0]))
    assert failed.status is Status.SOLVER_FAILED
    assert failed.message == "failure on command"
    assert failed.solve_ms >= 0.0
    optimiser.fails = False
    assert made.plan(request(plan, 0.2, plan.x[1])).ok


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_an_estimate_that_is_not_finite_is_a_status(value: float) -> None:
    optimiser, guidance = Scripted(), mission()
    made = planner(optimiser)
    x = guidance.start_state
    x[2] = value
    assert made.plan(request(None, 0.0, x)).status is Status.NOT_FINITE
    plan = made.plan(request(None, 0.0, guidance.start_state))
    assert made.plan(request(plan, 0.1, x)).status is Status.NOT_FINITE


def test_near_the_end_the_plan_is_flown_out() -> None:
    optimiser, guidance = Scripted(), mission()
    made, plan = started(optimiser)  # 2 s long
    asked = len(optimiser.asked)
    rest = made.plan(request(plan, 1.65, guidance.start_state))
    assert len(optimiser.asked) == asked  # whatever the estimate says
    assert rest.ok
    assert rest.t_start == pytest.approx(1.75)
    assert rest.t_end == plan.t_end
    for t in (1.75, 1.9, 2.0):
        np.testing.assert_allclose(
            guidance.coordinates.state_at(rest, t), guidance.coordinates.state_at(plan, t), atol=1e-9
        )
        np.testing.assert_array_equal(guidance.coordinates.input_at(rest, t), guidance.coordinates.input_at(plan, t))


def test_past_the_end_the_last_input_is_held_on() -> None:
    guidance = mission()
    made, plan = started(Scripted())
    after = made.plan(request(plan, 2.5, guidance.start_state))
    assert after.ok
    assert after.t_start == pytest.approx(2.6)
    assert after.t_end > after.t_start
    np.testing.assert_array_equal(after.u[-1], plan.u[-1])
    np.testing.assert_allclose(after.x[0], guidance.coordinates.state_at(plan, 2.6), atol=1e-9)


def test_what_is_to_be_said_is_said_once() -> None:
    made, plan = started(Scripted(), remark="there is something to say")
    assert (plan.notes, plan.message) == (("backend",), "there is something to say")
    again = made.plan(request(plan, 0.1, plan.x[0]))
    assert (again.notes, again.message) == ((), "")


def sequence(planner: Planner, guidance: MissileMission, count: int, deviation_size: float = 0.0) -> list[Plan]:
    """Plans of a missile that is ``off`` its plan, each time elsewhere."""
    plans: list[Plan] = []
    for k in range(count):
        t = k * planner.period
        current = plans[-1] if plans else None
        if current is None:
            x, start = guidance.start_state, t
        else:
            x, start = (
                guidance.coordinates.state_at(current, t) + deviation(guidance, deviation_size, k),
                t + planner.period,
            )
        plan = planner.plan(PlanRequest(t, start, Estimate(t, x), current))
        assert plan.ok, plan.message
        plans.append(plan)
    return plans


@pytest.mark.parametrize("fields", [{}, {"grid": "arclength"}])
def test_every_plan_ends_on_the_target_however_little_time_is_left(fields: dict[str, Any]) -> None:
    guidance = mission(target=Target((700.0, 0.0, 0.0), (15.0, 0.0, 0.0)))
    made, _ = built(guidance, replan_period=0.2, **fields)
    for plan in sequence(made, guidance, 44, deviation_size=0.1):
        assert miss(plan, guidance) < 5e-3
        end = plan.x[-1]
        assert end[3] == pytest.approx(-0.5 * math.pi, abs=1e-3)
        assert abs(end[1]) < 0.05


def test_in_space_every_plan_ends_on_the_target_too() -> None:
    guidance = mission(SPATIAL, target=Target((700.0, 100.0, 0.0), (10.0, -10.0, 0.0)))
    made, _ = built(guidance, replan_period=0.4)
    for plan in sequence(made, guidance, 20, deviation_size=0.1):
        assert miss(plan, guidance) < 0.05
        assert abs(plan.x[-1][6]) < 1e-3


def test_a_target_below_the_ground_is_announced_as_out_of_reach() -> None:
    optimiser, guidance = Scripted(), mission()
    made, plan = started(optimiser, guidance)
    sinking = Message(0.5, "target watch", "target", Target((700.0, 0.0, 5.0), (0.0, 0.0, 30.0), 0.5))
    failed = made.plan(request(plan, 0.5, guidance.start_state, sinking))
    assert failed.status is Status.INFEASIBLE
    assert "out of reach: it is 8 m below the ground" in failed.message
    assert len(optimiser.asked) == 1
