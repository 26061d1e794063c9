"""Checks of conditions on several fields together."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.checks import check, check_names, close_names
from mathnavi.interfaces.errors import FieldError

LOW, HIGH = -1.0, 2.5


@given(
    value=st.one_of(st.floats(), st.floats(-2.0, 3.0), st.sampled_from([LOW, HIGH])),
    high=st.sampled_from([HIGH, math.inf]),
    open_low=st.booleans(),
)
def test_a_value_out_of_its_range_is_named_with_what_is_allowed(value: float, high: float, open_low: bool) -> None:
    allowed = f"{'>' if open_low else '>='} -1" + (" and <= 2.5" if high == HIGH else "")
    if math.isfinite(value) and (value > LOW if open_low else value >= LOW) and value <= high:
        check(value, "one", LOW, high, open_low=open_low)
        return
    with pytest.raises(FieldError) as refused:
        check(value, "one", LOW, high, open_low=open_low)
    assert str(refused.value) == f"one = {value!r}; allowed: a finite value {allowed}"


def test_a_name_that_is_given_twice_is_refused() -> None:
    assert check_names(["a", "b"]) == ("a", "b")
    with pytest.raises(FieldError, match=r"names = \['a', 'b', 'a'\]; allowed: each once, and not a again"):
        check_names(["a", "b", "a"])


FLAGS = (
    *("--seed", "--start", "--store", "--terrain", "--target", "--trials", "--trust", "--out", "--video", "--duration"),
    *(
        "--noise.position",
        "--planner.nodes",
        "--planner.margin",
        "--estimator",
        "--estimator.timeout",
        "--faults.gust-rms",
    ),
)


@pytest.mark.parametrize(
    ("name", "offered"),
    [
        ("--sed", ["--seed"]),
        ("--planer.nods", ["--planner.nodes"]),
        ("--output", ["--out"]),
        ("--faults.gust", ["--faults.gust-rms"]),
        ("--Faults.gust_rms", ["--faults.gust-rms"]),
        ("--noise.positoin", ["--noise.position"]),
        ("--tragets", ["--target"]),
        *((name, []) for name in ("--mission", "--time", "--workers", "--port", "--noise", "--estimator.margin", "--")),
    ],
)
def test_only_a_name_that_is_close_is_offered(name: str, offered: list[str]) -> None:
    assert close_names(name, FLAGS) == offered
