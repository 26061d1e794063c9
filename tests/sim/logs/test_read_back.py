"""A run that is exported as MCAP is read back bit by bit, and estimators say the same of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.commands.cli import main
from tests.sim.scenarios.test_flight_beacons import flown

pytest.importorskip("mcap", reason="the extra mcap is not installed")
pytest.importorskip("mcap_protobuf", reason="the extra mcap is not installed")


def test_a_run_comes_back_bit_by_bit(tmp_path: Path) -> None:
    run = mn.run("range-localisation", seed=3, duration=1.0)
    run.save(tmp_path / "run")
    assert main(["export", str(tmp_path / "run"), "--mcap", str(tmp_path / "run.mcap")]) == 0
    log = mn.read_log(tmp_path / "run.mcap")
    assert np.array_equal(log["/truth"].t, run["t"])
    ranges, odometry = run["measurement.ranges"], run["measurement.odometry"]
    found = log.sensor_log(readings={"ranges": "/readings/ranges", "odometry": "/readings/odometry"})
    assert np.array_equal(found.t, run["t"])
    assert np.array_equal(found.readings["ranges"], ranges, equal_nan=True)
    assert np.array_equal(found.readings["odometry"], odometry, equal_nan=True)
    wall = mn.wall_through([(0.0, 0.0), (4.0, -0.2), (4.6, 2.0), (2.4, 3.2), (0.2, 2.4)], order=8)
    mission = mn.RangingMission(
        wall, (0.0, np.pi / 2), mn.RangeQuality(absolute=0.02), mn.OdometryQuality((0.02, 0.02)), period=0.01
    )
    own = mn.SensorLog(run["t"], {"ranges": ranges, "odometry": odometry})
    one, other = (mn.estimate("range_iekf", mission, each) for each in (own, found))
    assert np.array_equal(one.x, other.x, equal_nan=True)
    assert one.status == other.status


def test_ranges_to_beacons_of_a_flight_come_back_bit_by_bit(tmp_path: Path) -> None:
    run = flown()
    run.save(tmp_path / "run")
    assert main(["export", str(tmp_path / "run"), "--mcap", str(tmp_path / "run.mcap")]) == 0
    log = mn.read_log(tmp_path / "run.mcap")
    found = log.sensor_log(readings={"beacon_ranges": "/readings/beacon_ranges"})
    read = np.isfinite(run["measurement.beacon_ranges"]).any(axis=1)
    assert np.array_equal(found.t, run["t"][read])
    assert np.array_equal(found.readings["beacon_ranges"], run["measurement.beacon_ranges"][read], equal_nan=True)
