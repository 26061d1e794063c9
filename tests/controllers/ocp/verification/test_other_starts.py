"""Other starts: a lower minimum elsewhere takes the place of the one that the guess leads to."""

from __future__ import annotations

import dataclasses
from typing import Any

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.budget import Budget
from mathnavi.controllers.ocp.methods.by_name import solve_by
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.controllers.ocp.solver import Options
from mathnavi.controllers.ocp.verification import other_starts
from mathnavi.controllers.ocp.verification.other_starts import STARTS, OtherStarts, minima
from mathnavi.interfaces.errors import ProblemError


def two_wells(ocp: OptimalControlProblem) -> OptimalControlProblem:
    """The nearer well, at x = 1, ends higher than the one at x = -2; the guess leads to the nearer one."""
    x, u = ocp.state("x", lower=-3.0, upper=3.0, guess=(0.4, 1.0)), ocp.control("u", lower=-4.0, upper=4.0, guess=0.6)
    ocp.duration(1.0)
    ocp.dynamics(x, u)
    ocp.start(x, 0.4)
    ocp.minimise(running=0.01 * u**2, terminal=(x - 1.0) ** 2 * (x + 2.0) ** 2 + 0.3 * x)
    return ocp


def test_several_starts_find_the_lower_of_two_minima_and_say_what_they_found() -> None:
    nearer = two_wells(OptimalControlProblem("two wells")).solve(starts=1)
    found = two_wells(OptimalControlProblem("two wells")).solve(starts=6)
    assert nearer.status is found.status is SolverOutcome.OPTIMAL
    assert nearer["x"][-1] == pytest.approx(1.0, abs=0.1)
    assert found["x"][-1] == pytest.approx(-2.0, abs=0.1)
    assert found.cost < nearer.cost - 0.5
    assert f"from another start than J = {nearer.cost:.7g}" in found.message
    assert f"minima from 6 starts, on a coarse mesh of 21 nodes: J about {found.cost:.4g} from" in found.message
    assert two_wells(OptimalControlProblem("two wells")).solve(starts=6).cost == found.cost


@pytest.mark.parametrize("nodes", [None, 15])
def test_phases_and_given_nodes_have_other_starts_too(nodes: int | None) -> None:
    problem = MultiPhaseProblem("two wells")
    two_wells(problem.phase("only"))
    assert problem.solve(nodes, starts=6)["only"]["x"][-1] == pytest.approx(-2.0, abs=0.1)


def test_the_straight_guess_of_the_literature_leads_to_a_swing_that_is_not_the_lowest() -> None:
    """The cart-pole of Kelly begins towards the target, for 58.80767; the other way costs 1.5 % less."""
    problem = PROBLEMS["cart-pole"].problem()
    straight = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, np.pi, 0.0, 0.0]])
    problem = dataclasses.replace(problem, guess_states=straight)
    nearer, found = (
        solve_by(problem, None, "auto", None, guess=None, parameters=problem.nominal, starts=starts)
        for starts in (1, None)
    )
    assert nearer.cost == pytest.approx(58.80767, rel=1e-6)
    assert found.status is SolverOutcome.OPTIMAL
    assert found.cost == pytest.approx(57.94478, rel=1e-6)
    assert "from another start than J = 58.80767" in found.message


def test_the_eight_switchings_of_the_literature_are_not_the_lowest_minimum_of_a_robot_that_floats() -> None:
    """J = 7.9101471 is that of the literature; 7.6886191, with a singular arc, is lower on a coarse mesh too."""
    problem = PROBLEMS["free-flying robot"].problem()
    known = solve_by(problem, None, "hp", None, guess=None, parameters=problem.nominal, starts=1)
    assert known.cost == pytest.approx(7.9101471, rel=1e-6)
    others = OtherStarts(STARTS - 1, problem.guess, lambda start: start)
    found = minima(known, others, 1.0, Options(), Budget(Options()))
    assert min(found.costs) == pytest.approx(7.6886, rel=5e-3)


def test_a_mesh_that_does_not_hold_the_solution_is_refined_for_starts_that_are_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Almost as fast as can be: one interval, whose control is saturated at its points, is too slow; more are not."""
    ocp = OptimalControlProblem("rush")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(2.02)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end(x, 1.0)
    ocp.end(v, 0.0)
    ocp.minimise(running=u**2)
    known = ocp.solve(41, tolerance=1e-2, starts=1)
    assert known.solved
    monkeypatch.setattr(other_starts, "_NODES", (2, 5, 9))
    found = [
        minima(
            known, OtherStarts(3, known.problem.guess, lambda start: start, asked), 1.0, Options(), Budget(Options())
        )
        for asked in (False, True)
    ]
    assert not found[0].costs
    assert "3 other starts are not compared: the solution cannot be solved again on the coarse mesh of 2" in str(
        found[0]
    )
    assert found[1].costs[0] == pytest.approx(known.cost, rel=0.05)
    assert f"minima from 4 starts, on a coarse mesh of {found[1].nodes} nodes: J about" in str(found[1])
    assert found[1].nodes > 2


def test_a_mesh_on_which_j_is_another_does_not_hold_the_solution() -> None:
    """J has a spike between the points of the coarse mesh: solved there, the solution costs less, as any would."""
    ocp = OptimalControlProblem("spike")
    x, t, u = ocp.state("x"), ocp.state("t", guess=(0.0, 1.0)), ocp.control("u", lower=-4.0, upper=4.0)
    ocp.duration(1.0)
    ocp.dynamics(x, u)
    ocp.dynamics(t, 1.0)
    ocp.start(x, 0.0)
    ocp.start(t, 0.0)
    ocp.end(x, 1.0)
    ocp.minimise(running=u**2 + 100.0 * ca.exp(-(((t - 0.5025) / 5e-3) ** 2)))
    known = ocp.solve(starts=1)
    assert known.status is SolverOutcome.OPTIMAL
    found = [
        minima(
            known, OtherStarts(2, known.problem.guess, lambda start: start, asked), 1.0, Options(), Budget(Options())
        )
        for asked in (False, True)
    ]
    assert not found[0].held
    assert f"that does not hold the solution, for its J there is about {found[0].known:.4g}: J about" in str(found[0])
    assert found[1].held
    assert found[1].known == pytest.approx(known.cost, abs=0.1)


@pytest.mark.parametrize("starts", [0, True, 2.0, "3"])
def test_a_number_of_starts_that_is_none_is_refused(starts: Any) -> None:
    with pytest.raises(ProblemError, match=r"starts = .*; allowed: a whole number >= 1"):
        two_wells(OptimalControlProblem("two wells")).solve(starts=starts)
    with pytest.raises(ProblemError, match=r"starts = 2 with replay = False"):
        two_wells(OptimalControlProblem("two wells")).solve(9, replay=False, starts=2)
