"""Requirements that a run did not meet are reported in one line, and only then."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.sim.records.figure_names import SHORTFALL
from mathnavi.sim.scenarios.requirements import Requirement, evaluate

SUMMARY = {"arrived": False, "min_clearance_m": 45.13, "speed_max_m_s": 397.61, "touched_wall": True, "nothing": None}


@pytest.mark.parametrize(
    ("requirement", "expected"),
    [
        (Requirement("min_clearance_m", least=50.0), "min clearance 45.13 m < 50 m allowed"),
        (Requirement("speed_max_m_s", most=300.0), "speed max 397.6 m/s > 300 m/s allowed"),
        (Requirement("min_clearance_m", least=45.1301), "min clearance 45.13 m < 45.1301 m allowed"),
        (Requirement("arrived", least=True), "not arrived"),
        (Requirement("touched_wall", most=False), "touched wall"),
        (Requirement("nothing", least=1.0), "nothing is not known"),
        (Requirement("min_clearance_m", least=45.0, most=46.0), ""),
        (Requirement("arrived", most=False), ""),
        (Requirement("touched_wall", least=True), ""),
    ],
)  # fmt: skip
def test_a_requirement_that_is_missed_names_figure_limit_and_unit(requirement: Requirement, expected: str) -> None:
    assert requirement.missed(SUMMARY) == expected


@given(st.floats(), st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_a_requirement_is_missed_exactly_beyond_its_limits(value: float, least: float, most: float) -> None:
    expected = Requirement("miss_m", least, most).missed({"miss_m": value})
    assert bool(expected) == (not least <= value <= most)
    if expected and not math.isnan(value):
        _, figure, _, sign, limit, *_ = expected.split(" ")
        assert sign in "<>"
        assert figure != limit


def test_what_does_not_decide_is_reported_only_for_a_run_that_fell_short() -> None:
    near, fast = Requirement("min_clearance_m", least=50.0), Requirement("speed_max_m_s", most=300.0)
    summary, success = evaluate(SUMMARY, [near], reported=[fast])
    assert not success
    assert summary[SHORTFALL] == f"{near.missed(SUMMARY)}; {fast.missed(SUMMARY)}"
    assert evaluate(SUMMARY, [Requirement("min_clearance_m", least=40.0)], reported=[fast]) == (SUMMARY, True)
