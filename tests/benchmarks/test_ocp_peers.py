"""Everyone is given the same problem, and who does not come to the tolerance is not compared."""

from __future__ import annotations

import dataclasses
import io
import math

import numpy as np
import pytest
from rich.console import Console

from benchmarks import ocp_dymos, ocp_maptor
from benchmarks.ocp_peers import (
    DEFAULT,
    OURS,
    SMALL,
    Arguments,
    Entry,
    PeerFindings,
    Software,
    accepted,
    first_setting,
    our_settings,
)
from mathnavi.controllers.ocp.methods.direct import solve
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Outcome

NAME = "Bryson-Denham"


@pytest.mark.parametrize("name", ["double integrator, time", "Bryson-Denham"])
def test_maptor_solves_the_same_problem(name: str) -> None:
    pytest.importorskip("maptor", reason="the extra [bench] is not installed")
    cost = ocp_maptor.prepared(PROBLEMS[name].problem(), 1e-6)()
    assert cost is not None
    assert PROBLEMS[name].error(cost) < 1e-4


@pytest.mark.parametrize("name", SMALL)
def test_dymos_solves_the_same_problem(name: str) -> None:
    pytest.importorskip("dymos", reason="the extra [bench] is not installed")
    cost = ocp_dymos.prepared(PROBLEMS[name].problem(), 1e-4)()
    assert cost is not None
    assert PROBLEMS[name].error(cost) < 1e-4


def test_ours_has_a_setting_that_comes_to_the_tolerance() -> None:
    setting, error = first_setting(Software(OURS, our_settings()), PROBLEMS["double integrator, energy"])
    assert setting == "refinement, 0.001"
    assert error <= 1e-4


def test_the_first_setting_within_the_tolerance_counts_and_a_failure_does_not() -> None:
    settings = {"fails": lambda problem: lambda: None, "coarse": lambda problem: lambda: 4.1,
                "fine": lambda problem: lambda: 4.00001, "finer": lambda problem: lambda: 4.0}  # fmt: skip
    assert first_setting(Software("somebody", settings), PROBLEMS[NAME])[0] == "fine"
    del settings["fine"], settings["finer"]
    assert first_setting(Software("somebody", settings), PROBLEMS[NAME]) == ("", pytest.approx(0.025))


def test_ours_counts_with_the_worse_of_cost_and_replayed_cost_and_only_through_the_gate() -> None:
    problem = PROBLEMS[NAME].problem()
    solution = solve(problem, 10)
    assert solution.replay is not None
    worse = dataclasses.replace(solution, replay=dataclasses.replace(solution.replay, cost=3.9))
    assert accepted(problem, worse) == 3.9
    assert accepted(problem, dataclasses.replace(worse, status=Outcome.REFUSED)) is None
    diverged = dataclasses.replace(solution.replay, cost=math.nan, miss=math.inf)
    assert accepted(problem, dataclasses.replace(solution, replay=diverged)) is None


def test_who_did_not_come_to_the_tolerance_is_reported_and_has_no_row() -> None:
    entries = [
        Entry("a", OURS, "refinement", 1e-6, np.array([0.1, 0.2])),
        Entry("a", "MAPTOR", "0.001", 1e-6, np.array([0.2, 0.4])),
        Entry("b", OURS, "", 1e-2, np.empty(0)),
        Entry("b", "MAPTOR", "0.001", 1e-6, np.array([0.2, 0.4])),
        Entry("c", OURS, "refinement", 1e-6, np.array([0.1, 0.2])),
        Entry("c", "MAPTOR", "", np.inf, np.empty(0)),
    ]
    findings = PeerFindings(entries)
    (row,) = findings.comparisons()
    assert (row.what, row.ratio) == ("a", pytest.approx(2.0))
    console = Console(file=io.StringIO(), width=120)
    findings.show(console)
    assert console.file.getvalue().count("none") == 2  # type: ignore[attr-defined]
    assert [entry["setting"] for entry in findings.plain()["entries"]].count(None) == 2


def test_bad_arguments_are_refused() -> None:
    assert set(SMALL) <= set(DEFAULT) <= set(PROBLEMS)
    with pytest.raises(ValueError, match="repetitions = 0; allowed: >= 1"):
        Arguments(repetitions=0)
    with pytest.raises(ValueError, match="problems = moon landing; allowed: brachistochrone"):
        Arguments(problems=("moon landing",))
