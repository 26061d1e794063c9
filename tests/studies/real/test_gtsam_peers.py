"""The peers' problem: motion between poses is that of the odometry, and with GTSAM each finds the way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.studies.real.beacon_logs import BeaconCase, plaza
from mathnavi.studies.real.gtsam_peers import PEERS, gtsam_rows
from mathnavi.studies.real.peer_problem import pose_rows, steps_between
from tests.studies.real.logs import write_plaza


def after(pose: Array, step: Array) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return pose + np.array([c * step[0] - s * step[1], s * step[0] + c * step[1], step[2]])


def test_steps_between_poses_are_those_of_the_odometry(tmp_path: Path) -> None:
    write_plaza(tmp_path / "Plaza1_.mat", 200)
    drive = plaza(tmp_path / "Plaza1_.mat")
    t = drive.log.t
    reads = np.isfinite(drive.log.readings["beacon_ranges"]).any(axis=1)
    rows = pose_rows(t, reads, (t >= drive.t[0]) & (t <= drive.t[-1]))
    assert reads[rows].sum() == reads[(t >= drive.t[0]) & (t <= drive.t[-1])].sum()
    assert np.diff(t[rows]).max() < 0.25 + 0.21  # and a step of the log
    truth = drive.truth_at(t[rows])
    for k, (step, deviation) in enumerate(steps_between(drive, rows)):
        error = after(truth[k], step) - truth[k + 1]
        assert np.hypot(*error[:2]) < 5.0 * deviation[0] + 0.01
        assert abs(error[2]) < 5.0 * deviation[2] + 0.01


def test_with_gtsam_each_finds_the_way(tmp_path: Path) -> None:
    pytest.importorskip("gtsam")
    write_plaza(tmp_path / "Plaza1_.mat", 200)
    found = gtsam_rows(BeaconCase("beacons", (str(tmp_path / "Plaza1_.mat"),)), 0.07)
    errors = {row["estimator"]: row["position_rms_all_m"] for row in found}
    assert errors.keys() == PEERS.keys()
    assert max(errors.values()) < 0.3
    assert min(errors, key=errors.__getitem__) == "GTSAM, batch"  # it knows the future
