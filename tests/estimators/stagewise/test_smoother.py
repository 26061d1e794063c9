"""The smoothers against filterpy's, against each other, and against the truth."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import KalmanFilter
from scipy.optimize import least_squares

from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.stagewise.flight import FlightModel
from mathnavi.estimators.stagewise.model import SmootherStage, advanced, residuals
from mathnavi.estimators.stagewise.ranging import RangingModel
from mathnavi.estimators.stagewise.recorded_smoother import RecordedSmoother, SmootherConfig
from mathnavi.estimators.stagewise.smoother import batch_least_squares, rauch_tung_striebel, square_root
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from tests.unicycle import STANDARD

FLIGHT = FlightMission(
    HeightField(np.zeros((3, 3)), 500.0), (0.0, 0.0, 100.0), (9.0, 9.0, 100.0), position_noise=2.0,
    gust=DeclaredGusts(1.0),
)  # fmt: skip
GATE, INPUT = 1e-9, np.array([0.5, -0.3, 0.1])


def fixes(n: int = 40) -> list[SmootherStage]:
    """Fixes of a flight that sways, every second stage without one."""
    rng, stages = np.random.default_rng(2), []
    for k in range(n):
        readings = (FLIGHT.start + 2.0 * rng.standard_normal(3),) if k % 2 == 0 else ()
        stages.append(SmootherStage(0.1 * k, ((0.1, INPUT),) if k else (), readings))
    return stages


def test_of_a_linear_model_the_smoother_is_that_of_filterpy() -> None:
    model, stages = FlightModel.from_config(KalmanConfig(), FLIGHT), fixes()
    found = rauch_tung_striebel(model, stages, GATE)
    kalman = KalmanFilter(9, 3)
    kalman.x, kalman.P = model.start(None)
    kalman.H, kalman.R = np.eye(3, 9), 4.0 * np.eye(3)
    means, covariances, F, Q = [], [], np.eye(9), np.zeros((9, 9))
    for stage in stages:
        for h, u in stage.inputs:
            x, F, Q = model.transition(kalman.x, u, h)
            kalman.x, kalman.P = x, F @ kalman.P @ F.T + Q
        for y in stage.readings:
            kalman.update(y)
        means.append(kalman.x - moved(stage.t))
        covariances.append(kalman.P.copy())
    smoothed, P, _, _ = kalman.rts_smoother(
        np.array(means), np.array(covariances), [F] * len(stages), [Q] * len(stages)
    )
    for k, stage in enumerate(stages):
        np.testing.assert_allclose(found.x[k] - moved(stage.t), smoothed[k], atol=1e-7)
        np.testing.assert_allclose(found.P[k], P[k], atol=1e-9)


def moved(t: float) -> Array:
    """Effect of the input alone by a time: without it the model is x' = F x."""
    return np.concatenate([0.5 * INPUT * t**2, INPUT * t, np.zeros(3)])


def test_of_a_linear_model_batch_least_squares_is_the_smoother() -> None:
    model, stages = FlightModel.from_config(KalmanConfig(), FLIGHT), fixes()
    smoothed, batch = rauch_tung_striebel(model, stages, GATE), batch_least_squares(model, stages, GATE)
    assert batch.converged
    np.testing.assert_allclose(np.array(batch.x), np.array(smoothed.x), atol=1e-6)


def ranged(
    rng: np.random.Generator, n: int = 150, relative: float = 0.02
) -> tuple[RangingModel, list[SmootherStage], Array]:
    """A robot that drives a bow, from a start that is known roughly."""
    truth = np.array([0.6, -0.3, 0.8])
    start = truth + 0.1 * rng.standard_normal(3)
    mission = RangingMission(
        STANDARD, (0.0, 1.5, 3.0), RangeQuality(relative, 0.02), OdometryQuality((0.2, 0.3), 0.02),
        KnownStart((float(start[0]), float(start[1]), float(start[2])), (0.1, 0.1, 0.1)),
    )  # fmt: skip
    stages, poses, u = [], [], np.array([0.5, 0.7])
    for k in range(n):
        exact, _ = mission.curve.ranges(truth, mission.alpha)
        read = exact * (1.0 + relative * rng.standard_normal(3)) + 0.02 * rng.standard_normal(3)
        measured = 1.02 * u + np.array([0.2, 0.3]) * rng.standard_normal(2)
        stages.append(SmootherStage(0.01 * k, ((0.01, measured),) if k else (), (read,)))
        poses.append(truth)
        truth = mission.flow(truth, u, 0.01)
    return RangingModel(mission), stages, np.array(poses)


def test_a_smoother_is_nearer_to_the_truth_than_its_filter_and_batch_least_squares_agrees() -> None:
    rng = np.random.default_rng(7)
    filtered, smoothed = 0.0, 0.0
    for _ in range(4):
        model, stages, truth = ranged(rng)
        found = rauch_tung_striebel(model, stages, GATE)
        half = len(stages) // 2
        last = rauch_tung_striebel(model, stages[: half + 1], GATE)  # whose last state is the filter's
        filtered += float(np.square(last.x[-1][:2] - truth[half, :2]).sum())
        smoothed += float(np.square(found.x[half][:2] - truth[half, :2]).sum())
        batch = batch_least_squares(model, stages, GATE)
        assert batch.converged
        assert np.abs(np.array(batch.x) - np.array(found.x)).max() < 0.02
    assert smoothed < 0.7 * filtered


def test_in_a_gap_that_is_longer_than_declared_its_estimate_is_degraded() -> None:
    model = FlightModel.from_config(KalmanConfig(), FLIGHT)
    smoother = RecordedSmoother(SmootherConfig(), model, 0.1, 1.0)
    times = [0.1 * k for k in range(60)]
    fix = [(Measurement("position", t, np.array(FLIGHT.start)),) if not 1.95 < t < 3.95 else () for t in times]
    smoother.smooth((t, readings, np.zeros(3)) for t, readings in zip(times, fix, strict=True))
    statuses = [smoother.update(t, (), np.zeros(3)).status for t in times]
    assert statuses == [Status.OK] * 20 + [Status.DEGRADED] * 20 + [Status.OK] * 20


def test_an_outlier_is_not_used() -> None:
    model, stages = FlightModel.from_config(KalmanConfig(), FLIGHT), fixes()
    spoilt = list(stages)
    spoilt[20] = SmootherStage(stages[20].t, stages[20].inputs, (stages[20].readings[0] + 500.0,))
    without = list(stages)
    without[20] = SmootherStage(stages[20].t, stages[20].inputs, ())
    np.testing.assert_allclose(
        rauch_tung_striebel(model, spoilt, GATE).x, rauch_tung_striebel(model, without, GATE).x, atol=1e-9
    )


def test_batch_least_squares_finds_what_a_solver_finds_that_knows_no_structure() -> None:
    """Its variables are the start and the noises alone; the states follow from them."""
    model, stages, _ = ranged(np.random.default_rng(3), 8, relative=0.0)
    m_0, P_0 = model.start(None)

    def states(z: Array) -> list[Array]:
        x = [model.sum(m_0, square_root(P_0) @ z[:4])]
        for k, stage in enumerate(stages[1:], start=1):
            after, _, Q = advanced(model, x[-1], stage.inputs)
            x.append(model.sum(after, square_root(Q) @ z[4 * k : 4 * k + 4]))
        return x

    def squares(z: Array) -> Array:
        read = [residuals(model, x, stage.readings)[0] for x, stage in zip(states(z), stages, strict=True)]
        return np.concatenate([z, *read])

    other = states(least_squares(squares, np.zeros(4 * len(stages)), xtol=1e-12, ftol=1e-12, gtol=1e-12).x)
    found = batch_least_squares(model, stages, GATE)
    assert found.converged
    # the noise's direction follows the state, of which Gauss and Newton's Jacobian knows nothing
    np.testing.assert_allclose(found.x, other, atol=1e-4)
