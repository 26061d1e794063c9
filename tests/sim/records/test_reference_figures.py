"""Figures of estimates beside a reference, on estimates whose errors are drawn from their covariances."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.interfaces.signals import Status
from mathnavi.sim.records.reference_figures import reference_figures, squared_by_covariance

NAMES = ("x [m]", "y [m]", "heading [rad]")


def history(errors: np.ndarray, truth: np.ndarray, deviation: float, ok_from: int) -> mn.EstimateHistory:
    n = len(errors)
    x = truth + errors
    x[:, 2] = (x[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    status = tuple(Status.OK if k >= ok_from else Status.INITIALISING for k in range(n))
    P = np.tile(deviation**2 * np.eye(3), (n, 1, 1))
    return mn.EstimateHistory("test", 0.1 * np.arange(n), x, P, status, ("",) * n, {}, {})


def test_consistent_estimates_have_a_nees_of_one_and_wrong_ones_are_counted() -> None:
    rng = np.random.default_rng(0)
    truth = np.column_stack([np.arange(2000.0), np.zeros(2000), np.linspace(3.0, 3.3, 2000)])
    truth[:, 2] = (truth[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    errors = 0.2 * rng.standard_normal((2000, 3))
    errors[:100] = 30.0  # while it initialises
    found = reference_figures(history(errors, truth, 0.2, 100), 0.1 * np.arange(2000), truth, NAMES)
    assert found["nees_mean"] == pytest.approx(1.0, abs=0.05)
    assert found["position_rms_m"] == pytest.approx(0.2 * math.sqrt(2.0), rel=0.05)
    assert found["heading_rms_deg"] == pytest.approx(math.degrees(0.2), rel=0.05)
    assert found["usable_share"] == 0.95
    assert found["initialising_s"] == pytest.approx(10.0)
    assert found["wrong_share"] < 0.004
    sure = reference_figures(history(errors, truth, 0.05, 100), 0.1 * np.arange(2000), truth, NAMES)
    assert sure["wrong_share"] > 0.5


def test_a_state_that_is_no_pose_has_its_own_figure_and_nothing_usable_has_none() -> None:
    errors, truth = np.full((5, 3), 0.1), np.zeros((5, 3))
    found = reference_figures(history(errors, truth, 1.0, 5), 0.1 * np.arange(5), truth, ("q [rad]", "w [rad/s]", "z"))
    assert math.isnan(found["rms w [rad/s]"])
    assert math.isnan(found["nees_mean"])
    assert (found["usable_share"], found["wrong_share"]) == (0.0, 0.0)


def test_an_error_without_a_deviation_is_infinite_and_none_is_zero() -> None:
    """Particles that are all the same declare no deviation."""
    errors, P = np.array([[0.2, 0.0], [0.2, 0.1], [0.0, 0.0]]), np.diag([0.04, 0.0])
    found = squared_by_covariance(errors, np.tile(P, (3, 1, 1)))
    np.testing.assert_allclose(found[[0, 2]], [1.0, 0.0])
    assert math.isinf(found[1])
    assert np.isnan(squared_by_covariance(errors, np.full((3, 2, 2), np.nan))).all()
