"""Windowed test of the mean of all innovations together: of the vector, where ``windows`` tests each number.

A fault that a filter follows leaves a mean in all of its readings, small in each. Of the whitened innovations w of n
updates, each of variance kappa, with c_k values of number k in the window,

    T = sum_k (sum w_k)^2 / (kappa c_k)     over chi2_K(alpha),

K the numbers with ``fewest`` values or more.
"""

from __future__ import annotations

import copy

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.integrity.windows import CLIP, FEWEST
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
        size, read = len(self._sums), np.isfinite(white)
        after = self._sums[self._k % size].copy()
        after[0] += np.clip(np.where(read, white, 0.0), -self._clip, self._clip)
        after[1] += read
        self._k += 1
        self._sums[self._k % size] = after

    def worst(self, kappa: float, numbers: slice = slice(None)) -> float:
        """The largest statistic of all, or of some ``numbers``, over its threshold."""
        size, largest = len(self._sums), 0.0
        for n in self._lengths.tolist():
            within = self._sums[self._k % size] - self._sums[(self._k - min(n, self._k)) % size]
            sums, counts = within[:, numbers]
            enough = counts > self._fewest - 0.5
            if enough.any():
                T = float((np.square(sums[enough]) / counts[enough]).sum()) / kappa
                largest = max(largest, T / self._thresholds[int(enough.sum())])
        return largest
