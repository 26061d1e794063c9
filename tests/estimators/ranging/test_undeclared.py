"""Errors that were not declared: the bank finds the pose all the same, or says that it does not know it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.ranging.bank_kernels import (
    LEAST_SLIP,
    MOST_SLIP,
    Scoring,
    condition_each,
    covariance_of,
    declare_scale,
    no_hypotheses,
    predict_each,
)
from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBank, FeasibleSetBankConfig
from mathnavi.estimators.ranging.kalman_kernels import no_innovations
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.noise_kernels import WINDOW, declared_noise
from mathnavi.interfaces.signals import Estimate, Status
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality
from mathnavi.studies.ranging.mismatch import honesty
from tests.estimators.ranging.runs import with_odometry, with_ranges
from tests.estimators.ranging.walls import FIELD, SENSORS
from tests.ranging import Step, driven

START = np.array([0.6, -0.2, 0.5])
SCORING = Scoring(1.0, 0.9, -20.0, 0.0)
NEARLY_ROUND = Curve(((0.0, 0.0, 0.0, 0.0), (2.2, 0.0, 0.0, 2.16), (0.03, 0.0, 0.0, 0.03)), "nearly round")


def mission(sensors: str = "2s", curve: Curve = FIELD) -> RangingMission:
    """As it is declared."""
    angles = tuple(math.radians(angle) for angle in SENSORS[sensors])
    return RangingMission(curve, angles, RangeQuality(0.05), OdometryQuality((0.05, 0.05), 0.02))


def estimates_of(task: RangingMission, steps: Sequence[Step]) -> list[Estimate]:
    bank = FeasibleSetBank(FeasibleSetBankConfig(), task)
    return [bank.update(step.t, step.measurements, step.command) for step in steps]


def last_error(task: RangingMission, steps: Sequence[Step], estimates: Sequence[Estimate]) -> float:
    """The largest of the last second [m or rad]."""
    tail = zip(estimates[-100:], steps[-100:], strict=True)
    return max(max(task.error(estimate.x, step.truth)) for estimate, step in tail)


def test_twice_the_declared_noise_is_found_and_the_pose_too() -> None:
    for seed in range(3):
        task = mission()
        true = dataclasses.replace(task, ranging=RangeQuality(0.1))
        steps = list(driven(true, START, 6.0, rng=np.random.default_rng(seed)))
        estimates = estimates_of(task, steps)
        assert last_error(task, steps, estimates) < 0.15
        assert estimates[-1].status is Status.OK
        assert estimates[-1].extra["noise"][0] == pytest.approx(2.0, rel=0.15)


def test_outliers_that_were_not_declared_are_found_and_the_pose_too() -> None:
    for seed in range(3):
        task, rng = mission(), np.random.default_rng(seed + 10)
        steps = [
            with_ranges(step, lambda r, rng=rng: np.where(rng.random(2) < 0.3, rng.uniform(0.0, 7.5, 2), r))  # type: ignore[misc]
            for step in driven(task, START, 6.0, rng=np.random.default_rng(seed))
        ]
        estimates = estimates_of(task, steps)
        assert last_error(task, steps, estimates) < 0.15
        assert estimates[-1].status is Status.OK
        assert estimates[-1].extra["noise"][1] == pytest.approx(0.3, abs=0.06)


def test_odometry_that_is_off_without_being_declared_does_not_make_it_too_sure() -> None:
    squares = []
    for seed in range(6):
        task = dataclasses.replace(mission(), odometry=OdometryQuality((0.05, 0.05), 0.0))
        true = dataclasses.replace(task, odometry=OdometryQuality((0.05, 0.05), 0.05))
        steps = list(driven(true, START, 8.0, rng=np.random.default_rng(seed)))
        estimates = estimates_of(task, steps)
        for estimate, step in list(zip(estimates, steps, strict=True))[-300::50]:
            error = task.difference(estimate.x, step.truth)
            assert estimate.covariance is not None
            squares.append(error @ np.linalg.solve(estimate.covariance, error))
    assert np.mean(squares) < 6.0


@pytest.mark.parametrize("seed", [1003, 1011])
def test_odometry_that_is_off_is_not_sure_and_wrong_in_the_first_seconds_in_which_nothing_shows_it(seed: int) -> None:
    off = {"noise.odometry_bias": 0.0, "mismatch.odometry_bias": 0.05}
    found = honesty(mn.run("range-localisation", seed=seed, duration=3.0, **off))
    assert found["sure_and_wrong"] == 0.0
    assert found["known"] > 0.9


def test_what_is_known_of_a_scale_is_what_a_filter_of_that_prior_knows() -> None:
    """A filter that takes the scale of its odometry as declared also says what one with a prior of 2 % would."""
    task = dataclasses.replace(mission("4"), odometry=OdometryQuality((0.05, 0.05), 0.0))
    true = dataclasses.replace(task, odometry=OdometryQuality((0.05, 0.05), 0.01))
    model, rays = RangeModel(task), task.sensors
    banks = []
    for deviation in (0.0, 0.02):
        bank, noise, innovations = no_hypotheses(1, rays, WINDOW), declared_noise(0.0), no_innovations(rays)
        bank.x[0], bank.P[0], bank.score[0] = [*START, 0.0], model.covariance((0.1, 0.1, 0.1)), 0.0
        declare_scale(bank, 1, deviation)
        for step in list(driven(true, START, 4.0, rng=np.random.default_rng(0)))[1:]:
            rho, u = (each.value for each in step.measurements)
            predict_each(bank, u, model.W, model.wall, task.period, np.ones(2))
            condition_each(bank, 0, rho, model.wall, model.sensors(20.0), noise, SCORING, innovations)
        banks.append(bank)
    declared, known = banks
    m, M = declared.scale[0]
    assert declared.P[0, 3, 3] < 1.1e-8
    assert M < 0.5 * 0.02**2
    np.testing.assert_allclose((m, M), (known.x[0, 3], known.P[0, 3, 3]), rtol=0.05, atol=1e-4)
    b, P = declared.x[0, 3], declared.P[0]
    bias = (m - b) * P[:3, 3] / P[3, 3]
    np.testing.assert_allclose(
        covariance_of(declared, 0) - np.outer(bias, bias), known.P[0, :3, :3], rtol=0.05, atol=1e-6
    )


def test_wheels_that_spin_are_noticed_and_the_pose_is_not_lost() -> None:
    """For half of every second they turn half a metre a second faster, and half a radian."""
    task = mission()
    steps = list(driven(task, START, 8.0, rng=np.random.default_rng(0)))
    slipping = [step if step.t % 1.0 < 0.5 else with_odometry(step, step.measurements[1].value + 0.5) for step in steps]
    estimates = estimates_of(task, slipping)
    assert last_error(task, steps, estimates) < 0.3
    assert max(float(e.extra["slip"][0]) for e in estimates) > 1e3 * LEAST_SLIP
    honest = estimates_of(task, steps)
    assert np.median([float(e.extra["slip"][0]) for e in honest]) < 30.0 * LEAST_SLIP


def test_slip_stays_within_its_bounds() -> None:
    task, rng = mission(), np.random.default_rng(0)
    steps = [with_odometry(s, rng.normal(scale=3.0, size=2)) if s.t else s for s in driven(task, START, 2.0, rng=rng)]
    for estimate in estimates_of(task, steps):
        assert LEAST_SLIP <= estimate.extra["slip"][0] <= MOST_SLIP
    assert (no_hypotheses(3, 2, 9).slip == LEAST_SLIP).all()


def test_in_a_wall_that_is_nearly_round_it_says_both_and_is_never_sure_of_an_image() -> None:
    task = mission(curve=NEARLY_ROUND)
    several = 0
    for seed in range(4):
        steps = list(driven(task, START, 6.0, rng=np.random.default_rng(seed)))
        estimates = estimates_of(task, steps)
        wrong = [max(task.error(e.x, s.truth)) > 0.3 for e, s in zip(estimates, steps, strict=True)]
        known = [e.status is Status.OK for e in estimates]
        assert not any(w and k for w, k in zip(wrong[100:], known[100:], strict=True))
        several += int(np.isfinite(estimates[-1].extra["weights"]).sum() > 1)
    assert several >= 2
