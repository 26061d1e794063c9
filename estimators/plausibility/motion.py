"""How far a model explains the accelerations in readings of the position, in each coordinate.

For readings y_a, y_b, y_c at times H apart, in coordinates about y_b,

    s = (y_c - y_b) - (y_b - y_a)                      what a motion of constant velocity does not explain,
    r = y_c - x_c                                      what the model does not explain,

x being the model's motion from y_a, at the velocity that leads to y_b, under the recorded inputs. The share sum r^2 /
sum s^2 over windows that are spread over the log is near 0 for a model that fits the readings, and 1 or more for one
that does not. It is the same in any unit of the readings in which the model holds.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import CutLocusError, Manifold, greatest_rate
from mathnavi.models.manifold.system import LagrangianSystem

_STEPS = 8  # of the model over H
_SHOTS = 2  # corrections of the velocity
_SHORTEST, _LONGEST, _SHARE_OF_LOG = 4, 32, 8  # H in readings, and at most this part of a log
_GAP = 2.0  # times the median H, of a window with a gap
_CLEAR = 100.0  # ratio of s^2 over H to s^2 from reading to reading, at which noise does not matter
_INFORMED = 80.0  # the same, of a coordinate
_LONGER = 4  # times H, over which coordinates are compared that show nothing over H
_STILL = 1e-12  # [rad^2, m^2] s^2 of a coordinate that is at rest
_KEPT = 0.8  # of the windows: some have an outlier
_WORST = 4.0  # s^2 that a window may count


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """Readings of a position, and the inputs."""

    t: Array  # (N,) [s]
    y: Array  # (N, size) points of the manifold; NaN where there was no reading
    u: Array  # (N, nu) from each time to the next
    name: str = "position"  # of the sensor
    first: int = 0  # component of a point with which its readings begin; those before are not known
    longer: bool = False  # whether coordinates that show nothing over H are compared over longer times

    @cached_property
    def read(self) -> NDArray[np.intp]:
        """Rows of the readings."""
        return np.flatnonzero(np.isfinite(self.y).all(axis=1))

    def windows(self, stride: int, count: int) -> NDArray[np.intp]:
        """Rows (k, 3) of readings that are ``stride`` readings apart, spread over the log; none with a gap."""
        rows = np.column_stack([self.read[: -2 * stride], self.read[stride:-stride], self.read[2 * stride :]])
        H = np.diff(self.t[rows], axis=1)
        rows = rows[(_GAP * np.median(H) >= H).all(axis=1) & (np.median(H) / _GAP <= H).all(axis=1)]
        chosen = np.unique(np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(np.intp))
        return rows[chosen]

    @property
    def longest(self) -> int:
        """Readings of H at most."""
        return 0 if self.first else min(_LONGEST, len(self.read) // _SHARE_OF_LOG)

    def longer_than(self, stride: int) -> int:
        """Readings of a longer H than ``stride``; 0 in a log that is too short."""
        longer = min(_LONGER * stride, len(self.read) // _SHARE_OF_LOG)
        return longer if longer > stride else 0

    def stride(self, manifold: Manifold) -> int:
        """Readings after which accelerations are clear of the noise; 0 in a log that is too short, or lacks some."""
        longest, stride = self.longest, _SHORTEST
        if longest < stride:
            return 0
        noise = _typical(self, manifold, 1)
        while 2 * stride <= longest and not np.median(_typical(self, manifold, stride) / noise) >= _CLEAR:
            stride *= 2
        return stride


@dataclass(frozen=True, eq=False)
class Bends:
    """Accelerations in k windows of a log, in each of n coordinates."""

    s: Array  # (k, n) what a constant velocity does not explain
    r: Array  # (k, n) what the model does not explain; infinite where no motion of the model leads there
    informed: NDArray[np.bool_]  # (n,) whether s is clear of the noise

    def and_longer(self, longer: Bends) -> Array:
        """Shares (n,), those of ``longer`` windows for coordinates that show no acceleration in these."""
        return np.where(self.informed, self.shares, longer.shares)

    @property
    def shares(self) -> Array:
        """Shares (n,) that the model does not explain; NaN for a coordinate that shows no acceleration."""
        lost = np.minimum(np.square(self.r), _WORST * np.square(self.s).mean(axis=0))
        kept = lost <= np.quantile(lost, _KEPT, axis=0)
        share = (lost * kept).sum(axis=0) / np.maximum((np.square(self.s) * kept).sum(axis=0), _STILL)
        return np.where(self.informed, share, np.nan)


def bends(system: LagrangianSystem, motion: RecordedMotion, stride: int, count: int) -> Generator[None, None, Bends]:
    """Compare readings and model in ``count`` windows of 2 ``stride`` readings, one at each step."""
    manifold = system.manifold
    windows = motion.windows(stride, count)
    s, r = np.full((2, len(windows), manifold.dimension), np.inf)
    for k, window in enumerate(windows):
        s[k] = _bend(motion, manifold, window)
        with suppress(ArithmeticError, CutLocusError, np.linalg.LinAlgError):
            r[k] = _unexplained(system, motion, window)
        yield
    r[~np.isfinite(r)] = np.inf
    clear = _typical(motion, manifold, stride) >= _INFORMED * _typical(motion, manifold, 1)
    return Bends(s, r, clear & (np.square(s).mean(axis=0) > _STILL))


def speeds(system: LagrangianSystem, motion: RecordedMotion, stride: int, count: int = 40) -> Array:
    """Greatest rates (k,) [rad/s, m/s] in windows of 2 ``stride`` readings."""
    manifold, found = system.manifold, []
    for a, b, c in motion.windows(stride, count):
        moved = manifold.coordinates(motion.y[b], motion.y[c]) - manifold.coordinates(motion.y[b], motion.y[a])
        found.append(greatest_rate(manifold, moved / (motion.t[c] - motion.t[a])))
    return np.array(found)


def _typical(motion: RecordedMotion, manifold: Manifold, stride: int, count: int = 40) -> Array:
    """Typical s^2 (n,) in windows of 2 ``stride`` readings: few outliers do not matter."""
    s = [_bend(motion, manifold, window) for window in motion.windows(stride, count)]
    typical: Array = np.maximum(np.quantile(np.square(s), 0.75, axis=0), np.finfo(float).tiny)
    return typical


def _bend(motion: RecordedMotion, manifold: Manifold, window: NDArray[np.intp]) -> Array:
    """s (n,) of one window."""
    (a, b, c), (before, after) = motion.y[window], np.diff(motion.t[window])
    bend: Array = manifold.coordinates(b, c) + manifold.coordinates(b, a) * (after / before)
    return bend


def _unexplained(system: LagrangianSystem, motion: RecordedMotion, window: NDArray[np.intp]) -> Array:
    """r (n,) of one window."""
    manifold, (a, b, c) = system.manifold, window
    first, middle, last = motion.y[window]
    H = motion.t[b] - motion.t[a]
    w = manifold.coordinates(first, middle) / H
    for _ in range(_SHOTS):
        x, v = _moved(system, motion, first, manifold.vector(first, w), (a, b))
        w = w + manifold.coordinates(x, middle) / H
    x, _ = _moved(system, motion, middle, v, (b, c))
    return manifold.coordinates(x, last)


def _moved(
    system: LagrangianSystem, motion: RecordedMotion, x: Array, v: Array, rows: tuple[int, int]
) -> tuple[Array, Array]:
    """State (x, v) of the model after it moved from one row to another under the recorded inputs."""
    state, (first, last) = np.concatenate([x, v]), rows
    ends = np.unique(np.linspace(first, last, min(_STEPS, last - first) + 1).astype(np.intp))
    for i, j in pairwise(ends):
        state = system.flow(state, motion.u[i:j].mean(axis=0), float(motion.t[j] - motion.t[i]))
    return state[: len(x)], state[len(x) :]
