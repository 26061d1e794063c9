"""Bounds of normalised squared errors and bands of RMS errors: they cover what they say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.sim.metrics.consistency import consistency, normalised_error_squared, root_mean_square

RUNS, DEGREES, REPEATS = 40, 3, 2000


@given(st.integers(0, 10_000), st.integers(1, 4))
def test_nees_does_not_depend_on_units(seed: int, d: int) -> None:
    rng = np.random.default_rng(seed)
    e, A, T = rng.normal(size=(5, d)), rng.normal(size=(5, d, d)), rng.normal(size=(d, d)) + 3.0 * np.eye(d)
    P = A @ A.transpose(0, 2, 1) + 0.1 * np.eye(d)
    nees = normalised_error_squared(e, P)
    assert (nees >= 0.0).all()
    np.testing.assert_allclose(normalised_error_squared(e @ T.T, T @ P @ T.T), nees, rtol=1e-6, atol=1e-9)


def test_what_is_no_covariance_has_no_nees() -> None:
    P = np.array([np.eye(2), np.diag([1.0, 0.0]), np.ones((2, 2)), -np.eye(2), np.full((2, 2), np.nan)])
    nees = normalised_error_squared(np.ones((5, 2)), P)
    assert nees[0] == 2.0
    assert np.isnan(nees[1:]).all()


def test_an_estimator_that_knows_how_good_it_is_is_within_the_bounds_as_often_as_they_say() -> None:
    squares = np.random.default_rng(0).chisquare(DEGREES, (REPEATS, RUNS))
    assert np.mean([consistency(runs, DEGREES).holds for runs in squares]) == pytest.approx(0.95, abs=0.015)
    assert np.mean([consistency(runs, DEGREES, 0.5).holds for runs in squares]) == pytest.approx(0.5, abs=0.035)


@pytest.mark.parametrize("factor", [0.6, 1.6])
def test_one_that_believes_itself_too_much_or_too_little_is_not(factor: float) -> None:
    squares = factor * np.random.default_rng(1).chisquare(DEGREES, (REPEATS, RUNS))
    assert np.mean([consistency(runs, DEGREES).holds for runs in squares]) < 0.05


def test_the_band_of_an_rms_covers_the_true_one() -> None:
    rng = np.random.default_rng(2)
    bands = [root_mean_square(np.abs(rng.normal(size=60)), rng, resamples=400) for _ in range(400)]
    assert np.mean([band.low <= 1.0 <= band.high for band in bands]) == pytest.approx(0.93, abs=0.04)
    assert all(band.low <= band.value <= band.high for band in bands)


def test_the_rms_of_a_single_run_has_no_band() -> None:
    alone = root_mean_square([0.5], np.random.default_rng(0))
    assert alone.value == 0.5
    assert math.isnan(alone.low)
    assert alone.text() == "0.5 (n = 1)"


def test_the_band_is_that_of_its_seed() -> None:
    values = np.random.default_rng(3).normal(size=30)
    one, again = (root_mean_square(values, np.random.default_rng(7)) for _ in range(2))
    assert one == again


@pytest.mark.parametrize(
    ("expected", "make"),
    [
        ("squares have shape", lambda: consistency([], 3)),
        ("1 of 2 are NaN", lambda: consistency([1.0, math.nan], 3)),
        ("degrees = 0", lambda: consistency([1.0], 0)),
        ("confidence = 1.0", lambda: consistency([1.0], 3, 1.0)),
        ("values have shape", lambda: root_mean_square([], np.random.default_rng(0))),
        ("resamples = 0", lambda: root_mean_square([1.0, 2.0], np.random.default_rng(0), resamples=0)),
    ],
)
def test_what_cannot_be_judged_is_refused(expected: str, make: object) -> None:
    with pytest.raises(ValueError, match=expected):
        make()  # type: ignore[operator]
