"""Samplers of a search: they propose points of the unit cube, and learn from the costs there.

A coordinate of a point is a share, from 0 to less than 1, of the range of a field, or of its list of values. What a
sampler proposes follows from its seed and from the costs that it was told, in their order.

**CMA-ES** (Hansen and Ostermeier, Evolutionary Computation 9, 2001; Hansen, The CMA Evolution Strategy: A Tutorial,
arXiv:1604.00772) draws x from a normal distribution N(m, sigma^2 C) on R^n, and proposes the shares

    u = (1 - cos(pi x)) / 2,

so that no point lies outside of the cube, and the ends of the ranges, where extreme missions often are, are reached.
After each generation of 4 + floor(3 ln n) points, m, sigma and C move towards the better half of them. Only their order
counts, so a cost may be infinite. It ends where it has converged, or where all costs of a generation are equal, and
begins elsewhere.

**Sobol' points** (scrambled: Owen, Journal of Complexity 14, 1998) fill the cube evenly: of the first 2^k, each half of
each range holds half. CMA-ES that begins at the best of them starts near a minimum, not in the middle of the cube. Some
of the later points are Sobol' points too: they find what lies elsewhere, and where it begins the next time.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from heapq import heappop, heappush
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

SamplerName = Literal["sobol-cmaes", "cmaes", "random"]
Point = NDArray[np.float64]  # (n,)
Shares = Sequence[float]  # (n,) each from 0 to less than 1

_FIRST, _EVERY = 16, 4  # the first Sobol' points; after them, one of so many points
_WIDTH_OF_CUBE, _WIDTH = 1.0 / 6.0, 0.2  # sigma at the beginning: without and with a point that is known to be good
_CONVERGED = 0.01  # extent of a generation in every coordinate
_MOST = math.nextafter(1.0, 0.0)  # of a share


class Sampler(Protocol):
    """Source of points that learns from their costs."""

    def ask(self) -> Shares:
        """Return the next point; several may be requested before the first result is known."""
        ...

    def tell(self, shares: Shares, cost: float | None) -> None:
        """Report the cost at a point, to be minimised; inf where it is worse than all, None where it is unknown."""
        ...


def make_sampler(name: SamplerName, size: int, seed: int) -> Sampler:
    """Return a sampler of points with ``size`` coordinates."""
    if name == "random":
        return RandomSampler(size, seed)
    return CmaEsSampler(size, seed, covers=name == "sobol-cmaes")


class RandomSampler:
    """Independent points, uniform in the cube."""

    def __init__(self, size: int, seed: int) -> None:
        self._size, self._rng = size, np.random.default_rng(seed)

    def ask(self) -> Shares:
        """Return the next point."""
        shares: list[float] = self._rng.random(self._size).tolist()
        return shares

    def tell(self, shares: Shares, cost: float | None) -> None:
        """Learn nothing."""


class CmaEsSampler:
    """CMA-ES from the middle of the cube, then from random points; if it ``covers``, from the best Sobol' points."""

    def __init__(self, size: int, seed: int, covers: bool) -> None:
        from scipy.stats.qmc import Sobol  # slow to import

        self._rng = np.random.default_rng(seed)
        self._size, self._covers, self._asked = size, covers, 0
        self._sobol = Sobol(size, rng=self._rng)
        self._starts: list[tuple[float, int, Shares]] = []  # a heap: cost, number and place of Sobol' points
        self._open: deque[tuple[_Descent | None, Point]] = deque()  # not told yet, with their source; None for Sobol'
        self._descent = None if covers else self._begun(np.full(size, 0.5), _WIDTH_OF_CUBE)

    def ask(self) -> Shares:
        """Return the next point."""
        self._asked += 1
        sobol = self._covers and (self._asked <= _FIRST or self._asked % _EVERY == 0)
        source = None if sobol else self._descent
        point: Point = self._sobol.random()[0] if source is None else source.ask()
        self._open.append((source, point))
        shares: list[float] = np.minimum(point if source is None else _shares(point), _MOST).tolist()
        return shares

    def tell(self, shares: Shares, cost: float | None) -> None:
        """Report the cost at the point that was asked for first of those that are not told yet."""
        source, point = self._open.popleft()
        if source is not None and cost is not None:
            source.tell(point, cost)
        elif cost is not None and cost < math.inf:
            heappush(self._starts, (cost, len(self._starts), shares))
        if self._descent is not None and self._descent.ended:
            self._descent = None if self._covers else self._begun(self._rng.random(self._size), _WIDTH_OF_CUBE)
        if self._descent is None and self._starts and self._asked - len(self._open) >= _FIRST:
            self._descent = self._begun(np.arccos(1.0 - 2.0 * np.array(heappop(self._starts)[2])) / np.pi, _WIDTH)

    def _begun(self, start: Point, width: float) -> _Descent:
        return _Descent(start, width, int(self._rng.integers(2**32)))


def _shares(x: Point) -> Point:
    shares: Point = 0.5 - 0.5 * np.cos(np.pi * x)
    return shares


class _Descent:
    """CMA-ES from one point, until it ends."""

    def __init__(self, start: Point, width: float, seed: int) -> None:
        from cmaes import CMA

        self._cma = CMA(start, width, seed=seed)
        self._generation: list[tuple[Point, float]] = []
        self.ended = False

    def ask(self) -> Point:
        x: Point = self._cma.ask()
        return x

    def tell(self, point: Point, cost: float) -> None:
        if self.ended:
            return
        self._generation.append((point, cost))
        if len(self._generation) < self._cma.population_size:
            return
        points, costs = np.array([point for point, _ in self._generation]), [cost for _, cost in self._generation]
        ranks = np.argsort(np.argsort(costs, kind="stable"))
        self._cma.tell([(point, float(rank)) for point, rank in zip(points, ranks, strict=True)])
        converged = bool(np.all(np.ptp(_shares(points), axis=0) < _CONVERGED))
        self.ended = converged or min(costs) == max(costs) or self._cma.should_stop()
        self._generation = []
