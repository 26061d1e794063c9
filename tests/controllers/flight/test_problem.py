"""The times and places at which the problem samples its constraints, on grids of every shape, against motion integrated
arc by arc."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.controllers.flight.problem import POINTS_ON_MANOEUVRE, Parameters, proportional
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.dynamics import flow

SPEED, ACCELERATION = 300.0, 40.0
lengths_of_arcs = st.lists(st.floats(0.05, 12.0), min_size=1, max_size=12).map(tuple)


def parameters(lengths: tuple[float, ...]) -> Parameters:
    return Parameters(lengths, SPEED, ACCELERATION, beta=100.0, clearance=75.0)


def looked_at(p: Parameters, start: Array, accelerations: Array, climb: float) -> Array:
    """(Q, 3) [m] by flying arc after arc, then the manoeuvre; then p_N and where a last arc at rest would lead."""
    x, places = start, []
    for a, length, count in zip(accelerations, p.lengths, p.points, strict=True):
        places += [flow(x, a, length * part / count)[:3] for part in range(1, count + 1)]
        x = flow(x, a, length)
    braking = (np.array([0.0, 0.0, climb]) - x[3:]) / p.manoeuvre_duration
    for part in range(1, POINTS_ON_MANOEUVRE + 1):
        places.append(flow(x, braking, p.manoeuvre_duration * part / POINTS_ON_MANOEUVRE)[:3])
    return np.array([*places, x[:3], flow(x, np.zeros(3), p.lengths[-1])[:3]])


@given(lengths=lengths_of_arcs, seed=st.integers(0, 2**32 - 1))
def test_the_samples_lie_where_the_motion_leads(lengths: tuple[float, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    p = parameters(lengths)
    start = np.concatenate([rng.uniform(-1e4, 1e4, 3), rng.uniform(-200.0, 200.0, 3)])
    accelerations, climb = rng.uniform(-20.0, 20.0, (p.arcs, 3)), rng.uniform(0.0, 100.0)
    s = p.matrices
    places = start[:3] + s.base[:, None] * start[3:] + s.weights @ accelerations
    places[:, 2] += s.climbs * climb
    np.testing.assert_allclose(places, looked_at(p, start, accelerations, climb), rtol=1e-10, atol=1e-6)
    ends = np.cumsum(lengths)
    np.testing.assert_allclose(s.middles, ends - 0.5 * s.lengths, rtol=1e-12)


@given(h=st.floats(0.05, 12.0), arcs=st.integers(1, 40))
def test_equal_arcs_begin_at_whole_multiples_of_their_length_to_the_last_bit(h: float, arcs: int) -> None:
    p = parameters(arcs * (h,))
    s = p.matrices
    np.testing.assert_array_equal(s.middles, (np.arange(arcs) + 0.5) * h)
    np.testing.assert_array_equal(s.base[: 4 * arcs], np.arange(1, 4 * arcs + 1) / 4.0 * h)


@given(ratio=st.floats(0.7, 1.4), arcs=st.integers(2, 12), horizon=st.floats(2.0, 60.0))
def test_on_a_stretched_grid_no_path_between_two_points_is_longer_than_125_m(
    ratio: float, arcs: int, horizon: float
) -> None:
    p = parameters(proportional([ratio**i for i in range(arcs)], horizon))
    if ratio != 1.0:
        assert all(length * SPEED / count <= 125.0 + 1e-9 for length, count in zip(p.lengths, p.points, strict=True))


@given(ratio=st.floats(0.5, 2.0), arcs=st.integers(1, 12), duration=st.floats(0.1, 100.0))
def test_proportional_arcs_last_as_long_as_asked_and_keep_their_ratio(ratio: float, arcs: int, duration: float) -> None:
    lengths = proportional([3.0 * ratio**i for i in range(arcs)], duration)
    assert math.fsum(lengths) == pytest.approx(duration, rel=1e-12)
    np.testing.assert_allclose(np.divide(lengths[1:], lengths[:-1]), ratio, rtol=1e-12)


def test_equal_shares_divide_a_duration_as_a_quotient_does() -> None:
    assert proportional(12 * [1.7], 19.3) == 12 * (19.3 / 12,)


@given(lengths=lengths_of_arcs)
def test_the_manoeuvre_can_end_any_speed(lengths: tuple[float, ...]) -> None:
    p = parameters(lengths)
    assert p.manoeuvre_duration * ACCELERATION >= SPEED * (1.0 - 1e-8)
    assert p.manoeuvre_duration <= SPEED / ACCELERATION + lengths[0]
