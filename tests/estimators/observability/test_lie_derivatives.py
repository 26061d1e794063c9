"""Ranks are those of the theory, and the differentials are those of what is measured."""

from __future__ import annotations

import math

import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.observability.lie_derivatives import (
    ControlAffineSystem,
    codistribution,
    range_system,
    rank,
    ray_ends,
    singular_values,
)
from mathnavi.estimators.observability.range_outputs import RangeOutputs
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from mathnavi.models.textbook.library import camera_and_flags
from tests.estimators.observability.fields import BEAN, CIRCLE, CURVES, ELLIPSE, THESIS, THESIS_START, sensors


def rank_under(outputs: RangeOutputs, x: Array, u: tuple[float, float], order: int) -> int:
    system = range_system(outputs)
    return rank(codistribution(system, [system.held(u)], order), x, ray_ends(outputs, x))


def flags(distance_known: bool) -> ControlAffineSystem:
    system = camera_and_flags(distance_known)
    return ControlAffineSystem.from_functions(system.f, system.h, len(system.states), len(system.inputs))


def test_a_linear_system_has_the_rank_of_its_observability_matrix() -> None:
    A, C = np.diag([1.0, 2.0, 2.0]) + np.eye(3, k=1), np.array([[1.0, 0.0, 0.0]])
    system = ControlAffineSystem.from_functions(lambda x, u: casadi.DM(A) @ x, lambda x, u: casadi.DM(C) @ x, 3, 1)
    for order in range(3):
        matrix = np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(order + 1)])
        found = codistribution(system, [system.drift], order)
        np.testing.assert_allclose(np.array(found(np.ones(3), [])), matrix)
        assert rank(found, np.ones(3)) == order + 1


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_differentials_are_those_of_the_ranges_and_their_rates(curve: Curve, seed: int) -> None:
    rng, u = np.random.default_rng(seed), (0.6, -0.8)
    outputs = sensors(curve, *rng.uniform(-180.0, 180.0, 2))
    x = curve.draw(rng, 0.5)
    if np.abs(outputs.at(x)[1]).max() > 30.0:  # a ray nearly grazes, and differences are no derivative
        return
    system = range_system(outputs)
    found = np.array(codistribution(system, [system.held(u)], 1)(x, ray_ends(outputs, x)))
    e = 1e-6 * np.eye(3)
    rates = np.column_stack([(outputs.rate(x + d, u) - outputs.rate(x - d, u)) / 2e-6 for d in e])
    np.testing.assert_allclose(found[:2], outputs.at(x)[1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found[2:], rates, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("curve", [ELLIPSE, BEAN], ids=["ellipse", "bean"])
def test_standing_still_shows_as_many_directions_as_there_are_sensors(curve: Curve) -> None:
    rng = np.random.default_rng(0)
    for degrees in ((0.0,), (-90.0, -45.0), (0.0, 120.0, 240.0), (0.0, 90.0, 180.0, 270.0)):
        outputs = sensors(curve, *degrees)
        x = curve.draw(rng, 0.3)
        assert rank_under(outputs, x, (0.0, 0.0), order=3) == min(len(degrees), 3)


def test_two_sensors_need_one_derivative_and_one_sensor_two() -> None:
    for u in ((0.5, 0.0), (0.0, 1.0), (0.5, 0.5)):
        assert rank_under(THESIS, THESIS_START, u, order=1) == 3
    ahead = sensors(ELLIPSE, 0.0)
    assert rank_under(ahead, THESIS_START, (0.5, 0.5), order=1) == 2
    assert rank_under(ahead, THESIS_START, (0.5, 0.5), order=2) == 3
    assert rank_under(ahead, THESIS_START, (0.5, 0.0), order=4) == 1  # it sees one point only
    system = range_system(ahead)
    assert rank(codistribution(system, system.fields, 2), THESIS_START, ray_ends(ahead, THESIS_START)) == 3


def test_in_a_circle_the_rotation_is_never_seen() -> None:
    outputs, x = sensors(CIRCLE, 0.0, 70.0, 200.0), np.array([0.7, 0.2, 0.3])
    system = range_system(outputs)
    found = codistribution(system, system.fields, 2)
    assert rank(found, x, ray_ends(outputs, x)) == 2
    matrix = np.array(found(x, ray_ends(outputs, x)))
    np.testing.assert_allclose(matrix @ [-x[1], x[0], 1.0], 0.0, atol=1e-9)


@pytest.mark.parametrize(("distance_known", "full"), [(True, 3), (False, 4)])
def test_two_flags_need_a_robot_that_moves(distance_known: bool, full: int) -> None:
    """Example C.2: u_1 != 0, and along the axis of the flags an arc."""
    system = flags(distance_known)
    x = np.array([0.7, 1.3, 0.4, 4.0])[:full]
    on_axis = np.array([0.7, 0.0, 0.0, 4.0])[:full]
    for u, order, generic, along in (
        ((0.0, 0.0), 3, 2, 2),
        ((0.0, 1.0), 3, 2, 2),
        ((0.3, 0.0), 1, full, 2),
        ((0.3, 0.0), 3, full, 2),
        ((0.3, 0.6), 1, full, 2),
        ((0.3, 0.6), 2, full, full),
    ):
        differentials = codistribution(system, [system.held(u)], order)
        assert (rank(differentials, x), rank(differentials, on_axis)) == (generic, along)


def test_singular_values_of_what_is_not_defined_are_not_finite() -> None:
    system = flags(True)
    nowhere = codistribution(system, system.fields, 0)
    assert np.isnan(singular_values(nowhere, np.zeros(3))).all()
    with pytest.raises(ValueError, match="have no derivative there"):
        rank(nowhere, np.zeros(3))
    short = singular_values(codistribution(system, system.fields, 0), np.array([0.7, 1.3, 0.4]))
    assert short.shape == (3,)
    assert short[2] == 0.0


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="not affine"):
        ControlAffineSystem.from_functions(lambda x, u: u * u, lambda x, u: x, 1, 1)
    with pytest.raises(ValueError, match="depends on it"):
        ControlAffineSystem.from_functions(lambda x, u: x, lambda x, u: x + u, 1, 1)
    system = range_system(THESIS)
    for fields, order in (([], 1), ([system.drift], -1)):
        with pytest.raises(ValueError, match="allowed: an order >= 0 and a field or more"):
            codistribution(system, fields, order)
    assert math.isfinite(singular_values(codistribution(system, system.fields, 0), THESIS_START, [1.0, 2.0])[0])
