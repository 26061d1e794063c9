"""A graph that changes with time: links come and go as vehicles fly out of each other's reach and back."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.models.fleet.graph import Graph, Node


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

    def node(self, name: str, planning_period: float = 5.0 / 3.0, deadline: float = math.inf) -> Node:
        """Node of a vehicle: its knowledge of all edges that exist at some time."""
        return self.union.node(name, planning_period, deadline)

    def linked(self, sender: str, receiver: str, t: float) -> bool:
        """True if one vehicle hears the other at t [s], for ``mathnavi.sim.engine.network.Linked``."""
        return self.at(t).linked(sender, receiver, t)
