"""A robot among beacons whose sensors fail: which is found, what the estimate is worth, and what is said of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import binom, chi2

import mathnavi as mn
from mathnavi.estimators.beacons.filter import BeaconFilter
from mathnavi.estimators.beacons.refusals import Refusals, most_of
from mathnavi.estimators.beacons.witness import TESTED, RobotBeaconWitness
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.beacon_names import DIFFERENCES, RANGES
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from mathnavi.studies.ranging import beacon_integrity as study
from mathnavi.studies.ranging.integrity_judging import Watched
from tests.estimators.beacons.drives import PLACES, drive, mission


def difference(found: mn.EstimateHistory, truth: Array) -> Array:
    """Error (n, 3) [m, m, rad]."""
    error: Array = found.x - truth
    error[:, 2] = wrapped(error[:, 2])
    return error


def test_a_beacon_at_fault_is_named_left_out_and_read_again() -> None:
    driven = drive(scale=0.0, outliers=0.0)
    t, ranges = driven.log.t, np.array(driven.log.readings[RANGES])
    during = (t >= 40.0) & (t < 70.0)
    ranges[during, 2] += 2.0
    log = mn.SensorLog(t, {**driven.log.readings, RANGES: ranges})
    found = mn.estimate("beacon_bank", mission(), log)
    error = difference(found, driven.truth)
    assert not sure_and_wrong(t, found.ok, error, found.covariance).any()
    left_out = found.extra["left_out"]
    assert left_out[t > 50.0][0].tolist() == [0.0, 0.0, 1.0, 0.0]
    assert not left_out[-1].any()
    assert any("leaves out beacon 2" in each for each in found.message)
    assert np.hypot(*error[during, :2].T).max() < 1.5
    assert (np.hypot(error[:, 0], error[:, 1]) <= found.extra["protection"][:, 0])[found.ok].all()


@pytest.mark.parametrize(
    "fault", ["a beacon 1 m too long", "a beacon drifts", "odometry times 1.15", "two beacons stuck"]
)
def test_no_fault_leaves_it_sure_and_wrong_and_it_is_right_again_afterwards(fault: str) -> None:
    outcome = study.watched(Watched(study.ESTIMATORS[0], fault, 6002, monitored=True))
    assert outcome.judged == 0.0
    assert outcome.false == 0.0
    assert outcome.kept > 0.99
    assert math.isfinite(outcome.recovered)
    assert outcome.detected < 15.0


def test_without_a_fault_separations_are_chi_square_and_the_protection_level_is_kept() -> None:
    squares, kept = [], []
    for seed in range(4):
        driven = study.driven(np.random.default_rng(seed))
        robot = BeaconFilter(BeaconFilter.Config(), study._mission(study._known(driven.fine[0])))
        for update, truth in zip(study._updates(driven), driven.truth, strict=True):
            estimate = robot.update(*update)
            error = robot.model.mission.error(estimate.x, truth)
            squares.append(estimate.extra["separation"])
            kept.append(np.less_equal(error, estimate.extra["protection"]).all())
    assert np.mean(kept) > 0.999
    assert (np.array(squares) > chi2.isf(1e-3, 3)).mean() < 5e-3
    assert 0.2 < np.mean(squares) < 3.5  # of three degrees of freedom, fewer where a direction is not separate


def test_odometry_that_is_wrong_is_mistrusted_and_its_scale_is_found() -> None:
    rng = np.random.default_rng(11)
    driven = study.driven(rng)
    during = slice(round(study.ONSET / study.PERIOD), round(study.END / study.PERIOD))
    study.FAULTS["odometry times 1.15"](driven, during, rng)
    asked = study._mission(study._known(driven.fine[0]))
    robot, alone = BeaconFilter.build(BeaconFilter.Config(), asked), BeaconFilter(BeaconFilter.Config(), asked)
    alone._separation = None  # type: ignore[assignment]
    errors = []
    for update, truth in zip(study._updates(driven), driven.truth, strict=True):
        errors.append([math.dist(each.update(*update).x[:2], truth[:2]) for each in (robot, alone)])
    late = np.square(errors)[during][80:]
    one, other = np.sqrt(late.mean(axis=0))
    assert one < 0.4 * other


def test_a_reading_that_is_only_tested_changes_no_state() -> None:
    driven = drive(outliers=0.0)
    asked = mission(start=mn.KnownStart(tuple(driven.truth[0]), (0.3, 0.3, 0.1), float(driven.log.t[0])))
    one, other = (BeaconFilter(BeaconFilter.Config(), asked) for _ in range(2))
    value = np.array([np.nan, 30.0, np.nan, np.nan])
    a = one.update(0.5, (Measurement(RANGES + TESTED, 0.5, value),), np.ones(2))
    b = other.update(0.5, (), np.ones(2))
    assert np.array_equal(a.x, b.x)
    assert np.array_equal(a.covariance, b.covariance)
    assert np.isfinite(a.extra["innovations"]).tolist() == [False, True, False, False]
    assert not np.isfinite(a.extra["whitened_innovations"]).any()


def test_without_beacon_0_no_range_difference_is_used() -> None:
    robot = BeaconFilter(BeaconFilter.Config(), mission("range_differences"))
    witness = RobotBeaconWitness(robot.model)
    reading = Measurement(DIFFERENCES, 1.0, np.array([np.nan, 1.0, 2.0, 3.0]))
    used, tested = witness.without((reading,), frozenset({0}))
    assert not np.isfinite(used.value).any()
    assert tested.value[1:].tolist() == [1.0, 2.0, 3.0]
    used, tested = witness.without((reading,), frozenset({2}))
    assert np.isfinite(used.value).tolist() == [False, True, False, True]
    assert np.isfinite(tested.value).tolist() == [False, False, True, False]
    assert len(PLACES) == len(witness.names)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.05, 0.3])
@pytest.mark.parametrize("n", [4, 16, 128])
def test_more_refusals_than_declared_are_a_chance_of_one_in_100_000(n: int, share: float) -> None:
    most = most_of(n, share)
    assert binom.sf(most, n, share) <= 1e-5
    assert most == 0 or binom.sf(most - 1, n, share) > 1e-5


def test_refusals_of_one_beacon_are_not_hidden_by_the_others() -> None:
    refusals = Refusals(8, 0.05)
    for k in range(64):
        refusals.note(k % 8, k % 8 == 3 and k >= 32)
    assert not refusals.as_declared
    refusals.clear()
    assert refusals.as_declared
