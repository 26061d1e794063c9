"""What fields are held to."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from mathnavi.sim.interfaces.checks import check_counts, check_positive, check_probability


@pytest.mark.parametrize(
    ("check", "good", "bad"),
    [
        (check_positive, (1e-9, 1.0, 1e9), (0.0, -1.0, math.inf, math.nan)),
        (check_probability, (1e-9, 0.5, 0.999), (0.0, 1.0, -0.1, 2.0, math.nan)),
        (check_counts, (1, 1000, 1_000_000), (0, -1, 1_000_001)),
    ],
)
def test_a_field_is_refused_by_its_name(check: object, good: tuple[float, ...], bad: tuple[float, ...]) -> None:
    for value in good:
        check(SimpleNamespace(one=value, two=1e-3), "one")  # type: ignore[operator]
    for value in bad:
        with pytest.raises(ValueError, match=r"one = .*; allowed: "):
            check(SimpleNamespace(one=value, two=1e-3), "one")  # type: ignore[operator]


def test_a_field_that_is_not_given_needs_not_be_positive() -> None:
    check_positive(SimpleNamespace(one=None), "one")
