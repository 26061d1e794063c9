"""Rates with exact limits, medians with bootstrap bands."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest, bootstrap

from mathnavi.sim.records.statistics import median_band, rate, supported_band

counts = st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))
confidences = st.floats(0.5, 0.999)


@given(counts, confidences)
def test_limits_are_those_of_the_exact_binomial_test(count: tuple[int, int], confidence: float) -> None:
    events, trials = count
    both = binomtest(events, trials).proportion_ci(confidence, "exact")
    one = binomtest(events, trials, alternative="less").proportion_ci(confidence, "exact")
    found = rate(events, trials, confidence)
    np.testing.assert_allclose([found.low, found.high, found.upper], [both.low, both.high, one.high], atol=1e-9)


@given(st.integers(1, 100_000), confidences)
def test_without_an_event_the_bound_is_the_one_that_would_leave_none(trials: int, confidence: float) -> None:
    found = rate(0, trials, confidence)
    assert found.low == 0.0
    assert found.upper == pytest.approx(1.0 - (1.0 - confidence) ** (1.0 / trials), rel=1e-9)
    assert found.upper < found.high


@given(counts)
def test_limits_bracket_the_rate_and_grow_with_the_events(count: tuple[int, int]) -> None:
    events, trials = count
    found = rate(events, trials)
    assert 0.0 <= found.low <= found.value <= found.upper <= found.high <= 1.0
    if events < trials:
        more = rate(events + 1, trials)
        assert found.low < more.low
        assert found.high <= more.high


@pytest.mark.parametrize("trials", [1, 2, 5, 12])
@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_limits_cover_the_truth_as_often_as_they_say_whatever_it_is(trials: int, confidence: float) -> None:
    found = [rate(events, trials, confidence) for events in range(trials + 1)]
    for p in np.linspace(0.0, 1.0, 201):
        chance = binom.pmf(np.arange(trials + 1), trials, p)
        inside = np.array([r.low - 1e-12 <= p <= r.high + 1e-12 for r in found])
        below = np.array([p <= r.upper + 1e-12 for r in found])
        assert chance[inside].sum() >= confidence - 1e-9
        assert chance[below].sum() >= confidence - 1e-9


@pytest.mark.parametrize(
    ("events", "trials", "text"),
    [
        (0, 10_000, "0 of 10000 (at most 0.03 %, 95 %)"),
        (12, 200, "12 of 200: 6.0 % [3.1, 10.2]"),
        (5, 5, "5 of 5: 100.0 % [47.8, 100.0]"),
    ],
)
def test_a_rate_says_how_sure_it_is(events: int, trials: int, text: str) -> None:
    assert rate(events, trials).text() == text


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [((0, 0), "trials = 0"), ((-1, 5), "events = -1"), ((6, 5), "events = 6"), ((1, 5, 1.0), "confidence = 1.0")],
)
def test_what_is_no_rate_is_refused(arguments: tuple[int, ...], expected: str) -> None:
    with pytest.raises(ValueError, match=f"{expected}; allowed"):
        rate(*arguments)


@pytest.mark.parametrize("values", [[3.0, 1.0, 7.0], [3.0, 1.0, 7.0, 8.0], [1.0, 1.0, 2.0, 5.0, 9.0]])
@pytest.mark.parametrize("confidence", [0.5, 0.8, 0.9])
def test_the_band_is_that_of_all_samples_with_replacement(values: list[float], confidence: float) -> None:
    medians = np.array([np.median(sample) for sample in itertools.product(values, repeat=len(values))])
    band = median_band(values, np.random.default_rng(1), confidence, resamples=200_000)
    assert band.median == np.median(values)
    tails = 0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence)
    for limit, tail in zip((band.low, band.high), tails, strict=True):
        # The limits jump from value to value, and finitely many resamples may fall on either side of a jump.
        assert np.mean(medians < limit) - 0.01 <= tail <= np.mean(medians <= limit) + 0.01


@pytest.mark.parametrize("n", [40, 41])
def test_the_band_is_that_of_the_common_bootstrap(n: int) -> None:
    values = np.random.default_rng(2).normal(10.0, 2.0, n)
    theirs = bootstrap(
        (values,), np.median, n_resamples=20_000, method="percentile", rng=np.random.default_rng(3)
    ).confidence_interval
    band = median_band(values, np.random.default_rng(4), resamples=20_000)
    np.testing.assert_allclose([band.low, band.high], [theirs.low, theirs.high], atol=0.15)


numbers = st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=60)


@given(numbers)
def test_a_band_holds_the_median_and_lies_within_the_values(values: list[float]) -> None:
    band = median_band(values, np.random.default_rng(0))
    assert min(values) <= band.low <= band.high <= max(values)
    assert band.low <= band.median <= band.high
    assert band.n == len(values)


@given(numbers, st.randoms())
def test_the_order_of_the_values_changes_nothing(values: list[float], random: object) -> None:
    shuffled = values.copy()
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    assert median_band(values, np.random.default_rng(0)) == median_band(shuffled, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("n", "confidence", "known"), [(5, 0.95, False), (6, 0.95, True), (2, 0.5, True), (7, 0.99, False)]
)
def test_a_sample_too_small_for_a_band_has_a_median_without_one(n: int, confidence: float, known: bool) -> None:
    values = np.arange(float(n))
    band = supported_band(values, np.random.default_rng(0), confidence)
    whole = median_band(values, np.random.default_rng(0), confidence)
    assert band.median == whole.median
    assert (band == whole) is known
    # Whether the whole range covers the median so often at all: each of n values is on one side of it or the other.
    assert known == (1.0 - 2.0 * 0.5**n >= confidence)
    assert math.isnan(band.low) is math.isnan(band.high) is not known


def test_a_single_value_has_no_band() -> None:
    band = median_band([4.0], np.random.default_rng(0))
    assert band.median == 4.0
    assert math.isnan(band.low)
    assert math.isnan(band.high)
    assert band.text() == "4 (n = 1)"


def test_a_band_says_what_it_is() -> None:
    assert median_band([1.0] * 9, np.random.default_rng(0)).text() == "1 [1, 1] (n = 9)"


@pytest.mark.parametrize(
    ("values", "expected"), [([], r"shape \(0,\)"), ([1.0, math.nan, math.nan], "2 of 3 are NaN"), ([[1.0]], "shape")]
)
def test_what_has_no_median_is_refused(values: list[float], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        median_band(values, np.random.default_rng(0))
