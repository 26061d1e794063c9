"""Protocols between the monitor and an estimator: the tests of its channels, and its restart once it is lost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol, Self

import numpy as np

from mathnavi.estimators.integrity.windows import Flags, Windows, Worst
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement

_ROUNDING = 1e-9  # of the largest variance


class Witness(Protocol):
    """Tests of what an estimator publishes, against the readings that it is given; its own state can be copied."""

    windows: Windows
    names: tuple[str, ...]
    """names (l,) of the channels, in messages"""

    def take(
        self, before: Estimate | None, after: Estimate, measurements: Sequence[Measurement], command: Array, used: Flags
    ) -> Worst:
        """Take an update, and return the worst test over the channels that were ``used`` (l,).

        ``before`` and ``after`` are the estimates before and after it, the latter with a covariance.
        """

    def stuck(self) -> list[int]:
        """Channels whose reading stays while what they should read moves."""

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        """The readings without some channels."""

    def clear(self) -> None:
        """Forget what was taken."""

    def copy(self) -> Self:
        """A copy with a state of its own."""


class Recovery(Protocol):
    """Restart of an estimator that is lost."""

    def found(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimator | None:
        """Take the readings of t [s]; a new estimator once the state is known again, until then None."""


def is_plausible(estimate: Estimate) -> bool:
    """True for a finite state with a covariance that is finite and positive semidefinite."""
    P = estimate.covariance
    return P is not None and bool(is_possible(estimate.x, P))


@njit(cache=True, nogil=True)
def is_possible(x: Array, P: Array) -> bool:
    """True for finite x (n,) and P (m, m) whose Cholesky factor exists, but for rounding."""
    for value in x:
        if not math.isfinite(value):
            return False
    m = len(P)
    L, largest = np.zeros((m, m)), 0.0
    for i in range(m):
        largest = max(largest, P[i, i])
    if not math.isfinite(largest):
        return False
    for i in range(m):
        for j in range(i + 1):
            s = P[i, j]
            for c in range(j):
                s -= L[i, c] * L[j, c]
            if not math.isfinite(s) or (i == j and s < -_ROUNDING * largest):
                return False
            if i == j:
                L[i, i] = math.sqrt(max(s, 0.0))
            else:
                L[i, j] = s / L[j, j] if L[j, j] > _ROUNDING * largest else 0.0
    return True
