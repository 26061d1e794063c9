"""A graph is what A.8.1 says, and one that is none is refused by the name of the culprit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.models.fleet.graph import Graph, Switching
from tests.fleet import NAMES, graphs

ABC = ("a", "b", "c")
N = 8


def weights(**entries: float) -> np.ndarray:
    """Weights of a line a, b, c with some entries changed, ab=2.0 for one."""
    a = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    for at, value in entries.items():
        a["abc".index(at[0]), "abc".index(at[1])] = value
    return a


@given(graphs())
def test_the_laplacian_is_symmetric_annihilates_ones_and_is_positive_semidefinite(graph: Graph) -> None:
    L = graph.laplacian
    np.testing.assert_array_equal(L, L.T)
    np.testing.assert_allclose(L @ np.ones(len(graph.names)), 0.0, atol=1e-12)
    assert graph.eigenvalues[0] == pytest.approx(0.0, abs=1e-9)
    assert graph.algebraic_connectivity > 1e-4
    assert graph.connected


@given(graphs(), st.data())
def test_the_connectivity_is_zero_exactly_where_the_graph_falls_apart(graph: Graph, data: st.DataObject) -> None:
    apart = data.draw(st.sets(st.sampled_from(graph.names), min_size=1, max_size=len(graph.names) - 1))
    inside = np.array([name in apart for name in graph.names])
    cut = Graph(graph.names, np.where(inside[:, None] == inside, graph.weights, 0.0))
    assert not cut.connected
    assert cut.diameter == math.inf
    assert cut.algebraic_connectivity == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(ValueError, match="the graph is not connected: no way from a to"):
        cut.checked_connected()
    assert graph.checked_connected() is graph


def test_the_named_graphs_have_the_eigenvalues_of_the_textbooks() -> None:
    line, ring, complete = Graph.line(NAMES), Graph.ring(NAMES), Graph.complete(NAMES)
    k = np.arange(N)
    np.testing.assert_allclose(line.eigenvalues, 2.0 - 2.0 * np.cos(np.pi * k / N), atol=1e-12)
    np.testing.assert_allclose(ring.eigenvalues, np.sort(2.0 - 2.0 * np.cos(2.0 * np.pi * k / N)), atol=1e-12)
    np.testing.assert_allclose(complete.eigenvalues, [0.0] + [float(N)] * (N - 1), atol=1e-12)
    assert [graph.diameter for graph in (line, ring, complete)] == [7, 4, 1]
    assert ring.neighbours("a") == ("b", "h")
    assert line.neighbours("a") == ("b",)
    assert Graph.line(("a",)).algebraic_connectivity == math.inf


def test_a_vehicle_knows_its_own_links_only() -> None:
    graph = Graph.from_edges(ABC, {("a", "b"): 2.0, ("c", "b"): 0.5})
    assert graph.neighbourhood("b", 2.0, 90.0).weights == {"a": 2.0, "c": 0.5}
    assert graph.neighbourhood("b").valency == 2.5
    assert (graph.neighbourhood("b", 2.0, 90.0).planning_period, graph.neighbourhood("b", 2.0, 90.0).deadline) == (
        2.0,
        90.0,
    )
    assert graph.linked("b", "c", 0.0)
    assert not graph.linked("a", "c", 0.0)
    assert not graph.linked("a", "z", 0.0)


def test_the_same_seed_draws_the_same_graph() -> None:
    one, other = (Graph.random_connected(NAMES, 0.3, np.random.default_rng(4), 0.5, 2.0) for _ in range(2))
    np.testing.assert_array_equal(one.weights, other.weights)
    drawn = one.weights[one.weights > 0.0]
    assert 0.5 <= drawn.min() < drawn.max() <= 2.0


def test_its_weights_cannot_be_changed() -> None:
    given_ = weights()
    graph = Graph(ABC, given_)
    given_[0, 1] = 5.0
    assert graph.weights[0, 1] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        graph.weights[0, 1] = 5.0


@pytest.mark.parametrize(
    ("names", "a", "said"),
    [
        (("a", "b", "a"), weights(), r"names = .*; allowed: each once, and not a again"),
        ((), np.empty((0, 0)), r"names = \[\]; allowed: at least one"),
        (ABC, np.zeros((3, 2)), r"weights of shape \(3, 2\); allowed: \(3, 3\)"),
        (ABC, weights(ab=math.nan), r"weights\[a, b\] = nan; allowed: a finite value >= 0"),
        (ABC, weights(bc=math.inf), r"weights\[b, c\] = inf"),
        (ABC, weights(ab=-1.0, ba=-1.0), r"weights\[a, b\] = -1\.0; allowed: a finite value >= 0"),
        (ABC, weights(cc=1.0), r"weights\[c, c\] = 1\.0; allowed: 0, no self-loop"),
        (ABC, weights(ab=2.0), r"weights\[a, b\] = 2\.0 and weights\[b, a\] = 1\.0; allowed: equal"),
    ],
)
def test_what_is_no_undirected_graph_is_refused(names: tuple[str, ...], a: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Graph(names, a)


def test_other_mistakes_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="allowed in a ring: at least 3"):
        Graph.ring(("a", "b"))
    with pytest.raises(ValueError, match="name = 'z'; allowed: a, b, c"):
        Graph.line(ABC).neighbours("z")
    with pytest.raises(ValueError, match="name = 'z'; allowed: a, b, c"):
        Graph.from_edges(ABC, {("a", "z"): 1.0})
    with pytest.raises(ValueError, match=r"chance = 1\.5"):
        Graph.random_connected(ABC, 1.5, rng)
    with pytest.raises(ValueError, match=r"least weight = 0\.0"):
        Graph.random_connected(ABC, 0.5, rng, 0.0)


# ---- switching

AB, BC = Graph.from_edges(ABC, {("a", "b"): 2.0}), Graph.from_edges(ABC, {("b", "c"): 1.0})


def test_each_graph_of_a_switching_one_holds_from_its_own_time_on() -> None:
    switching = Switching(((1.0, AB), (2.0, BC)))
    assert [switching.at(t) for t in (0.0, 1.0, 1.9, 2.0, 9.0)] == [AB, AB, AB, BC, BC]
    assert switching.linked("a", "b", 1.5)
    assert not switching.linked("a", "b", 2.5)
    assert switching.names == ABC
    assert switching.neighbourhood("b").weights == {"a": 2.0, "c": 1.0}


def test_a_switching_graph_is_connected_where_its_union_is() -> None:
    switching = Switching(((0.0, AB), (2.0, BC)))
    assert switching.connected
    assert switching.checked_connected() is switching
    with pytest.raises(ValueError, match="no way from a to c"):
        Switching(((0.0, AB),)).checked_connected()


def test_what_cannot_switch_is_refused() -> None:
    with pytest.raises(ValueError, match=r"pieces = \[\]"):
        Switching(())
    for begins in ((1.0, 1.0), (1.0, math.nan), (2.0, 1.0)):
        with pytest.raises(ValueError, match=r"begin = .*; allowed: finite and increasing"):
            Switching(tuple(zip(begins, (AB, BC), strict=True)))
    with pytest.raises(ValueError, match=r"names = \['x', 'y'\] from 1 s on; allowed: \['a', 'b', 'c'\]"):
        Switching(((0.0, AB), (1.0, Graph.line(("x", "y")))))
    with pytest.raises(ValueError, match=r"weights\[a, b\] = 1\.0 from 1 s on and 2\.0 at another time"):
        Switching(((0.0, AB), (1.0, Graph.line(ABC))))
