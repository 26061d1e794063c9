"""The generated tables of the reference show of a field what its declaration holds."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Interval

from mathnavi.interfaces.bounds import FINITE, Positive, configuration
from tests.docs.extensions import load


@configuration
class Fields:
    """Fields of three kinds."""

    commit_speed: Annotated[float, Interval(ge=1.0, le=1000.0), FINITE] = 100.0
    """least mean speed [m/s]"""
    horizon: Positive | None = None
    """length of the horizon [s]"""
    form: Literal["x", "z"] = "x"
    """form of the state"""


def test_a_table_shows_bounds_default_and_meaning_of_every_field() -> None:
    generated = load("generated")
    rows = [row.strip("| ").split(" | ") for row in generated.table(Fields, "planner").splitlines()[3:]]
    assert rows == [
        ["`--planner.commit-speed`", "number", r"\>= 1 and \<= 1000", "`100`", r"least mean speed \[m/s\]"],
        ["`--planner.horizon`", "number", r"\> 0", "–", r"length of the horizon \[s\]"],
        ["`--planner.form`", "`x`, `z`", "", "`x`", "form of the state"],
    ]
