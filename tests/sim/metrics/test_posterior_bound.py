"""The posterior Cramér-Rao bound against the Kalman filter, and against estimators of a nonlinear system."""

from __future__ import annotations

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from mathnavi.interfaces.signals import Array
from mathnavi.models.linear_noise import discretised
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound, efficiency

STEPS, H_STEP = 40, 0.1
A, W_NOISE = np.array([[0.0, 1.0], [-1.0, -0.2]]), np.diag([0.0, 0.3])
READS, R = np.array([[1.0, 0.0]]), 0.04


def test_in_the_linear_gaussian_case_it_is_the_covariance_of_the_kalman_filter() -> None:
    F, Q = discretised(A, W_NOISE, H_STEP)
    kalman = KalmanFilter(2, 1)
    kalman.F, kalman.Q, kalman.H, kalman.R, kalman.P = F, Q, READS, np.array([[R]]), np.diag([0.5, 2.0])
    bound = BoundRecursion(covariance=kalman.P.copy())
    for _ in range(STEPS):
        kalman.predict()
        kalman.update(np.zeros((1, 1)))
        bound.predict(F, Q)
        bound.observe(READS / math.sqrt(R))
        np.testing.assert_allclose(bound.covariance, kalman.P, rtol=1e-9)


@pytest.mark.parametrize("noise", [W_NOISE, np.zeros((2, 2))], ids=["noise", "none"])
def test_without_a_prior_it_is_the_limit_of_ever_wider_ones(noise: Array) -> None:
    F, Q = discretised(A, noise, H_STEP)
    unknown = BoundRecursion(information=np.zeros((2, 2)))
    wide = BoundRecursion(covariance=1e7 * np.eye(2))
    for k in range(STEPS):
        for bound in (unknown, wide):
            bound.observe(READS / math.sqrt(R))
        if k:
            assert unknown.covariance is not None
            np.testing.assert_allclose(unknown.covariance, wide.covariance, rtol=1e-4)
        else:
            assert unknown.covariance is None, "one position says nothing of the velocity"
        for bound in (unknown, wide):
            bound.predict(F, Q)


def test_two_readings_at_once_are_the_two_one_after_the_other() -> None:
    W, start = np.array([[1.0, 0.5, 0.0], [0.2, 0.0, 3.0]]), np.diag([4.0, 1.0, 9.0])
    together, apart = BoundRecursion(covariance=start), BoundRecursion(covariance=start)
    together.observe(W)
    for row in W:
        apart.observe(row[np.newaxis])
    variance, covariance = apart.variance, together.covariance
    assert variance is not None
    assert covariance is not None
    np.testing.assert_allclose(variance, np.diag(covariance), rtol=1e-12)


def test_what_is_never_observed_has_no_bound() -> None:
    bound = BoundRecursion(information=np.zeros((2, 2)))
    for _ in range(STEPS):
        bound.predict(np.eye(2), np.diag([0.1, 0.1]))
        bound.observe(READS)
    assert bound.covariance is None


def test_no_estimator_of_a_pendulum_beats_it_and_the_extended_kalman_filter_comes_near() -> None:
    """Monte Carlo over starts, noise and readings; the bound averaged over the trajectories."""
    h, q, sigma, runs, steps = 0.05, 0.3, 0.1, 400, 60
    P0 = np.diag([0.2, 0.2]) ** 2
    rng = np.random.default_rng(4)
    squares, bounds = np.zeros((steps, 2)), np.zeros((steps, 2))

    def step(x: Array) -> Array:
        v = x[1] - h * 4.0 * math.sin(x[0])
        return np.array([x[0] + h * v, v])

    def jacobian(x: Array) -> Array:
        c = -h * 4.0 * math.cos(x[0])
        return np.array([[1.0 + h * c, h], [c, 1.0]])

    Q = np.diag([1e-6, q**2 * h])
    W = np.array([[1.0 / sigma, 0.0]])
    for _ in range(runs):
        mean = np.array([1.5, 0.0])
        x = mean + np.sqrt(np.diag(P0)) * rng.standard_normal(2)
        P, bound = P0.copy(), BoundRecursion(covariance=P0.copy())
        for k in range(steps):
            F = jacobian(mean)
            bound.predict(jacobian(x), Q)
            x = step(x) + np.sqrt(np.diag(Q)) * rng.standard_normal(2)
            mean, P = step(mean), F @ P @ F.T + Q
            gain = P[:, 0] / (P[0, 0] + sigma**2)
            mean = mean + gain * (x[0] + sigma * rng.standard_normal() - mean[0])
            P = P - np.outer(gain, P[0])
            bound.observe(W)
            squares[k] += np.square(mean - x) / runs
            bounds[k] += np.diag(bound.covariance) / runs
    over = math.sqrt(squares[20:].sum() / bounds[20:].sum())
    assert 0.97 < over < 1.1, "0.03 is what chance leaves of 400 runs"


def test_efficiency_is_the_root_of_the_ratio_of_the_sums() -> None:
    assert efficiency(np.array([[3.0], [4.0]]), np.array([[2.0], [3.0]])) == pytest.approx(math.sqrt(5.0))
    assert efficiency(np.array([[3.0], [np.nan]]), np.ones((2, 1))) is None
    assert efficiency(np.ones((2, 1)), np.zeros((2, 1))) is None


def test_where_there_is_no_bound_the_figures_say_why() -> None:
    figures = PosteriorBound.none("the ranges are declared exact", 3).figures(np.zeros((3, 0)), slice(None), "the run")
    assert figures == {"efficiency": None, "efficiency_basis": "none: the ranges are declared exact"}


def test_either_an_information_or_a_covariance_is_given() -> None:
    with pytest.raises(ValueError, match="exactly one"):
        BoundRecursion()
