"""The range and the range rate at the centre of a window."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.estimators.ranging.observer import FitWindow, check_window, savitzky_golay, spread
from mathnavi.estimators.ranging.range_rate_kernels import centre_fit, innovated, measured
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.kernels import integrate
from tests.estimators.ranging.walls import FIELD, WALLS

DT = 0.01  # [s]
ALPHA = np.radians([-60.0, 60.0])
windows = st.sampled_from([3, 5, 21, 101])


@given(windows, st.integers(1, 5), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_a_polynomial_of_its_order_is_found_again(window: int, order: int, seed: int) -> None:
    order = min(order, window - 1)
    a, tau = np.random.default_rng(seed).uniform(-3.0, 3.0, order + 1), np.linspace(-1.0, 1.0, window)
    found = centre_fit(np.polynomial.polynomial.polyval(tau, a), savitzky_golay(window, order))
    np.testing.assert_allclose(found[:2], a[:2], atol=1e-9)
    assert not found[2]


@given(st.integers(1, 4), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_so_it_is_where_readings_are_missing_or_outliers_of_which_the_one_at_the_centre_is_told(
    order: int, seed: int
) -> None:
    rng, tau = np.random.default_rng(seed), np.linspace(-1.0, 1.0, 101)
    a = rng.uniform(-3.0, 3.0, order + 1)
    samples = np.polynomial.polynomial.polyval(tau, a)
    samples[rng.random(101) < 0.2] = np.nan
    there = np.flatnonzero(np.isfinite(samples))
    wrong = rng.choice(there, 3, replace=False)
    samples[wrong] += 5.0
    *found, refused = centre_fit(samples, savitzky_golay(101, order))
    np.testing.assert_allclose(found, a[:2], atol=1e-6)
    assert refused == (50 in wrong)
    assert measured(samples[:, None], savitzky_golay(101, order), DT)[2, 0] == refused


def test_of_half_a_window_nothing_is_made() -> None:
    samples = np.linspace(1.0, 2.0, 101)
    samples[60:] = np.nan
    assert np.isnan(centre_fit(samples, savitzky_golay(101, 1))[:2]).all()
    ranges = np.stack([samples, np.linspace(1.0, 2.0, 101)], axis=1)
    readings = measured(ranges, savitzky_golay(101, 1), DT)
    assert readings[0, 0] == samples[50]  # as it was read
    assert np.isnan(readings[1, 0])
    np.testing.assert_allclose(readings[:, 1], [1.5, 1.0, 0.0])


def test_noise_is_averaged_as_least_squares_say() -> None:
    """Of n readings with independent errors sigma, a line's value has variance sigma^2 / n."""
    rng, m, sigma = np.random.default_rng(1), 50, 0.1
    readings = np.array(
        [measured(2.0 + sigma * rng.standard_normal((101, 1)), savitzky_golay(101, 1), DT)[:, 0] for _ in range(2000)]
    )
    assert readings[:, 0].std() == pytest.approx(sigma / np.sqrt(101), rel=0.06)
    assert readings[:, 1].std() == pytest.approx(sigma * np.sqrt(3.0 / (m * (m + 1) * (2 * m + 1))) / DT, rel=0.06)


@pytest.mark.parametrize("curve", WALLS)
@pytest.mark.parametrize(("window", "error"), [(3, 1e-12), (21, 1e-4), (101, 1e-4)])
def test_the_innovation_of_a_robot_that_knows_where_it_is_is_nought(curve: Curve, window: int, error: float) -> None:
    """Then rho is the range and rho_dot its rate, whatever the window is; the ranges themselves are curved in time."""
    inputs = np.stack([np.full(window - 1, 0.4), np.linspace(0.5, 1.5, window - 1)], axis=1)
    poses = travelled(np.array([0.3, -0.2, 0.4]), inputs)
    ranges = np.array([curve.ranges(pose, ALPHA)[0] for pose in poses])
    m = window // 2
    pose, u = poses[m], 0.5 * (inputs[m - 1] + inputs[m])
    fit = (savitzky_golay(window, 1), spread(window), DT)
    readings = innovated(ranges, inputs, u, fit, curve.wall, ALPHA, pose)
    h = 1e-4
    ahead, behind = (curve.ranges(integrate(pose, *u, way), ALPHA)[0] for way in (h, -h))
    np.testing.assert_allclose(readings[0], ranges[m], rtol=0, atol=error)
    np.testing.assert_allclose(readings[1], (ahead - behind) / (2.0 * h), rtol=0, atol=error + 1e-6)


def test_a_robot_that_is_elsewhere_sees_it_in_the_innovation() -> None:
    inputs = np.full((100, 2), (0.4, 0.8))
    poses = travelled(np.array([0.3, -0.2, 0.4]), inputs)
    ranges = np.array([FIELD.ranges(pose, ALPHA)[0] for pose in poses])
    supposed = poses[50] + np.array([0.05, 0.03, 0.03])
    fit = (savitzky_golay(101, 3), spread(101), DT)
    rho, rho_dot, _ = innovated(ranges, inputs, inputs[0], fit, FIELD.wall, ALPHA, supposed)
    h = 1e-4
    ahead, behind = (FIELD.ranges(integrate(poses[50], *inputs[0], way), ALPHA)[0] for way in (h, -h))
    np.testing.assert_allclose(rho, ranges[50], rtol=0, atol=1e-2)
    np.testing.assert_allclose(rho_dot, (ahead - behind) / (2.0 * h), rtol=0, atol=0.1)
    assert np.abs(FIELD.ranges(supposed, ALPHA)[0] - ranges[50]).max() > 5e-2


def test_a_window_holds_the_last_readings_and_the_inputs_between_them() -> None:
    window = FitWindow(5, 1)
    for k in range(9):
        window.push(np.array([float(k)]), np.array([float(k), -float(k)]))
        assert window.has_centre is (k >= 2)
        assert window.is_at_start is (k == 2)
        assert window.inputs_since[:, 0].tolist() == list(range(max(1, k - 1), k + 1))
    assert window.ranges.ravel().tolist() == [4.0, 5.0, 6.0, 7.0, 8.0]
    assert window.inputs[:, 0].tolist() == [5.0, 6.0, 7.0, 8.0]
    np.testing.assert_array_equal(window.centre_input, [6.5, -6.5])


@pytest.mark.parametrize(("window", "order"), [(2, 1), (100, 3), (1, 1), (-3, 1), (1003, 1), (5, 0), (5, 5), (101, 8)])
def test_a_window_that_cannot_be_is_refused(window: int, order: int) -> None:
    with pytest.raises(ValueError, match=r"(window|order) = .*; allowed"):
        check_window(window, order)


def travelled(pose: Array, inputs: Array) -> list[Array]:
    poses = [pose]
    for u in inputs:
        poses.append(integrate(poses[-1], u[0], u[1], DT))
    return poses
