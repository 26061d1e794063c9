"""Filters without a sensor each beside that of a flight: their steps, and the protection level that they give."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.beacons.flight_kernels import condition_flights, predict_flights
from mathnavi.estimators.beacons.flight_separation import FlightSeparation
from mathnavi.estimators.beacons.flight_side import Side
from mathnavi.estimators.flight_model import AxisModel, KalmanConfig
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.aerial.beacon_readings import DIFFERENCE, BeaconRows
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.beacon_names import BeaconKind
from mathnavi.studies.ranging import flight_integrity as study
from mathnavi.studies.ranging.integrity_judging import Watched
from tests.estimators.beacons.flights import FLAT, FOUR, SIX, flight

EVERYTHING: tuple[BeaconKind, ...] = ("ranges", "bearings", "range-differences")


def wide(rng: np.random.Generator) -> tuple[Array, Array]:
    """A state (9,) and a covariance (9, 9) with which second derivatives matter."""
    A = rng.standard_normal((9, 9)) * np.repeat([20.0, 3.0, 1.0], 3)[:, None]
    return np.array([2000.0, 3100.0, 420.0, 20.0, -5.0, 1.0, 0.3, 0.1, -0.2]), A @ A.T / 9.0


def test_a_step_is_that_of_the_filter_of_all_readings() -> None:
    rng, rows = np.random.default_rng(4), BeaconRows(FlightBeacons(SIX, noise=0.5, read=EVERYTHING))
    x, P = wide(rng)
    F, B, Q = AxisModel(1.0, 3.0, 1.0).discretised(0.1)
    u = np.array([1.0, -2.0, 0.5])
    side, states, covariances = Side(x, P), np.zeros((1, 10)), np.zeros((1, 10, 10))
    states[0, :9], covariances[0, :9, :9] = x, P
    side.predict(np.kron(F, np.eye(3)), np.outer(B, u).ravel(), np.kron(Q, np.eye(3)))
    predict_flights(states, covariances, np.ascontiguousarray(F), np.outer(B, u).ravel(), np.ascontiguousarray(Q))
    y = np.array([rows.at(k, x[:3] + 5.0)[0] for k in range(rows.size)])
    y[rows.slices["beacon_differences"].start] = np.nan
    shared = rows.kinds == DIFFERENCE
    for differing in (False, True):
        if differing:
            side.share(rows.common)
        for k in np.flatnonzero((shared == differing) & np.isfinite(y)).tolist():
            expected, H, R = side.expected(rows, k)
            PH, S = side.spread(H, R, shared=differing)
            side.condition(PH, rows.innovation(k, y[k], expected), S)
    side.share(None)
    refused = np.empty(1)
    condition_flights(
        states, covariances, y, rows.kinds, rows.beacons, rows.places, rows.variance, rows.common, 1e9,
        np.array([-2]), refused,
    )  # fmt: skip
    assert refused[0] == 0.0
    assert states[0, :9] == pytest.approx(side.x, abs=1e-6)
    assert covariances[0, :9, :9] == pytest.approx(side.P, abs=1e-6)


def test_the_filter_without_a_sensor_is_that_of_the_others_alone() -> None:
    rng, rows = np.random.default_rng(5), BeaconRows(FlightBeacons(FOUR, read=EVERYTHING))
    x, P = wide(rng)
    y = np.array([rows.at(k, x[:3] + 5.0)[0] for k in range(rows.size)])
    given = {2: (np.where(rows.beacons == 2, np.nan, y), x[:3] + 6.0), 4: (y, None)}  # 4 is without the fixes

    def conditioned(y: Array, fix: Array | None) -> Array:
        beside = FlightSeparation(rows, 1e9, 4.0, 100.0, 1.0)
        beside.begin(x, P)
        beside.condition(y, beacons=True, common=rows.common)
        if fix is not None:
            beside.condition(fix, beacons=False)
        return beside._x[:, :9]

    both = conditioned(y, x[:3] + 6.0)
    for i, (own, fix) in given.items():
        assert both[i] == pytest.approx(conditioned(own, fix)[i], abs=1e-9)
        assert both[i] != pytest.approx(both[0], abs=1e-3)


@pytest.mark.parametrize(
    ("places", "read", "off"), [(SIX, ("ranges",), 1.5), (FLAT, ("ranges",), 2.0), (SIX, ("range-differences",), 1.5)]
)
def test_the_level_holds_where_a_fault_is_too_small_to_be_found(
    places: tuple[tuple[float, float, float], ...], read: tuple[BeaconKind, ...], off: float
) -> None:
    for seed in range(2):
        run = flight(places, seed, 30.0, failing=(1, off), read=read)
        level = np.array([each.extra["protection"] for each in run.estimates])
        deviations = np.array([np.linalg.eigvalsh(each.covariance[:3, :3])[-1] for each in run.estimates])  # type: ignore[index]
        assert (np.linalg.norm(run.error, axis=1) <= level[:, 0]).all()
        assert np.median(level[:, 0]) < 12.0 * np.sqrt(np.median(deviations))


def test_without_beacon_0_the_differences_of_the_others_have_a_level() -> None:
    run = flight(SIX, 0, 30.0, failing=(0, 8.0), read=("range-differences",))
    level = np.array([each.extra["protection"] for each in run.estimates])
    assert run.left_out[-1].tolist() == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert (np.linalg.norm(run.error, axis=1) <= level[:, 0]).all()
    assert np.median(level[-300:, 0]) < 12.0


def test_three_ranges_have_no_level_that_is_worth_much_and_no_start_is_a_fault() -> None:
    run = flight(FOUR[:3], 0, 30.0)
    level = np.array([each.extra["protection"] for each in run.estimates])
    assert run.ok.all()
    assert level[0, 0] < 30.0
    assert level[-1, 0] > 300.0 or math.isinf(level[-1, 0])


def test_readings_that_are_all_late_are_no_beacon_at_fault_and_are_remembered() -> None:
    outcome = study.watched(Watched("kalman, beacons", "readings 0.5 s late", 5000, monitored=True))
    assert outcome.judged == 0.0
    assert outcome.position == 0.0
    assert math.isfinite(outcome.recovered)


def test_gusts_that_are_larger_than_declared_are_found_by_the_estimated_gust() -> None:
    outcome = study.watched(Watched("kalman, beacons", study.GUSTY, 5002, monitored=True))
    assert outcome.detected < 10.0
    assert outcome.false == 0.0


def test_a_horizon_that_has_lost_its_flight_begins_at_the_next_fix() -> None:
    outcome = study.watched(Watched("moving_horizon, fixes", "fixes stuck", 5001, monitored=True))
    assert outcome.recovered < 25.0
    assert outcome.position == 0.0  # though after 20 s the estimate agrees with the fix that stays


def test_what_the_longest_window_has_of_an_alarm_is_no_other_alarm() -> None:
    for seed in (5000, 5001):
        outcome = study.watched(Watched("moving_horizon, fixes", "readings 0.5 s late", seed, monitored=True))
        assert outcome.judged == 0.0
        assert outcome.recovered < 38.0


def test_a_lost_flight_has_no_level() -> None:
    run = flight(FOUR[:2], 3, 60.0, config=KalmanConfig(position_std_max=5.0))
    lost = [each for each in run.estimates if each.status is Status.LOST]
    assert lost
    assert all(np.isinf(each.extra["protection"]).all() for each in lost[30:])
