"""Plans in the pitch plane and in the yaw plane, flown together in space, are followed exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.controllers.missile.optimiser import flown
from mathnavi.controllers.missile.planes import inputs_between, joined, split
from mathnavi.controllers.missile.shooting import Solved
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL
from mathnavi.models.missile.dynamics import Body

BODY = Body(axial_inertia=30.0)  # thick enough for the products of inertia to matter


def state(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    low = [20.0, -30.0, -20.0, -1.0, -1.0, -1.6, -1.2, -900.0, -900.0, -900.0]
    high = [200.0, 30.0, 20.0, 1.0, 1.0, 1.6, 1.2, 900.0, 900.0, 0.0]
    return rng.uniform(low, high)


def planned(seed: int, duration: float) -> tuple[Solved, Solved]:
    """One interval in each plane with forces and moments held."""
    rng = np.random.default_rng(seed)
    pitch, yaw = split(state(seed))
    forces = rng.uniform(-1.0, 1.0, (1, 3)) * (3e3, 2e4, 200.0), rng.uniform(-1.0, 1.0, (1, 2)) * (1e4, 200.0)
    nodes, nothing = np.array([0.0, 1.0]), np.empty(0)
    return tuple(
        Solved(np.stack([x, x]), u, nodes, duration, nothing, np.nan, 0)
        for x, u in zip((pitch, yaw), forces, strict=True)
    )


@given(st.integers(0, 10_000))
def test_a_motion_falls_apart_into_two_and_two_make_it_again(seed: int) -> None:
    x = state(seed)
    np.testing.assert_allclose(joined(*split(x)), x, atol=1e-9)


def test_the_pitch_plane_is_a_pitch_motion_without_yaw() -> None:
    pitch, yaw = split(PLANAR.in_space(np.array([120.0, 3.0, 0.2, -0.4, 50.0, -80.0])))
    np.testing.assert_array_equal(pitch, [120.0, 3.0, 0.2, -0.4, 50.0, -80.0])
    np.testing.assert_array_equal(yaw, 0.0)


@given(st.integers(0, 10_000))
def test_each_plane_moves_as_if_there_were_no_other(seed: int) -> None:
    pitch, yaw = planned(seed, 1e-3)
    _, u = inputs_between(pitch, yaw, 1, BODY)
    # Rates of both planes' states along the spatial motion, by differences about the middle of the interval.
    h = 0.5e-3
    start = joined(pitch.x[0], yaw.x[0])
    middle = flown(start, np.array([0.0, h]), u, SPATIAL, BODY)[-1]
    ends = [flown(middle, np.array([0.0, dt]), u, SPATIAL, BODY)[-1] for dt in (-h, h)]
    rates = [(after - before) / (2.0 * h) for before, after in zip(split(ends[0]), split(ends[1]), strict=True)]
    in_pitch, (V, r, _, _) = split(middle)
    F_2, swing = yaw.u[0]
    np.testing.assert_allclose(rates[0], PLANAR.rate(in_pitch, pitch.u[0], BODY), rtol=1e-4, atol=2e-3)
    np.testing.assert_allclose(rates[1], [F_2 / BODY.mass, swing / BODY.inertia, r, V], rtol=1e-4, atol=2e-3)


def test_the_error_of_holding_inputs_along_the_body_falls_with_the_square_of_the_parts() -> None:
    pitch, yaw = planned(3, 0.4)
    exact = PLANAR.flow(pitch.x[0], pitch.u[0], 0.4, BODY)
    errors = []
    for parts in (2, 4, 8):
        t, u = inputs_between(pitch, yaw, parts, BODY)
        assert t[-1] == pytest.approx(0.4)
        assert len(u) == parts
        end, _ = split(flown(joined(pitch.x[0], yaw.x[0]), t, u, SPATIAL, BODY)[-1])
        errors.append(np.linalg.norm((end - exact)[4:]))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.2)
