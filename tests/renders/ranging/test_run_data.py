"""The data of the pictures of a robot that localises itself agree with motion, readings and estimates."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.interfaces.signals import Status
from mathnavi.models.field.curve import BEAN
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.film import Frame
from mathnavi.renders.ranging.drawing import drawing, overlay
from mathnavi.renders.ranging.run_data import RangingRun, load_run
from tests.renders.ranging.believers import CALM, ELSEWHERE, FIRST_ERROR, LOSS, LOWEST, SILENT, START


def test_the_mission_is_what_was_driven_in(bank_run: RangingRun, observer_run: RangingRun) -> None:
    assert bank_run.curve.symmetry == 2
    assert bank_run.pose[0].tolist() == pytest.approx([START[0], START[1], math.radians(START[2])])
    assert bank_run.mission.start is not None
    assert (bank_run.drive, observer_run.drive) == ("ideal", "differential")
    read = np.isfinite(bank_run.ranges)
    error = (bank_run.ranges - bank_run.true_ranges)[read] / bank_run.true_ranges[read]
    assert np.std(error) == pytest.approx(0.05, rel=0.2)
    assert not read[(bank_run.t > 2.0) & (bank_run.t < 3.0)].any()


def test_a_robot_that_reads_beacons_finds_itself_and_is_the_one(tmp_path: Path) -> None:
    """From ranges to beacons the heading shows only once the robot drives: it may not wait for it."""
    places = [[2.0, 0.8], [-2.0, -0.5], [0.0, 1.2]]
    flags = [word for place in places for word in ("--beacons.places", *map(str, place))]
    words = ["run", "range-localisation", "--estimator", "beacon_bank", "--duration", "5", "--seed", "2", *flags]
    assert main([*words, "--beacons.range-noise", "0.05", "--out", str(tmp_path / "run")]) == 0
    run = load_run(tmp_path / "run")
    assert run.beacons.tolist() == places
    assert (run.curve.symmetry, run.symmetry, len(run.images(run.pose[0]))) == (2, 1, 1)
    assert run.found is not None
    assert run.found < 3.0
    assert np.ptp(run.pose[:, :2], axis=0).max() > 0.3
    assert not run.reads_walls
    assert "3 beacons" in " ".join(overlay(run, Frame(1.0, "top", 0.0, 0.0)).title)


def test_errors_are_those_of_the_estimates(bank_run: RangingRun) -> None:
    t = bank_run.beliefs.t
    expected = np.exp(-t / CALM)[:, None] * FIRST_ERROR
    np.testing.assert_allclose(bank_run.difference, expected, atol=1e-3)
    np.testing.assert_allclose(bank_run.position_error, np.hypot(expected[:, 0], expected[:, 1]), atol=1e-3)
    np.testing.assert_allclose(bank_run.heading_error, expected[:, 2], atol=1e-3)
    assert bank_run.found == pytest.approx(CALM * math.log(FIRST_ERROR[2] / 0.2), abs=0.02)  # the heading is the last
    assert bank_run.log.summary["convergence_time_s"] == pytest.approx(bank_run.found, abs=0.011)


def test_what_the_estimator_is_unsure_of_is_taken_from_its_covariance(bank_run: RangingRun) -> None:
    assert bank_run.deviation is not None
    metres, radians = bank_run.deviation
    decay = np.exp(-bank_run.beliefs.t / CALM)
    np.testing.assert_allclose(metres, np.sqrt(0.09 * decay + 1e-4))
    np.testing.assert_allclose(radians, np.sqrt(0.04 * decay + 1e-4))
    e, k = bank_run.difference, 60
    assert bank_run.nees[k] == pytest.approx((e[k] ** 2 / (np.square([0.3, 0.1, 0.2]) * decay[k] + 1e-4)).sum())
    singular = replace(bank_run.beliefs, covariance=np.zeros((len(decay), 3, 3)))
    assert np.isnan(replace(bank_run, beliefs=singular).nees).all()


def test_hypotheses_lose_strength_until_they_are_dropped(bank_run: RangingRun) -> None:
    beliefs = bank_run.beliefs
    assert beliefs.left is not None
    assert beliefs.hypotheses is not None
    assert beliefs.left[0] == 4
    assert beliefs.left[-1] == 1
    strengths = np.array([beliefs.strengths(k) for k in range(len(beliefs.t))])
    assert (strengths[:, 0] == 1.0).all()
    assert (np.diff(strengths[:, 1:], axis=0) <= 0.0).all()
    for j, loss in enumerate(LOSS, start=1):
        gone = LOWEST / -loss
        assert strengths[beliefs.t < gone - 0.02, j].min() > 0.0
        assert (strengths[beliefs.t > gone + 0.02, j] == 0.0).all()
    agreed = beliefs.t[bank_run.agreed]
    assert agreed[0] == pytest.approx(LOWEST / -LOSS.min(), abs=0.02)


def test_hypotheses_that_are_images_of_the_estimate_agree_with_it(bank_run: RangingRun) -> None:
    beliefs = bank_run.beliefs
    images = np.array([bank_run.curve.images(x) for x in beliefs.x])
    twins = replace(beliefs, hypotheses=images, scores=np.zeros((len(beliefs.t), 2)))
    assert replace(bank_run, beliefs=twins).agreed.all()
    others = images.copy()
    others[:, 1] = ELSEWHERE[0]
    assert not replace(bank_run, beliefs=replace(twins, hypotheses=others)).agreed.any()


def test_nothing_is_believed_while_the_estimator_is_initialising(bank_run: RangingRun, silent_run: RangingRun) -> None:
    assert bank_run.status(0.0) is Status.INITIALISING
    assert bank_run.belief(SILENT - 0.02) == -1
    k = bank_run.belief(1.0)
    assert bank_run.beliefs.t[k] == pytest.approx(1.0)
    assert bank_run.status(1.0) is Status.OK
    assert len(silent_run.beliefs.t) == 0
    assert silent_run.belief(0.5) == -1
    assert silent_run.found is None


def test_an_answer_that_is_an_image_of_the_truth_is_seen_as_such(bank_run: RangingRun) -> None:
    beliefs = bank_run.beliefs
    turned = replace(bank_run, beliefs=replace(beliefs, x=np.array([bank_run.curve.images(x)[1] for x in beliefs.x])))
    assert (bank_run.image, turned.image) == (0, 1)
    np.testing.assert_allclose(turned.position_error, bank_run.position_error, atol=1e-9)
    assert not bank_run.indistinguishable.any()
    assert turned.found is not None
    off_centre = np.linalg.norm(bank_run.believed_at[:, :2], axis=1) > 0.2
    assert off_centre.any()
    assert turned.indistinguishable[off_centre & (turned.beliefs.t >= turned.found)].all()
    np.testing.assert_allclose(turned.mirrored[:, :2], -bank_run.believed_at[:, :2], atol=1e-12)
    np.testing.assert_allclose(bank_run.mirrored[:, :2], bank_run.believed_at[:, :2])


def test_a_run_says_by_whom_it_is_drawn(bank_dir: Path) -> None:
    assert drawing_of(bank_dir).cameras == drawing.cameras == ("top", "chase")


def test_what_does_not_describe_a_robot_with_range_sensors_is_refused(bank_dir: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(bank_dir, tmp_path / "run")
    config = json.loads((copy / "config.json").read_text())
    wrong = {"drive": "legs"}, {"angles": []}, {"coefficients": [[0.0] * 4]}
    for mission in ({}, *(config["mission"] | fields for fields in wrong)):
        (copy / "config.json").write_text(json.dumps(config | {"mission": mission}))
        with pytest.raises(ValueError, match=r"config\.json.* does not describe a robot with range sensors"):
            load_run(copy)
    more = config["mission"] | {"angles": [0.0, 1.0, 2.0]}
    (copy / "config.json").write_text(json.dumps(config | {"mission": more}))
    with pytest.raises(ValueError, match=r"log\.npz.*measurement\.ranges has shape"):
        load_run(copy)


def test_any_curve_is_read_back(bank_dir: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(bank_dir, tmp_path / "run")
    config = json.loads((copy / "config.json").read_text())
    config["mission"] |= {"field": BEAN.name, "coefficients": BEAN.coefficients}
    (copy / "config.json").write_text(json.dumps(config))
    assert load_run(copy).curve == BEAN
