"""The planner of the thesis as printed: (A.2) and (A.4) to the letter, and what they leave open."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize

from mathnavi.controllers.flight.as_printed import AsPrintedConfig, AsPrintedFlight, EulerNlp, solve, steepest_sine
from mathnavi.controllers.flight.cost_to_go import trilinear_cost
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from mathnavi.models.terrain.height_field import HeightField
from tests import flight

H = 5.0 / 3.0


def nlp_from(x: Array, nodes: int = 7) -> EulerNlp:
    terrain, target = flight.mountains(), np.array(flight.mission().target)
    cost = trilinear_cost(terrain, target, (), 33, 5)
    return EulerNlp(terrain, cost, x, nodes, H, 100.0, 0.01 * H * 100.0, 50.0, 300.0, 23.0)


def instances() -> list[EulerNlp]:
    """States on the way, a few hundred metres above the ground, some at rest and some in flight."""
    rng, terrain = np.random.default_rng(5), flight.mountains()
    return [
        nlp_from(np.array([*flight.above(terrain, (float(x), float(y)), float(up)), speed, 0.8 * speed, 10.0]))
        for x, y, up, speed in zip(
            rng.uniform(1000.0, 6000.0, 8),
            rng.uniform(1000.0, 6000.0, 8),
            rng.uniform(200.0, 500.0, 8),
            [0.0, 50.0, 100.0, 150.0, 180.0, 30.0, 120.0, 0.0],
            strict=True,
        )
    ]


@cache
def flown_plans() -> list[tuple[PlanRequest, Plan]]:
    """A low mission without faults, request by request."""
    ground = flight.mountains()
    mission = dataclasses.replace(
        flight.mission(),
        start=flight.above(ground, flight.START, 60.0),
        target=flight.above(ground, flight.TARGET, 60.0),
    )
    planner, _ = AsPrintedFlight.build(AsPrintedConfig(), mission)
    asked: list[tuple[PlanRequest, Plan]] = []
    current: Plan | None = None
    for k in range(30):
        t = k * planner.period
        x = flight.at_rest(mission.start) if current is None else state_at(current, t)
        request = PlanRequest(t, t if current is None else t + planner.period, Estimate(t, x), current)
        plan = planner.plan(request)
        asked.append((request, plan))
        current = plan if plan.ok else current
    return asked


def optimised(asked: list[tuple[PlanRequest, Plan]]) -> list[Plan]:
    return [plan for _, plan in asked if plan.ok and plan.phase[0] == FlightPhase.OPTIMISED]


def test_the_nodes_are_forward_eulers() -> None:
    nlp = instances()[2]
    a = np.random.default_rng(0).uniform(-20.0, 20.0, (6, 3))
    p, v = nlp.states(a)
    np.testing.assert_array_equal(p[0], nlp.start[:3])
    np.testing.assert_array_equal(v[0], nlp.start[3:])
    np.testing.assert_allclose(np.diff(p, axis=0), H * v[:-1])
    np.testing.assert_allclose(np.diff(v, axis=0), H * a)


def test_gradient_and_jacobian_are_the_slopes() -> None:
    rng, step = np.random.default_rng(1), 1e-5
    for nlp in instances():
        a = rng.uniform(-5.0, 5.0, (6, 3))
        d = rng.normal(size=(6, 3))
        forward, backward = a + step * d, a - step * d
        slope = (nlp.objective(forward) - nlp.objective(backward)) / (2.0 * step)
        assert nlp.gradient(a) @ d.ravel() == pytest.approx(slope, rel=1e-5, abs=1e-4)
        slopes = (nlp.constraints(forward) - nlp.constraints(backward)) / (2.0 * step)
        np.testing.assert_allclose(nlp.jacobian(a) @ d.ravel(), slopes, rtol=1e-5, atol=1e-4)


def test_a_solution_keeps_every_constraint_and_no_general_solver_finds_a_better_one() -> None:
    solved = 0
    for nlp in instances():
        a, status = solve(nlp, np.zeros((6, 3)))
        if status is not Status.OK:
            continue
        solved += 1
        assert nlp.constraints(a).max() <= 1e-3
        assert np.abs(a).max() <= nlp.thrust
        other = minimize(
            lambda u, nlp=nlp: nlp.objective(u.reshape(6, 3)),
            a.ravel(),
            jac=lambda u, nlp=nlp: nlp.gradient(u.reshape(6, 3)),
            bounds=[(-nlp.thrust, nlp.thrust)] * 18,
            constraints={
                "type": "ineq",
                "fun": lambda u, nlp=nlp: -nlp.constraints(u.reshape(6, 3)),
                "jac": lambda u, nlp=nlp: -nlp.jacobian(u.reshape(6, 3)),
            },
            method="SLSQP",
        )
        if nlp.constraints(other.x.reshape(6, 3)).max() <= 1e-3:
            assert other.fun >= nlp.objective(a) * (1.0 - 1e-3)
    assert solved >= 6


def test_what_cannot_be_met_is_infeasible_not_ignored() -> None:
    under_ground = flight.at_rest(flight.above(flight.mountains(), (3000.0, 3000.0), -200.0))
    assert solve(nlp_from(under_ground), np.zeros((6, 3)))[1] is Status.INFEASIBLE


def test_its_plans_hold_inputs_for_h_keep_the_prints_boxes_and_end_in_the_set_of_safe_states() -> None:
    plans, sine = optimised(flown_plans()), steepest_sine(flight.mountains())
    assert len(plans) > 10
    assert 0.7 < sine < 1.0
    for plan in plans:
        flight.assert_well_formed(plan)
        first = plan.phase == FlightPhase.OPTIMISED
        assert first.sum() == 13
        np.testing.assert_allclose(np.diff(plan.t[:14]), H)
        np.testing.assert_array_equal(plan.u[12], 0.0)  # a_N
        assert np.abs(plan.x[:-1][first, 3:]).max() <= 300.0 + 1e-2
        assert np.abs(plan.u[first]).max() <= 40.0 / math.sqrt(3.0)
        v = plan.x[14, 3:]  # behind 13 arcs and the manoeuvre's one
        assert v[2] >= sine * float(np.linalg.norm(v))


def test_the_steepest_slope_is_that_of_a_triangle() -> None:
    slope = HeightField(np.array([[0.0, 0.0], [30.0, 40.0]]), 100.0)
    assert steepest_sine(slope) == pytest.approx(math.sin(math.atan(0.4)))  # the other one rises by (0.1, 0.3)


def test_between_its_nodes_it_sees_nothing() -> None:
    ground = flight.mountains()
    least = [
        ground.path_clearance(plan.x[:-1, :3], plan.x[:-1, 3:], plan.u, np.diff(plan.t)).min()
        for plan in optimised(flown_plans())
    ]
    assert min(least) < 50.0 - 5.0


def test_where_the_nlp_fails_the_last_plan_stays_and_the_failure_says_why() -> None:
    for request, plan in flown_plans():
        if not plan.ok:
            assert request.current is not None
            assert plan.status in (Status.INFEASIBLE, Status.SOLVER_FAILED, FlightStatus.LOW_CLEARANCE)
            assert plan.message.startswith("the NLP (A.2)" if not plan.notes else "the manoeuvre (A.4)")


def test_a_displaced_vehicle_is_planned_for_from_where_it_is_measured() -> None:
    mission = flight.mission()
    planner, _ = AsPrintedFlight.build(AsPrintedConfig(), mission)
    first = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, flight.at_rest(mission.start)), None))
    jump = np.array([20.0, -10.0, 30.0, 0.0, 0.0, 0.0])
    t = planner.period
    plan = planner.plan(PlanRequest(t, 2.0 * t, Estimate(t, state_at(first, t) + jump), first))
    assert plan.ok, plan.message
    np.testing.assert_allclose(plan.x[0], state_at(first, 2.0 * t) + jump, atol=1e-9)


def test_gusts_that_need_all_the_force_are_refused() -> None:
    mission = dataclasses.replace(flight.mission(), acceleration_max=0.05)
    with pytest.raises(ValueError, match=r"acceleration_max = 0\.05 leaves nothing"):
        AsPrintedFlight.build(AsPrintedConfig(), mission)
