"""Everybody solves the same problems, and is judged by the same cost."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from benchmarks import acados_replan
from benchmarks.acados_wheel import FOLDER, missing
from benchmarks.do_mpc_solver import DoMpc
from benchmarks.flight_solvers import (
    DO_MPC,
    IPOPT,
    OURS,
    TOLERANCE,
    Recorded,
    Result,
    SolverFindings,
    judged,
    measure,
    record,
)
from mathnavi.controllers.flight.problem import PlanSolution, Problem
from mathnavi.controllers.flight.reference import InteriorPoint
from mathnavi.controllers.flight.sqp import CondensedSqp
from mathnavi.interfaces.signals import Array
from tests.flight import mountains, save

FEW = 4
QUIET = Console(quiet=True)


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    file = save(mountains(), Path(tmp_path_factory.mktemp("terrain")) / "mountains.npz")
    return record(file, FEW, lambda done, doing="": None)


@pytest.fixture(scope="module")
def problems(mission: Recorded) -> Recorded:
    return mission[:FEW]


def test_problems_are_recorded_with_the_planners_guess(problems: Recorded) -> None:
    assert len(problems) == FEW
    for problem, guess in problems:
        assert problem.terminal_position is None
        assert guess.shape == (3 * problem.arcs + 1,)


def test_everybody_solves_every_problem_to_the_same_cost(problems: Recorded) -> None:
    contestants = {OURS: partial(CondensedSqp, TOLERANCE), IPOPT: partial(InteriorPoint, "ipopt", TOLERANCE)}
    results = measure(contestants, problems, 2, QUIET)
    assert all(result.ms.shape == (2, FEW) and not result.failures for result in results.values())
    assert results[OURS].cost == pytest.approx(results[IPOPT].cost, rel=1e-4)


@pytest.mark.filterwarnings("ignore::FutureWarning")  # CasADi's, of how do-mpc calls it
def test_do_mpc_solves_the_same_problem(problems: Recorded) -> None:
    pytest.importorskip("do_mpc", reason="the extra [bench] is not installed")
    contestants = {OURS: partial(CondensedSqp, TOLERANCE), DO_MPC: partial(DoMpc, TOLERANCE)}
    results = measure(contestants, problems[:2], 1, QUIET)
    assert results[OURS].cost == pytest.approx(results[DO_MPC].cost, rel=1e-4)


def test_acados_solves_the_same_problem(mission: Recorded) -> None:
    if reason := missing(FOLDER):
        pytest.skip(f"acados: {reason}")
    problems = mission[5 : 5 + FEW]  # in flight: from rest, without multipliers, its full steps do not converge
    ours = measure({OURS: partial(CondensedSqp, TOLERANCE)}, problems, 1, QUIET)[OURS]
    answers = acados_replan.solved(FOLDER, problems, 1)
    results = {name: judged(problems, *answer) for name, answer in answers.items()}
    assert set(results) == {"acados, SQP", "acados, RTI"}
    assert results["acados, SQP"].failures < len(problems)
    assert np.nanmin(results["acados, SQP"].cost / ours.cost) == pytest.approx(1.0, rel=1e-4)
    assert (results["acados, RTI"].ms > 0.0).all()


def test_a_plan_beyond_its_limits_is_seen(problems: Recorded) -> None:
    problem, _ = problems[0]
    plan = condensed(problem, problems[0][1])
    assert acados_replan.excess(problem, plan.accelerations, plan.climb) < 1e-5
    assert acados_replan.excess(problem, 20.0 * plan.accelerations, plan.climb) > 0.1


def condensed(problem: Problem, guess: Array) -> PlanSolution:
    plan = CondensedSqp(TOLERANCE).solve(problem, guess)
    assert isinstance(plan, PlanSolution)
    return plan


def test_who_gives_up_has_failed_and_has_no_cost(problems: Recorded) -> None:
    class Resigned:
        def solve(self, problem: Problem, guess: Array) -> PlanSolution | str:
            return "no"

    (result,) = measure({"resigned": Resigned}, problems, 1, QUIET).values()
    assert result.failures == FEW
    assert math.isnan(result.iterations)


def findings(**cost: Any) -> SolverFindings:
    best = np.array([1.0, 2.0])
    ours = Result(np.array([[1.0, 1.0], [1.0, 3.0]]), cost.get("ours", best), 2.0)
    ipopt = Result(np.array([[40.0, 40.0], [40.0, 80.0]]), cost.get("ipopt", best), 8.0)
    return SolverFindings("plain", 13, {OURS: ours, IPOPT: ipopt}, best, cost.get("ipopt_tight", best))


def test_mean_and_median_are_compared_repetition_by_repetition() -> None:
    mean, median = findings().comparisons()
    assert mean.ratios == pytest.approx([40.0, 30.0])
    assert median.ratios == pytest.approx([40.0, 30.0])
    assert mean.wanted == ">= 30"


def test_failures_stand_beside_the_name() -> None:
    assert findings(ipopt=np.array([1.0, np.nan])).comparisons()[0].software == f"{IPOPT} (1 failed)"


def test_a_worse_cost_is_reported_unless_it_is_another_minimum() -> None:
    def gap(found: SolverFindings) -> float:
        measured: float = found.claims()[-1]["measured"]
        return measured

    assert gap(findings()) == 0.0
    assert gap(findings(ours=np.array([1.0, 2.3]))) == pytest.approx(0.1)
    assert gap(findings(ours=np.array([1.0, 2.3]), ipopt_tight=np.array([1.0, 1.7]))) == 0.0


def test_what_is_found_can_be_shown_and_stored(capsys: pytest.CaptureFixture[str]) -> None:
    found = findings()
    found.show(Console(width=100))
    assert "condensed" in capsys.readouterr().out
    assert found.plain()["problems"] == 2
