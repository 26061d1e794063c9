"""The benchmark of attitudes: what it says where the data are not, and what it reads where they are."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks.attitude import AttitudeArguments, ahead, main
from mathnavi.studies.real.attitude_logs import AttitudeLog, attitude_rows, figures, ours, read_trial
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
    made = ours(trial)
    found, (row, *_) = figures(made, trial), attitude_rows(AttitudeLog(str(tmp_path / "06_simulated.mat")))
    assert (row["log"], row["estimator"]) == ("06_simulated", "inertial_attitude")
    assert row["inclination_rms_deg"] == found["inclination"] < 1.0
    assert found["inclination"] <= found["total"] + 1e-9
    assert found["nees"] < 2.0
    assert found["wrong"] == 0.0
    assert figures(ahead(made, trial, 0.03), trial)["inclination"] > 2.0 * found["inclination"], "it does not lag"
    aside = trial.truth[:, [1, 0, 3, 2]] * [-1.0, 1.0, -1.0, 1.0]
    elsewhere = replace(trial, truth=math.cos(0.2) * trial.truth + math.sin(0.2) * aside)
    assert figures(made, elsewhere)["wrong"] > 0.9, "it is sure of a vertical that is 23 degrees off"
