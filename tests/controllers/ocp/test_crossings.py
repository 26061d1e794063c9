"""Jumps and kinks that a trajectory crosses are found, named, and never passed over as OPTIMAL."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.crossings import Crossing, crossings
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from tests.controllers.ocp.statements import two_costs

Expression = Callable[[ca.SX], ca.SX]


def clock(cost: Expression, nodes: int = 4, **limits: float) -> Solution:
    """x = t over [0, 2], whatever ``cost`` of x is integrated; nodes at 0, 2/3, 4/3 and 2 s."""
    ocp = OptimalControlProblem("clock")
    x, u = ocp.state("x", guess=(0.0, 2.0), **limits), ocp.control("u", guess=1.0)
    ocp.duration(2.0)
    ocp.minimise(running=cost(x) + 1e3 * (u - 1.0) ** 2)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end(x, 2.0)
    return solve(ocp.functions(), nodes, tolerance=1e3)


@pytest.mark.filterwarnings("ignore:.*kink")
@pytest.mark.parametrize(
    ("cost", "text", "times", "jumps"),
    [
        (lambda x: ca.if_else(x < 0.9, 1.0, 1.1), "(x<0.9)", [0.9], True),
        (lambda x: ca.if_else(ca.logic_and(x >= 0.9, x < 1.7), 1.0, 1.1), "(0.9<=x)", [0.9, 1.7], True),
        (lambda x: ca.sign(x - 0.9), "sign((x-0.9))", [0.9], True),
        (lambda x: ca.floor(2.0 * x), "floor((2.*x))", [0.5, 1.0, 1.5], True),
        (lambda x: ca.ceil(x), "ceil(x)", [1.0], True),
        (lambda x: ca.fmod(x, 0.8), "fmod(x,0.8)", [0.8, 1.6], True),
        (lambda x: ca.remainder(x, 0.8), "remainder(x,0.8)", [0.4, 1.2], True),
        (lambda x: ca.copysign(1.0, x - 0.9), "copysign(1,(x-0.9))", [0.9], True),
        (lambda x: ca.fabs(x - 0.9), "fabs((x-0.9))", [0.9], False),
        (lambda x: ca.fmax(x, 0.9), "fmax(x,0.9)", [0.9], False),
        (lambda x: ca.fmin(x, 0.9), "fmin(x,0.9)", [0.9], False),
    ],
)
def test_every_jump_and_kink_is_found_at_its_time(cost: Expression, text: str, times: list[float], jumps: bool) -> None:
    solution = clock(cost)
    found = crossings(solution)
    assert [each.time for each in found] == pytest.approx(times, abs=1e-2)  # x is t but for a little
    assert solution("x", np.array([each.time for each in found])) == pytest.approx(times, abs=1e-9)
    assert all(each.jump is jumps and each.inside for each in found)
    assert found[0].text == text
    assert solution.status is SolverOutcome.CONVERGED
    assert not solution.ok
    assert f"not smooth inside an interval, so that J need not be the least: {found[0]}" in solution.message


@pytest.mark.parametrize(
    "cost",
    [
        lambda x: (x - 0.9) * ca.fabs(x - 0.9),  # its slope goes on
        lambda x: ca.if_else(x < 3.0, 1.0, 2.0),  # not reached
        lambda x: ca.fmax(x, 0.0) ** 2 + ca.if_else(x < 0.0, 5.0, 1.0),  # at the start, from one side
        lambda x: x**2,
    ],
)
@pytest.mark.filterwarnings("ignore:.*kink")
def test_what_is_smooth_along_the_trajectory_is_not_counted(cost: Expression) -> None:
    solution = clock(cost)
    assert crossings(solution) == ()
    assert solution.status is SolverOutcome.OPTIMAL


@pytest.mark.filterwarnings("ignore:.*kink")
@pytest.mark.parametrize(
    ("cost", "jump", "status"),
    [
        (lambda x: ca.fabs(x - 1.0), False, SolverOutcome.OPTIMAL),
        (lambda x: ca.if_else(x < 1.0, 1.0, 1.1), True, SolverOutcome.CONVERGED),  # nothing keeps the node there
    ],
)
def test_a_node_at_a_crossing_is_enough_for_a_kink(cost: Expression, jump: bool, status: SolverOutcome) -> None:
    solution = clock(cost, nodes=5)
    (crossing,) = crossings(solution)
    assert (crossing.time, crossing.jump, crossing.inside) == (pytest.approx(1.0, abs=1e-6), jump, jump)
    assert solution.status is status


def held(limit: float) -> tuple[Crossing, ...]:
    """Crossings of an x that stays at 0.5 for most of the time and may not be below ``limit``."""
    ocp = OptimalControlProblem("rest")
    x, u = ocp.state("x", lower=limit), ocp.control("u")
    ocp.duration(4.0)
    ocp.minimise(running=100.0 * (x - 0.5) ** 2 + u**2 + ca.if_else(x < 0.5, 2.0, 1.0))
    ocp.dynamics(x, u)
    ocp.start(x, 0.5)
    return crossings(solve(ocp.functions(), 9))


def test_an_arc_on_a_surface_is_named_unless_a_bound_keeps_to_one_side() -> None:
    (arc,) = held(-1.0)
    assert arc.until - arc.time > 3.9
    assert "is held from t = 0 to 4 s" in str(arc)
    assert held(0.5) == ()


def test_a_kink_of_a_path_constraint_counts_where_it_holds_back() -> None:
    """x has to stay under two lines that meet at 0.45 s."""

    def found(limit: float) -> tuple[Crossing, ...]:
        ocp = OptimalControlProblem("tent")
        x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u")
        ocp.duration(1.0)
        ocp.minimise(running=u**2)
        ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))
        ocp.constrain(x - 0.3 * ca.fabs(ocp.t - 0.45) <= limit)
        ocp.start(ca.vertcat(x, v), ca.vertcat(0.0, 1.0))
        ocp.end(ca.vertcat(x, v), ca.vertcat(0.0, -1.0))
        return crossings(solve(ocp.functions(), 12))

    assert found(9.0) == ()
    assert [each.time for each in found(0.1)] == pytest.approx([0.45], abs=1e-6)


def test_an_interface_is_crossed_where_snells_law_says() -> None:
    """The least time over a medium of speed 1 and one of speed 2; without a node there J is 1.4 % too large."""
    ocp = OptimalControlProblem("refraction")
    x, y, angle = ocp.state("x", guess=(0.0, 2.0)), ocp.state("y", guess=(0.0, 1.0)), ocp.control("angle", guess=0.5)
    ocp.minimise(terminal=ocp.free_duration(guess=2.0, lower=0.1, upper=10.0))
    speed = ca.if_else(x < 1.0, 1.0, 2.0)
    ocp.dynamics(ca.vertcat(x, y), speed * ca.vertcat(ca.cos(angle), ca.sin(angle)))
    ocp.start(ca.vertcat(x, y), 0.0)
    ocp.end(ca.vertcat(x, y), ca.vertcat(2.0, 1.0))
    found = ocp.solve()
    assert found.status is SolverOutcome.OPTIMAL
    (node,) = found.surface_nodes
    height = float(found["y"][node])
    first, second = np.hypot(1.0, height), np.hypot(1.0, 1.0 - height)
    assert height / first * 2.0 == pytest.approx((1.0 - height) / second, abs=1e-5)
    assert found.cost == pytest.approx(first + second / 2.0, rel=1e-7)
    assert "a node where (x<1) jumps at t = 1.04388 s" in found.message
    assert found.conditions is not None
    assert found.conditions.holds, found.conditions  # the costate of x jumps there


def stop_and_go(durations: tuple[float, ...]) -> MultiPhaseProblem:
    """v from 1 to -1 and x back to its start against dry friction of 0.3, in phases."""
    whole = MultiPhaseProblem("stop and go")
    phases = [whole.phase(f"phase {k}") for k in range(len(durations))]
    for phase, duration in zip(phases, durations, strict=True):
        x, v, u = phase.state("x"), phase.state("v", guess=(1.0, -1.0)), phase.control("u")
        phase.duration(duration)
        phase.minimise(running=u**2)
        phase.dynamics(ca.vertcat(x, v), ca.vertcat(v, u - 0.3 * ca.sign(v)))
        if phase is phases[0]:
            phase.start(ca.vertcat(x, v), ca.vertcat(0.0, 1.0))
        if phase is phases[-1]:
            phase.end(ca.vertcat(x, v), ca.vertcat(0.0, -1.0))
    for before, after in itertools.pairwise(phases):
        whole.link(before, after)
    return whole


def test_a_crossing_in_one_of_two_phases_gets_a_node() -> None:
    """u is -0.7 and then -1.3, by symmetry."""
    found = stop_and_go((0.7, 1.3)).solve()
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(0.7**2 + 1.3**2, rel=1e-6)
    assert found["phase 1"].status is SolverOutcome.OPTIMAL


def test_where_no_node_can_be_placed_the_reason_is_said() -> None:
    ocp = OptimalControlProblem("valve")
    x, u = ocp.state("x"), ocp.control("u", guess=(2.0, -1.0))
    ocp.duration(1.0)
    ocp.minimise(running=(u - 1.0 + 3.0 * ocp.t) ** 2)
    ocp.dynamics(x, ca.if_else(u + x > 0.0, u, 2.0 * u))
    ocp.start(x, 0.0)
    found = ocp.solve()
    assert found.status is SolverOutcome.CONVERGED
    assert "which depends on a control" in found.message


def test_the_error_of_the_cost_at_crossings_is_bounded_where_it_is_asked_for() -> None:
    def solved(verify: bool | None) -> Solution:
        ocp, _ = two_costs()
        return ocp.solve(verify=verify)

    bounded, quick = solved(None), solved(False)
    assert bounded.surface_nodes
    assert quick.cost == bounded.cost
    assert bounded.cost_bound < 1e-5
    assert math.isnan(quick.cost_bound)
    assert quick.message.endswith("the error of J is not estimated")
