"""The moving horizon: the Kalman filter where it should be, robust where that is not, and honest where it fails."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.kalman import KalmanConfig
from mathnavi.estimators.moving_horizon import MovingHorizonConfig, MovingHorizonEstimator
from mathnavi.estimators.stagewise.flight import FlightModel
from mathnavi.estimators.stagewise.horizon import MovingHorizon
from mathnavi.estimators.stagewise.horizon_programme import HorizonProgramme
from mathnavi.estimators.stagewise.model import Stage
from mathnavi.estimators.stagewise.smoother import rauch_tung_striebel
from mathnavi.models.nlp_solver import NlpReport, Outcome
from mathnavi.sim.interfaces.signals import Measurement, Status
from tests.estimators.stagewise.test_smoother import FLIGHT, fixes, ranged


@pytest.mark.parametrize("stages", [2, 6])
def test_of_a_linear_model_it_is_the_kalman_filter_whatever_its_length(stages: int) -> None:
    model = FlightModel.of(KalmanConfig(), FLIGHT)
    horizon = MovingHorizon(model, stages, 1, slope=1e9)
    taken: list[Stage] = []
    for k, stage in enumerate(fixes(20)):
        horizon.add(stage)
        taken.append(stage)
        if k % 5 == 4:
            kalman = rauch_tung_striebel(model, taken, 1e-300)  # whose last state is the filter's
            np.testing.assert_allclose(horizon.x, kalman.x[-1], atol=1e-5)
            np.testing.assert_allclose(horizon.P, kalman.P[-1], atol=1e-6)


def test_the_limits_of_the_mission_hold() -> None:
    """A fix that is far off would ask for a gust that is not declared."""
    model = FlightModel.of(KalmanConfig(), FLIGHT)
    horizon = MovingHorizon(model, 6, 1, slope=1e9)
    for stage in fixes(20):
        far = tuple(y + 30.0 * stage.t**2 for y in stage.readings)
        horizon.add(Stage(stage.t, stage.inputs, far))
    assert np.abs(horizon.x[6:]).max() <= FLIGHT.gust.limit + 1e-6


def test_an_outlier_moves_it_by_less_than_a_filter_without_a_gate() -> None:
    errors = {}
    for slope in (1.5, 1e9):
        model, stages, truth = ranged(np.random.default_rng(1), 40)
        horizon = MovingHorizon(model, 8, 1, slope)
        for k, stage in enumerate(stages):
            readings = tuple(y + np.array([0.0, 2.0, 0.0]) * (k % 7 == 3) for y in stage.readings)
            horizon.add(Stage(stage.t, stage.inputs, readings))
        errors[slope] = float(np.linalg.norm(horizon.x[:2] - truth[-1, :2]))
    assert errors[1.5] < 0.3 * errors[1e9]


def test_a_solver_that_fails_is_a_status_and_the_estimate_is_the_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    estimator = MovingHorizonEstimator.build(MovingHorizonConfig(), FLIGHT)
    fix = FLIGHT.start + np.zeros(3)
    for k in range(5):
        good = estimator.update(0.1 * k, (Measurement("position", 0.1 * k, fix),), np.zeros(3))
    assert good.status is Status.OK

    def fails(self: Any) -> NlpReport:
        return NlpReport(Outcome.FAILED, "the solver gave up", None)

    monkeypatch.setattr("mathnavi.models.nlp_solver.NlpSolver.solve", fails)
    bad = estimator.update(0.5, (Measurement("position", 0.5, fix + 1.0),), np.zeros(3))
    assert bad.status is Status.SOLVER_FAILED
    np.testing.assert_allclose(bad.x[:3], good.x[:3] + 0.1 * good.x[3:6], atol=0.02)
    monkeypatch.undo()
    assert estimator.update(0.6, (Measurement("position", 0.6, fix),), np.zeros(3)).status is Status.OK


def test_readings_that_are_not_finite_are_not_solved_for() -> None:
    programme = HorizonProgramme(2, 1, 3)
    programme.clear()
    programme.r[1, 0], programme.W[1, 0, 0] = np.nan, 1.0
    errors, message = programme.solve()
    assert errors is None
    assert message
