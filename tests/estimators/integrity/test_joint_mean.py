"""The test of the mean of all innovations together: rare false alarms, and means that no number shows by itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.integrity.joint_mean import JointMean
from mathnavi.estimators.integrity.windows import CLIP

LENGTHS = np.array([5, 50])


def ratios(white: np.ndarray, alpha: float, **options: float) -> list[float]:
    test, found = JointMean(LENGTHS, white.shape[1], alpha, **options), []  # type: ignore[arg-type]
    for each in white:
        test.add(each)
        found.append(test.worst(1.0))
    return found


def test_noise_alarms_at_most_as_often_as_its_level_says_missing_numbers_or_not() -> None:
    rng = np.random.default_rng(0)
    white = rng.standard_normal((4000, 4))
    white[rng.random(white.shape) < 0.3] = np.nan
    assert np.mean(np.array(ratios(white, 1e-2)) > 1.0) == pytest.approx(0.014, abs=0.01), "of two windows"
    assert max(ratios(white, 1e-7)) < 1.0


def test_a_mean_that_each_number_shares_is_found_where_none_is_by_itself() -> None:
    white = np.full((60, 4), 0.65)
    assert max(ratios(white, 1e-7)) > 1.0
    assert max(ratios(white[:, :1], 1e-7)) < 1.0


def test_an_outlier_is_no_alarm_unless_it_counts_in_full() -> None:
    white = np.zeros((20, 3))
    white[10, 1] = 100.0
    assert max(ratios(white, 1e-7)) == pytest.approx(CLIP**2 / 5.0 / 34.4, rel=0.1)
    assert max(ratios(white, 1e-7, clip=math.inf)) > 1.0


def test_a_copy_goes_on_by_itself_and_what_is_forgotten_no_longer_counts() -> None:
    one = JointMean(LENGTHS, 2, 1e-7)
    for _ in range(30):
        one.add(np.array([3.0, 0.0]))
    other = one.copy()
    other.forget(0)
    assert other.worst(1.0) == 0.0 < 1.0 < one.worst(1.0)
    one.clear()
    assert one.worst(1.0) == 0.0
