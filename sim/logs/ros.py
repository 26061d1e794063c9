"""Bags of ROS 1 (.bag) and ROS 2 (a folder, .db3, or .mcap), by ``rosbags``, without ROS.

A topic is a channel. Its stamps are those of the messages' headers, where they have one, or the times at which the
recorder received them. Units are those that ROS prescribes for its own messages (REP 103).
"""

from __future__ import annotations

import math
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal

from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.extras import extra
from mathnavi.interfaces.short_tables import counted
from mathnavi.sim.logs.lines import head_of
from mathnavi.sim.logs.messages import NANOSECONDS, Messages
from mathnavi.sim.logs.recorded_log import RecordedLog

_BAG = b"#ROSBAG V2.0"
_SQLITE = b"SQLite format 3\0"
_DESCRIPTION = "metadata.yaml"  # of the folder of a bag of ROS 2
_POSE = {"position.": "m"}
_TWIST = {"linear.": "m/s", "angular.": "rad/s"}
_UNITS = {  # by kind of message, by the beginnings of names
    "nav_msgs/msg/Odometry": {
        **{f"pose.pose.{name}": unit for name, unit in _POSE.items()},
        **{f"twist.twist.{name}": unit for name, unit in _TWIST.items()},
    },
    "geometry_msgs/msg/Twist": _TWIST,
    "geometry_msgs/msg/TwistStamped": {f"twist.{name}": unit for name, unit in _TWIST.items()},
    "geometry_msgs/msg/Pose": _POSE,
    "geometry_msgs/msg/PoseStamped": {f"pose.{name}": unit for name, unit in _POSE.items()},
    "geometry_msgs/msg/PoseWithCovarianceStamped": {f"pose.pose.{name}": unit for name, unit in _POSE.items()},
    "geometry_msgs/msg/PointStamped": {"point.": "m"},
    "geometry_msgs/msg/TransformStamped": {"transform.translation.": "m"},
    "sensor_msgs/msg/Imu": {"angular_velocity.": "rad/s", "linear_acceleration.": "m/s^2"},
    "sensor_msgs/msg/MagneticField": {"magnetic_field.": "T"},
    "sensor_msgs/msg/LaserScan": {"range": "m", "angle": "rad", "time_increment": "s", "scan_time": "s"},
    "sensor_msgs/msg/Range": {"range": "m", "min_range": "m", "max_range": "m", "field_of_view": "rad"},
    "sensor_msgs/msg/NavSatFix": {"latitude": "deg", "longitude": "deg", "altitude": "m"},
}
_SCAN, _JOINTS = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/JointState"


class RosLog:
    """Bag of ROS 1 (.bag) or of ROS 2 (folder, .db3 or .mcap)."""

    @configuration
    class Config:
        """Stamps that are taken."""

        clock: Literal["header", "received"] = "header"
        """stamps of the messages' headers, where they have one, or times at which they were received"""

    @staticmethod
    def accepts(path: Path) -> bool:
        """True for a bag of ROS 1, a database, and a folder with the description of a bag of ROS 2."""
        if path.is_dir():
            return (path / _DESCRIPTION).is_file()
        start = head_of(path)
        return start.startswith(_BAG) or (start.startswith(_SQLITE) and path.suffix == ".db3")

    @staticmethod
    def read(path: Path, config: Config) -> RecordedLog:
        """Read a bag; LogError for one that is damaged, or whose kinds of messages it does not describe itself."""
        highlevel, typesys = extra("rosbags.highlevel", "format ros"), extra("rosbags.typesys", "format ros")
        found: dict[str, Messages] = {}
        without: set[str] = set()  # topics without stamps
        notes: list[str] = []
        try:
            store = typesys.get_typestore(typesys.Stores.LATEST)
            with highlevel.AnyReader([path], default_typestore=store) as bag:
                known = [each for each in bag.connections if each.msgtype in bag.typestore.types or each.msgdef]
                unknown = sorted({f"{each.topic} ({each.msgtype})" for each in bag.connections if each not in known})
                for connection, received, raw in bag.messages(connections=known):
                    message = bag.deserialize(raw, connection.msgtype)
                    messages = found.setdefault(connection.topic, Messages(kind=connection.msgtype))
                    stamp = _stamp(message)
                    if config.clock == "received" or stamp is None:
                        without |= {connection.topic} if config.clock == "header" else set()
                        stamp = received
                    _take(messages, stamp, message)
        except (FileNotFoundError, LogError):
            raise
        except Exception as fault:  # a damaged bag raises nearly anything
            reason = str(fault).partition("\n")[0] or type(fault).__name__
            raise LogError(f"{path}: not a readable bag ({reason})") from None
        if not found:
            raise LogError(f"{path}: it has no message of a kind that is known")
        start = min((min(messages.stamps) for messages in found.values() if any(messages.rows)), default=0)
        channels = {
            topic: channel
            for topic, messages in found.items()
            if (channel := messages.channel(start, _UNITS.get(messages.kind))) is not None
        }
        notes += [f"{each} not read, a kind of message that is not described" for each in unknown]
        notes += [f"{topic} not read, which holds no numbers" for topic in found if topic not in channels]
        notes += [
            f"{topic}: {', '.join(sorted(messages.skipped))} not read, pictures or points"
            for topic, messages in found.items()
            if messages.skipped
        ]
        if headless := sorted(without & {*channels}):
            notes.append(f"{', '.join(headless)}: stamps are times of receipt, for its messages have no header")
        if not channels:
            raise LogError(f"{path}: none of its {counted(len(found), 'topic')} holds numbers")
        clock = "stamps of the headers" if config.clock == "header" else "times of receipt"
        return RecordedLog(str(path), "bag of ROS", channels, clock, Decimal(start) / NANOSECONDS, notes=tuple(notes))


def _stamp(message: Any) -> int | None:
    """Stamp [ns] of a message's header, or of its first transform's; None where it has none or zero."""
    transforms = getattr(message, "transforms", None)
    header = getattr(transforms[0] if transforms else message, "header", None)
    stamp = getattr(header, "stamp", None)
    if stamp is None or not (stamp.sec or stamp.nanosec):
        return None
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def _take(messages: Messages, stamp: int, message: Any) -> None:
    """Add a message to those of its topic."""
    header = getattr(message, "header", None)
    if header is not None and not messages.frame:
        messages.frame = str(header.frame_id)
    if messages.kind == _JOINTS:
        row = {
            f"{kind} {name}": value
            for kind in ("position", "velocity", "effort")
            for name, value in zip(message.name, getattr(message, kind), strict=False)
        }
        messages.add(stamp, row)
        return
    if messages.kind == _SCAN and not messages.facts:
        messages.facts = {
            "first angle [deg]": f"{math.degrees(message.angle_min):.10g}",
            "step [deg]": f"{math.degrees(message.angle_increment):.10g}",
            "longest range [m]": f"{message.range_max:g}",
        }
    messages.add(stamp, {"ranges": message.ranges} if messages.kind == _SCAN else message, ("header",))
