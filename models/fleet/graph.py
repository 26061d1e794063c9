"""Communication graph of a fleet: the weighted graph G = (V, E, A) (thesis, A.8.1).

A = [a_lm] (n, n) holds a_lm > 0 where the vehicles l and m hear each other and 0 where they do not; the graph is
undirected. Its Laplacian is L = diag(d_1, ..., d_n) - A with the valencies d_m = sum_l a_lm, and the second smallest
eigenvalue lambda_2 of L is the algebraic connectivity, with which the protocol (A.10) reaches consensus (Theorem 8 of
Olfati-Saber and Murray, "Consensus problems in networks of agents with switching topology and time-delays", 2004, the
thesis' [35]); it is positive if and only if the graph is connected.

**A graph that changes with time**: links come and go as vehicles fly out of each other's reach and back.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from scipy.sparse.csgraph import shortest_path

from mathnavi.interfaces.checks import check, check_names
from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.signals import Array


@dataclass(frozen=True)
class Neighbourhood:
    """Vehicle of a fleet, with its knowledge of those that it communicates with."""

    name: str
    weights: Mapping[str, float]  # a_lm > 0 of each neighbour l
    planning_period: float = 5.0 / 3.0  # [s] h, after which the vehicles agree again
    deadline: float = math.inf  # [s] D, the latest common time that the fleet may agree on
    clock_error: float = 0.0  # [s] epsilon, largest error of a vehicle's clock

    @property
    def valency(self) -> float:
        """Valency d_m = sum_l a_lm."""
        return sum(self.weights.values())


@dataclass(frozen=True, eq=False)
class Graph:
    """An undirected weighted graph of named vehicles.

    ValueError for no names or a name that is there twice, weights that are not square, finite, non-negative and
    symmetric, and for self-loops.
    """

    names: tuple[str, ...]  # (n,)
    weights: Array  # (n, n) a_lm

    def __post_init__(self) -> None:
        names = check_names(self.names)
        if not names:
            raise ArgumentError("names = []; allowed: at least one")
        weights = np.array(self.weights, dtype=np.float64)
        if weights.shape != (len(names), len(names)):
            raise ArgumentError(
                f"weights of shape {weights.shape}; allowed: {(len(names), len(names))}, a row and a column a vehicle"
            )
        for l, m in zip(*np.nonzero(~(np.isfinite(weights) & (weights >= 0.0))), strict=True):  # noqa: E741
            raise ArgumentError(f"{_entry(names, l, m)} = {float(weights[l, m])!r}; allowed: a finite value >= 0")
        for m in np.flatnonzero(np.diag(weights)):
            raise ArgumentError(f"{_entry(names, m, m)} = {float(weights[m, m])!r}; allowed: 0, no self-loop")
        for l, m in zip(*np.nonzero(weights != weights.T), strict=True):  # noqa: E741
            raise ArgumentError(
                f"{_entry(names, l, m)} = {float(weights[l, m])!r} and {_entry(names, m, l)} = "
                f"{float(weights[m, l])!r}; allowed: equal, for the graph is undirected"
            )
        weights.setflags(write=False)
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "weights", weights)

    # ---- graphs of a kind

    @staticmethod
    def from_edges(names: Sequence[str], edges: Mapping[tuple[str, str], float]) -> Graph:
        """Graph with the edges (l, m): a_lm.

        Raises FieldError for an end that is no name.
        """
        weights = np.zeros((len(names), len(names)))
        order = {name: k for k, name in enumerate(names)}
        for (sender, receiver), weight in edges.items():
            for end in (sender, receiver):
                _check_known(end, tuple(names))
            weights[order[sender], order[receiver]] = weights[order[receiver], order[sender]] = weight
        return Graph(tuple(names), weights)

    @staticmethod
    def line(names: Sequence[str], weight: float = 1.0) -> Graph:
        """Graph in which each vehicle hears the next."""
        return Graph.from_edges(names, dict.fromkeys(pairwise(names), weight))

    @staticmethod
    def ring(names: Sequence[str], weight: float = 1.0) -> Graph:
        """Graph in which each vehicle hears the next, and the last the first.

        Raises FieldError for fewer than three.
        """
        if len(names) < 3:
            raise FieldError(f"names = {list(names)!r}; allowed in a ring: at least 3")
        return Graph.from_edges(names, dict.fromkeys(pairwise([*names, names[0]]), weight))

    @staticmethod
    def complete(names: Sequence[str], weight: float = 1.0) -> Graph:
        """Graph in which each vehicle hears every other."""
        return Graph.from_edges(names, dict.fromkeys(combinations(names, 2), weight))

    @staticmethod
    def random_connected(
        names: Sequence[str], chance: float, rng: np.random.Generator, least: float = 1.0, most: float = 1.0
    ) -> Graph:
        """Random tree, plus every other edge with a given probability; weights uniform from ``least`` to ``most``.

        ValueError for a probability outside 0 to 1, or weights that are not positive or not in order.
        """
        check(chance, "chance", 0.0, 1.0)
        check(least, "least weight", 0.0, open_low=True)
        check(most, "most weight", least)
        order = [names[k] for k in rng.permutation(len(names))]
        tree = {(order[k], order[int(rng.integers(k))]) for k in range(1, len(order))}
        edges = {}
        for pair in combinations(names, 2):
            drawn, weight = rng.random() < chance, float(rng.uniform(least, most))
            if drawn or pair in tree or pair[::-1] in tree:
                edges[pair] = weight
        return Graph.from_edges(names, edges)

    # ---- properties

    @cached_property
    def laplacian(self) -> Array:
        """Laplacian L = diag(d) - A (n, n)."""
        laplacian: Array = np.diag(self.weights.sum(axis=1)) - self.weights
        return laplacian

    @cached_property
    def eigenvalues(self) -> Array:
        """Eigenvalues (n,) of L, ascending; the first is 0."""
        values: Array = np.asarray(np.linalg.eigvalsh(self.laplacian), dtype=np.float64)
        return values

    @property
    def algebraic_connectivity(self) -> float:
        """Algebraic connectivity lambda_2; infinite for a single vehicle, which agrees with itself at once."""
        return float(self.eigenvalues[1]) if len(self.names) > 1 else math.inf

    @cached_property
    def hops(self) -> Array:
        """Number (n, n) of links on the shortest path between two vehicles; infinite if no path joins them."""
        hops: Array = np.asarray(shortest_path(self.weights > 0.0, unweighted=True), dtype=np.float64)
        return hops

    @property
    def diameter(self) -> float:
        """Number of links on the longest of the shortest paths; infinite if the graph is not connected."""
        return float(self.hops.max())

    @property
    def connected(self) -> bool:
        """True if there is a path between any two vehicles."""
        return math.isfinite(self.diameter)

    def checked_connected(self) -> Graph:
        """Return the graph.

        Raises ArgumentError, with the vehicles that the first one does not reach, if it is not connected.
        """
        if not self.connected:
            apart = [name for name, far in zip(self.names, self.hops[0], strict=True) if not math.isfinite(far)]
            raise ArgumentError(
                f"the graph is not connected: no way from {self.names[0]} to {', '.join(apart)}; allowed: a way "
                "between any two vehicles, or they do not agree"
            )
        return self

    def neighbours(self, name: str) -> tuple[str, ...]:
        """Names N_m of the neighbours of a vehicle, in the order of the names.

        Raises FieldError for an unknown name.
        """
        row = self._row(name)
        return tuple(other for other, weight in zip(self.names, row, strict=True) if weight > 0.0)

    def neighbourhood(self, name: str, planning_period: float = 5.0 / 3.0, deadline: float = math.inf) -> Neighbourhood:
        """Neighbourhood of a vehicle: its knowledge of the graph.

        Raises FieldError for an unknown name.
        """
        row = zip(self.names, self._row(name).tolist(), strict=True)
        return Neighbourhood(name, {other: weight for other, weight in row if weight > 0.0}, planning_period, deadline)

    def linked(self, sender: str, receiver: str, t: float) -> bool:
        """True if one vehicle hears the other, for ``mathnavi.sim.engine.network.Linked``; t [s] does not matter."""
        return receiver in self.names and bool(self._row(sender)[self.names.index(receiver)] > 0.0)

    def _row(self, name: str) -> Array:
        _check_known(name, self.names)
        row: Array = self.weights[self.names.index(name)]
        return row


def _entry(names: Sequence[str], row: Any, column: Any) -> str:
    return f"weights[{names[row]}, {names[column]}]"


def _check_known(name: str, names: tuple[str, ...]) -> None:
    if name not in names:
        raise FieldError(f"name = {name!r}; allowed: {', '.join(names)}")


@dataclass(frozen=True, eq=False)
class Switching:
    """Graphs of the same vehicles, each from its begin on; before the first begins, the first.

    An edge has the same weight in all graphs that have it, so that a vehicle has one weight for each neighbour.
    ValueError for no graph, times that do not increase or are not finite, other vehicles, or an edge with two weights.
    """

    pieces: tuple[tuple[float, Graph], ...]  # begin [s], graph

    def __post_init__(self) -> None:
        pieces = tuple((float(begin), graph) for begin, graph in self.pieces)
        object.__setattr__(self, "pieces", pieces)
        if not pieces:
            raise ArgumentError("pieces = []; allowed: at least one")
        begins = [begin for begin, _ in pieces]
        if not all(map(math.isfinite, begins)) or any(later <= earlier for earlier, later in pairwise(begins)):
            raise ArgumentError(f"begin = {begins!r}; allowed: finite and increasing")
        first = pieces[0][1]
        for begin, graph in pieces:
            if graph.names != first.names:
                raise ArgumentError(
                    f"names = {list(graph.names)!r} from {begin:g} s on; allowed: {list(first.names)!r}"
                )
        for begin, graph in pieces:
            both = (graph.weights > 0.0) & (self.union.weights != graph.weights)
            for row, column in zip(*np.nonzero(both), strict=True):
                raise ArgumentError(
                    f"weights[{first.names[row]}, {first.names[column]}] = {float(graph.weights[row, column])!r} from "
                    f"{begin:g} s on and {float(self.union.weights[row, column])!r} at another time; allowed: one "
                    "weight wherever the edge is there"
                )

    @property
    def names(self) -> tuple[str, ...]:
        """Names (n,) of the vehicles."""
        return self.pieces[0][1].names

    @cached_property
    def union(self) -> Graph:
        """Graph of all edges that exist at some time."""
        return Graph(self.names, np.maximum.reduce([graph.weights for _, graph in self.pieces]))

    @property
    def connected(self) -> bool:
        """True if the union is connected, which is enough for an agreement if its graphs keep recurring."""
        return self.union.connected

    def at(self, t: float) -> Graph:
        """Graph at t [s]."""
        return self.pieces[max(0, bisect_right([begin for begin, _ in self.pieces], t) - 1)][1]

    def checked_connected(self) -> Switching:
        """Return the switching graph.

        Raises ValueError if its union is not connected.
        """
        self.union.checked_connected()
        return self

    def neighbourhood(self, name: str, planning_period: float = 5.0 / 3.0, deadline: float = math.inf) -> Neighbourhood:
        """Neighbourhood of a vehicle: its knowledge of all edges that exist at some time."""
        return self.union.neighbourhood(name, planning_period, deadline)

    def linked(self, sender: str, receiver: str, t: float) -> bool:
        """True if one vehicle hears the other at t [s], for ``mathnavi.sim.engine.network.Linked``."""
        return self.at(t).linked(sender, receiver, t)
