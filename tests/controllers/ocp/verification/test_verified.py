"""OPTIMAL is said where second order, Hamiltonian and two finer meshes have nothing against it."""

from __future__ import annotations

import math

import pytest

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import SolverOutcome
from tests.controllers.ocp.statements import double_integrator
from tests.controllers.ocp.verification.statements import chattering, concave, conjugate, cubed, far_end, singular


@pytest.mark.parametrize(
    ("problem", "cost"),
    [(concave(1.0), -1.0), (far_end(), -1.0), (singular(-1.0), -1.0 / 3.0)],
    ids=["concave", "far end", "Kelley"],
)
def test_a_stationary_point_is_left_for_the_minimum(problem: OptimalControlProblem, cost: float) -> None:
    for starts, way in ((1, "from a stationary point with J = "), (None, "from another start than J = ")):
        found = problem.solve(starts=starts)
        assert found.status is SolverOutcome.OPTIMAL
        assert found.cost == pytest.approx(cost, rel=1e-6)
        assert way in found.message


@pytest.mark.parametrize("nodes", [None, 40])
def test_what_takes_its_place_is_judged_by_the_same_tolerance(nodes: int | None) -> None:
    found = concave(1.0).solve(nodes, method="hp")
    assert found.cost == pytest.approx(-1.0, rel=1e-6)
    assert found.tolerance == 1e-6


def test_a_minimum_that_the_given_nodes_cannot_hold_is_named() -> None:
    found = concave(1.0).solve(13)  # the parabolas of a control that jumps between its bounds leave them
    assert found.status is SolverOutcome.STATIONARY
    assert "leads to J = -1 in place of 0" in found.message
    smooth = far_end().solve(13)
    assert smooth.status is SolverOutcome.OPTIMAL
    assert smooth.cost == pytest.approx(-1.0, rel=1e-6)


@pytest.mark.parametrize("nodes", [None, 13])
@pytest.mark.parametrize("problem", [concave(), conjugate(4.0), conjugate(3.15)], ids=["concave", "4 > π", "3.15 > π"])
def test_what_falls_without_limit_from_there_is_unbounded(problem: OptimalControlProblem, nodes: int | None) -> None:
    found = problem.solve(nodes)
    assert found.status is SolverOutcome.UNBOUNDED
    assert not found.ok
    assert "(from a stationary point with J = 0)" in found.message


def test_before_its_conjugate_point_it_is_a_minimum() -> None:
    found = conjugate(3.1).solve()
    assert found.status is SolverOutcome.OPTIMAL
    assert found.cost == 0.0


@pytest.mark.parametrize("nodes", [None, 13])
def test_a_hamiltonian_without_a_minimum_is_only_stationary(nodes: int | None) -> None:
    found = cubed().solve(nodes)
    assert found.status is SolverOutcome.STATIONARY
    assert found.solved
    assert not found.ok
    assert "the Hamiltonian falls without limit in u" in found.message


def test_a_limit_of_the_control_gives_it_a_minimum() -> None:
    ocp, x, v, u = double_integrator(limit=1.0)
    ocp.duration(2.0)
    ocp.minimise(running=u**4 - u**3)
    ocp.end(x, 0.5)
    ocp.end(v, 0.0)
    assert ocp.solve().status is SolverOutcome.OPTIMAL


def test_an_accuracy_that_a_mesh_lacks_is_added_or_named() -> None:
    right = 2.0 * math.sqrt(3.0)
    refined = OptimalControlProblem("double integrator, time").solve(60, method="refine", tolerance=1e-6)
    assert refined.status is SolverOutcome.CONVERGED
    assert refined.cost_bound >= refined.cost - right
    assert "J may be " in refined.message
    chosen = chattering().solve()
    assert chosen.status is SolverOutcome.OPTIMAL
    assert chosen.cost == pytest.approx(0.7640175, rel=3e-7)
    assert abs(chosen.cost - 0.7640175) <= 5.0 * chosen.cost_bound


@pytest.mark.parametrize("monitor", ["curvature", "arclength"])
def test_nodes_that_are_moved_and_too_few_are_not_enough(monitor: str) -> None:
    problem = OptimalControlProblem("hypersensitive, short")
    found = problem.solve(15, method="redistribute", monitor=monitor)
    assert found.status is SolverOutcome.CONVERGED
    known = PROBLEMS["hypersensitive, short"]
    assert found.cost_bound >= abs(found.cost - known.sign * known.optimum)


def test_a_given_number_of_nodes_is_verified_in_full_on_request() -> None:
    problem = OptimalControlProblem("double integrator, time")
    quick, full = problem.solve(40), problem.solve(40, verify=True)
    assert quick.message.endswith("the error of J is not estimated")
    assert math.isnan(quick.cost_bound)
    assert full.cost == quick.cost
    assert abs(full.cost - 2.0 * math.sqrt(3.0)) <= full.cost_bound


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_the_unit_of_the_cost_changes_no_word(factor: float) -> None:
    ocp, x, u = OptimalControlProblem("unit"), None, None
    x, u = ocp.state("x", guess=1.0), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=factor * (x**2 + u**2))
    ocp.dynamics(x, u)
    ocp.start(x, 1.0)
    found = ocp.solve()
    assert found.status is SolverOutcome.OPTIMAL
    assert found.cost == pytest.approx(factor * math.tanh(1.0), rel=1e-6)
    assert found.cost_bound <= 1e-6 * abs(found.cost)
