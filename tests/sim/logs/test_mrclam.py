"""Data sets of MR.CLAM: one robot of a folder, its landmarks by their bar codes, and what is refused."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

import mathnavi as mn

EPOCH = 1248444187.0
FILES = {
    "Barcodes.dat": "# Subject Barcode\n 1 5\n 2 14\n 6 72\n 7 27\n",
    "Landmark_Groundtruth.dat": "# Subject x y\n 6 1.0 -2.0 0.0001 0.0001\n 7 4.0 0.5 0.0001 0.0001\n",
    "Robot2_Odometry.dat": "# t v w\n" + "".join(f"{EPOCH + 0.1 * k:.3f} \t 0.5 \t 0.1\n" for k in range(20)),
    "Robot2_Measurement.dat": (
        "# t code range bearing\n"
        f"{EPOCH + 0.25} 72 2.0 0.1\n{EPOCH + 0.25} 27 3.0 -0.2\n{EPOCH + 0.25} 5 1.0 0.0\n"
        f"{EPOCH + 1.0} 72 2.1 0.2\n{EPOCH + 1.0} 99 9.0 0.0\n"
    ),
    "Robot2_Groundtruth.dat": "# t x y th\n" + "".join(f"{EPOCH + 0.5 * k} {0.2 * k} 0 3.1\n" for k in range(5)),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / f"{name}.gz").write_bytes(gzip.compress(text.encode()))
    return tmp_path


def test_a_robot_is_read_with_landmarks_robots_and_unknown_codes_apart(folder: Path) -> None:
    log = mn.read_log(folder)
    assert list(log) == ["odometry", "landmarks", "robots", "unknown", "motion capture"]
    assert log["landmarks"].values.tolist() == [[6.0, 2.0, 0.1], [7.0, 3.0, -0.2], [6.0, 2.1, 0.2]]
    assert log["unknown"].values[0].tolist() == [99.0, 9.0, 0.0]
    assert log["motion capture"].role == "reference"
    assert log.facts == {"landmark 6 [m]": "1 -2", "landmark 7 [m]": "4 0.5"}
    assert float(log.start) == EPOCH
    assert log["odometry"].t[1] == pytest.approx(0.1, abs=1e-6)


def test_a_channel_becomes_one_with_a_column_for_each_landmark(folder: Path) -> None:
    log = mn.read_log(folder, robot=2).spread("landmarks:range", by="landmarks:subject")
    found = log["range"]
    assert found.signals == ("subject=6 [m]", "subject=7 [m]")
    assert found.t.tolist() == pytest.approx([0.25, 1.0])
    assert np.array_equal(found.values, [[2.0, 3.0], [2.1, np.nan]], equal_nan=True)
    with pytest.raises(mn.LogError, match="a channel 'range' already"):
        log.spread("landmarks:range", by="landmarks:subject")
    with pytest.raises(mn.LogError, match="one channel"):
        log.spread("landmarks:bearing", by="unknown:bar code")
    with pytest.raises(mn.LogError, match=r"landmarks:bearing \[rad\] is 0.1 in row 0; allowed: whole"):
        log.spread("landmarks:subject", by="landmarks:bearing")


def test_the_same_reading_twice_stays_two_rows() -> None:
    values = np.array([[1.0, 5.0], [1.0, 6.0], [2.0, 7.0]])
    uwb = mn.Channel(np.zeros(3), values, ("node", "range [m]"))
    log = mn.RecordedLog("robot.log", "test", {"uwb": uwb}, "clock").spread("range", by="node")
    assert np.array_equal(log["range"].values, [[5.0, np.nan], [6.0, 7.0]], equal_nan=True)
    assert log["range"].timing.doubled == 1


def test_counts_become_rates_and_a_delay_is_said(folder: Path) -> None:
    wheels = mn.Channel(np.array([0.0, 0.5, 0.5, 0.25, 1.25]), np.full((5, 1), 2.0), ("distance [m]",))
    log = mn.RecordedLog("robot.log", "test", {"wheels": wheels}, "clock").rates("wheels")
    assert log["wheels"].signals == ("distance [m/s]",)
    assert np.array_equal(log["wheels"].values.ravel(), [np.nan, 4.0, np.nan, np.nan, 2.0], equal_nan=True)
    with pytest.raises(mn.LogError, match="of a length or an angle"):
        log.rates("wheels")
    later = log.delayed("wheels", 0.2)
    assert later["wheels"].t[0] == 0.2
    assert later.notes[-1:] == ("wheels: stamps later by 0.2 s, as was asked",)
    with pytest.raises(mn.LogError, match="finite"):
        log.delayed("wheels", float("nan"))


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("Robot2_Measurement.dat.gz", "1.0 72 x 0\n", r"line 1: '1.0 72 x 0'; allowed: 4 numbers"),
        ("Robot2_Odometry.dat.gz", "1.0 2.0\n", "allowed: 3 numbers"),
        ("Barcodes.dat.gz", None, r"has no Barcodes\.dat"),
    ],
)
def test_a_folder_that_is_not_whole_is_refused(folder: Path, name: str, text: str | None, said: str) -> None:
    (folder / name).unlink()
    if text is not None:
        (folder / name).write_bytes(gzip.compress(text.encode()))
    with pytest.raises(mn.LogError, match=said):
        mn.read_log(folder)
    with pytest.raises(mn.LogError, match="robot = 9; allowed: one whose odometry"):
        mn.read_log(folder, robot=9)
