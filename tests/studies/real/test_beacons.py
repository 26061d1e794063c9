"""Logs with beacons: what is read of a file in the format of Plaza, and what is found among fewer beacons."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mathnavi.studies.real.beacon_logs import BeaconCase, beacon_rows, plaza
from tests.estimators.beacons.drives import PLACES
from tests.studies.real.logs import write_plaza


def test_a_file_in_the_format_of_plaza_is_read_and_judged(tmp_path: Path) -> None:
    file = tmp_path / "Plaza1_.mat"
    write_plaza(file, 400)
    assert plaza(file).mission.beacons == PLACES
    on_line, smoothed = beacon_rows(BeaconCase("beacons", (str(file),)))
    assert on_line["log"] == "Plaza1"
    assert smoothed["position_rms_all_m"] < min(0.6, on_line["position_rms_all_m"])
    assert on_line["wrong_share"] < 0.02
    assert on_line["setting"] > 0.03  # ranges are 7 % too long


def test_fewer_beacons_are_spread_over_all(tmp_path: Path) -> None:
    write_plaza(tmp_path / "Plaza1_.mat", 100)
    whole = plaza(tmp_path / "Plaza1_.mat")
    two = whole.with_beacons(2)
    assert two.mission.beacons == (PLACES[0], PLACES[3])
    np.testing.assert_array_equal(two.log.readings["beacon_ranges"], whole.log.readings["beacon_ranges"][:, [0, 3]])
    assert whole.with_beacons(0) is whole


def test_one_beacon_does_not_tell_a_pose_and_the_row_says_so(tmp_path: Path) -> None:
    file = tmp_path / "Plaza1_.mat"
    write_plaza(file, 60)
    rows = beacon_rows(BeaconCase("beacons", (str(file),), beacons=1))
    assert [row["found"] for row in rows] == [False, False]
