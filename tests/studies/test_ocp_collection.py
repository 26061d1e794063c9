"""When a known optimum counts as found by ``solve()``, and when a status lies."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from mathnavi.controllers.ocp.compiled_statement import KNOWN
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.studies.nodes.ocp_problems import (
    FEWEST,
    automatic_claims,
    automatic_row,
    automatic_table,
    solved_by_name,
)

ENERGY = "double integrator, energy"


@pytest.fixture(scope="module")
def solution() -> Solution:
    """An accurate solution of a smooth problem."""
    found = solve(PROBLEMS[ENERGY].problem(), 10, tolerance=1e-6)
    assert found.status is SolverOutcome.OPTIMAL
    return found


def with_replay(solution: Solution, **other: Any) -> Solution:
    assert solution.replay is not None
    return dataclasses.replace(solution, replay=dataclasses.replace(solution.replay, **other))


def test_every_problem_is_solved_by_its_name_with_nothing_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    assert solved_by_name(ENERGY)["problem"] == ENERGY
    monkeypatch.delitem(KNOWN, ENERGY)
    with pytest.raises(Exception, match="no problem with a known optimum"):
        solved_by_name(ENERGY)


def test_an_accurate_solution_reaches_the_optimum_and_says_so(solution: Solution) -> None:
    found = automatic_row(ENERGY, solution)
    assert found["reached"]
    assert found["lie"] == ""


def test_both_costs_have_to_be_within_the_precision(solution: Solution) -> None:
    assert not automatic_row(ENERGY, dataclasses.replace(solution, cost=6.0001))["reached"]
    assert not automatic_row(ENERGY, with_replay(solution, cost=6.0001))["reached"]
    assert not automatic_row(ENERGY, with_replay(solution, cost=math.nan))["reached"]
    assert not automatic_row(ENERGY, dataclasses.replace(solution, replay=None))["reached"]


@pytest.mark.parametrize("figure", ["miss", "path_violation", "cost_error"])
def test_optimal_lies_where_a_figure_of_the_replay_exceeds_the_tolerance(solution: Solution, figure: str) -> None:
    assert "exceeds" in automatic_row(ENERGY, with_replay(solution, **{figure: 2e-6}))["lie"]
    assert "exceeds" in automatic_row(ENERGY, with_replay(solution, **{figure: math.nan}))["lie"]


def test_optimal_lies_where_it_is_better_than_the_optimum(solution: Solution) -> None:
    assert "better" in automatic_row(ENERGY, dataclasses.replace(solution, cost=5.9999))["lie"]
    assert automatic_row(ENERGY, dataclasses.replace(solution, cost=6.0001))["lie"] == ""  # a local optimum may be one
    highest = "Goddard"  # to be greatest
    assert "better" in automatic_row(highest, dataclasses.replace(solution, cost=-1.013))["lie"]
    assert automatic_row(highest, dataclasses.replace(solution, cost=-1.012))["lie"] == ""


def test_what_is_right_and_not_called_optimal_is_a_lie(solution: Solution) -> None:
    assert (
        automatic_row(ENERGY, dataclasses.replace(solution, status=SolverOutcome.REFUSED))["lie"]
        == "REFUSED, but it is right"
    )
    wrong = dataclasses.replace(solution, status=SolverOutcome.REFUSED, cost=7.0)
    assert automatic_row(ENERGY, wrong)["lie"] == ""
    assert (
        automatic_row(ENERGY, with_replay(dataclasses.replace(solution, status=SolverOutcome.CONVERGED), miss=1e-3))[
            "lie"
        ]
        == ""
    )


def test_the_claims_are_about_the_whole_collection(solution: Solution) -> None:
    good = automatic_row(ENERGY, solution)
    rows = [good | {"problem": name} for name in PROBLEMS]
    assert len(rows) >= FEWEST
    assert [claim.holds for claim in automatic_claims(rows)] == [True, True]
    assert [claim.holds for claim in automatic_claims(rows[:3])] == [None, None]
    missed, lying = good | {"reached": False}, good | {"lie": "OPTIMAL, but ..."}
    assert [claim.holds for claim in automatic_claims([missed, *rows[1:]])] == [False, True]
    assert [claim.holds for claim in automatic_claims([lying, *rows[1:]])] == [True, False]
    assert ENERGY in automatic_claims([missed])[0].measured


def test_the_table_names_a_lie(solution: Solution) -> None:
    cells = automatic_table(
        [
            automatic_row(ENERGY, solution),
            automatic_row(ENERGY, dataclasses.replace(solution, status=SolverOutcome.REFUSED)),
        ]
    ).rows
    assert [cell[8] for cell in cells] == ["optimal", "refused (lie)"]
