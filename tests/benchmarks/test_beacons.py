"""The benchmark of robots among beacons: what it says where the data are not, and what it reads where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks.beacons import BeaconArguments, figures, main, ours, plaza
from tests.estimators.beacons.drives import PLACES, drive


def test_data_that_are_absent_are_named_and_the_code_is_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(BeaconArguments(tmp_path)) == 1
    printed = capsys.readouterr().out
    assert f"plaza: there is no {tmp_path / 'plaza' / 'Plaza1_.mat'}" in printed
    assert f"mrclam: there is no {tmp_path / 'mrclam6'}" in printed


def test_a_file_in_the_format_of_plaza_is_read_and_judged(tmp_path: Path) -> None:
    driven = drive(count=400)
    t, odometry = driven.log.t, driven.log.readings["odometry"]
    rows = np.flatnonzero(np.isfinite(odometry[:, 0]))
    steps = np.diff(t[rows], prepend=0.0)
    ranges = [
        [t[k], 2.0, 10.0 + i, rho[i]]
        for k, rho in enumerate(driven.log.readings["beacon_ranges"])
        for i in np.flatnonzero(np.isfinite(rho)).tolist()
    ]
    arrays = {
        "DR": np.column_stack([t[rows], odometry[rows] * steps[:, None]]),
        "TD": np.array(ranges),
        "GT": np.column_stack([t, driven.truth]),
        "TL": np.column_stack([10.0 + np.arange(4), np.array(PLACES)])[::-1],
    }
    savemat(tmp_path / "Plaza1_.mat", arrays)
    recorded = plaza(tmp_path / "Plaza1_.mat")
    assert recorded.mission.beacons == PLACES
    found = {name: figures(history, recorded) for name, (history, _) in ours(recorded, None).items()}
    assert found["smoother"]["all_m"] < 0.6
    assert found["smoother"]["all_m"] < found["filter"]["all_m"]
    assert found["filter"]["wrong_share"] < 0.02
