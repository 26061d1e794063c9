"""The cheapest way through the air over a terrain: a lattice of places, and the clear legs between them.

The lattice has columns ``spacing`` [m] apart and ``layers`` heights from the lowest ground to above the highest. A leg
is clear if the ground stays far enough below every point of it, which is exact. Its price is its length, times 1 + w
where radars of total weight w see it. Dijkstra's algorithm from the target finds the cheapest way from everywhere at
once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.kernels import Booleans
from mathnavi.models.terrain.visibility import Radar

TURNING = 0.02  # of a way's length that one more corner must save
ROUNDING = 1e-6  # [m] of a clearance
BORDER = 0.02  # of the map's side that no column stands in


@dataclass(frozen=True)
class Air:
    """Free space to fly through."""

    terrain: HeightField
    radars: tuple[Radar, ...]
    clearance: float  # [m] that a leg keeps above the ground
    margin: float = 0.0  # [m] that it keeps beside that, or as much of it as its ends have

    def clear(self, p: Array, q: Array) -> Booleans:
        """Tell (n,) which straight legs from p to q (n, 3) [m] are clear."""
        low = np.minimum(*(end[:, 2] - self.terrain.height(end[:, 0], end[:, 1]) for end in (p, q)))
        needed = np.clip(low - ROUNDING, self.clearance, self.clearance + self.margin)
        kept = self.terrain.path_clearance(p, q - p, np.zeros_like(p), np.ones(len(p)))
        return kept >= needed

    def prices(self, p: Array, q: Array, samples: int = 3) -> Array:
        """Return the prices (n,) [m] of straight legs, clear or not, with radars evaluated at ``samples`` points."""
        share = (np.arange(samples) + 0.5)[:, np.newaxis, np.newaxis] / samples
        places = (p + share * (q - p)).reshape(-1, 3)
        weight = np.zeros(len(places))
        for radar in self.radars:
            weight += radar.weight * radar.exposed(self.terrain, places)
        price: Array = np.linalg.norm(q - p, axis=1) * (1.0 + weight.reshape(samples, -1).mean(axis=0))
        return price

    def clear_prices(self, p: Array, q: Array, samples: int = 3) -> Array:
        """Return the ``prices`` (n,) [m] of clear legs, inf for the others."""
        return np.where(self.clear(p, q), self.prices(p, q, samples), np.inf)


@dataclass(frozen=True, eq=False)
class Lattice:
    """Places, and the pairs of neighbours that see each other over the ground."""

    places: Array  # (N, 3) [m] map frame
    pairs: Integers  # (M, 2)
    spacing: float  # [m] between columns


@lru_cache(maxsize=8)  # a mission asks for several planners over one map
def lattice(air: Air, columns: int, layers: int) -> Lattice:
    """Return the lattice with ``columns`` columns along the longer side of the map, and its clear legs."""
    terrain = air.terrain
    margin = BORDER * max(terrain.width, terrain.depth)
    spacing = (max(terrain.width, terrain.depth) - 2.0 * margin) / (columns - 1)
    x, y = (
        np.linspace(margin, side - margin, max(2, 1 + round((side - 2.0 * margin) / spacing)))
        for side in (terrain.width, terrain.depth)
    )
    lowest = air.clearance + air.margin
    z = np.linspace(terrain.z.min() + lowest, terrain.z.max() + 1.5 * lowest, layers)
    shape = len(x), len(y), len(z)
    places = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(len(places)).reshape(shape)
    forward = [step for step in product((-1, 0, 1), repeat=3) if step > (0, 0, 0)]  # each pair once
    pairs = np.concatenate(
        [np.stack([_shifted(index, step, -1), _shifted(index, step, 1)], axis=1) for step in forward]
    )
    p, q = places[pairs[:, 0]], places[pairs[:, 1]]
    return Lattice(places, pairs[air.clear(p, q)], spacing)


def _shifted(index: Integers, step: tuple[int, ...], side: int) -> Integers:
    """The first (side -1) or the second (side 1) places of all pairs that are a step apart."""
    cut = [slice(max(0, side * d), n + min(0, side * d)) for d, n in zip(step, index.shape, strict=True)]
    return index[tuple(cut)].ravel()


class Routes:
    """The cheapest way to one target from everywhere."""

    def __init__(self, air: Air, grid: Lattice, target: Array) -> None:
        self._air, self._grid = air, grid
        p, q = grid.places[grid.pairs[:, 0]], grid.places[grid.pairs[:, 1]]
        prices = air.prices(p, q)
        self._ends = self._column(target)  # (m, 3) the target, and places above it
        near, above, joined = self._joints(self._ends)
        n, m = len(grid.places), len(self._ends)
        rows = np.concatenate([grid.pairs[:, 0], near, np.full(m - 1, n)])
        columns = np.concatenate([grid.pairs[:, 1], n + above, n + np.arange(1, m)])
        climb = air.clear_prices(np.repeat(target[np.newaxis], m - 1, axis=0), self._ends[1:])
        priced = np.concatenate([prices, joined, climb])
        kept = np.isfinite(priced)
        graph = coo_array((priced[kept], (rows[kept], columns[kept])), shape=(n + m, n + m)).tocsr()
        self._places = np.vstack([grid.places, self._ends])
        self._togo, self._next = dijkstra(graph, directed=False, indices=n, return_predecessors=True)

    def route(self, start: Array) -> Array | None:
        """(k, 3) [m] corners of the cheapest way from ``start`` (3,) [m] to the target, both included; None without."""
        starts = self._column(start)
        near, above, joined = self._joints(starts)
        climb = self._air.clear_prices(np.repeat(start[np.newaxis], len(starts), axis=0), starts)
        total = joined + climb[above] + self._togo[near]
        if not len(total) or not np.isfinite(total.min()):
            return None
        best = int(total.argmin())
        way = [near[best]]
        while way[-1] != len(self._grid.places):
            way.append(self._next[way[-1]])
        lift = starts[1:][above[best] - 1 : above[best]]  # none where the way begins with the start itself
        return self._straightened(np.vstack([start, lift, self._places[way]]))

    def _column(self, place: Array) -> Array:
        """(m, 3) a place itself, and those above it at the lattice's heights."""
        heights = np.unique(self._grid.places[:, 2])
        z = np.concatenate([place[2:], heights[heights > place[2]]])
        return np.column_stack([np.repeat(place[np.newaxis, :2], len(z), axis=0), z])

    def _joints(self, column: Array) -> tuple[Integers, Integers, Array]:
        """Legs between a column and the lattice around it: which of the lattice, which of the column, their prices."""
        distance = np.abs(self._grid.places[:, :2] - column[0, :2]).max(axis=1)
        around = np.flatnonzero(distance <= 1.5 * self._grid.spacing)
        near, above = (each.ravel() for each in np.meshgrid(around, np.arange(len(column)), indexing="ij"))
        return near, above, self._air.clear_prices(column[above], self._grid.places[near])

    def _straightened(self, corners: Array) -> Array:
        """The cheapest way over some of the corners, each of which costs something by itself."""
        first, last = np.triu_indices(len(corners), 1)
        p, q = corners[first], corners[last]
        samples = max(3, int(np.linalg.norm(q - p, axis=1).max() / self._grid.spacing))
        leg = np.full((len(corners),) * 2, np.inf)
        leg[first, last] = self._air.clear_prices(p, q, samples)
        leg += TURNING * np.linalg.norm(corners[-1] - corners[0])
        cost, after = np.zeros(len(corners)), np.zeros(len(corners), np.int64)
        for k in range(len(corners) - 2, -1, -1):
            togo = leg[k, k + 1 :] + cost[k + 1 :]
            after[k], cost[k] = k + 1 + int(togo.argmin()), togo.min()
        kept = [0]
        while kept[-1] != len(corners) - 1:
            kept.append(int(after[kept[-1]]))
        return corners[kept]
