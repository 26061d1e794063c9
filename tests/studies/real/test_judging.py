"""Figures and targets of the study of real logs, on estimates and rows whose figures are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.interfaces.signals import Status
from mathnavi.studies.real.judging import pose_figures, row
from mathnavi.studies.real.targets import TARGETS, judge_arm, judge_attitude, judge_beacons, judge_floor, judge_room


def history(off: np.ndarray, usable_from: int) -> mn.EstimateHistory:
    """Estimates at whole seconds that are ``off`` (n,) [m] along x, with deviations of 0.1."""
    n = len(off)
    x = np.column_stack([off, np.zeros(n), np.zeros(n)])
    statuses = (Status.INITIALISING,) * usable_from + (Status.OK,) * (n - usable_from)
    return mn.EstimateHistory("any", np.arange(n, dtype=float), x, np.tile(0.01 * np.eye(3), (n, 1, 1)), statuses,
                              ("",) * n, {}, {})  # fmt: skip


def test_a_pose_is_locked_once_it_may_be_used_and_stays_near() -> None:
    off = np.full(20, 0.1)
    off[:3] = off[6] = 2.0  # far at first, and once more
    found = pose_figures(history(off, 2), np.arange(20), np.zeros((20, 3)), (0.3, 0.2))
    assert found["lock_s"] == 7.0
    assert found["position_rms_m"] == pytest.approx(math.sqrt((16 * 0.01 + 2 * 4.0) / 18))
    assert found["position_rms_all_m"] == pytest.approx(math.sqrt((16 * 0.01 + 4 * 4.0) / 20))
    assert found["nees"] == pytest.approx((16 * 1.0 + 2 * 400.0) / 18 / 3)
    assert found["wrong_share"] == 0.0  # each for a second and not more
    off[8:12] = 2.0
    assert pose_figures(history(off, 2), np.arange(20), np.zeros((20, 3)), (0.3, 0.2))["wrong_share"] == 4 / 20
    assert math.isnan(pose_figures(history(off, 20), np.arange(20), np.zeros((20, 3)), (0.3, 0.2))["lock_s"])


def windows(place: str, beams: int, found: int, of: int, log: str = "intel") -> list[dict[str, object]]:
    return [
        row(
            part=place,
            log=log,
            beams=beams,
            estimator="feasible_set_bank",
            found=k < found,
            wrong_share=0.0,
            mapped_share=0.9 if k < 7 else 0.1,
        )
        for k in range(of)
    ]


def test_rooms_and_floors_are_judged_by_the_share_that_is_found() -> None:
    measured, holds = judge_room([*windows("room", 4, 6, 10), *windows("room", 8, 10, 10)])
    assert "6 of 10 with 4 beams, 10 of 10 with 8; where the map explains" in measured
    assert "6 of 7 and 7 of 7;" in measured
    assert holds is False
    assert judge_room([*windows("room", 4, 9, 10), *windows("room", 8, 10, 10)])[1]
    assert not judge_room([*windows("room", 4, 9, 10), *windows("room", 8, 9, 10)])[1]
    assert judge_room(windows("room", 8, 9, 10))[1] is None
    both = [*windows("floor", 8, 9, 10), *windows("floor", 8, 8, 10, "freiburg-101")]
    measured, holds = judge_floor(both)
    assert "intel 9 of 10, freiburg-101 8 of 10" in measured
    assert holds is False
    assert judge_floor([*windows("floor", 8, 9, 10), *windows("floor", 8, 0, 10, "fhw")])[1]


def test_without_the_rival_nothing_is_said_of_who_is_better() -> None:
    common = {"part": "beacons", "log": "Plaza1", "beams": 4}
    ours = [
        row(estimator="beacon_bank", start="known", position_rms_all_m=0.24, **common),
        row(estimator="smoother of beacon_bank", start="known", position_rms_all_m=0.2, **common),
    ]
    measured, holds = judge_beacons(ours)
    assert holds is None
    assert "rival not at hand" in measured
    batch, on_line = (
        row(estimator=name, position_rms_all_m=0.2, **common) for name in ("GTSAM, batch", "GTSAM, invariant EKF")
    )
    worse, better = dict(batch, position_rms_all_m=0.21), dict(batch, position_rms_all_m=0.19)
    assert judge_beacons([*ours, worse])[1] is None  # each is compared with its like
    assert judge_beacons([*ours, worse, batch, on_line])[1]
    assert judge_beacons([*ours, better, on_line])[1] is False
    worst = dict(on_line, position_rms_all_m=ours[0]["position_rms_all_m"] / 1.21)
    assert judge_beacons([*ours, batch, worst])[1] is False


def test_an_arm_is_compared_with_the_best_of_the_tuned_filters() -> None:
    errors = {"Butterworth of differences": 3.0, "constant-acceleration Kalman": 1.0, "momentum_observer": 2.0}

    def rows(own: float) -> list[dict[str, object]]:
        every = {**errors, "riemannian_observer": own}
        return [row(part="arm", log="a", estimator=name, velocity_rms_rad_s=each) for name, each in every.items()]

    assert judge_arm(rows(0.9))[1]
    measured, holds = judge_arm(rows(0.95))
    assert "0.95 of constant-acceleration Kalman" in measured
    assert not holds


def test_attitudes_are_compared_by_their_mean_over_trials() -> None:
    def rows(own: float, *others: str) -> list[dict[str, object]]:
        errors = {"a": {"inertial_attitude": own, "VQF": 0.4}, "b": {"inertial_attitude": 0.9, "VQF": 0.8}}
        return [
            row(part="attitude", log=log, estimator=name, inclination_rms_deg=error, wrong_share=0.0)
            for log, by_name in errors.items()
            for name, error in by_name.items()
            if name in ("inertial_attitude", *others)
        ]

    measured, holds = judge_attitude(rows(0.3, "VQF"))
    assert holds
    assert "0.600 deg in the mean of 2 trials, VQF 0.600 deg; the least error in 1 trials" in measured
    assert judge_attitude(rows(0.31, "VQF"))[1] is False
    measured, holds = judge_attitude(rows(0.3))
    assert holds is None
    assert "rival not at hand" in measured


def test_what_is_not_at_hand_is_not_measured_for_a_reason() -> None:
    for target in TARGETS:
        claim = target.claim([], "no folder")
        assert claim.holds is None
        assert claim.measured == "not measured: no folder"
