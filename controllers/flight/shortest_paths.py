"""Dijkstra's algorithm on the 26-neighbour graph of a terrain-following grid (thesis A.5).

The graph is never stored: the length of an edge follows from the spacing and the heights of its ends, so that a
grid of n nodes takes the memory of its distances and of a queue, 24 bytes a node, where a matrix of the edges takes
312. Each node waits in the queue, a binary heap, at most once.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array

Indices = NDArray[np.int64]


def distances(height: Array, spacing: float, density: Array, source: int) -> Array:
    """Cheapest way D from every node to the source: D(i) = min over neighbours j of D(j) + c_ij, D(source) = 0.

    The cost of an edge is c_ij = |p_i - p_j| (1 + (rho_i + rho_j) / 2), p the nodes' positions, rho the threat density.
    A sum of costs is rounded as the way is followed from the source.

    Args:
        height: (layers, rows, columns) [m] of the nodes.
        spacing: [m] between rows and between columns.
        density: threat density rho >= 0 at the nodes, of the same shape.
        source: index of the node that all ways lead to, counted along columns, rows, layers.

    Returns:
        (layers, rows, columns) [m].
    """
    distance = np.full(height.size, np.inf)
    place = np.full(height.size, -1)
    queue = np.full(height.size, source)
    distance[source], place[source] = 0.0, 0
    z, rho = np.ascontiguousarray(height).ravel(), np.ascontiguousarray(density).ravel()
    _settle(z, rho, distance, place, queue, spacing, *height.shape)
    return distance.reshape(height.shape)


@njit(cache=True, nogil=True)
def _settle(
    z: Array,
    rho: Array,
    distance: Array,
    place: Indices,
    queue: Indices,
    spacing: float,
    layers: int,
    rows: int,
    columns: int,
) -> None:
    """Lower the distances (n,) [m] to those of the cheapest ways; at first the queue (n,) holds the source alone.

    ``place`` (n,) is where in the queue a node stands, -1 where it does not.
    """  # fmt: skip
    length = 1
    while length > 0:
        node = queue[0]
        length -= 1
        place[node] = -1
        if length > 0:
            _sink(queue[length], length, queue, place, distance)
        reached = distance[node]
        k, i, j = node // (rows * columns), node // columns % rows, node % columns
        for a in range(max(k - 1, 0), min(k + 2, layers)):
            for b in range(max(i - 1, 0), min(i + 2, rows)):
                for c in range(max(j - 1, 0), min(j + 2, columns)):
                    other = (a * rows + b) * columns + c
                    if distance[other] <= reached:
                        continue  # it is settled, or the node itself
                    rise = z[other] - z[node]
                    level = spacing * spacing * ((b - i) * (b - i) + (c - j) * (c - j))
                    way = reached + math.sqrt(level + rise * rise) * (1.0 + 0.5 * (rho[node] + rho[other]))
                    if way < distance[other]:
                        distance[other] = way
                        if place[other] < 0:
                            place[other] = length
                            length += 1
                        _rise(other, place[other], queue, place, distance)


@inner_njit(nogil=True)
def _rise(node: int, at: int, queue: Indices, place: Indices, distance: Array) -> None:
    """Put a node at the place ``at`` of the queue, or above, where its parent is no farther from the source."""
    while at > 0:
        parent = (at - 1) // 2
        above = queue[parent]
        if distance[above] <= distance[node]:
            break
        queue[at] = above
        place[above] = at
        at = parent
    queue[at] = node
    place[node] = at


@inner_njit(nogil=True)
def _sink(node: int, length: int, queue: Indices, place: Indices, distance: Array) -> None:
    """Put a node at the head of the queue, or below, where no child is nearer to the source."""
    at = 0
    while 2 * at + 1 < length:
        child = 2 * at + 1
        if child + 1 < length and distance[queue[child + 1]] < distance[queue[child]]:
            child += 1
        below = queue[child]
        if distance[below] >= distance[node]:
            break
        queue[at] = below
        place[below] = at
        at = child
    queue[at] = node
    place[node] = at
