"""Beacons at unknown places: what is judged does not depend on where a solution is, and each finds path and places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mathnavi.studies.real.beacon_logs import RANGE, BeaconCase
from mathnavi.studies.real.gtsam_peers import at_hand
from mathnavi.studies.real.unknown_beacons import aligned, unknown_rows
from tests.studies.real.logs import write_plaza


def test_a_path_is_moved_and_turned_onto_the_reference_but_not_mirrored() -> None:
    path = np.random.default_rng(0).standard_normal((20, 2))
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    R, s = aligned(path, path @ turn.T + (3.0, -2.0))
    np.testing.assert_allclose(R, turn, atol=1e-12)
    np.testing.assert_allclose(s, (3.0, -2.0), atol=1e-12)
    R, _ = aligned(path, path * (1.0, -1.0))
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_path_and_places_are_found_without_a_place_that_is_known(tmp_path: Path) -> None:
    write_plaza(tmp_path / "Plaza1_.mat", 400)
    on_line, smoothed, *peers = unknown_rows(BeaconCase("beacons", (str(tmp_path / "Plaza1_.mat"),)))
    assert smoothed["position_rms_all_m"] < on_line["position_rms_all_m"]
    assert smoothed["beacons_rms_m"] <= smoothed["beacons_max_m"] < RANGE  # closer than a range tells
    assert len(peers) == (4 if at_hand() else 0)
    for same in (row for row in peers if row["start"] == "ours" and row["setting"]):
        assert same["beacons_max_m"] < RANGE


def test_what_is_not_found_has_no_error(tmp_path: Path) -> None:
    write_plaza(tmp_path / "Plaza1_.mat", 60)
    rows = unknown_rows(BeaconCase("beacons", (str(tmp_path / "Plaza1_.mat"),)))
    assert [(row["found"], np.isnan(row["position_rms_m"])) for row in rows] == [(False, True)] * 2
