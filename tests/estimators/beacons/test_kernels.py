"""The kernels of the bank: gradients and second derivatives of readings, and motion and merging of Gaussians."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from mathnavi.estimators.beacons.kernels import STATES, condition, expected, merged, predict, transition
from mathnavi.interfaces.signals import Array

PLACES = np.array([[0.0, 0.0], [6.0, 1.0], [-2.0, 5.0]])
KNOWN, SECOND = np.array([-1, -1, -1]), np.array([-1, STATES, -1])  # where in the state the places are
STATE = some.tuples(*(some.floats(-9.0, 9.0),) * 2, some.floats(-3.1, 3.1), *(some.floats(-0.2, 0.2),) * 3)


def reading(x: Array, kind: int, i: int) -> float:
    value: float = expected(x, kind, i, PLACES, SECOND)[0]
    return value


@given(STATE, some.integers(0, 2), some.integers(1, 2))
def test_gradient_and_second_derivative_are_those_of_the_reading(state: tuple[float, ...], kind: int, i: int) -> None:
    x = np.array([*state, *PLACES[1]])  # that of beacon 1 is not known
    if min(math.hypot(*(place - x[:2])) for place in PLACES) < 0.5:
        return
    _, H, D, _ = expected(x, kind, i, PLACES, SECOND)
    positions = [0, 1, STATES, STATES + 1]
    for k, e in enumerate(1e-5 * np.eye(len(x))):
        turned = reading(x + e, kind, i) - reading(x - e, kind, i)
        slope = (turned + math.pi) % (2.0 * math.pi) - math.pi if kind == 1 else turned
        assert slope / 2e-5 == pytest.approx(H[k], abs=1e-5)
        if k in positions:
            ahead, behind = (expected(x + sign * e, kind, i, PLACES, SECOND)[1] for sign in (1.0, -1.0))
            assert (ahead - behind)[positions] / 2e-5 == pytest.approx(D[k, positions], abs=1e-4)


@given(STATE, some.floats(-2.0, 2.0), some.floats(-2.0, 2.0), some.floats(0.01, 0.5))
def test_the_jacobian_of_a_transition_is_that_of_the_motion(
    state: tuple[float, ...], u_1: float, u_2: float, h: float
) -> None:
    x = np.array(state)
    _, A, Q = transition(x, u_1, u_2, h, 0.1, 0.2)
    for k, e in enumerate(1e-6 * np.eye(STATES)):
        ahead, behind = (transition(x + sign * e, u_1, u_2, h, 0.1, 0.2)[0] for sign in (1.0, -1.0))
        change = ahead - behind
        change[2] = (change[2] + math.pi) % (2.0 * math.pi) - math.pi
        assert change / 2e-6 == pytest.approx(A[:, k], abs=1e-6)
    assert np.linalg.eigvalsh(Q).min() > -1e-12
    assert Q[2, 2] == pytest.approx(0.2 * h)


def test_two_short_steps_have_the_noise_of_a_long_one() -> None:
    x, P = np.array([[1.0, 2.0, 0.4, 0.0, 0.0, 0.0]]), np.zeros((1, STATES, STATES))
    twice, whole = (x.copy(), P.copy()), (x.copy(), P.copy())
    predict(*twice, 1.0, 0.0, 0.1, 0.3, 0.05)
    predict(*twice, 1.0, 0.0, 0.3, 0.3, 0.05)
    predict(*whole, 1.0, 0.0, 0.4, 0.3, 0.05)
    assert twice[0] == pytest.approx(whole[0])
    along = np.array([math.cos(0.4), math.sin(0.4)])
    assert along @ twice[1][0, :2, :2] @ along == pytest.approx(along @ whole[1][0, :2, :2] @ along)
    assert twice[1][0, 2, 2] == pytest.approx(whole[1][0, 2, 2])


def test_a_gross_reading_changes_nothing_and_a_good_one_is_the_kalman_update() -> None:
    x, P = np.array([[3.0, -1.0, 0.2, 0.0, 0.0, 0.0]]), np.diag([0.01, 0.02, 0.01, 0.0, 0.0, 0.0])[None]
    before, weights, found = (x.copy(), P.copy()), np.zeros(1), np.empty((1, 3))
    errors = np.array([0.1, 0.0, 0.01, 50.0, 20.0])
    condition(x, P, weights, 40.0, 0, 1, PLACES, KNOWN, errors, found)
    assert np.array_equal(x, before[0])
    assert np.array_equal(P, before[1])
    assert found[0, 2] == 0.0
    h, H, _, _ = expected(x[0], 0, 1, PLACES, KNOWN)
    condition(x, P, weights, h + 0.1, 0, 1, PLACES, KNOWN, errors, found)
    s = H @ before[1][0] @ H + 0.01
    gain = before[1][0] @ H / s
    assert x[0] == pytest.approx(before[0][0] + 0.1 * gain, abs=2e-3)
    assert P[0] == pytest.approx(before[1][0] - np.outer(gain, gain) * s, abs=1e-4)
    assert found[0, 2] > 0.99


def test_merging_keeps_mean_and_covariance_also_across_the_cut_of_headings() -> None:
    x = np.zeros((3, STATES))
    x[:, 0], x[:, 2] = (0.0, 0.1, 50.0), (math.pi - 0.05, -math.pi + 0.05, 0.0)
    P, weights = np.tile(np.diag([0.04, 0.04, 0.04, 1e-4, 1e-4, 1e-4]), (3, 1, 1)), np.array([0.5, 0.25, 0.25])
    states, covariances, kept, places = merged(x, P, weights, 1.0, 0.3, 1.0)
    assert kept.tolist() == [0.75, 0.25]
    assert places.tolist() == [0, 2]
    assert states[0, 0] == pytest.approx(0.1 / 3.0)
    assert math.sin(states[0, 2]) == pytest.approx(math.sin(math.pi - 0.05 + 0.1 / 3.0))
    assert covariances[0, 0, 0] == pytest.approx(0.04 + 0.1**2 * 2.0 / 9.0)
    assert covariances[0, 0, 2] == pytest.approx(0.1**2 * 2.0 / 9.0)
