"""The Kalman filter: its covariance and its declared quality are what a simulated flight shows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov

from mathnavi.estimators.flight_model import AxisModel, KalmanConfig, clipped_rms
from mathnavi.estimators.kalman import Kalman, first_covariance
from mathnavi.interfaces.reading_counts import Unused, unused_in
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.aerial.dynamics import TICK, flow
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.terrain.height_field import HeightField

OMEGA = 2.0  # [rad/s] of the tracker that closes the loop below


def mission_of(gust: DeclaredGusts, position_noise: float) -> FlightMission:
    terrain = HeightField(np.zeros((3, 3)), 1000.0)
    start = (1000.0, 1000.0, 500.0)
    return FlightMission(terrain, start, (900.0, 900.0, 500.0), position_noise=position_noise, gust=gust)


def fix(t: float, position: Array) -> Measurement:
    return Measurement("position", t, position)


@dataclass(frozen=True)
class Flight:
    """Standard deviations over one hovering flight; the three axes count as three samples."""

    error: Array  # (2,) of position [m] and velocity [m/s] estimates, just before a fix
    state: Array  # (2,) of position and velocity about the hover


def hover(mission: FlightMission, duration: float) -> Flight:
    """A critically damped tracker holds the start on the filter's estimate, under gusts."""
    config, gust, rng = KalmanConfig(), mission.gust, np.random.default_rng(0)
    filter_, reference = Kalman.build(config, mission), np.array([*mission.start, 0.0, 0.0, 0.0])
    keep = math.exp(-TICK / gust.time_constant)
    stir = gust.rms * math.sqrt(1.0 - keep**2)
    x, g, u = reference.copy(), gust.rms * rng.standard_normal(3), np.zeros(3)
    errors, states, fixes = [], [], []
    for k in range(round(duration / TICK)):
        t = k * TICK
        if k % 30 == 0:
            fixes.append(fix(t, x[:3] + mission.position_noise * rng.standard_normal(3)))
        if k % 3 == 0:
            estimate, fixes = filter_.update(t, fixes, u), []
            error = estimate.x - reference
            u = -(OMEGA**2) * error[:3] - 2.0 * OMEGA * error[3:]
            if t > 20.0:
                states.append(x - reference)
                if k % 30 == 27:
                    errors.append(x - estimate.x)
        length = float(np.linalg.norm(g))
        x = flow(x, u + g * min(1.0, gust.limit / length), TICK)
        g = keep * g + stir * rng.standard_normal(3)
    return Flight(*(np.sqrt(np.square(s).mean(axis=0).reshape(2, 3).mean(axis=1)) for s in (errors, states)))


@pytest.mark.parametrize(
    ("gust", "noise"),
    [(DeclaredGusts(1.5, 3.0, 100.0), 5.0), (DeclaredGusts(4.0, 3.0, 4.0), 5.0), (DeclaredGusts(1.0), 1.0)],
)
def test_the_declared_quality_is_that_of_a_flight(gust: DeclaredGusts, noise: float) -> None:
    mission = mission_of(gust, noise)
    quality, flight = Kalman.quality(KalmanConfig(), mission), hover(mission, 160.0)
    np.testing.assert_allclose(flight.error, np.sqrt(np.diag(quality.error))[:2], rtol=0.2)
    # x = x^ + e, the two uncorrelated, and x^ is driven through the closed loop by the corrections alone.
    closed = np.array([[0.0, 1.0, 0.0], [-(OMEGA**2), -2.0 * OMEGA, 1.0], [0.0, 0.0, -1.0 / gust.time_constant]])
    predicted = solve_continuous_lyapunov(closed, -quality.driving) + quality.error
    np.testing.assert_allclose(flight.state, np.sqrt(np.diag(predicted))[:2], rtol=0.2)


@pytest.mark.parametrize("gust", [DeclaredGusts(0.0), DeclaredGusts(2.0)])
@pytest.mark.parametrize("noise", [0.0, 5.0])
def test_the_covariance_settles_at_the_declared_quality(gust: DeclaredGusts, noise: float) -> None:
    mission = mission_of(gust, noise)
    filter_, declared = Kalman.build(KalmanConfig(), mission), Kalman.quality(KalmanConfig(), mission).error[:2, :2]
    worst, rng = np.zeros(2), np.random.default_rng(0)
    for k in range(4000):  # 40 s
        t = k * 0.01
        readings = [fix(t, mission.start + 1e-3 * rng.standard_normal(3))] if k % 10 == 0 else []
        covariance = filter_.update(t, readings, np.zeros(3)).covariance
        assert covariance is not None
        if k > 3500:
            worst = np.maximum(worst, np.diag(covariance)[[0, 3]])
    assert np.all(worst <= np.diag(declared) * (1.0 + 1e-6))  # declared just before a fix, seen .01 s earlier
    assert np.all(worst >= np.diag(declared) * 0.8)


@given(a=st.floats(0.001, 2.0), b=st.floats(0.001, 2.0), rms=st.floats(0.05, 5.0), tau=st.floats(0.3, 30.0))
def test_the_discretisation_is_a_semigroup(a: float, b: float, rms: float, tau: float) -> None:
    model = AxisModel(rms, tau, 1.0)
    (Fa, Ba, Qa), (Fb, Bb, Qb), (F, B, Q) = (model.discretised(h) for h in (a, b, a + b))
    np.testing.assert_allclose(Fb @ Fa, F, atol=1e-12)
    np.testing.assert_allclose(Fb @ Ba + Bb, B, atol=1e-12)
    np.testing.assert_allclose(Fb @ Qa @ Fb.T + Qb, Q, rtol=1e-7, atol=1e-9)


def test_the_gust_of_the_model_is_stationary() -> None:
    F, _, Q = AxisModel(2.0, 3.0, 1.0).discretised(0.1)
    assert F[2, 2] ** 2 * 4.0 + Q[2, 2] == pytest.approx(4.0)


def test_how_often_it_is_asked_does_not_matter() -> None:
    mission, rng = mission_of(DeclaredGusts(2.0), 5.0), np.random.default_rng(0)
    fast, slow = (Kalman.build(KalmanConfig(), mission) for _ in range(2))
    u, pending = np.array([1.0, -2.0, 0.5]), []
    for k in range(101):
        t = k * 0.01
        readings = [fix(t, np.array(mission.start) + rng.normal(size=3))] if k % 10 == 0 else []
        pending += readings
        often = fast.update(t, readings, u)
        if k % 25 == 0:
            seldom, pending = slow.update(t, pending, u), []
            np.testing.assert_allclose(seldom.x, often.x, rtol=0.0, atol=1e-8)
            assert seldom.covariance is not None
            assert often.covariance is not None
            np.testing.assert_allclose(seldom.covariance, often.covariance, rtol=1e-7)
            np.testing.assert_allclose(seldom.extra["gust"], often.extra["gust"], atol=1e-8)


def test_without_fixes_it_predicts_on_and_says_that_it_is_lost() -> None:
    mission = mission_of(DeclaredGusts(0.0), 0.0)
    filter_, u = Kalman.build(KalmanConfig(timeout=0.5), mission), np.array([1.0, 2.0, 3.0])
    x = np.array([*mission.start, 0.0, 0.0, 0.0])
    assert filter_.update(0.0, [], u).status is Status.INITIALISING
    assert filter_.update(0.01, [fix(0.01, flow(x, u, 0.01)[:3])], u).status is Status.OK
    for k in range(2, 101):
        estimate = filter_.update(k * 0.01, [], u)
        np.testing.assert_allclose(estimate.x, flow(x, u, k * 0.01), atol=1e-8)
        assert estimate.status is (Status.OK if k <= 51 else Status.LOST)


def test_a_constant_gust_is_found() -> None:
    mission, g = mission_of(DeclaredGusts(2.0, time_constant=300.0), 0.5), np.array([2.0, -1.0, 0.5])
    filter_, x = Kalman.build(KalmanConfig(), mission), np.array([*mission.start, 0.0, 0.0, 0.0])
    rng = np.random.default_rng(0)
    found = []
    for k in range(2000):
        readings = [fix(k * 0.01, x[:3] + 0.5 * rng.normal(size=3))] if k % 10 == 0 else []
        estimate = filter_.update(k * 0.01, readings, -g)  # the input holds the vehicle against it
        found.append(estimate.extra["gust"])
    np.testing.assert_allclose(np.mean(found[1000:], axis=0), g, atol=0.25)


@pytest.mark.parametrize(
    "gust", [DeclaredGusts(0.0), DeclaredGusts(1.0), DeclaredGusts(4.0), DeclaredGusts(20.0), DeclaredGusts(2.0, 3, 9)]
)
def test_the_rms_of_a_clipped_gust_is_that_of_samples(gust: DeclaredGusts) -> None:
    g = gust.rms * np.random.default_rng(0).standard_normal((200_000, 3))
    length = np.linalg.norm(g, axis=1, keepdims=True)
    clipped = g * np.minimum(1.0, gust.limit / np.maximum(length, 1e-300))
    assert clipped_rms(gust) == pytest.approx(np.sqrt(np.mean(clipped**2)), rel=0.01)


@pytest.mark.refused("sensor log", "reading that is older than one that was used")
def test_a_fix_from_the_past_is_counted_and_changes_nothing_and_an_estimate_of_the_past_is_refused() -> None:
    mission = mission_of(DeclaredGusts(1.0), 5.0)
    filter_ = Kalman.build(KalmanConfig(), mission)
    filter_.update(1.0, [], np.zeros(3))
    estimate = filter_.update(1.0, [fix(0.5, np.zeros(3))], np.zeros(3))
    np.testing.assert_array_equal(estimate.x[:3], mission.start)
    assert unused_in(estimate.extra) == {Unused.LATE.value: 1}
    with pytest.raises(ValueError, match=r"0\.5.*already"):
        filter_.update(0.5, [], np.zeros(3))


def fixes_of(gust_scale: float, outlier: float) -> tuple[Kalman, list[float], float]:
    """The filter after a minute of hover, its position deviation at each step, and the error of its last estimate."""
    gust, rng = DeclaredGusts(0.5, 3.0), np.random.default_rng(4)
    mission = mission_of(gust, 1.0)
    filter_, x = Kalman.build(KalmanConfig(), mission), np.array([*mission.start, 0.0, 0.0, 0.0])
    g, u, deviations = np.zeros(3), np.zeros(3), []
    for k in range(3600):
        t = k / 60.0
        jump = np.array([outlier, 0.0, 0.0]) if k == 3000 else np.zeros(3)
        fixes = [fix(t, x[:3] + jump + rng.standard_normal(3))] if k % 6 == 0 else []
        estimate = filter_.update(t, fixes, u)
        assert estimate.covariance is not None
        deviations.append(math.sqrt(estimate.covariance[0, 0]))
        u = -0.64 * (estimate.x[:3] - mission.start) - 1.6 * estimate.x[3:]
        g = g * math.exp(-1.0 / 180.0) + gust_scale * 0.5 * math.sqrt(1.0 - math.exp(-1.0 / 90.0)) * rng.normal(size=3)
        x = flow(x, u + g, 1.0 / 60.0)
    return filter_, deviations, float(np.linalg.norm(estimate.x[:3] - x[:3]))


def declared_deviation() -> float:
    return math.sqrt(Kalman.quality(KalmanConfig(), mission_of(DeclaredGusts(0.5), 1.0)).error[0, 0])


def test_an_outlier_is_not_used_and_widens_the_covariance() -> None:
    _, deviations, error = fixes_of(1.0, 500.0)
    _, plain, _ = fixes_of(1.0, 0.0)
    assert error < 5.0 * plain[-1]
    assert max(deviations[3000:3010]) > max(plain)
    assert (
        max(plain) <= math.sqrt(Kalman.quality(KalmanConfig(), mission_of(DeclaredGusts(0.5), 1.0)).error[0, 0]) * 1.001
    )


def test_gusts_beyond_the_declared_ones_widen_the_covariance() -> None:
    _, deviations, _ = fixes_of(20.0, 0.0)
    assert max(deviations) > 1.3 * declared_deviation()


def test_the_filter_is_that_of_filterpy() -> None:
    config, mission = KalmanConfig(), mission_of(DeclaredGusts(1.5, 3.0, 100.0), 5.0)
    ours, axis, rng = Kalman.build(config, mission), AxisModel.from_config(config, mission), np.random.default_rng(2)
    theirs = KalmanFilter(dim_x=3, dim_z=1, dim_u=1)
    theirs.x = np.vstack([mission.start, np.zeros((2, 3))])
    theirs.P, theirs.R = first_covariance(config, mission), np.array([[axis.fix_std**2]])
    reads_position = np.array([[1.0, 0.0, 0.0]])
    for k in range(200):
        t, u, place = 0.1 * k, rng.normal(size=3), np.array(mission.start) + rng.normal(size=3)
        estimate = ours.update(t, [fix(t, place)], u)
        if k:
            F, B, Q = axis.discretised(0.1)
            theirs.predict(u[np.newaxis, :], B, F, Q)
        theirs.update(place[np.newaxis, :], H=reads_position)
        np.testing.assert_allclose(estimate.x, theirs.x[:2].ravel(), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(estimate.extra["gust"], theirs.x[2], rtol=0.0, atol=1e-12)
        assert estimate.covariance is not None
        np.testing.assert_allclose(estimate.covariance, np.kron(theirs.P[:2, :2], np.eye(3)), rtol=1e-12, atol=1e-15)
