"""The study of integrity: from when on a fault can be found, and what an estimate is judged by until then."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mathnavi.interfaces.signals import Estimate, Measurement, Status
from mathnavi.models.unicycle.quality import KnownStart
from mathnavi.studies.ranging.integrity import Cell, claims
from mathnavi.studies.ranging.integrity_detection import findable
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, judged
from mathnavi.studies.ranging.pose_integrity import (
    DURATION,
    END,
    ONSET,
    PERIOD,
    SETTLED,
    UNSURE,
    Drive,
    _mission,
    _updates,
    driven,
)

ONE, LAST = round(ONSET / PERIOD), round(END / PERIOD)
DURING = slice(ONE, LAST)
TIMING = Timing(PERIOD, ONSET, END, SETTLED)
Update = tuple[float, tuple[Measurement, ...], np.ndarray]


@pytest.fixture(scope="module")
def quiet() -> Drive:
    drive = driven(np.random.default_rng(7))
    return dataclasses.replace(
        drive, ranges=drive.ranges - drive.noise, noise=np.zeros_like(drive.noise), odometry=drive.commands.copy()
    )


def first_found(quiet: Drive, bias: float, spread: float = 1.0) -> float:
    """Time [s] from the onset until a bias of a ray can be found within 2 s, or noise of so many times the variance."""
    drive = dataclasses.replace(quiet, ranges=quiet.ranges.copy())
    drive.ranges[DURING, 1] += bias
    first = drive.fine[0]
    mission = _mission(KnownStart((first[0], first[1], first[2]), (UNSURE, UNSURE, UNSURE)))
    found = findable(mission, list(_updates(drive))[: ONE + 100], DURING, np.full(3, spread))
    assert not found[:ONE].any()
    return PERIOD * float(np.argmax(found) - ONE) if found.any() else math.inf


def test_the_larger_a_bias_the_sooner_it_can_be_found_and_without_one_nothing_is(quiet: Drive) -> None:
    assert first_found(quiet, 0.0) == math.inf
    assert first_found(quiet, 0.002) == math.inf
    times = [first_found(quiet, bias) for bias in (0.05, 0.1)]
    assert times[1] <= times[0] <= 1.0
    assert times[1] < 0.3


def test_noise_of_nine_times_the_variance_is_found_without_a_bias(quiet: Drive) -> None:
    assert first_found(quiet, 0.0, 9.0) < 1.0


def test_until_it_can_be_found_a_fault_is_judged_by_the_level_and_then_by_three_deviations() -> None:
    count = round(DURATION / PERIOD)
    truth, P = np.zeros((count, 3)), 1e-4 * np.eye(3)
    estimates = [
        Estimate(PERIOD * k, np.array([0.05 if k >= ONE else 0.0, 0.0, 0.0]), P, Status.OK, {"protection": level})
        for k, level in enumerate(np.where(np.arange(count)[:, None] < ONE + 200, [0.06, 0.06], [0.04, 0.04]))
    ]
    late, early = np.arange(count) >= ONE + 400, np.arange(count) >= ONE + 100
    whole = count - ONE
    one, other = (judged(estimates, truth, each, TIMING) for each in (late, early))
    assert one.position == other.position == 1.0
    assert one.judged == pytest.approx((whole - 200) / whole)
    assert other.judged == pytest.approx((whole - 100) / whole)
    assert one.kept == other.kept == pytest.approx(200 / whole)
    assert (one.findable, other.findable) == (8.0, 2.0)


def test_a_filter_of_which_the_monitor_is_a_part_has_no_share_in_what_is_said_of_runs_without() -> None:
    done = Outcome(0.1, 0.0, 0.0, 1.0, 2.0, 0.1, 1.0, 0.1, 1.0)
    rows = [
        {"estimator": name, "fault": "off", "monitored": monitored, **vars(done)}
        for name, monitored in (("one", True), ("one", False), ("other", True))
    ]
    claim = claims([Cell(name, "off", rows) for name in ("one", "other")])[0]
    assert "without the monitor 10% on average" in claim.measured
