"""Importances of the fields of a search: how much of the order of its missions each field explains by itself.

The figures of the flown missions are replaced by their ranks R, so that infinite and skewed figures count as any other,
and the values of a field are sorted into bins B. Its first-order index

    S = Var(E[R | B]) / Var(R)

(Saltelli and others, Global Sensitivity Analysis, 2008, section 1.2.12; from given points: Plischke, Borgonovo and
Smith, European Journal of Operational Research 226, 2013) is estimated by Kelley's epsilon squared (Proceedings of the
National Academy of Sciences 21, 1935), which is 0 in the mean for a field without influence however many bins it has,

    S^ = max(0, 1 - (N - 1) / (N - k) * sum_i (R_i - mean of its bin)^2 / sum_i (R_i - mean)^2)

for N missions in k bins. Points of a directed search lie where it looked: an index says what mattered there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from mathnavi.sim.search.evaluation import Evaluation
from mathnavi.sim.search.space import Choice, Dimension

FEWEST = 20  # missions from which importances are meaningful
_IN_A_BIN = 5  # missions at least, of a range
_MOST_BINS = 10


def importances(evaluations: Sequence[Evaluation], space: Sequence[Dimension]) -> dict[str, float]:
    """Return each field's share of the sum of all indices, the largest first.

    {} if fewer than ``FEWEST`` missions were flown, or no field explains anything of their order.
    """
    flown = [each for each in evaluations if each.figure is not None]
    if len(flown) < FEWEST:
        return {}
    ranks = rankdata([each.figure for each in flown])
    indices = {each.name: _index(ranks, _bins(each, [one.values[each.name] for one in flown])) for each in space}
    total = sum(indices.values())
    if not total:
        return {}
    return {name: index / total for name, index in sorted(indices.items(), key=lambda pair: -pair[1])}


def _bins(dimension: Dimension, values: Sequence[object]) -> NDArray[np.int64]:
    """Return the number (N,) of the bin of each value: of a list its place, of a range by quantiles."""
    if isinstance(dimension, Choice):
        return np.array([dimension.values.index(value) for value in values])
    given = np.array(values, dtype=float)
    bins = min(_MOST_BINS, len(given) // _IN_A_BIN)
    return np.searchsorted(np.quantile(given, np.arange(1, bins) / bins), given, side="right")


def _index(ranks: NDArray[np.float64], bins: NDArray[np.int64]) -> float:
    """Return Kelley's epsilon squared of ranks (N,) in bins (N,); 0 for equal ranks, or with one mission a bin."""
    names, where = np.unique(bins, return_inverse=True)
    spread, free = float(np.sum((ranks - ranks.mean()) ** 2)), len(ranks) - len(names)
    if not spread or not free:
        return 0.0
    means = np.bincount(where, ranks) / np.bincount(where)
    within = float(np.sum((ranks - means[where]) ** 2))
    return max(0.0, 1.0 - (len(ranks) - 1) / free * within / spread)
