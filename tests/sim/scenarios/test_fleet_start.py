"""Slots are assigned so that vehicles on straight lines, flown in one time, keep apart."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.interfaces.errors import MissionError
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.scenarios.fleet_fields import SimultaneousArrivalConfig
from mathnavi.sim.scenarios.fleet_start import (
    _assigned,
    _check_starts_apart,
    _checked_ring,
    _drawn_target,
    _NoFleetError,
    _slots,
)


def flight_mission(terrain: HeightField) -> FlightMission:
    return FlightMission(terrain, (0.0, 0.0, 100.0), (0.0, 0.0, 100.0))


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


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 40), st.floats(0.1, 0.95))
def test_a_drawn_target_has_all_slots_on_the_map_where_any_has(seed: int, n: int, share: float) -> None:
    plain = HeightField(np.zeros((11, 11)), 1000.0)
    radius = 0.5 * share * plain.width
    config = SimultaneousArrivalConfig(vehicles=n, slot_spacing=2.0 * radius * math.sin(math.pi / n), separation=2.0)
    common = flight_mission(plain)
    ring = _checked_ring(config, plain)
    target = _drawn_target(config, common, ring, np.random.default_rng(seed))
    slots = _slots(common, target, ring)
    assert all(plain.contains(x, y) for x, y, _ in slots)
    assert math.dist(slots[0], slots[1]) == pytest.approx(config.slot_spacing)


PLAIN = HeightField(np.zeros((11, 11)), 1000.0)


@pytest.mark.parametrize("target", [None, (5000.0, 5000.0, 100.0)])
def test_the_spacing_that_an_error_allows_is_one_that_fits(target: tuple[float, float, float] | None) -> None:
    wide = SimultaneousArrivalConfig(vehicles=12, slot_spacing=1e4, target=target)
    with pytest.raises(MissionError, match=r"slot_spacing = 10000\.0: the ring of 12 slots") as caught:
        _checked_ring(wide, PLAIN)
    allowed = re.search(r"<= (\d+) m", str(caught.value))
    assert allowed is not None
    fitting = dataclasses.replace(wide, slot_spacing=float(allowed[1]))
    ring = _checked_ring(fitting, PLAIN)
    if target is None:
        _drawn_target(fitting, flight_mission(PLAIN), ring, np.random.default_rng(0))


def test_no_spacing_is_allowed_that_vehicles_may_not_have() -> None:
    crowd = SimultaneousArrivalConfig(vehicles=256, slot_spacing=800.0, separation=150.0)
    with pytest.raises(MissionError, match=r"the ring of 256 slots is .* allowed: fewer vehicles$"):
        _checked_ring(crowd, PLAIN)  # slots less than 123 m apart would fit


def test_starts_that_are_too_close_are_named() -> None:
    config = SimultaneousArrivalConfig(vehicles=3, separation=200.0)
    named = r"start of vehicle_1 and of vehicle_3 are 150\.00 m apart; allowed: >= 200 m"
    with pytest.raises(_NoFleetError, match=named):
        _check_starts_apart(config, [(0.0, 0.0, 0.0), (900.0, 0.0, 0.0), (0.0, 150.0, 0.0)])
