"""Slots are assigned so that vehicles on straight lines, flown in one time, keep apart."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.sim.scenarios.fleet_start import _assigned


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 12))
def test_assigned_slots_keep_straight_lines_apart(seed: int, n: int) -> None:
    starts, slots = np.random.default_rng(seed).uniform(0.0, 1e4, (2, n, 3))
    goals = np.array(_assigned("least_squares", [tuple(x) for x in starts], [tuple(g) for g in slots]))
    assert sorted(map(tuple, goals)) == sorted(map(tuple, slots))
    for i in range(n):
        for j in range(i):
            apart, after = starts[i] - starts[j], goals[i] - goals[j]
            assert apart @ after >= -1e-6
            share = np.linspace(0.0, 1.0, 21)[:, None]
            least = np.linalg.norm((1.0 - share) * apart + share * after, axis=1).min()
            assert least >= min(np.linalg.norm(apart), np.linalg.norm(after)) / np.sqrt(2.0) - 1e-6


def test_slots_in_order_are_those_given() -> None:
    slots = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    assert _assigned("in_order", slots[::-1], slots) == slots
