"""A flight does not leap: where its readings do, they are late, or either place may be the right one."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.kalman import Kalman
from mathnavi.estimators.moving_horizon import MovingHorizonConfig, MovingHorizonEstimator
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.beacons import FlightBeacons, slant_ranges
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.beacon_names import RANGES
from mathnavi.models.terrain.height_field import HeightField

PERIOD, EVERY, SPEED, TURN = 1.0 / 30.0, 3, 25.0, 0.04  # [s], updates between readings, [m/s], [rad/s]
LATE, BEGIN, END, DURATION = 0.5, 15.0, 60.0, 95.0  # [s]
NOISE = 2.0  # [m]
PLACES = (
    (0.0, 0.0, 50.0), (6000.0, 0.0, 900.0), (0.0, 6000.0, 300.0), (6000.0, 6000.0, 10.0), (3000.0, 3000.0, 1200.0),
)  # fmt: skip
"""[m]"""


def mission_of(beacons: FlightBeacons | None = None, rate: float = 1.0 / (EVERY * PERIOD)) -> FlightMission:
    terrain, start = HeightField(np.zeros((3, 3)), 3000.0), (*path(0.0)[:2].tolist(), 500.0)
    return FlightMission(
        terrain, start, (5000.0, 5000.0, 500.0), gust=DeclaredGusts(0.5), beacons=beacons, position_noise=NOISE,
        control_period=PERIOD, position_rate=rate,
    )  # fmt: skip


def path(t: float) -> Array:
    """Position (3,) [m] on a circle that is begun gently: no velocity at 0 s, ``SPEED`` from 10 s on."""
    angle = TURN * (t - 5.0 if t > 10.0 else t * t * t / 100.0 - t**4 / 2000.0)
    radius = SPEED / TURN
    return np.array([3000.0 + radius * math.cos(angle), 2500.0 + radius * math.sin(angle), 500.0])


def acceleration(t: float) -> Array:
    """[m/s^2] on the way, on average over a period before t."""
    h = 0.5 * PERIOD
    return (path(t) - 2.0 * path(t - h) + path(t - 2.0 * h)) / h**2


def flown(
    estimator: Estimator,
    duration: float,
    *,
    late: bool = False,
    aside: float = 0.0,
    off: float = 0.0,
    every: int = EVERY,
    gust: float = 0.0,
    seed: int = 3,
) -> Iterator[tuple[Estimate, Array]]:
    """Estimates and positions (3,) of a flight; its readings, in ``every`` update, are ``LATE``, or of a place that is
    ``off`` [m], from BEGIN to END, or the vehicle is moved ``aside`` [m] at BEGIN, or by gusts of ``gust`` [m/s^2].
    """
    rng, among = np.random.default_rng(seed), isinstance(estimator, Guarded)
    blown, keep = np.zeros((3, 3)), math.exp(-PERIOD / DeclaredGusts(0.5).time_constant)  # place, velocity, gust
    for k in range(round(duration / PERIOD)):
        t = k * PERIOD
        ago = LATE if late and BEGIN <= t < END else 0.0
        outward = path(t) - np.array([3000.0, 2500.0, 500.0])
        moved = aside * outward / np.linalg.norm(outward) if t >= BEGIN else np.zeros(3)
        if gust > 0.0 and BEGIN <= t < END:
            blown[2] = keep * blown[2] + gust * math.sqrt(1.0 - keep**2) * rng.standard_normal(3)
        blown[:2] += PERIOD * blown[1:]
        moved = moved + blown[0]
        seen = path(t - ago) + moved + (off if BEGIN <= t < END else 0.0) * np.array([0.0, 0.6, 0.8])
        readings: tuple[Measurement, ...] = ()
        if k % every == 0 and among:
            ranges = slant_ranges(np.array(PLACES), seen)[0]
            readings = (Measurement(RANGES, t, ranges + NOISE * rng.standard_normal(len(PLACES))),)
        elif k % every == 0:
            readings = (Measurement("position", t, seen + NOISE * rng.standard_normal(3)),)
        yield estimator.update(t, readings, acceleration(t)), path(t) + moved


def by_fixes(rate: float = 10.0) -> Estimator:
    return Kalman.build(KalmanConfig(timeout=4.0), mission_of(rate=rate))


def by_window() -> Estimator:
    return MovingHorizonEstimator.build(MovingHorizonConfig(), mission_of())


def by_ranges() -> Estimator:
    return Kalman.build(KalmanConfig(), mission_of(FlightBeacons(PLACES, noise=NOISE)))


@pytest.mark.parametrize("estimator", [by_fixes(), by_window(), by_ranges()], ids=["fixes", "window", "ranges"])
def test_late_readings_are_doubted_for_as_long_as_they_are_late(estimator: Estimator) -> None:
    late = [(e, x) for e, x in flown(estimator, DURATION, late=True) if e.t > BEGIN + 1.0]
    during = [e for e, _ in late if e.t < END]
    assert all(e.status is not Status.OK for e in during)
    assert any("0.5" in e.message and "late" in e.message for e in during)  # it says by how much
    after = [(e, x) for e, x in late if e.t > DURATION - 2.0]
    assert all(e.status is Status.OK and np.linalg.norm(e.x[:3] - x) < 4.0 for e, x in after)


@pytest.mark.parametrize("estimator", [by_fixes(), by_ranges()], ids=["fixes", "ranges"])
def test_a_vehicle_that_was_moved_aside_is_not_taken_for_late_readings(estimator: Estimator) -> None:
    estimates = [e for e, _ in flown(estimator, BEGIN + 35.0, aside=LATE * SPEED) if e.t > BEGIN + 1.0]
    assert not any("late" in e.message for e in estimates)
    assert any(e.status is not Status.OK for e in estimates)
    assert estimates[-1].status is Status.OK


@pytest.mark.parametrize("estimator", [by_fixes(), by_window()], ids=["fixes", "window"])
def test_fixes_that_leap_may_be_off_by_that_until_they_leap_back(estimator: Estimator) -> None:
    found = [(e, float(np.linalg.norm(e.x[:3] - x))) for e, x in flown(estimator, DURATION, off=20.0) if e.t > BEGIN]
    sure = [(e, error) for e, error in found if e.status is Status.OK]
    assert any(e.t < END for e, _ in sure)  # it goes on by the fixes
    assert all(error < 3.0 * deviation(e) for e, error in sure)
    last, error = sure[-1]
    assert last.t > DURATION - 1.0
    assert error < 3.0 * deviation(last) < 6.0


def test_a_leap_of_fixes_that_come_once_a_second_is_remembered_too() -> None:
    found = [(e, float(np.linalg.norm(e.x[:3] - x))) for e, x in flown(by_fixes(1.0), DURATION, off=40.0, every=30)]
    sure = [e.t for e, error in found if e.status is Status.OK and error > 3.0 * deviation(e)]
    assert len(sure) * PERIOD < 2.0
    assert sum(e.status is Status.OK for e, _ in found if BEGIN < e.t < END) * PERIOD > 10.0  # it goes on by them
    assert deviation(found[-1][0]) < 4.0


def test_larger_gusts_are_no_leap() -> None:
    for seed in (4, 6):
        last = [e for e, _ in flown(by_fixes(), DURATION, gust=2.5, seed=seed)][-1]
        assert deviation(last) < 8.0


def deviation(estimate: Estimate) -> float:
    """The largest standard deviation [m] of the position in any direction."""
    assert estimate.covariance is not None
    return math.sqrt(float(np.linalg.eigvalsh(estimate.covariance[:3, :3])[-1]))
