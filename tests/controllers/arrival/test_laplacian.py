"""The Laplacian protocol behaves as the theory predicts, for every length of a round."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.arrival.inbox import ConsensusPayload
from mathnavi.controllers.arrival.laplacian import DELTA, LaplacianConfig, LaplacianConsensus, is_outlier
from mathnavi.interfaces.signals import Array, Message
from mathnavi.models.fleet.graph import Graph
from mathnavi.sim.engine.network import DelayedLinks, IdealNetwork, LossyLinks, Network
from mathnavi.studies.fleet.message_exchange import exchanged
from tests.fleet import NAMES, graphs, laplacians, started, starts_for

H = 1.0 / 60.0
scalings = st.floats(-2.0, 4.0).map(lambda exponent: 10.0**exponent)  # rounds from very fine to far too coarse


def rounds_of(graph: Graph, starts: Array, scaling: float, rounds: int = 12, network: Network | None = None) -> Array:
    parts = started(laplacians(graph, LaplacianConfig(scaling=scaling)), starts)
    return exchanged(parts, graph, network or IdealNetwork(graph.names), rounds)


@settings(max_examples=40)
@given(graphs(), st.integers(0, 2**32 - 1), scalings)
def test_disagreement_never_grows_and_the_average_is_kept(graph: Graph, seed: int, scaling: float) -> None:
    values = rounds_of(graph, starts_for(graph, seed), scaling)
    apart = np.linalg.norm(values - values.mean(axis=1, keepdims=True), axis=1)
    assert (np.diff(apart) <= 1e-9).all()
    assert (np.diff(np.ptp(values, axis=1)) <= 1e-9).all()
    assert apart[-1] < apart[0]
    np.testing.assert_allclose(values.mean(axis=1), values[0].mean(), atol=1e-9)


@settings(max_examples=20)
@given(graphs(), st.integers(0, 2**32 - 1))
def test_in_short_rounds_it_is_the_exponential_of_the_laplacian(graph: Graph, seed: int) -> None:
    starts = starts_for(graph, seed)
    s = 1e-3 / (graph.weights.sum(axis=1).max() * H)
    values = rounds_of(graph, starts, s, 40)
    eigenvalues, modes = np.linalg.eigh(graph.laplacian)
    exact = modes @ (np.exp(-s * 40 * H * eigenvalues) * (modes.T @ starts))
    np.testing.assert_allclose(values[-1], exact, atol=1e-2)
    assert np.abs(values[-1] - starts).max() > 0.5 or np.ptp(starts) < 50.0


@settings(max_examples=20)
@given(graphs(), st.integers(0, 2**32 - 1), scalings, st.floats(0.0, 0.6), st.floats(0.0, 0.2))
def test_with_loss_and_delay_all_stay_within_the_starts(
    graph: Graph, seed: int, scaling: float, loss: float, delay: float
) -> None:
    starts, rng = starts_for(graph, seed), np.random.default_rng(seed)
    network = LossyLinks(DelayedLinks(IdealNetwork(graph.names), 0.0, delay, rng), loss, 0.2, rng)
    values = rounds_of(graph, starts, scaling, 25, network)
    assert starts.min() <= values.min()
    assert values.max() <= starts.max()


def test_compared_with_itself_then_it_keeps_the_average_and_is_unstable_beyond_the_bound() -> None:
    graph = Graph.from_edges(NAMES[:4], {("a", "b"): 1.0, ("b", "c"): 2.0, ("b", "d"): 0.5})
    s = 0.05 / (graph.eigenvalues[-1] * H)
    bound = math.pi / (2.0 * s * graph.eigenvalues[-1])
    last = {}
    for fraction in (0.7, 1.3):
        config = LaplacianConfig(scaling=s, own="then", memory=2.0 * bound)
        parts = started(laplacians(graph, config), [100.0, 120.0, 90.0, 105.0])
        delay = fraction * bound
        network = DelayedLinks(IdealNetwork(graph.names), delay, delay, np.random.default_rng(0))
        values = exchanged(parts, graph, network, 600)
        np.testing.assert_allclose(values.mean(axis=1), values[0].mean(), atol=1e-6)
        last[fraction] = np.ptp(values[-60:])
    assert last[0.7] < 1.0
    assert last[1.3] > 100.0


def test_a_neighbour_that_falls_silent_is_forgotten() -> None:
    part = LaplacianConsensus(LaplacianConfig(memory=0.1), Graph.line(("a", "b")).neighbourhood("a"))
    part.start(0.0)
    part.exchange(0.0, [])
    moved = []
    for k in range(1, 20):
        part.exchange(k * H, [Message(0.0, "b", "", ConsensusPayload(10.0, 1.0))])
        moved.append(part.value)
    assert moved[4] < moved[5] == moved[-1] < 10.0  # 6 rounds are .1 s


def test_a_second_start_forgets_what_was_said_before() -> None:
    graph = Graph.line(("a", "b"))
    parts = started(laplacians(graph, LaplacianConfig()), [80.0, 100.0])
    network = IdealNetwork(graph.names)
    exchanged(parts, graph, network, 60)
    started(parts, [90.0, 70.0])
    again = exchanged(parts, graph, network, 60, begin=60 * H)
    np.testing.assert_array_equal(again[0], [90.0, 70.0])
    np.testing.assert_allclose(again.mean(axis=1), 80.0, atol=1e-9)


# ---- outliers (A.14)


@given(st.floats(10.0, 300.0), st.floats(0.5, 2.0), st.floats(0.0, 1000.0))
def test_who_is_an_outlier_does_not_depend_on_where_the_clock_begins(own: float, ratio: float, now: float) -> None:
    neighbourhood = Graph.line(("a", "b")).neighbourhood("a", planning_period=1.0)
    found = []
    for zero in (0.0, now):
        part = LaplacianConsensus(LaplacianConfig(scaling=1e6), neighbourhood)
        part.start(zero + own, zero)
        part.exchange(zero, [])
        for k in range(1, 40):
            part.exchange(zero + k * H, [Message(zero + k * H, "b", "", ConsensusPayload(zero + ratio * own, 1.0))])
        part.start(zero + own, zero + 1.0)
        found.append(part.outlier)
    if abs(abs((ratio * own - 1.0) / own - 1.0) - DELTA) > 1e-6:
        assert found == [is_outlier(ratio * own, own, 1.0)] * 2


LINE = Graph.line(NAMES[:5])


def periods(owns: list[list[float]], rounds: int = 900) -> tuple[Array, dict[str, LaplacianConsensus]]:
    """Values of the vehicles on a line after each planning period (k, 5)."""
    config = LaplacianConfig(period=1.0 / 600.0, scaling=100.0)
    parts = {name: LaplacianConsensus(config, LINE.neighbourhood(name)) for name in LINE.names}
    network, ends = IdealNetwork(LINE.names), []
    for k, own in enumerate(owns):
        started(parts, own)
        ends.append(exchanged(parts, LINE, network, rounds - 1, begin=k * rounds / 600.0)[-1])
    return np.array(ends), parts


def test_an_outlier_follows_keeps_the_graph_connected_and_comes_back() -> None:
    far, near = [100.0, 90.0, 180.0, 110.0, 104.0], [100.0, 90.0, 101.0, 110.0, 104.0]
    ends, parts = periods([far, far])
    assert [part.outlier for part in parts.values()] == [False, False, True, False, False]
    assert ends[0, 0] == pytest.approx(np.mean(far), abs=0.01)  # nobody knew yet
    np.testing.assert_allclose(ends[1], 101.0, atol=0.5)  # the others' average, on both sides
    assert np.ptp(ends[1]) < 1e-3
    ends, parts = periods([far, near, near])
    assert not parts["c"].outlier
    np.testing.assert_allclose(ends[2], 101.0, atol=1e-3)


def test_one_that_is_far_enough_makes_outliers_of_all_and_they_keep_what_they_hold() -> None:
    """As printed: from the average with it on, all others are as far."""
    far = [100.0, 90.0, 400.0, 110.0, 104.0]
    ends, parts = periods([far, far, far])
    assert all(part.outlier for part in parts.values())
    np.testing.assert_allclose(ends[1:], np.mean(far), atol=0.01)


def test_a_vehicle_without_an_estimate_follows() -> None:
    ends, parts = periods([[100.0, 90.0, math.nan, 110.0, 104.0]])
    assert parts["c"].outlier
    np.testing.assert_allclose(ends[0], 101.0, atol=0.5)


def test_as_printed_all_that_agree_are_outliers_in_the_last_seconds() -> None:
    h = 5.0 / 3.0
    assert not is_outlier(5.6, 5.6, h)
    assert is_outlier(5.5, 5.5, h)
    assert is_outlier(0.0, 0.0, h)
