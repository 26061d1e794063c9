"""Statistics of samples: proportions with exact limits, medians with bootstrap bands.

**Proportion.** k events in n independent trials of unknown probability p. The two-sided limits are Clopper and
Pearson's: low is the p for which k or more events have probability (1 - c) / 2, high that for which k or fewer have it,
so that [low, high] covers p with probability c at least, for every p. The one-sided bound, ``upper``, leaves 1 - c on
its one side: without any event, (1 - upper)^n = 1 - c. As P(k or more events) = I_p(k, n - k + 1), the regularised
incomplete beta function, the limits are values of its inverse.

**Median.** The band is the bootstrap's percentile interval: the median of n values drawn with replacement from the
sample, repeatedly. The drawn values are the sample's order statistics x_(1) <= ... <= x_(n) at the indices
ceil(n u), u uniform, and sorting commutes with that: the i-th smallest of them is x_(ceil(n U_i)) with U_i the i-th
order statistic of n uniform numbers. Those in the middle are drawn directly, U_i ~ Beta(i, n + 1 - i), so that a
resample costs the same for every n.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from mathnavi.interfaces.errors import ArgumentError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Proportion:
    """Proportion of events in trials, with limits of their probability."""

    events: int
    trials: int
    low: float  # two-sided
    high: float  # two-sided
    upper: float  # one-sided
    confidence: float = 0.95

    @property
    def value(self) -> float:
        return self.events / self.trials

    def text(self) -> str:
        """Return the proportion as text; without an event it states the upper bound."""
        if self.events == 0:
            return f"0 of {self.trials} (at most {percent(self.upper)} %, {100.0 * self.confidence:g} %)"
        limits = f"[{percent(self.low)}, {percent(self.high)}]"
        return f"{self.events} of {self.trials}: {percent(self.value)} % {limits}"


@dataclass(frozen=True)
class Band:
    """Median of n values, with the limits between which resampled medians lie."""

    median: float
    low: float  # NaN for too few values
    high: float
    n: int
    confidence: float = 0.95

    def text(self) -> str:
        """Return median and band as text, in the unit of the values."""
        if math.isnan(self.low):
            return f"{self.median:.4g} (n = {self.n})"
        return f"{self.median:.4g} [{self.low:.4g}, {self.high:.4g}] (n = {self.n})"


def rate(events: int, trials: int, confidence: float = 0.95) -> Proportion:
    """Return the rate of ``events`` in ``trials``.

    Raises ArgumentError unless 0 <= events <= trials, trials >= 1 and 0 < confidence < 1.
    """
    _check_confidence(confidence)
    if trials < 1:
        raise ArgumentError(f"trials = {trials!r}; allowed: a whole number >= 1")
    if not 0 <= events <= trials:
        raise ArgumentError(f"events = {events!r}; allowed: 0 to the number of trials, {trials}")
    tail = 0.5 * (1.0 - confidence)
    low = float(betaincinv(events, trials - events + 1, tail)) if events > 0 else 0.0
    high, upper = (
        float(betaincinv(events + 1, trials - events, level)) if events < trials else 1.0
        for level in (1.0 - tail, confidence)
    )
    return Proportion(events, trials, low, high, upper, confidence)


def median_band(
    values: Sequence[float] | Array, rng: np.random.Generator, confidence: float = 0.95, resamples: int = 9999
) -> Band:
    """Return the median of ``values`` (n,) and its bootstrap band; a single value has no band.

    Raises ValueError for no values at all, and for NaN: missing values must be left out, and counted, before.
    """
    x = np.sort(checked_sample(values, "values", confidence))
    n = x.size
    if resamples < 1:
        raise ArgumentError(f"resamples = {resamples!r}; allowed: a whole number >= 1")
    if n == 1:
        return Band(float(x[0]), math.nan, math.nan, 1, confidence)
    tails = [0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence)]
    low, high = np.quantile(_resampled_medians(x, rng, resamples), tails, method="inverted_cdf")
    return Band(float(np.median(x)), float(low), float(high), n, confidence)


def supported_band(values: Sequence[float] | Array, rng: np.random.Generator, confidence: float = 0.95) -> Band:
    """Return ``median_band`` of values (n,), but without limits if the sample is too small for any.

    All n values together span the median of their distribution only with probability 1 - 2^(1 - n); no interval
    within them can do so with a higher one. For 95 % it takes six.
    """
    band = median_band(values, rng, confidence)
    return band if 1.0 - 2.0 ** (1 - band.n) >= confidence else replace(band, low=math.nan, high=math.nan)


def checked_sample(values: Sequence[float] | Array, name: str, confidence: float) -> Array:
    """Return sample as an array (n,); ValueError, with its name, for none and NaN, and a confidence not in (0, 1)."""
    _check_confidence(confidence)
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1 or x.size == 0:
        raise ArgumentError(f"{name} have shape {x.shape}; allowed: (n,), n >= 1")
    if np.isnan(x).any():
        raise ArgumentError(f"{name}: {np.count_nonzero(np.isnan(x))} of {x.size} are NaN; allowed: numbers")
    return x


def percent(p: float) -> str:
    """Return a probability in percent, with enough digits for small ones."""
    return f"{100.0 * p:.1f}" if p >= 0.001 or p == 0.0 else f"{100.0 * p:.2g}"


def _resampled_medians(x: Array, rng: np.random.Generator, resamples: int) -> Array:
    """Return medians (resamples,) of samples with replacement of the sorted values ``x`` (n,)."""
    n = x.size
    i = (n + 1) // 2  # the middle one, or the lower of the two
    u = rng.beta(i, n + 1 - i, resamples)
    lower = x[_index(u, n)]
    if n % 2:
        return lower
    # Given U_i, the n - i numbers above it are uniform above it, and U_i+1 is the least of them.
    above = u + (1.0 - u) * rng.beta(1, n - i, resamples)
    return 0.5 * lower + 0.5 * x[_index(above, n)]


def _index(u: Array, n: int) -> NDArray[np.int64]:
    return np.minimum((u * n).astype(np.int64), n - 1)


def _check_confidence(confidence: float) -> None:
    if not 0.0 < confidence < 1.0:
        raise ArgumentError(f"confidence = {confidence!r}; allowed: between 0 and 1")
