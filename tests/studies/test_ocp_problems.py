"""The study of known optima: when an optimum counts as reached, and the report."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.studies.nodes.ocp_problems import (
    ADAPTIVE,
    COMPARED,
    METHODS,
    OcpProblemsConfig,
    _claim,
    _first_reached,
    _row,
    attempts,
)

ENERGY = "double integrator, energy"


def attempt(**other: Any) -> dict[str, Any]:
    row = {"adaptive": True, "reached": False, "status": "optimal", "error": 1e-3, "error_replayed": 1e-3,
           "tolerance": 1e-4, "nodes": 60}  # fmt: skip
    return row | other


def test_a_solution_that_the_gate_refused_has_reached_nothing() -> None:
    solution = solve(PROBLEMS[ENERGY].problem(), 10)
    assert _row(ENERGY, "refinement", solution)["reached"] is True
    refused = dataclasses.replace(solution, status=SolverOutcome.REFUSED)
    assert _row(ENERGY, "refinement", refused)["reached"] is False


def test_both_the_cost_and_the_replayed_cost_have_to_be_near() -> None:
    solution = solve(PROBLEMS[ENERGY].problem(), 10)
    assert solution.replay is not None
    optimistic = dataclasses.replace(solution, replay=dataclasses.replace(solution.replay, cost=6.01))
    assert _row(ENERGY, "refinement", optimistic)["reached"] is False
    lost = dataclasses.replace(solution, replay=dataclasses.replace(solution.replay, cost=math.nan))
    assert _row(ENERGY, "refinement", lost)["reached"] is False
    assert _row(ENERGY, "refinement", dataclasses.replace(solution, replay=None))["reached"] is False


def test_reported_is_the_first_adaptive_method_that_reached_it_not_the_best() -> None:
    rows = [
        attempt(method="a"),
        attempt(method="b", reached=True, error=9e-5, error_replayed=9e-5),
        attempt(method="c", reached=True, error=1e-9, error_replayed=1e-9),
        attempt(method="uniform", adaptive=False, reached=True, error=0.0),
    ]
    assert _first_reached(rows)["method"] == "b"


def test_where_none_reached_it_the_nearest_that_the_gate_passed_is_reported() -> None:
    rows = [
        attempt(method="a", status="refused", error=1e-5, error_replayed=1e-5),
        attempt(method="b", error=2e-4),
        attempt(method="c", error=2e-4, error_replayed=5e-4),
        attempt(method="uniform", adaptive=False, reached=True),
    ]
    assert _first_reached(rows)["method"] == "c"


@pytest.mark.parametrize(
    ("reached", "count", "holds"), [(True, len(COMPARED), True), (False, len(COMPARED), False), (True, 3, None)]
)
def test_the_claim_is_about_every_problem(reached: bool, count: int, holds: bool | None) -> None:
    best = {name: attempt(reached=True) for name in COMPARED[:count]}
    last = list(best)[-1]
    best[last] = attempt(reached=reached)
    claim = _claim(best, [name for name, row in best.items() if row["reached"]], OcpProblemsConfig())
    assert claim.holds is holds
    assert (last in claim.measured) is not reached


def test_the_points_inside_an_interval_count_as_nodes() -> None:
    problem = PROBLEMS["brachistochrone"].problem()
    for method in METHODS:
        row = _row("brachistochrone", method, METHODS[method](problem, 13))
        assert row["nodes"] <= 13, method


def test_what_is_not_exhaustive_stops_at_the_first_that_reached_it() -> None:
    assert len(attempts(ENERGY, 10, exhaustive=False)) == 1
    assert [row["method"] for row in attempts(ENERGY, 10, exhaustive=True)] == list(METHODS)
    assert list(METHODS)[: len(ADAPTIVE)] == list(ADAPTIVE)
