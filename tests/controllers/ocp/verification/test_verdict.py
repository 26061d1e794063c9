"""The table from evidence to status, row by row."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.controllers.ocp.verification.verdict import Evidence, judge

GOOD = Evidence(cost=2.0, size=2.0, tolerance=1e-6, bound=4e-8)


@pytest.mark.parametrize(
    ("evidence", "status", "words"),
    [
        ({}, SolverOutcome.OPTIMAL, "J within 4e-08"),
        ({"bound": None}, SolverOutcome.OPTIMAL, "the error of J is not estimated"),
        (
            {"negative_curvature": True},
            SolverOutcome.OPTIMAL,
            "J within 4e-08; the second-order condition is not shown",
        ),
        ({"negative_curvature": True, "bent": False}, SolverOutcome.OPTIMAL, "J within 4e-08"),
        ({"decided": False}, SolverOutcome.OPTIMAL, "J within 4e-08; the second-order condition is not shown"),
        ({"bound": 2.1e-6}, SolverOutcome.CONVERGED, "J may be 2.1e-06 too large, which is 1e-06 of its size"),
        ({"bound": math.inf}, SolverOutcome.CONVERGED, "the error of J is unknown: no finer mesh was solved"),
        ({"bound": math.nan}, SolverOutcome.CONVERGED, "J may be nan too large"),
        ({"accurate": False}, SolverOutcome.CONVERGED, ""),
        ({"lower_cost": 1.5}, SolverOutcome.STATIONARY, "no minimum: a start beside this solution leads to J = 1.5"),
        ({"lower_cost": 1.5, "bound": 0.6}, SolverOutcome.CONVERGED, "J may be 0.6 too large"),
        ({"lower_cost": 1.5, "bound": None}, SolverOutcome.STATIONARY, "no minimum"),
        ({"lower_elsewhere": 1.5}, SolverOutcome.CONVERGED, "another start leads to J = 1.5 in place of 2"),
        ({"lower_elsewhere": 1.9999999}, SolverOutcome.OPTIMAL, "J within 4e-08"),
        ({"control_without_minimum": "u"}, SolverOutcome.STATIONARY, "the Hamiltonian falls without limit in u"),
        ({"runs_away": "u runs to 1e+20"}, SolverOutcome.UNBOUNDED, "u runs to 1e+20 (from a stationary point"),
        ({"runs_away": "u", "lower_cost": 1.0, "accurate": False}, SolverOutcome.UNBOUNDED, "u"),
        ({"control_without_minimum": "u", "bound": 1.0}, SolverOutcome.STATIONARY, "the Hamiltonian"),
    ],
)
def test_the_first_row_that_holds_decides(evidence: dict[str, Any], status: SolverOutcome, words: str) -> None:
    found, added = judge(dataclasses.replace(GOOD, **evidence))
    assert found is status
    assert added.startswith(words)
