"""Dijkstra's algorithm without a matrix of the edges, held against scipy's."""

from __future__ import annotations

import itertools
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from mathnavi.controllers.flight.shortest_paths import distances
from mathnavi.interfaces.signals import Array


def by_matrix(height: Array, spacing: float, density: Array, source: int) -> Array:
    """The same by scipy, every edge written down."""
    shape, count = height.shape, height.size
    node = np.arange(count).reshape(shape)
    ends, costs = [], []
    for offset in itertools.product((-1, 0, 1), repeat=3):
        if any(offset):
            here = tuple(slice(max(0, -d), n - max(0, d)) for d, n in zip(offset, shape, strict=True))
            there = tuple(slice(max(0, d), n - max(0, -d)) for d, n in zip(offset, shape, strict=True))
            level = spacing**2 * (offset[1] ** 2 + offset[2] ** 2)
            length = np.sqrt(level + (height[there] - height[here]) ** 2)
            costs.append((length * (1.0 + 0.5 * (density[here] + density[there]))).ravel())
            ends.append((node[here].ravel(), node[there].ravel()))
    rows, columns = (np.concatenate(part) for part in zip(*ends, strict=True))
    graph = csr_array((np.concatenate(costs), (rows, columns)), shape=(count, count))
    return np.asarray(dijkstra(graph, indices=source)).reshape(shape)


@given(
    shape=st.tuples(st.integers(1, 4), st.integers(1, 7), st.integers(1, 7)),
    seed=st.integers(0, 2**32 - 1),
    flat=st.booleans(),
    threatened=st.booleans(),
)
def test_distances_have_the_bits_of_scipys(
    shape: tuple[int, int, int], seed: int, flat: bool, threatened: bool
) -> None:
    """Over flat ground many ways are equally long."""
    rng = np.random.default_rng(seed)
    ground = np.zeros(shape[1:]) if flat else rng.uniform(0.0, 900.0, shape[1:])
    height = ground + 120.0 + 250.0 * np.arange(shape[0])[:, None, None]
    density = rng.uniform(0.0, 3.0, shape) * (rng.uniform(size=shape) > 0.5) if threatened else np.zeros(shape)
    source = int(rng.integers(math.prod(shape)))
    found = distances(height, 500.0, density, source)
    np.testing.assert_array_equal(found, by_matrix(height, 500.0, density, source))
    assert found.ravel()[source] == 0.0
