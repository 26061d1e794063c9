"""The drawn flights of the missile: repeatable, different, and their bands those of order statistics."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.studies.nodes.missile_closed_loop import drawn_trial, quantile_limits


def test_a_number_draws_the_same_flight_and_another_one_another() -> None:
    assert drawn_trial(3).parameters == drawn_trial(3).parameters
    assert drawn_trial(3).parameters != drawn_trial(4).parameters
    headings = [drawn_trial(number).spec.config.start_heading for number in range(40)]
    assert min(headings) < -90.0
    assert max(headings) > 90.0


def test_the_limits_of_a_quantile_cover_it_as_often_as_they_say() -> None:
    rng = np.random.default_rng(5)
    covered = 0
    for _ in range(400):
        quantile, low, high = quantile_limits(rng.uniform(size=100), 0.9)
        assert low <= quantile <= high
        covered += low <= 0.9 <= high
    assert 0.93 <= covered / 400 <= 0.99


@pytest.mark.parametrize("size", [1, 5])
def test_of_too_few_values_the_upper_limit_is_not_known(size: int) -> None:
    assert np.isnan(quantile_limits(np.arange(size, dtype=float), 0.9)[2])
