"""Radau IIA collocation whose number of points differs from interval to interval: the transcription of an hp mesh.

A mesh is the nodes of a grid and the degree of every interval. Values at points are arrays (N - 1, k, ...) for the
largest number of points k: an interval of fewer points repeats its last one, at the end of the interval, at no weight
in any interpolation and any quadrature. So what holds at all points, a bound or a largest value, needs no distinction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA, radau
from mathnavi.controllers.ocp.transcriptions.scheme import (
    IntervalEquations,
    Rates,
    Scheme,
    integral_weights,
    weights,
)
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array, Integers


@dataclass(frozen=True)
class VariableRadauIIA:
    """Radau IIA collocation at ``counts[i]`` points of interval i.

    ProblemError for no interval; FieldError for a number of points that ``RadauIIA`` does not have.
    """

    counts: tuple[int, ...]  # (N - 1,)

    def __post_init__(self) -> None:
        if not self.counts:
            raise ProblemError("counts = (); allowed: a number of points for every interval, at least one interval")
        for count in set(self.counts):
            RadauIIA(count)

    @property
    def name(self) -> str:
        """Name of the scheme, with its least and its highest order."""
        return f"Radau IIA of orders {2 * min(self.counts) - 1} to {2 * max(self.counts) - 1}"

    @property
    def order(self) -> int:
        """Least order of a state at the end of an interval."""
        return 2 * min(self.counts) - 1

    @property
    def interior(self) -> int:
        """Largest number of unknown states inside an interval."""
        return max(self.counts) - 1

    @property
    def shared(self) -> bool:
        """False: a control may jump at a node."""
        return False

    @property
    def explicit(self) -> bool:
        """False: the end of an interval is solved for."""
        return False

    @property
    def costate_at(self) -> float:
        """Fraction of the interval at which the multipliers of its equations are the costate: its start."""
        return 0.0

    @cached_property
    def points(self) -> tuple[float, ...]:
        """Points (k,) of an interval that has the largest number k of them; see ``interval_points`` for the others."""
        return radau(max(self.counts))

    def interval(
        self, rates: Rates, x_0: ca.SX, X: Sequence[ca.SX], x_1: ca.SX, U: Sequence[ca.SX], t: ca.SX, d: ca.SX
    ) -> IntervalEquations:
        """Raise ProblemError: intervals of several numbers of points have no equations in common."""
        raise ProblemError(f"scheme = {self.name} with nodes that are unknowns; allowed: RadauIIA, or fixed nodes")


class Members(NamedTuple):
    """Intervals with the same transcription."""

    scheme: Scheme  # of each of them
    intervals: Integers  # (m,) their indices


def alike(scheme: Scheme, count: int) -> tuple[Members, ...]:
    """Group the ``count`` intervals of a grid by their scheme; ProblemError if ``scheme`` has another number."""
    if not isinstance(scheme, VariableRadauIIA):
        return (Members(scheme, np.arange(count, dtype=np.int64)),)
    if len(scheme.counts) != count:
        raise ProblemError(f"counts: points for {len(scheme.counts)} intervals; allowed: {count}, like the grid's")
    own = np.array(scheme.counts, dtype=np.int64)
    return tuple(Members(RadauIIA(k), np.flatnonzero(own == k)) for k in sorted(set(scheme.counts)))


def point_counts(scheme: Scheme) -> Integers:
    """Number (N - 1,) of each interval's points, or (1,) where all have the same."""
    own = scheme.counts if isinstance(scheme, VariableRadauIIA) else (len(scheme.points),)
    return np.array(own, dtype=np.int64)


def own_points(scheme: Scheme, interval: int) -> tuple[float, ...]:
    """Points of one interval, without repetitions."""
    return radau(scheme.counts[interval]) if isinstance(scheme, VariableRadauIIA) else scheme.points


def interval_points(scheme: Scheme) -> Array:
    """Points (N - 1, k), fractions of each interval, or (1, k) where all have the same."""
    if not isinstance(scheme, VariableRadauIIA):
        return np.array(scheme.points)[None]
    points = np.ones((len(scheme.counts), len(scheme.points)))
    for own, intervals in alike(scheme, len(scheme.counts)):
        points[intervals, : len(own.points)] = own.points
    return points


def interval_weights(scheme: Scheme, at: Array) -> Array:
    """Interpolation weights (N - 1, n, k) of values at the points in those at fractions (n,); (1, n, k) if alike."""
    return _by_intervals(scheme, lambda points: weights(points, at))


def interval_integral_weights(scheme: Scheme, to: Array) -> Array:
    """Integration weights (N - 1, n, k) of rates at the points to fractions (n,); (1, n, k) if alike."""
    return _by_intervals(scheme, lambda points: integral_weights(points, to))


def located_weights(scheme: Scheme, interval: Integers, fraction: Array, *, integral: bool = False) -> Array:
    """Weights (n, k) of an interval's values at its points in that at a fraction (n,) of it, or the integral."""
    own_weights = integral_weights if integral else weights
    if not isinstance(scheme, VariableRadauIIA):
        return own_weights(scheme.points, fraction)
    found = np.zeros((len(interval), len(scheme.points)))
    counts = point_counts(scheme)[interval]
    for k in np.unique(counts).tolist():
        chosen = counts == k
        found[chosen, :k] = own_weights(radau(k), fraction[chosen])
    return found


def repeated(scheme: Scheme, values: Array) -> Array:
    """Values (N - 1, k, ...) at points, with that of an interval's last point at those which repeat it."""
    if not isinstance(scheme, VariableRadauIIA):
        return values
    source = np.minimum(np.arange(values.shape[1]), point_counts(scheme)[:, None] - 1)
    found: Array = values[np.arange(len(values))[:, None], source]
    return found


def _by_intervals(scheme: Scheme, weights_at: Callable[[tuple[float, ...]], Array]) -> Array:
    if not isinstance(scheme, VariableRadauIIA):
        return weights_at(scheme.points)[None]
    own = np.array(scheme.counts)
    tables = {k: weights_at(radau(k)) for k in sorted(set(scheme.counts))}
    found = np.zeros((len(own), len(tables[int(own[0])]), len(scheme.points)))
    for k, table in tables.items():
        found[own == k, :, :k] = table
    return found
