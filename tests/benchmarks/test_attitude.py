"""The benchmark of attitudes: what it says where the data are not, and what it reads where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks.attitude import AttitudeArguments, figures, led_on, main, ours, read_trial
from tests.estimators.invariant.handheld import handled


def test_data_that_are_absent_are_named_and_the_code_is_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(AttitudeArguments(tmp_path, trials=("06",))) == 1
    assert f"trial 06: there is no {tmp_path / '06'}_*.mat" in capsys.readouterr().out


def test_a_file_in_the_format_of_broad_is_read_and_judged(tmp_path: Path) -> None:
    device = handled(seconds=7.0)
    imu, n = device.log.readings["imu"], len(device.truth)
    truth = device.truth.copy()
    truth[400:410] = np.nan
    arrays = {
        **{"imu_gyr": imu[:, :3], "imu_acc": imu[:, 3:], "opt_quat": truth, "sampling_rate": 100.0},
        "movement": np.arange(n) > 300,
    }
    savemat(tmp_path / "06_simulated.mat", arrays)
    trial = read_trial(tmp_path / "06_simulated.mat")
    row = ours(trial)
    found = figures(row, trial)
    assert found["inclination"] < 1.0
    assert found["inclination"] <= found["total"] + 1e-9
    assert found["nees"] < 2.0
    assert found["wrong"] < 0.01
    assert figures(led_on(row, trial, 0.03), trial)["inclination"] > 2.0 * found["inclination"], "it does not lag"
