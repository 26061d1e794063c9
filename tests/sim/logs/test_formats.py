"""Formats of logs: what each file says is read, and what it is not is named."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
import scipy.io

import mathnavi as mn

CARMEN = """# message formats defined: PARAM SYNC ODOM FLASER
PARAM robot_length 0.6 nohost 0
ODOM 1 2 0.5 0.1 0.2 0 100.5 host 0.5
FLASER 4 1.5 2.5 3.5 4.5 9 8 0.7 1 2 0.5 100.75 host 0.75
ROBOTLASER1 0 -1.5 3.0 1.0 80.0 0.01 0 3 5 6 7 0 1 2 0.1 1 2 0.2 0 0 0.1 0.2 0.3 101 host 1
NEFF 30.5
ODOM 1.1 2 0.5 0.1 0.2 0 100.25 host 0.8
"""


def test_carmen(tmp_path: Path) -> None:
    path = tmp_path / "robot.log.gz"
    path.write_bytes(gzip.compress(CARMEN.encode()))
    log = mn.read_log(path)
    assert list(log) == ["odometry", "scan", "scan pose", "laser 1", "laser 1 pose"]
    assert log.start == 0
    assert log["odometry"].t.tolist() == [100.5, 100.25]
    assert log["odometry"].timing.late == 1
    assert log["scan"].values.tolist() == [[1.5, 2.5, 3.5, 4.5]]
    assert log["scan"].facts == {"first angle [deg]": "-90", "step [deg]": "45"}
    assert log["scan pose"].role == "reference"
    assert log["scan pose"].values.tolist() == [[9.0, 8.0, 0.7]]
    assert log["laser 1"].facts["longest range [m]"] == "80"
    assert float(log["laser 1"].facts["step [deg]"]) == pytest.approx(np.degrees(1.0))
    assert log.facts == {"robot_length": "0.6"}
    assert log.notes == ("poses are those of GMapping, and those of ODOM between two scans begin at them",)


def test_a_pose_that_is_said_twice_is_no_reference(tmp_path: Path) -> None:
    path = tmp_path / "raw.log"
    path.write_text("SYNC a\nFLASER 3 1 2 3 1 2 0.5 1 2 0.5 0.75 host 0.75\n")
    log = mn.read_log(path)
    assert [(name, each.role) for name, each in log.channels.items()] == [
        ("scan", "reading"),
        ("scan odometry", "reading"),
    ]
    assert log["scan"].facts["step [deg]"] == "90"  # an odd number of ranges has one at either end
    assert log.notes == ("1 message SYNC not read",)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("ODOM 1 2 0.5 0.1", "no whole message ODOM"),
        ("ODOM 1 2 0.5 0.1 0.2 0 nan host 1", "no whole message ODOM"),
        ("FLASER 5 1 2 3 1 2 0.5 1 2 0.5 0.75 host 0.75", "no whole message FLASER"),
        ("FLASER 1 1 1 2 0.5 1 2 0.5 0.75 host 0.75", "no whole message FLASER"),
        ("FLASER x 1 2 3 1 2 0.5 1 2 0.5 0.75 host 0.75", "no whole message FLASER"),
        ("ROBOTLASER1 0 -1.5 3.0 1.0 80.0 0.01 0 3 5 6 7", "no whole message ROBOTLASER1"),
    ],
)
def test_a_message_that_is_cut_off_is_named_with_its_line(line: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "cut.log"
    path.write_text(f"{CARMEN}{line}\n")
    with pytest.raises(mn.LogError, match=r"cut\.log line 8: ") as refused:
        mn.read_log(path)
    assert said in str(refused.value)


def test_scans_of_two_sizes_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "two.log"
    path.write_text(f"{CARMEN}FLASER 2 1.5 2.5 9 8 0.7 1 2 0.5 100.75 host 0.75\n")
    with pytest.raises(mn.LogError, match="scan has messages with 2 and with 4 numbers"):
        mn.read_log(path)


def test_a_packed_log_that_is_damaged_is_named(tmp_path: Path) -> None:
    path = tmp_path / "robot.log.gz"
    path.write_bytes(gzip.compress(CARMEN.encode())[:-9])
    with pytest.raises(mn.LogError, match=r"robot.log.gz: not a readable .gz file"):
        mn.read_log(path)


def test_a_table_keeps_its_stamps_and_says_what_it_leaves(tmp_path: Path) -> None:
    path = tmp_path / "robot.csv"
    path.write_text("time [ms],angle [deg],state,front\n10,180,idle,1.5\n30,90,go,\n20,0,go,2.5\n20,0,go,3.5\n")
    log = mn.read_log(path, time="time")
    table = log["table"]
    assert table.signals == ("angle [rad]", "front")
    assert table.t.tolist() == [0.01, 0.03, 0.02, 0.02]
    assert table.values[:, 0].tolist() == [np.pi, np.pi / 2, 0.0, 0.0]
    assert (table.timing.late, table.timing.doubled) == (2, 1)
    assert log.notes == (
        "column 'time [ms]' was converted from ms, 1 ms = 0.001 s",
        "column 'angle [deg]' was converted from deg, 1 deg = 0.0174533 rad",
        "column 'state' not read, which holds no numbers",
    )
    found = log.sensor_log(readings={"ranges": "front"}, disorder="sort")
    assert found.readings["ranges"].ravel().tolist()[:2] == [1.5, 2.5]
    with pytest.raises(mn.LogError, match="line 2, column 'state': 'idle'"):
        mn.read_log(path, time="time", columns=("state",))
    with pytest.raises(mn.FieldError, match="units = 'deg'; allowed: COLUMN=UNIT"):
        mn.read_log(path, time="time", units=("deg",))


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_arrays(ending: str, tmp_path: Path) -> None:
    path, t = tmp_path / f"robot.{ending}", np.array([5.0, 5.1, 5.3])
    arrays = {"t": t, "gyro": np.arange(9.0).reshape(3, 3), "height": np.array([1.0, 2.0, 3.0]), "rate": 10.0}
    arrays |= {"map": np.zeros((4, 2)), "cube": np.zeros((3, 2, 2))}
    if ending == "npz":
        np.savez(path, **arrays)  # type: ignore[arg-type]
    else:
        scipy.io.savemat(path, {**arrays, "about": "a test", "s": {"acc": np.ones(3)}, "cell": [np.ones(2), "a"]})
    log = mn.read_log(path)
    assert {*log} == ({"gyro", "height"} if ending == "npz" else {"gyro", "height", "s.acc"})
    assert log["gyro"].signals == ("gyro 0", "gyro 1", "gyro 2")
    assert np.array_equal(log["gyro"].t, t)
    assert (log.clock, log.facts["rate"]) == ("array 't'", "10")
    said = " ".join(log.notes)
    assert "cube of shape (3, 2, 2) not read" in said
    assert "map not read, which have no times" in said
    if ending == "mat":
        assert log.facts["about"] == "a test"
        assert "cell not read, which is no array of numbers" in said
    uniform = mn.read_log(path, rate=10.0, arrays=("height",))
    assert uniform["height"].t.tolist() == [0.0, 0.1, 0.2]
    assert mn.read_log(path, rate_array="rate", arrays=("height",))["height"].t.tolist() == [0.0, 0.1, 0.2]
    columns = mn.read_log(path, time_column=0, arrays=("gyro",))
    assert columns["gyro"].t.tolist() == [0.0, 3.0, 6.0]
    assert columns["gyro"].signals == ("gyro 1", "gyro 2")


def test_stamps_since_an_epoch_lose_nothing(tmp_path: Path) -> None:
    stamps = 1_700_000_000_000_000_000 + np.array([1, 0, 250])
    np.savez(tmp_path / "robot.npz", stamp=stamps, v=np.ones(3))
    log = mn.read_log(tmp_path / "robot.npz", time_unit="ns")
    assert log["v"].t.tolist() == [1e-9, 0.0, 250e-9]
    assert log.start == 1_700_000_000
    for kind in (np.int64, np.uint64):  # a double is 21 ns off here
        own = np.array([1_700_000_000_123_456_789, 1_700_000_000_123_456_790], dtype=kind)
        np.savez(tmp_path / "own.npz", stamp=own, v=np.ones(2))
        exact = mn.read_log(tmp_path / "own.npz", time_unit="ns")
        assert (exact["v"].t.tolist(), str(exact.start)) == ([0.0, 1e-9], "1700000000.123456789")
    (tmp_path / "carmen.log").write_text(CARMEN.replace(" 100.", " 1700000100.").replace(" 101 ", " 1700000101 "))
    carmen = mn.read_log(tmp_path / "carmen.log")
    assert (carmen["odometry"].t.tolist(), str(carmen.start)) == ([0.25, 0.0], "1700000100.25")


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"time": "clock"}, "there is no array of times called 'clock'"),
        ({"time": "gyro"}, "time = 'gyro' has the shape (3, 3); allowed: one column"),
        ({"arrays": ("gyra",)}, "there is no array 'gyra'; did you mean gyro?"),
        ({"time_column": 7}, "no array has times; the arrays are "),
        ({"time": "t", "rate": 2.0}, "exclude each other"),
        ({"rate_array": "gyro"}, "rate_array = 'gyro' of shape (3, 3) is no rate; allowed: one number > 0 [Hz]"),
        ({"rate_array": "gyra"}, "there is no array 'gyra'; did you mean gyro?"),
        ({"time_unit": "min"}, "time_unit = 'min'; allowed: s, ms, us, ns"),
        ({"rates": 1.0}, "rates"),
    ],
)
def test_times_that_are_not_there_are_asked_for(fields: dict[str, object], said: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.npz"
    np.savez(path, t=np.arange(3.0), gyro=np.ones((3, 3)))
    with pytest.raises(ValueError, match=r".") as refused:
        mn.read_log(path, **fields)
    assert said in str(refused.value)


@pytest.mark.parametrize("content", [b"", b"MATLAB 5.0", b"MATLAB 7.3".ljust(512) + b"\x89HDF\r\n\x1a\n"])
def test_a_file_that_is_none_of_matlab_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "robot.mat"
    path.write_bytes(content)
    with pytest.raises(
        mn.LogError, match=r"robot.mat(:| is) (not a readable MATLAB file|a MATLAB file of version 7.3)"
    ):
        mn.read_log(path)


def test_a_file_of_no_format_and_a_missing_one_are_named(tmp_path: Path) -> None:
    (tmp_path / "photo.jpg").write_bytes(b"\xff\xd8\xff")
    with pytest.raises(
        mn.LogError, match=r"photo.jpg is of no format that is known; allowed with format=NAME: .*carmen"
    ):
        mn.read_log(tmp_path / "photo.jpg")
    with pytest.raises(FileNotFoundError):
        mn.read_log(tmp_path / "nothing.csv")
    with pytest.raises(mn.PluginError, match="logs: 'rosbag' is not known"):
        mn.read_log(tmp_path / "photo.jpg", "rosbag")


def test_what_a_damaged_file_cites_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "robot.mat"
    scipy.io.savemat(path, {"time": np.arange(9.0)}, format="4")
    path.write_bytes(path.read_bytes().replace(b"time", b"ti\nme"))
    with pytest.raises(mn.LogError) as refused:
        mn.read_log(path)
    assert str(refused.value).isprintable()
