"""Published problems: their lists are consistent, prints are compared digit by digit, and no process ends a study."""

from __future__ import annotations

import dataclasses
import json
import math
import signal
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published import ocp_outside, ocp_rounding, solving
from mathnavi.studies.published.library import (
    COLLECTION,
    DISTINCT,
    EVERY,
    PUBLISHED,
    STATED_AS,
    known_cost,
    merged,
    relative_error,
    stated_as,
)
from mathnavi.studies.published.optimum import PublishedOptimum
from mathnavi.studies.published.printed import first_difference
from mathnavi.studies.published.solving import Attempt, attempted, no_figures, perturbed, told

NAME = f"{COLLECTION}double integrator, energy"


def found(status: str, cost: float, **more: Any) -> dict[str, Any]:
    """Figures of an attempt."""
    solved = status in ("optimal", "converged")
    return {**no_figures(), "status": status, "message": "", "cost": cost, "solved": solved, "cpu_s": 1.0, **more}


# lists


def test_the_lists_are_consistent() -> None:
    """What is stated has no other statement, what is not says why, and every print can be compared."""
    assert len(DISTINCT) >= ocp_outside.FEWEST
    for name, entry in PUBLISHED.items():
        assert entry.source, name
        if entry.value:
            assert Decimal(entry.value).is_finite(), name
        assert entry.statement is None or not entry.same_as, name
        stated = EVERY[STATED_AS[name]]
        assert stated.statement is not None or stated.note, name
        assert entry.independent is None or entry.evidence, name
        assert entry.sign in (1.0, -1.0), name


def test_entries_of_one_problem_agree_on_its_optimum() -> None:
    for name, entry in PUBLISHED.items():
        optimum = known_cost(name)
        if optimum is not None and entry.independent is not None:
            assert entry.sign * entry.independent == pytest.approx(optimum, rel=1e-6), name


def test_a_list_without_an_end_a_beginning_or_with_a_name_twice_is_refused() -> None:
    entry = PublishedOptimum("1", "here")
    with pytest.raises(ValueError, match="a: in two lists"):
        merged({"a": entry}, {"a": entry})
    circle = {"a": dataclasses.replace(entry, same_as="b"), "b": dataclasses.replace(entry, same_as="a")}
    with pytest.raises(ValueError, match="a: same as 'a'"):
        stated_as("a", circle)
    with pytest.raises(ValueError, match="a: same as 'c'"):
        stated_as("a", {"a": dataclasses.replace(entry, same_as="c")})
    assert stated_as("a", {"a": dataclasses.replace(entry, same_as="b"), "b": entry}) == "b"


def test_the_error_is_relative_to_the_distance_from_the_origin() -> None:
    entry = PublishedOptimum("1.01283", "here", origin=1.0)
    assert relative_error(entry, 1.011, 1.01) == pytest.approx(0.1)
    assert relative_error(PublishedOptimum("0", "here"), 1e-3, 0.0) == 1e-3


# digits


@pytest.mark.parametrize(
    ("printed", "value", "digit"),
    [
        ("1.01283", 1.0128369, 6),
        ("1.01284", 1.0128369, None),
        ("-4.80556e-2", -0.0480556858, 6),
        ("1.97462e7", 1.974659e7, 6),
        ("1255.05", 1248.031025, 3),
        ("0.99999", 1.0000001, 5),
        ("6.0", 6.0, None),
        ("3.14", -3.14, 1),
        ("0.0", 0.2, 1),
        ("0.0", 0.04, None),
        ("1", math.nan, 1),
    ],
)
def test_the_digit_in_which_a_value_first_differs_from_a_print(printed: str, value: float, digit: int | None) -> None:
    assert first_difference(printed, value) == digit


@given(st.floats(1e-6, 1e6), st.integers(1, 12), st.sampled_from((1.0, -1.0)))
def test_a_value_agrees_with_its_own_rounding_and_differs_where_it_is_changed(x: float, n: int, sign: float) -> None:
    value = sign * x
    printed = f"{value:.{n - 1}e}"
    assert first_difference(printed, value) is None
    unit = 10.0 ** (math.floor(math.log10(abs(float(printed)))) - n + 1)
    assert first_difference(printed, float(printed) + 0.9 * unit) == n


@pytest.mark.parametrize("printed", ["", "about 3", "nan", "inf"])
def test_a_print_that_is_no_number_is_refused(printed: str) -> None:
    with pytest.raises(ValueError, match=r"printed .*; allowed: a"):
        first_difference(printed, 1.0)


# verdicts


@given(st.sampled_from(("optimal", "converged", "infeasible", "limit", "error", "time limit")), st.floats(0.0, 1.0))
def test_only_optimal_within_the_precision_is_solved_and_only_two_things_are_lies(status: str, error: float) -> None:
    said = ocp_outside.verdict(status, error, 1e-6, known=True)
    assert (said == "solved") == (status == "optimal" and error <= 1e-6)
    assert (said == "lie") == (status == "infeasible" or (status == "optimal" and error > 1e-6))
    assert ocp_outside.verdict(status, error, 1e-6, known=False) == "unsolved"


def test_optimal_with_no_number_is_a_lie() -> None:
    assert ocp_outside.verdict("optimal", math.nan, 1e-6, known=True) == "lie"


def test_a_row_has_both_digits_and_a_problem_without_a_statement_is_unsolved(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = PublishedOptimum("1.01283", "here", same_as=NAME, sign=-1.0, quantity="h(T)", note="table is missing")
    monkeypatch.setitem(EVERY, "other", entry)
    monkeypatch.setitem(EVERY, "lost", dataclasses.replace(entry, same_as="", independent=1.0128369, evidence="twice"))
    monkeypatch.setitem(STATED_AS, "other", "lost")
    monkeypatch.setitem(STATED_AS, "lost", "lost")
    row = ocp_outside.row("other", found("optimal", -1.0128369, miss=1e-9))
    assert (row["verdict"], row["differs_in_digit"], row["independent_differs_in_digit"]) == ("solved", 6, 6)
    assert row["value"] == 1.0128369
    missing = ocp_outside.row("lost", None)
    assert (missing["verdict"], missing["status"], missing["message"]) == ("unsolved", "not stated", "table is missing")
    assert math.isnan(missing["value"])
    assert [each["problem"] for each in ocp_outside.distinct([row, missing])] == ["other"]


def test_the_claim_counts_lies_and_what_is_slow() -> None:
    good = [ocp_outside.row(name, None) | {"verdict": "solved", "cpu_s": 1.0, "problem": name} for name in DISTINCT]
    assert ocp_outside.claim(good).holds is True
    assert ocp_outside.claim(good[:5]).holds is None
    lie = ocp_outside.claim([*good[1:], good[0] | {"verdict": "lie"}])
    assert (lie.holds, f"lies: {DISTINCT[0]}" in lie.measured) == (False, True)
    slow = ocp_outside.claim([each | {"cpu_s": 31.0} for each in good])
    assert (slow.holds, slow.measured.startswith("0 of")) == (False, True)


def test_the_figure_and_the_table_show_every_problem() -> None:
    rows = [ocp_outside.row(name, None) for name in PUBLISHED]
    rows[0] |= {"verdict": "lie", "error": 0.1, "cpu_s": 500.0, "status": "optimal"}
    drawn = ocp_outside.figure(ocp_outside.distinct(rows))
    names = [label.get_text() for axes in drawn.axes for label in axes.get_yticklabels()]
    assert len([name for name in names if name]) == len(DISTINCT)
    assert len(ocp_outside.table(rows).rows) == len(PUBLISHED)


# processes


def test_a_crash_a_time_limit_and_an_exit_are_figures() -> None:
    crash = told(-signal.SIGSEGV, "", "Fatal\nSegmentation fault", 3.0)
    assert (crash["status"], crash["message"]) == ("error", "ended by SIGSEGV: Segmentation fault")
    late = told(-signal.SIGXCPU, '{"a": ', "", 130.0)
    assert (late["status"], late["message"]) == ("time limit", f"ended after {solving.SECONDS} s of CPU time")
    assert math.isnan(late["cost"])
    assert told(2, "", "", 1.0)["message"] == "exit code 2"
    line = json.dumps(found("optimal", 1.0, wall_s=2.0, miss=math.nan))
    assert told(0, f"noise\n{line}\n", "warning", 3.0)["cost"] == 1.0


def test_a_process_that_does_not_answer_is_a_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(*_: object, **__: object) -> None:
        raise solving.subprocess.TimeoutExpired("python", 1.0)

    monkeypatch.setattr(solving.subprocess, "run", late)
    assert attempted(Attempt(NAME))["status"] == "time limit"


def test_a_process_computes_on_one_core_under_its_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    class Done:
        returncode, stdout, stderr = 0, json.dumps(found("optimal", 6.0, wall_s=1.0)), ""

    asked: list[tuple[list[str], dict[str, Any]]] = []
    monkeypatch.setattr(solving.subprocess, "run", lambda command, **more: asked.append((command, more)) or Done())
    figures = attempted(Attempt(NAME, 3, "libm without FMA"))
    command, environment = asked[0][0], asked[0][1]["env"]
    assert json.loads(command[-1]) == {"problem": NAME, "draw": 3, "setting": "libm without FMA"}
    assert environment["OMP_NUM_THREADS"] == "1"
    assert "-FMA" in environment["GLIBC_TUNABLES"]
    assert figures["cost"] == 6.0
    assert isinstance(figures["cpu_s"], solving.MeasuredTime)


def test_an_attempt_solves_the_stated_problem_and_an_exception_is_its_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    figures = solving.performed({"problem": NAME, "draw": 1, "setting": "as it is"})
    assert figures["status"] == "optimal"
    assert figures["cost"] == pytest.approx(6.0, rel=1e-9)

    def broken(**_: object) -> None:
        raise IndexError("list index\nout of range")

    problem = OptimalControlProblem("double integrator, energy")
    monkeypatch.setattr(problem, "solve", broken)
    failed = solving.solved(problem)
    assert (failed["status"], failed["message"]) == ("error", "IndexError: list index")


def test_a_perturbed_guess_differs_in_last_digits_and_is_the_same_for_the_same_draw() -> None:
    functions = OptimalControlProblem("brachistochrone").functions()
    moved, again = (perturbed(functions, np.random.default_rng(2)) for _ in range(2))
    for before, after, scale in (
        (functions.guess_states, moved.guess_states, functions.state_scale),
        (functions.guess_controls, moved.guess_controls, functions.control_scale),
    ):
        apart = np.abs(after - before) / scale
        assert 0.0 < apart.max() < 1e-11
    assert 0.0 < abs(moved.guess_duration - functions.guess_duration) < 1e-11
    assert (moved.guess_states == again.guess_states).all()


# rounding


def test_a_problem_is_settled_by_one_status_and_one_cost() -> None:
    def row(*pairs: tuple[str, float]) -> dict[str, Any]:
        made = {Attempt(NAME, draw): found(*pair) for draw, pair in enumerate(pairs)}
        return ocp_rounding.row(NAME, made)

    assert row(("optimal", 6.0), ("optimal", 6.0 + 1e-9))["settled"]
    apart = row(("optimal", 6.0), ("optimal", 6.0001))
    assert not apart["settled"]
    assert apart["spread"] == pytest.approx(1e-4 / 6.0)
    mixed = row(("optimal", 6.0), ("converged", 6.0))
    assert (mixed["settled"], mixed["statuses"]) == (False, "optimal converged")
    assert row(("infeasible", 1.0), ("infeasible", 7.0))["settled"]
    assert not row((solving.TIMED_OUT, math.nan))["settled"]
    claim = ocp_rounding.claim([apart, mixed], ocp_rounding.OcpRoundingConfig())
    assert claim.holds is False
    assert claim.measured == f"0 of 2; not {NAME} (2e-05), {NAME} (optimal, converged)"
