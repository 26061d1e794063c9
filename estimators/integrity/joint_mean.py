"""Windowed test of the mean of all innovations together: of the vector, where ``windows`` tests each number.

A fault that a filter follows leaves a mean in all of its readings, small in each. Of the whitened innovations w of n
updates, each of variance kappa, with c_k values of number k in the window,

    T = sum_k (sum w_k)^2 / (kappa c_k)     over chi2_K(alpha),

K the numbers with ``fewest`` values or more.
"""

from __future__ import annotations

import copy
import math

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.integrity.windows import CLIP, FEWEST
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Integers


class JointMean:
    """Sums of the whitened innovations (l,) over the last updates."""

    def __init__(
        self, lengths: Integers, numbers: int, alpha: float, *, fewest: int = FEWEST, clip: float = CLIP
    ) -> None:
        """``lengths`` (w,) are those of the windows in updates; ``alpha`` is the level of a test; values count as at
        most ``clip``.
        """
        self._lengths, self._fewest, self._clip = lengths, fewest, clip
        self._sums = np.zeros((int(lengths[-1]) + 1, 2, numbers))  # running sums of w and of 1, in a ring
        self._k = 0
        self._thresholds = np.append(np.inf, chdtri(np.arange(1, numbers + 1), alpha))

    def clear(self) -> None:
        """Forget everything."""
        self._sums[:] = 0.0
        self._k = 0

    def forget(self, number: int) -> None:
        """Forget what was read of a number."""
        self._sums[:, :, number] = 0.0

    def copy(self) -> JointMean:
        """A copy with its own sums."""
        made = copy.copy(self)
        made._sums = self._sums.copy()
        return made

    def add(self, white: Array) -> None:
        """Add the whitened innovations (l,) of an update, NaN where nothing was read, or used."""
        add_clipped(self._sums, self._k, white, self._clip)
        self._k += 1

    def worst(self, kappa: float, number: int | None = None) -> float:
        """The largest statistic of all, or of one ``number``, over its threshold."""
        first, last = (0, self._sums.shape[2]) if number is None else (number, number + 1)
        return float(largest(self._sums, self._k, first, last, self._lengths, self._fewest, kappa, self._thresholds))


@njit(cache=True, nogil=True)
def add_clipped(sums: Array, k: int, white: Array, clip: float) -> None:
    """Write the running sums of update k + 1 behind those of k, of values that count as at most ``clip``."""
    before, after = sums[k % len(sums)], sums[(k + 1) % len(sums)]
    for i in range(len(white)):
        read = math.isfinite(white[i])
        after[0, i] = before[0, i] + (min(max(white[i], -clip), clip) if read else 0.0)
        after[1, i] = before[1, i] + (1.0 if read else 0.0)


@njit(cache=True, nogil=True)
def largest(
    sums: Array, k: int, first: int, last: int, lengths: Integers, fewest: int, kappa: float, thresholds: Array
) -> float:  # fmt: skip
    """The largest statistic of the numbers from ``first`` up to ``last`` over its threshold."""
    found, now = 0.0, sums[k % len(sums)]
    for n in lengths:
        then = sums[(k - min(n, k)) % len(sums)]
        T, numbers = 0.0, 0
        for i in range(first, last):
            count = now[1, i] - then[1, i]
            if count > fewest - 0.5:
                T += (now[0, i] - then[0, i]) ** 2 / count
                numbers += 1
        if numbers > 0:
            found = max(found, T / kappa / thresholds[numbers])
    return found
