"""Bags of ROS, logs of PX4 and MCAP files, as the libraries of each write them."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mathnavi as mn

pytest.importorskip("rosbags", reason="the extra logs is not installed")
pytest.importorskip("pyulog", reason="the extra logs is not installed")
pytest.importorskip("mcap", reason="the extra logs is not installed")

from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

SECOND = 10**9
START = 1_700_000_000


def messages(store: Any, *, ros1: bool) -> Iterator[tuple[str, str, int, Any]]:
    """Topic, kind, time of receipt [ns] and message: headers are 20 ms older, and the second scan is late."""
    types = store.types
    own = {"seq": 0} if ros1 else {}

    def header(ns: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=START + ns // SECOND, nanosec=ns % SECOND)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="laser", **own)

    scan, twist, joints = (types[f"{kind}"] for kind in (
        "sensor_msgs/msg/LaserScan", "geometry_msgs/msg/Twist", "sensor_msgs/msg/JointState"
    ))  # fmt: skip
    vector = types["geometry_msgs/msg/Vector3"]
    for k, ns in enumerate((0, SECOND // 2, SECOND // 4)):
        ranges = np.array([1.0 + k, 2.0, np.inf], dtype=np.float32)
        made = scan(
            header=header(ns), angle_min=-0.5, angle_max=0.5, angle_increment=0.5, time_increment=0.0, scan_time=0.0,
            range_min=0.1, range_max=8.0, ranges=ranges, intensities=np.empty(0, np.float32),
        )  # fmt: skip
        yield "/scan", "sensor_msgs/msg/LaserScan", START * SECOND + k * SECOND + 20_000_000, made
    velocity = twist(linear=vector(x=0.5, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.25))
    yield "/cmd_vel", "geometry_msgs/msg/Twist", (START + 3) * SECOND, velocity
    state = joints(
        header=header(SECOND), name=["elbow", "wrist"], position=np.array([0.1, 0.2]), velocity=np.array([1.0, 2.0]),
        effort=np.empty(0),
    )  # fmt: skip
    yield "/joint_states", "sensor_msgs/msg/JointState", (START + 4) * SECOND, state
    yield "/words", "std_msgs/msg/String", (START + 5) * SECOND, types["std_msgs/msg/String"](data="idle")


@pytest.fixture(params=["ros 1", "ros 2", "ros 2, one file of MCAP"])
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    ros1 = request.param == "ros 1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if ros1:
        path, writer = tmp_path / "robot.bag", Bag1Writer(tmp_path / "robot.bag")
    else:
        plugin = StoragePlugin.MCAP if "MCAP" in request.param else StoragePlugin.SQLITE3
        path, writer = tmp_path / "robot", Bag2Writer(tmp_path / "robot", version=9, storage_plugin=plugin)
    with writer:
        connections = {}
        for topic, kind, received, message in messages(store, ros1=ros1):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            raw = store.serialize_ros1(message, kind) if ros1 else store.serialize_cdr(message, kind)
            writer.write(connections[topic], received, raw)
    if "MCAP" in request.param:
        (path,) = path.glob("*.mcap")
    return path


def test_a_bag_of_ros(bag: Path) -> None:
    log = mn.read_log(bag)
    assert {*log} == {"/scan", "/cmd_vel", "/joint_states"}
    scan = log["/scan"]
    assert log.start == START
    assert scan.t.tolist() == [0.0, 0.5, 0.25]  # of the headers; the last is late
    assert scan.timing.late == 1
    assert scan.signals == ("ranges 0 [m]", "ranges 1 [m]", "ranges 2 [m]")
    assert scan.values[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert np.isinf(scan.values[:, 2]).all()
    assert scan.frame == "laser"
    assert scan.facts["longest range [m]"] == "8"
    assert log["/cmd_vel"].t.tolist() == [3.0]  # it has no header
    assert "/cmd_vel: stamps are times of receipt, for its messages have no header" in log.notes
    assert "/words not read, which holds no numbers" in log.notes
    assert dict(zip(log["/joint_states"].signals, log["/joint_states"].values[0], strict=True)) == {
        "position elbow": 0.1, "position wrist": 0.2, "velocity elbow": 1.0, "velocity wrist": 2.0,
    }  # fmt: skip
    received = (
        mn.read_log(bag, clock="received") if bag.suffix != ".mcap" else mn.read_log(bag, "ros", clock="received")
    )
    assert received["/scan"].t.tolist() == [0.0, 1.0, 2.0]
    found = log.sensor_log(readings={"ranges": "/scan"}, disorder="sort")
    assert found.readings["ranges"][:, 0].tolist() == [1.0, 3.0, 2.0]


def test_a_damaged_bag_is_named(bag: Path, tmp_path: Path) -> None:
    file = bag if bag.is_file() else next(path for path in bag.iterdir() if path.suffix == ".db3")
    cut = tmp_path / f"cut{file.suffix}"
    cut.write_bytes(file.read_bytes()[: file.stat().st_size // 3])
    with pytest.raises(mn.LogError, match=rf"cut{file.suffix}: not a readable (bag|MCAP file)"):
        mn.read_log(cut)


def test_a_log_of_px4(tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog())
    log = mn.read_log(path)
    assert {*log} == {"gyro", "gyro 1"}
    assert log["gyro"].signals == ("x", "temperature")
    assert log["gyro"].t.tolist() == [0.0, 0.0025]
    assert log["gyro"].values.tolist() == [[0.5, 20.0], [0.75, 21.0]]
    assert log["gyro 1"].t.tolist() == [0.001]
    assert str(log.start) == "5"
    assert log.facts["sys_name"] == "PX4"
    assert log.facts["MC_ROLL_P"] == "6.5"
    assert "1 dropout of the recorder, the longest 12 ms" in log.notes


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (b"", b""),
        (b"timestamp", b"timestemp"),
        (b"float MC_ROLL", b"flaot MC_ROLL"),
        (b"gyro:uint64_t", b"gyro:uint64_x"),
    ],
)
def test_a_damaged_log_of_px4_is_named_and_nothing_is_printed(
    before: bytes, after: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cut.ulg"
    path.write_bytes(ulog().replace(before, after) if before else ulog()[:20])
    with pytest.raises(mn.LogError, match=r"cut.ulg: (not a readable ULog|it has no topic with messages)"):
        mn.read_log(path)
    assert capsys.readouterr().out == ""


def ulog() -> bytes:
    """A log of two gyroscopes, by the format's own description."""

    def message(kind: str, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), ord(kind)) + content

    def keyed(kind: str, key: str, value: bytes) -> bytes:
        return message(kind, bytes([len(key)]) + key.encode() + value)

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 4_000_000)
    out += message("B", bytes(40))
    out += message("F", b"gyro:uint64_t timestamp;float x;float temperature;")
    out += keyed("I", "char[3] sys_name", b"PX4")
    out += keyed("P", "float MC_ROLL_P", struct.pack("<f", 6.5))
    out += message("A", struct.pack("<BH", 0, 0) + b"gyro") + message("A", struct.pack("<BH", 1, 1) + b"gyro")
    out += message("D", struct.pack("<HQff", 0, 5_000_000, 0.5, 20.0))
    out += message("D", struct.pack("<HQff", 1, 5_001_000, 0.1, 0.0))
    out += message("O", struct.pack("<H", 12))
    out += message("D", struct.pack("<HQff", 0, 5_002_500, 0.75, 21.0))
    return out


def test_messages_of_json_give_back_the_time_that_their_stamp_rounds(tmp_path: Path) -> None:
    path, times = tmp_path / "run.mcap", [0.0, 0.1 + 0.2, 1.0 / 3.0]
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema("truth", "jsonschema", b"{}")
        own = writer.register_channel("/truth", "json", schema)
        other = writer.register_channel("/late", "json", schema)
        odd = writer.register_channel("/odd", "morse", schema)
        for t in times:
            stamp = round(t * SECOND)
            content = {"t": t, "x": {"height": t / 7.0}, "list": [1.0, None, 3.0], "name": "a"}
            writer.add_message(own, stamp, json.dumps(content).encode(), stamp)
            writer.add_message(other, stamp, json.dumps({"t": 99.0, "v": 1}).encode(), stamp)
        writer.add_message(odd, 0, b".-", 0)
        writer.finish()
    log = mn.read_log(path)
    assert log["/truth"].t.tolist() == times
    assert log["/truth"].signals == ("x.height", "list 0", "list 2")
    assert log["/truth"].values[:, 0].tolist() == [t / 7.0 for t in times]
    assert log["/late"].t.tolist() == [round(t * SECOND) / SECOND for t in times]
    assert [note for note in log.notes if "morse" in note] == [
        "/odd (morse) not read, a drawing or an encoding that is not known"
    ]
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:60])
    with pytest.raises(mn.LogError, match=r"cut.mcap: not a readable MCAP file"):
        mn.read_log(tmp_path / "cut.mcap")
