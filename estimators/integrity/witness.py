"""Protocols between the monitor and an estimator: the tests of its channels, and how it begins again."""

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


POSE_LEVELS = ("protection, position [m]", "protection, heading [rad]")
"""names of the numbers of the protection level of a pose"""


class Witness(Protocol):
    """Tests of what an estimator publishes, against the readings that it is given; its own state can be copied."""

    windows: Windows
    names: tuple[str, ...]
    """names (l,) of the channels, in messages"""
    rebuilt: frozenset[int]
    """channels that an estimator leaves out if it is built for that: their readings are given to it all the same"""
    strict: bool
    """True if nothing may be put down to what an estimator has found by itself"""

    def take(
        self, before: Estimate | None, after: Estimate, measurements: Sequence[Measurement], command: Array, used: Flags
    ) -> Worst:
        """Take an update, and return the worst test over the channels that were ``used`` (l,).

        ``before`` and ``after`` are the estimates before and after it, the latter with a covariance.
        """

    @property
    def levels(self) -> tuple[str, ...]:
        """Names (k,) of the numbers of the protection level, "name [unit]"."""

    @property
    def protection(self) -> Array:
        """Errors (k,) of the last estimate that no fault of one channel exceeds unfound; NaN if they are not known."""

    def widened(self, covariance: Array) -> Array:
        """A covariance of the last estimate that covers what a fault of one channel may do, as far as that is known."""

    @property
    def suspicious(self) -> bool:
        """True if a strict test of the last update has failed."""

    @property
    def doubtful(self) -> bool:
        """True if it has failed by more than what the estimate itself may be off by."""

    def stuck(self) -> list[int]:
        """Channels whose reading stays while what they should read moves."""

    def against(self, channel: int) -> float:
        """The largest ratio of a channel's own tests."""

    def is_quiet(self, channel: int, updates: int) -> bool:
        """True if the last updates of a channel pass its own tests at the soft level."""

    def forget(self, channel: int) -> None:
        """Forget what was read of a channel."""

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        """The readings without some channels."""

    def agree(self, one: Estimate, other: Estimate) -> bool:
        """True if two estimates with covariances are of the same state, within their errors."""

    def clear(self) -> None:
        """Forget what was taken."""

    def copy(self) -> Self:
        """A copy with its own state."""


class Recovery(Protocol):
    """Restart of an estimator that is lost."""

    def found(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimator | None:
        """Take the readings of t [s]; a new estimator once the state is known again, until then None."""


class Restart(Protocol):
    """Makers of estimators that begin at an estimate."""

    stands_in: bool
    """True if a simpler estimator stands in for the monitor's in replays"""
    without: frozenset[int]
    """channels of those that estimators have to be built for which can be left out"""

    def begun(self, estimate: Estimate, out: frozenset[int], *, replayed: bool) -> Estimator | None:
        """An estimator that begins at an estimate and leaves out some channels, to go on with or to be ``replayed``;
        None where it can not begin there.
        """


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
