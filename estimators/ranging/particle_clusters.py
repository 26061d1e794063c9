"""Cells and clusters of weighted particles for adaptive Monte Carlo localisation, compiled.

A grid over (x_1, x_2, phi) divides the poses into cells; the heading is periodic. Occupied cells that share a face, an
edge or a corner form one cluster. The number k of occupied cells bounds the number of particles (KLD sampling, Fox,
2003): with the probability 1 - delta the Kullback-Leibler divergence between the sampled and the true posterior over
the cells stays below epsilon if

    n >= (k - 1) / (2 epsilon) (1 - 2 / (9 (k - 1)) + sqrt(2 / (9 (k - 1))) z_{1 - delta})^3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.unicycle.kernels import wrapped

_EMPTY = -1
_OFFSET = 1 << 19  # cells to either side of the origin that have a key of their own
_PRIMES = (73856093, 19349663, 83492791)  # of the spatial hash


class Cells(NamedTuple):
    """Grid of the cells."""

    position: float  # side of a cell [m]
    headings: int  # number of cells around the circle


class Clusters(NamedTuple):
    """Clusters of weighted particles; headings of the means count from ``origin``, not wrapped."""

    label: Integers  # (n,) cluster of each particle, 0 to K - 1
    weight: Array  # (K,) summing to one
    members: Integers  # (K,) numbers of particles
    origin: Integers  # (K,) heaviest particle of each
    offset: Array  # (K, 4) mean minus that particle
    covariance: Array  # (K, 4, 4)


@njit(cache=True, nogil=True)
def kld_bound(k: int, epsilon: float, z: float) -> float:
    """Number of particles that k occupied cells need; z is the upper quantile of the standard normal distribution."""
    if k < 2:
        return 1.0
    ninths = 2.0 / (9.0 * (k - 1))
    return (k - 1) / (2.0 * epsilon) * (1.0 - ninths + math.sqrt(ninths) * z) ** 3


@inner_njit(nogil=True)
def occupied_cells(x: Array, cells: Cells) -> tuple[Integers, Integers]:
    """Occupied cells of states x (n, 4): the cell (n,) of each and the coordinates (k, 3) of the k cells."""
    table, cell = _table(len(x)), np.empty(len(x), np.int64)
    coordinates = np.empty((len(x), 3), np.int64)
    k = 0
    for n in range(len(x)):
        i, j = math.floor(x[n, 0] / cells.position), math.floor(x[n, 1] / cells.position)
        h = math.floor((x[n, 2] + math.pi) * cells.headings / (2.0 * math.pi)) % cells.headings
        at = _slot(table, i, j, h)
        if table[at, 1] == _EMPTY:
            table[at, 0], table[at, 1] = _key(i, j, h), k
            coordinates[k] = i, j, h
            k += 1
        cell[n] = table[at, 1]
    return cell, coordinates[:k]


@njit(cache=True, nogil=True)
def clusters_of(x: Array, w: Array, cells: Cells) -> Clusters:
    """Clusters of states x (n, 4) of weights w (n,) that sum to one."""
    cell, coordinates = occupied_cells(x, cells)
    parent = _connected(coordinates, cells)
    number, K = np.full(len(parent), _EMPTY), 0
    label = np.empty(len(x), np.int64)
    for n in range(len(x)):
        root = _root(parent, cell[n])
        if number[root] == _EMPTY:
            number[root] = K
            K += 1
        label[n] = number[root]
    weight, count, origin = np.zeros(K), np.zeros(K, np.int64), np.full(K, _EMPTY)
    for n in range(len(x)):
        c = label[n]
        weight[c] += w[n]
        count[c] += 1
        if origin[c] == _EMPTY or w[n] > w[origin[c]]:
            origin[c] = n
    offset, covariance, d = np.zeros((K, 4)), np.zeros((K, 4, 4)), np.empty(4)
    for n in range(len(x)):
        c = label[n]
        if weight[c] > 0.0:
            difference(x[n], x[origin[c]], d)
            offset[c] += w[n] / weight[c] * d
    for n in range(len(x)):
        c = label[n]
        if weight[c] > 0.0:
            difference(x[n], x[origin[c]], d)
            for i in range(4):
                for j in range(4):
                    covariance[c, i, j] += w[n] / weight[c] * ((d[i] - offset[c, i]) * (d[j] - offset[c, j]))
    return Clusters(label, weight, count, origin, offset, covariance)


@njit(cache=True, nogil=True)
def difference(a: Array, b: Array, d: Array) -> None:
    """Write a - b, of a, b (4,), with the heading wrapped, into d (4,)."""
    for i in range(4):
        d[i] = a[i] - b[i]
    d[2] = wrapped(d[2])


@njit(cache=True, nogil=True)
def fold(x: Array, heading: float, symmetry: int, c_1: float, c_2: float) -> None:
    """Replace states x (n, 4), in place, by their images with the nearest heading to ``heading`` [rad].

    The wall is symmetric under ``symmetry`` rotations about (c_1, c_2) [m], so that a pose and its images are
    indistinguishable.
    """
    sector = 2.0 * math.pi / symmetry
    for n in range(len(x)):
        turns = round(wrapped(heading - x[n, 2]) / sector)
        if turns != 0:
            c, s = math.cos(turns * sector), math.sin(turns * sector)
            d_1, d_2 = x[n, 0] - c_1, x[n, 1] - c_2
            x[n, 0], x[n, 1] = c_1 + c * d_1 - s * d_2, c_2 + s * d_1 + c * d_2
            x[n, 2] = wrapped(x[n, 2] + turns * sector)


@inner_njit(nogil=True)
def _connected(coordinates: Integers, cells: Cells) -> Integers:
    """Parents (k,) in a forest whose trees are the sets of connected cells."""
    k = len(coordinates)
    table, parent = _table(k), np.arange(k)
    for a in range(k):
        i, j, h = coordinates[a]
        at = _slot(table, i, j, h)
        table[at, 0], table[at, 1] = _key(i, j, h), a
    for a in range(k):
        i, j, h = coordinates[a]
        for di in range(2):  # half of the neighbours: the other half finds this cell
            for dj in range(-1, 2):
                for dh in range(-1, 2):
                    b = table[_slot(table, i + di, j + dj, (h + dh) % cells.headings), 1]
                    if b != _EMPTY:
                        parent[_root(parent, b)] = _root(parent, a)
    return parent


@inner_njit(nogil=True)
def _root(parent: Integers, a: int) -> int:
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    return a


@njit(cache=True, nogil=True)
def _table(n: int) -> Integers:
    """An empty hash table, less than half full with n entries: key and value of each."""
    size = 8
    while size < 2 * n + 1:
        size *= 2
    return np.full((size, 2), _EMPTY)


@njit(cache=True, nogil=True)
def _key(i: int, j: int, h: int) -> int:
    return ((i + _OFFSET) * 2 * _OFFSET + (j + _OFFSET)) * 2 * _OFFSET + h


@inner_njit(nogil=True)
def _slot(table: Integers, i: int, j: int, h: int) -> int:
    """Place of a cell in the table, or the free place that it would take."""
    mask, key = len(table) - 1, _key(i, j, h)
    at = (i * _PRIMES[0] ^ j * _PRIMES[1] ^ h * _PRIMES[2]) & mask
    while table[at, 1] != _EMPTY and table[at, 0] != key:
        at = (at + 1) & mask
    return at
