"""The protection level of a pose: what its error is within while no test has found a fault."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.integrity.pose_protection import no_responses, nothing_since, respond
from mathnavi.estimators.integrity.ranging import PoseWitness
from mathnavi.estimators.integrity.windows import Thresholds
from mathnavi.estimators.ranging.pose_filter import RangeEkf
from mathnavi.interfaces.signals import Array
from tests.estimators.integrity.test_ranging import ANGLES, FIRST, NOISE, ODOMETRY, PERIOD, WALL, Drive, driven

USED = np.ones(len(ANGLES) + 1, dtype=bool)


def watched(drive: Drive, noise: float = NOISE, odometry: tuple[float, float] = ODOMETRY) -> tuple[Array, Array, Array]:
    """Errors, protection levels and three deviations (n, 2) of an EKF, until the witness alarms."""
    quality = mn.RangeQuality(absolute=noise), mn.OdometryQuality(noise=odometry)
    mission = mn.RangingMission(
        WALL, ANGLES, *quality, start=mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05)), period=PERIOD
    )
    estimator, witness, before, found = RangeEkf(RangeEkf.Config(), mission), PoseWitness(mission), None, []
    for k, (z, u, x) in enumerate(zip(drive.ranges, drive.odometry, drive.x, strict=True)):
        t = PERIOD * (k + 1)
        readings = mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u)
        estimate = estimator.update(t, readings, u)
        if witness.take(before, estimate, readings, u, USED).ratio > 1.0:
            break
        d, P = estimate.x - x, estimate.covariance
        assert P is not None
        error = math.hypot(d[0], d[1]), abs(math.remainder(d[2], 2.0 * math.pi))
        sure = 3.0 * math.sqrt(np.linalg.eigvalsh(P[:2, :2])[-1]), 3.0 * math.sqrt(P[2, 2])
        found.append((error, witness.protection, sure))
        before = estimate
    return tuple(np.array(each) for each in zip(*found, strict=True))  # type: ignore[return-value]


def longer(ray: int, bias: float) -> Callable[[Drive], None]:
    def change(drive: Drive) -> None:
        drive.ranges[FIRST:, ray] += bias

    return change


def faster(bias: float) -> Callable[[Drive], None]:
    def change(drive: Drive) -> None:
        drive.odometry[FIRST:, 0] += bias

    return change


def test_the_error_by_a_bias_that_no_test_has_found_is_within_the_level() -> None:
    sure, levels = [], []
    for channel in range(4):
        within = []
        for seed, size in enumerate((-0.02, 0.015, 0.03)):
            drive = driven(40 + seed)
            (longer(channel, size) if channel < 3 else faster(0.5 * size))(drive)
            error, level, three = (each[FIRST:] for each in watched(drive))
            within += [*(error <= level).all(axis=1)]
            sure += [*(error <= three).all(axis=1)]
            levels += [*level[:, 0]]
        assert np.mean(within) >= 0.99, channel
    assert np.mean(sure) < 0.8  # the biases are ones that three deviations do not cover
    assert np.median(levels) < 0.08


def test_it_is_as_many_deviations_at_any_size_of_the_noise() -> None:
    drive = driven(3)
    drive.ranges[:] = [WALL.ranges(pose, ANGLES)[0] for pose in drive.x]
    levels = [watched(drive, size * NOISE, (size * 0.02, size * 0.02))[1] for size in (0.5, 1.0)]
    np.testing.assert_allclose(levels[1][100:300], 2.0 * levels[0][100:300], rtol=0.05)


def response(bias: Array, steps: int, between: int, moved: Array) -> tuple[float, float]:
    """Level of one branch after so many updates of which every ``between``-th responds, of three rays at a fixed pose
    while the pose seems to move by ``moved`` (2,) [m] in each.
    """
    H, R, P = np.array([[1.0, 0.2, 0.0], [-0.3, 1.0, 0.4], [-0.6, -0.8, 0.9]]), np.full(3, 4e-4), 1e-5 * np.eye(3)
    known = Thresholds.of(3, PERIOD, (0.1, 0.5, 2.0, 5.0), further=1)
    responses, since, level = no_responses(1, 3), nothing_since(3), (math.nan, math.nan)
    for k in range(1, steps + 1):
        since += np.array([*moved, PERIOD, 0.0, PERIOD, 1.0, 1.0, 1.0, 1.0])
        if k % between == 0:
            level = respond(
                responses, np.array([float(k)]), 1e-4 * np.eye(3)[None], since, H, R, P, bias, known.lengths, 50.0,
                1.0, known.z, known.energy[3],
            )  # fmt: skip
    return level


def test_it_is_the_response_of_a_kalman_filter_to_the_least_bias_that_is_found() -> None:
    """Of one ray alone that is at fault, by a filter that is written out."""
    H, R, P = np.array([[1.0, 0.2, 0.0]]), 4e-4, 1e-5 * np.eye(3)
    known = Thresholds.of(3, PERIOD, (0.1, 0.5, 2.0, 5.0), further=1)
    s = (H @ P @ H.T).item() + R
    K = P @ H.T / s
    a, total, best, level = np.zeros((3, 1)), 0.0, 0.0, 0.0
    only = np.array([True, False, False, False])
    for k in range(1, 41):
        total += (1.0 - (H @ a).item()) / math.sqrt(s)
        a += K * (1.0 - (H @ a).item())
        window = min(length for length in known.lengths if length >= k)
        best = max(best, total / math.sqrt(window) / (known.z + 2.326))
        if k == 25:  # dead reckoning is tested
            reckoned = math.sqrt(float((a.T @ a).item()) / 1e-4)
            best = max(best, reckoned / (math.sqrt(known.energy[3]) + 2.326))
        level = math.hypot(a[0, 0], a[1, 0]) / best
    assert response(only, 40, 1, np.zeros(2))[0] == pytest.approx(level, rel=1e-9)


def test_it_changes_little_where_several_updates_are_taken_as_one() -> None:
    one, four = (response(np.ones(4, dtype=bool), 96, between, np.array([0.005, 0.001])) for between in (1, 4))
    np.testing.assert_allclose(four, one, rtol=0.15)


def test_what_no_reading_would_find_is_not_protected() -> None:
    """Without ranges nothing tells odometry that is off."""
    assert response(np.array([False, False, False, True]), 8, 4, np.zeros(2)) == (math.inf, math.inf)


def test_it_is_not_known_before_there_is_an_estimate_and_is_published_by_every_update() -> None:
    from mathnavi.sim.plugin.registry import load

    mission = mn.RangingMission(WALL, ANGLES, mn.RangeQuality(absolute=NOISE), period=PERIOD)
    plugin, drive = load("estimators", "feasible_set_bank"), driven(3)
    bank, levels = plugin.build(plugin.Config(), dataclasses.replace(mission)), []
    for k, (z, u) in enumerate(zip(drive.ranges[:150], drive.odometry, strict=False)):
        t = PERIOD * (k + 1)
        found = bank.update(t, (mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u)), u)
        levels.append(found.extra["protection"])
    assert np.isnan(levels[0]).all()
    assert np.isfinite(levels[-1]).all()
    assert {each.shape for each in levels} == {(2,)}
