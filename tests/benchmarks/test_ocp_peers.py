"""Everyone states the same problem and is judged by the same replay; who comes to no accuracy is not compared."""

from __future__ import annotations

import dataclasses
import io
import math
from importlib import import_module

import numpy as np
import pytest
from rich.console import Console

from benchmarks import ocp_collocation, ocp_ours
from benchmarks.ocp_attempts import MODULES, Attempt, attempts, level
from benchmarks.ocp_peers import OURS, SMALL, Arguments, Entry, PeerFindings
from benchmarks.ocp_trajectory import Trajectory, ends, judge
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.library import PROBLEMS

NAME = "Bryson-Denham"


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    found = ocp_ours.solved(PROBLEMS[NAME].problem(), 1e-6)
    assert found is not None
    return found


@pytest.mark.parametrize("name", [NAME, "Zermelo"])
def test_maptor_solves_the_same_problem(name: str) -> None:
    pytest.importorskip("maptor", reason="the extra [bench] is not installed")
    known = PROBLEMS[name]
    found = import_module(MODULES["maptor"]).solved(known.problem(), 1e-4)
    assert found is not None
    assert judge(found, known).accuracy < 1e-3


def test_dymos_solves_the_same_problem() -> None:
    pytest.importorskip("dymos", reason="the extra [bench] is not installed")
    known = PROBLEMS["double integrator, energy"]
    found = import_module(MODULES["dymos"]).solved(known.problem(), 1e-3)
    assert found is not None
    assert judge(found, known).accuracy < 1e-3


def test_the_judge_sees_a_wrong_cost_a_wrong_end_and_a_violated_bound(trajectory: Trajectory) -> None:
    known = PROBLEMS[NAME]
    assert judge(trajectory, known).accuracy < 1e-6
    wrong_cost = dataclasses.replace(trajectory, cost=1.01 * trajectory.cost)
    assert judge(wrong_cost, known).cost_error == pytest.approx(0.01, rel=1e-3)
    states = trajectory.states.copy()
    states[-1] += 0.1
    assert judge(dataclasses.replace(trajectory, states=states), known).miss > 0.09
    weaker = tuple(0.9 * control for control in trajectory.controls)
    verdict = judge(dataclasses.replace(trajectory, controls=weaker), known)
    assert min(verdict.cost_error, verdict.miss) > 1e-2
    stronger = tuple(0.0 * control for control in trajectory.controls)
    assert judge(dataclasses.replace(trajectory, controls=stronger), known).violation > 0.1


def test_values_of_single_states_are_fixed_and_other_ends_are_not() -> None:
    start, end = ends(PROBLEMS["Zermelo"].problem())
    assert start.fixed == pytest.approx({0: 3.66 / 3.0, 1: -1.86 / 3.0})
    assert (end.fixed, end.others) == ({0: 0.0, 1: 0.0}, ())
    start, end = ends(PROBLEMS["orbit raising"].problem())
    assert end.others


def test_attempts_become_finer_until_the_precision_and_a_failure_is_no_result(trajectory: Trajectory) -> None:
    coarse = dataclasses.replace(trajectory, cost=1.002 * trajectory.cost)
    answers = {1e-3: None, 1e-4: dataclasses.replace(coarse, cost=1.0005 * trajectory.cost), 1e-5: trajectory}

    def solve(problem: ProblemFunctions, tolerance: float) -> Trajectory | None:
        return answers[tolerance]

    found = list(attempts(solve, PROBLEMS[NAME], 2))
    assert [level(attempt.accuracy) for attempt in found] == [None, 1e-3, 1e-6]
    assert [len(attempt.seconds) for attempt in found] == [1, 2, 2]
    assert math.isinf(found[0].accuracy)


def test_two_are_compared_at_the_finest_level_that_both_came_to() -> None:
    def attempt(accuracy: float, *seconds: float) -> Attempt:
        return Attempt(1e-3, accuracy, accuracy, seconds, 1.0)

    entries = [
        Entry("a", OURS, (attempt(5e-4, 0.1, 0.1), attempt(5e-7, 0.2, 0.2))),
        Entry("a", "maptor", (attempt(5e-4, 0.4, 1.0),), "ended after 60 s"),
        Entry("b", OURS, (attempt(5e-7, 0.2, 0.2),)),
        Entry("b", "maptor", (attempt(5e-2, 0.4),)),
    ]
    findings = PeerFindings(entries)
    (row,) = findings.comparisons()
    assert row.what == "a, 0.001"
    assert row.ratio == pytest.approx(np.median([0.25, 0.1]))
    (claim,) = findings.claims()
    assert (claim["id"], claim["holds"]) == ("ocp.peers", True)
    console = Console(file=io.StringIO(), width=120)
    findings.show(console)
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert "none" in shown
    assert "ended after 60 s" in shown
    assert [entry["level"] for entry in findings.plain()["entries"]] == [1e-6, 1e-3, 1e-6, None]


def test_bad_arguments_are_refused() -> None:
    assert set(SMALL) <= set(PROBLEMS)
    short, long = Arguments(limit=10), Arguments(limit=60)
    assert [short.limit_of(name) for name in (OURS, "maptor", "dymos")] == [10, 10, 20]
    assert long.limit_of("dymos") == 60
    with pytest.raises(ValueError, match="problems = moon landing; allowed: brachistochrone"):
        Arguments(problems=("moon landing",))


def test_plain_collocation_refines_until_its_cost_settles_and_a_failure_is_no_result() -> None:
    known = PROBLEMS["double integrator, time"]  # a switch at an unknown time
    coarse, fine = (ocp_collocation.solved(known.problem(), tolerance) for tolerance in (1e-2, 1e-4))
    assert coarse is not None
    assert fine is not None
    assert len(fine.nodes) >= len(coarse.nodes)
    assert judge(fine, known).cost_error < 1e-3
    smooth = PROBLEMS["steering"]
    found = ocp_collocation.solved(smooth.problem(), 1e-6)
    assert found is not None
    assert judge(found, smooth).accuracy < 1e-5
    unbounded = dataclasses.replace(smooth.problem(), duration_bounds=(1e-3, 1e-3), guess_duration=1e-3)
    assert ocp_collocation.solved(unbounded, 1e-4) is None
