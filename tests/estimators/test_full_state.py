"""The estimator that hands the full-state reading on."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.full_state import FullState, FullStateConfig
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.aerial.dynamics import TICK, flow
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.terrain.height_field import HeightField

X = np.array([500.0, 600.0, 700.0, 30.0, -20.0, 10.0])


@pytest.fixture
def mission() -> FlightMission:
    terrain = HeightField(np.zeros((3, 3)), 1000.0)
    return FlightMission(
        terrain, (100.0, 200.0, 300.0), (900.0, 900.0, 300.0), position_noise=4.0, gust=DeclaredGusts(2.0)
    )


def reading(t: float, x: Array = X) -> list[Measurement]:
    return [Measurement("full_state", t, x)]


def test_a_reading_is_the_estimate(mission: FlightMission) -> None:
    estimate = FullState.build(FullStateConfig(), mission).update(0.0, reading(0.0), np.zeros(3))
    np.testing.assert_array_equal(estimate.x, X)
    assert estimate.covariance is not None
    np.testing.assert_allclose(np.diag(estimate.covariance), [16.0] * 3 + [0.0] * 3)
    assert estimate.status is Status.OK


def test_the_newest_reading_counts_whatever_the_order(mission: FlightMission) -> None:
    estimator = FullState.build(FullStateConfig(), mission)
    estimate = estimator.update(TICK, [*reading(TICK), *reading(0.0, 2.0 * X)], np.zeros(3))
    np.testing.assert_array_equal(estimate.x, X)


def test_without_readings_the_exact_motion_goes_on_and_the_estimate_is_lost_in_time(mission: FlightMission) -> None:
    estimator, u = FullState.build(FullStateConfig(timeout=0.5), mission), np.array([3.0, -1.0, 2.0])
    estimator.update(0.0, reading(0.0), u)
    traces = []
    for k in range(1, 301):
        estimate = estimator.update(k * TICK, [], u)
        np.testing.assert_allclose(estimate.x, flow(X, u, k * TICK), rtol=0.0, atol=1e-9)
        assert estimate.status is (Status.OK if k <= 150 else Status.LOST)
        assert estimate.covariance is not None
        traces.append(np.trace(estimate.covariance))
    assert np.all(np.diff(traces) > 0.0)
    assert estimator.update(301 * TICK, reading(301 * TICK), u).status is Status.OK


def test_the_covariance_without_readings_bounds_what_the_gusts_do(mission: FlightMission) -> None:
    rng, gust, age, ticks = np.random.default_rng(0), mission.gust, 1.0, 300
    estimator = FullState.build(FullStateConfig(), mission)
    estimator.update(0.0, reading(0.0), np.zeros(3))
    covariance = estimator.update(age, [], np.zeros(3)).covariance
    assert covariance is not None
    keep = np.exp(-TICK / gust.time_constant)
    g, x = gust.rms * rng.standard_normal((4000, 3)), np.zeros((4000, 6))
    for _ in range(ticks):
        x = flow(x, g, TICK)
        g = keep * g + gust.rms * np.sqrt(1.0 - keep**2) * rng.standard_normal((4000, 3))
    spread = x.std(axis=0) ** 2 + np.array([16.0] * 3 + [0.0] * 3)
    assert np.all(spread <= np.diag(covariance) * 1.05)
    assert np.all(spread >= np.diag(covariance) * 0.7)


def test_it_mounts_the_sensor_it_reads(mission: FlightMission) -> None:
    (sensor,) = FullState.sensors(FullStateConfig(rate=30.0), mission)
    assert (sensor.name, sensor.rate, sensor.position_noise) == ("full_state", 30.0, 4.0)


def test_its_quality_is_the_noise_of_the_readings_and_the_gusts(mission: FlightMission) -> None:
    quality = FullState.quality(FullStateConfig(), mission)
    np.testing.assert_array_equal(quality.error, np.diag([16.0, 0.0, 0.0]))
    np.testing.assert_allclose(quality.driving, np.diag([0.0, 0.0, 2.0 * 2.0**2 / 3.0]))
