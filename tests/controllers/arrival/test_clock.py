"""Clocks that nobody synchronises agree, up to what the delays' asymmetry allows."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.arrival.clock import ClockConfig, ClockConsensus, ClockPayload
from mathnavi.interfaces.signals import Array, Message
from mathnavi.models.fleet.graph import Graph
from mathnavi.sim.engine.network import DelayedLinks, IdealNetwork, Network
from mathnavi.studies.fleet.message_exchange import ClockCase, clocks_agree, exchanged
from tests.fleet import NAMES

PERIOD = 0.01


def corrected(graph: Graph, offsets: Array, rates: Array, network: Network, seconds: float, **fields: float) -> Array:
    """Final times of the corrected clocks (n,) [s]."""
    config = ClockConfig(period=PERIOD, **fields)
    parts = {name: ClockConsensus(config, graph.neighbourhood(name)) for name in graph.names}
    clocks = {
        name: (lambda t, o=float(o), r=float(r): t * (1.0 + r) + o)
        for name, o, r in zip(graph.names, offsets, rates, strict=True)
    }
    values = exchanged(parts, graph, network, round(seconds / PERIOD), clocks=clocks)
    return np.array([clocks[name](seconds) for name in graph.names]) + values[-1]


@settings(max_examples=4)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.01, 0.034]))
def test_a_delay_that_is_the_same_both_ways_drops_out(seed: int, delay: float) -> None:
    rng = np.random.default_rng(seed)
    graph = Graph.random_connected(NAMES[:4], 0.3, rng)
    offsets = rng.uniform(-20.0, 20.0, 4)
    network = DelayedLinks(IdealNetwork(graph.names), delay, delay, rng)
    shown = corrected(graph, offsets, np.zeros(4), network, 3.0) - 3.0
    assert np.ptp(shown) < 1e-5 * np.ptp(offsets)
    assert offsets.min() < shown.mean() < offsets.max()
    if not delay:
        assert shown.mean() == pytest.approx(offsets.mean(), abs=1e-6)  # no clock leads


def test_an_asymmetric_delay_leaves_half_of_its_difference_on_each_link() -> None:
    found = clocks_agree(ClockCase("", (0.03, 0.03), (0.01, 0.01), n=3))
    assert found["last"] == pytest.approx(2 * 0.01, rel=1e-6)
    assert found["first"] > 1.0


def test_agreeing_on_rates_takes_the_drift_out() -> None:
    graph, offsets, rates = Graph.complete(NAMES[:3]), np.array([0.0, 1.0, -2.0]), np.array([1e-3, -1e-3, 0.0])
    drifting, agreed = (
        np.ptp(
            corrected(graph, offsets, rates, IdealNetwork(graph.names), 10.0, scaling=4.0, rate_scaling=s, baseline=0.5)
        )
        for s in (0.0, 1.0)
    )
    assert drifting == pytest.approx(2e-3 / (4.0 * 3.0), rel=0.1)  # rho / (s lambda_2)
    assert agreed < 0.3 * drifting


def test_a_round_trip_that_took_too_long_or_came_before_it_was_sent_is_not_used() -> None:
    part = ClockConsensus(ClockConfig(memory=0.25), Graph.line(("a", "b")).neighbourhood("a"))
    part.exchange(10.0, [])
    for k, (sent, taken) in enumerate([(9.0, 10.04), (10.0, 9.9)]):
        t = 10.05 + 0.01 * k
        part.exchange(t, [Message(t - 0.01, "b", "", ClockPayload(5.0, 0.0, 1.0, {"a": (sent, taken)}))])
    assert part.refused == {"round trip": 2}
    assert part.value == 0.0
    part.exchange(10.1, [Message(10.09, "b", "", ClockPayload(5.0, 0.0, 1.0, {"a": (10.05, 10.07)}))])
    assert part.value > 0.0


def test_a_clock_that_is_further_off_than_clocks_are_is_not_followed() -> None:
    part = ClockConsensus(ClockConfig(apart=60.0), Graph.line(("a", "b")).neighbourhood("a"))
    part.exchange(1000.0, [])
    payload = ClockPayload(0.0, 0.0, 1.0, {"a": (1000.0, 1000.0)})
    part.exchange(1000.1, [Message(1061.0, "b", "", payload)])
    part.exchange(1000.2, [Message(900.0, "b", "", payload)])
    part.exchange(1000.2, [Message(1000.1, "b", "", ClockPayload(math.nan, 0.0, 1.0, {}))])
    assert part.refused == {"from the future": 1, "late": 1, "garbage": 1}
    assert part.value == 0.0
