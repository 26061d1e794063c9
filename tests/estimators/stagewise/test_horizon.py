"""The moving horizon: the Kalman filter where it should be, robust where that is not, and honest where it fails."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.moving_horizon import MovingHorizonConfig, MovingHorizonEstimator
from mathnavi.estimators.stagewise.flight import FlightModel
from mathnavi.estimators.stagewise.horizon import HorizonProgramme, MovingHorizon
from mathnavi.estimators.stagewise.model import SmootherStage
from mathnavi.estimators.stagewise.smoother import rauch_tung_striebel
from mathnavi.interfaces.signals import Measurement, Status
from mathnavi.models.nlp_solver import NlpReport, SolverOutcome
from tests.estimators.stagewise.test_smoother import FLIGHT, fixes, ranged


@pytest.mark.parametrize("stages", [2, 6])
def test_of_a_linear_model_it_is_the_kalman_filter_whatever_its_length(stages: int) -> None:
    model = FlightModel.from_config(KalmanConfig(), FLIGHT)
    horizon = MovingHorizon(model, stages, 1, slope=1e9)
    taken: list[SmootherStage] = []
    for k, stage in enumerate(fixes(20)):
        horizon.add(stage)
        taken.append(stage)
        if k % 5 == 4:
            kalman = rauch_tung_striebel(model, taken, 1e-300)  # whose last state is the filter's
            np.testing.assert_allclose(horizon.x, kalman.x[-1], atol=1e-5)
            np.testing.assert_allclose(horizon.P, kalman.P[-1], atol=1e-6)


def test_the_limits_of_the_mission_hold() -> None:
    """Fixes that run away ask for a gust that is not declared, of a filter without limits."""
    model = FlightModel.from_config(KalmanConfig(), FLIGHT)
    horizon, limit = MovingHorizon(model, 6, 1, slope=1e9), FLIGHT.gust.limit
    for stage in runaway(20):
        horizon.add(stage)
        assert horizon.failure == ""
        assert np.abs(horizon.x[6:]).max() <= limit + 1e-3
    assert np.abs(rauch_tung_striebel(model, runaway(20), 1e-300).x[-1][6:]).max() > limit


def runaway(n: int) -> list[SmootherStage]:
    """Fixes that accelerate by 60 m/s^2."""
    return [
        SmootherStage(stage.t, stage.inputs, tuple(y + 30.0 * stage.t**2 for y in stage.readings)) for stage in fixes(n)
    ]


def test_fatrop_finds_what_the_closed_form_finds_where_no_limit_is_active(monkeypatch: pytest.MonkeyPatch) -> None:
    model, stages, _ = ranged(np.random.default_rng(2), 12)
    found = []
    for _ in range(2):
        horizon = MovingHorizon(model, 5, 1, slope=1.5)
        for stage in stages:
            horizon.add(stage)
        found.append(horizon.x)

        def always(self: MovingHorizon, offsets: Any, readings: Any, closed: Any = MovingHorizon._unlimited) -> Any:
            errors, P = closed(self, offsets, readings)
            limited, message = self._limited(
                offsets, readings, [(-np.full(4, np.inf), np.full(4, np.inf))] * len(errors)
            )
            assert limited is not None, message
            return limited, P

        monkeypatch.setattr(MovingHorizon, "_unlimited", always)
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)


def test_an_outlier_moves_it_by_less_than_a_filter_without_a_gate() -> None:
    errors = {}
    for slope in (1.5, 1e9):
        model, stages, truth = ranged(np.random.default_rng(1), 40)
        horizon = MovingHorizon(model, 8, 1, slope)
        for k, stage in enumerate(stages):
            readings = tuple(y + np.array([0.0, 2.0, 0.0]) * (k % 7 == 3) for y in stage.readings)
            horizon.add(SmootherStage(stage.t, stage.inputs, readings))
        errors[slope] = float(np.linalg.norm(horizon.x[:2] - truth[-1, :2]))
    assert errors[1.5] < 0.3 * errors[1e9]


def test_a_solver_that_fails_is_a_status_and_the_estimate_is_the_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    estimator = MovingHorizonEstimator.build(MovingHorizonConfig(), FLIGHT)
    for k in range(5):
        fix = Measurement("position", 0.1 * k, FLIGHT.start + np.zeros(3))
        good = estimator.update(0.1 * k, (fix,), np.zeros(3))
    assert good.status is Status.OK

    def fails(self: Any) -> NlpReport:
        return NlpReport(SolverOutcome.FAILED, "the solver gave up", None)

    monkeypatch.setattr("mathnavi.models.nlp_solver.NlpSolver.solve", fails)
    monkeypatch.setattr(FlightModel, "limits", lambda self, x: (-np.full(9, 1e-9), np.full(9, 1e-9)))
    far = Measurement("position", 0.5, fix.value + 1.0)
    bad = estimator.update(0.5, (far,), np.zeros(3))
    assert bad.status is Status.SOLVER_FAILED
    np.testing.assert_allclose(bad.x[:3], good.x[:3] + 0.1 * good.x[3:6], atol=0.02)
    monkeypatch.undo()
    after = estimator.update(0.6, (Measurement("position", 0.6, fix.value),), np.zeros(3))
    assert after.status is Status.OK


def test_readings_that_are_not_finite_are_not_solved_for() -> None:
    programme = HorizonProgramme(2, 3)
    programme.clear()
    programme.g[1, 0] = np.nan
    errors, message = programme.solve()
    assert errors is None
    assert message
