"""MCAP files with messages of JSON or Protobuf, by ``mcap``; those of ROS are read as a bag.

A topic is a channel. A message of JSON whose field ``t`` is the time that its stamp rounds has that as its stamp: the
files that ``mathnavi export`` writes give back each number bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.extras import extra
from mathnavi.interfaces.reading.files import MOST_LINES, opened, parsed
from mathnavi.sim.logs.lines import head_of
from mathnavi.sim.logs.messages import NANOSECONDS, Messages
from mathnavi.sim.logs.recorded_log import Channel, RecordedLog
from mathnavi.sim.logs.ros import RosLog

_MAGIC = b"\x89MCAP0\r\n"
_TIME = "t"  # field with the time that a stamp rounds
_ROUNDED = 1e-9  # [s] by which it may differ
_ROS = ("cdr", "ros1")  # encodings
_DRAWN = ("SceneUpdate", "PointCloud", "RawImage", "CompressedImage", "CompressedVideo")  # schemas without readings


class McapLog:
    """MCAP file with messages of JSON, Protobuf or ROS."""

    @configuration
    class Config:
        """It has no fields."""

    @staticmethod
    def accepts(path: Path) -> bool:
        """True for a file that begins as MCAP."""
        return path.is_file() and head_of(path).startswith(_MAGIC)

    @staticmethod
    def read(path: Path, config: Config) -> RecordedLog:
        """Read a file; LogError for one that is damaged."""
        reader = extra("mcap.reader", "format mcap")
        found: dict[str, Messages] = {}
        times: dict[str, list[float]] = {}
        left: set[str] = set()
        with opened(path, LogError, MOST_LINES) as file:
            try:
                for topic, encoding, stamp, message in _messages(reader.make_reader(file)):
                    if encoding in _ROS:
                        return RosLog.read(path, RosLog.Config())
                    if message is None:
                        left.add(f"{topic} ({encoding})")
                        continue
                    messages = found.setdefault(topic, Messages(kind=encoding))
                    messages.add(stamp, message, (_TIME,))
                    own = message.get(_TIME) if isinstance(message, dict) else None
                    times.setdefault(topic, []).append(float(own) if isinstance(own, int | float) else np.nan)
            except LogError:
                raise
            except Exception as fault:  # a damaged file raises nearly anything
                reason = str(fault).partition("\n")[0] or type(fault).__name__
                raise LogError(f"{path}: not a readable MCAP file ({reason})") from None
        exact = {topic for topic in found if _rounds(times[topic], found[topic].stamps)}
        others = [min(messages.stamps) for topic, messages in found.items() if topic not in exact]
        start = 0 if exact else min(others, default=0)
        channels: dict[str, Channel] = {}
        notes = [f"{each} not read, a drawing or an encoding that is not known" for each in sorted(left)]
        for topic, messages in found.items():
            channel = messages.channel(start)
            if channel is None:
                notes.append(f"{topic} not read, which holds no numbers")
                continue
            t = np.array(times[topic]) if topic in exact else channel.t
            channels[topic] = Channel(t, channel.values, channel.signals, channel.role, channel.frame, channel.facts)
        if not channels:
            raise LogError(f"{path}: none of its topics holds numbers")
        clock = f"log time, and {_TIME!r} where a message has it" if exact else "log time"
        notes += [
            f"{topic}: {', '.join(sorted(messages.skipped))} not read, pictures or points"
            for topic, messages in found.items()
            if messages.skipped
        ]
        return RecordedLog(str(path), "MCAP", channels, clock, Decimal(start) / NANOSECONDS, notes=tuple(notes))


def _messages(reader: Any) -> Iterator[tuple[str, str, int, Any]]:
    """Topic, encoding, stamp [ns] and content of each message, in the order of the file; None for another encoding."""
    protobuf = None
    decoders: dict[int, Any] = {}
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        content: Any = None
        if channel.message_encoding == "json":
            content = parsed(message.data, channel.topic, LogError)
        elif channel.message_encoding == "protobuf" and schema.name.rpartition(".")[2] not in _DRAWN:
            if protobuf is None:
                protobuf = extra("mcap_protobuf.decoder", "format mcap").DecoderFactory()
            if channel.id not in decoders:
                decoders[channel.id] = protobuf.decoder_for(channel.message_encoding, schema)
            content = _of_protobuf(decoders[channel.id](message.data))
        yield channel.topic, channel.message_encoding, message.log_time, content


def _of_protobuf(message: Any) -> dict[str, Any]:
    """The fields of a message of Protobuf, also those of their default values, as mappings and lists."""
    found: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.message_type is None:
            found[field.name] = list(value) if field.is_repeated else value
        elif field.is_repeated:
            found[field.name] = [_of_protobuf(each) for each in value]
        elif message.HasField(field.name):
            found[field.name] = _of_protobuf(value)
    return found


def _rounds(times: list[float], stamps: list[int]) -> bool:
    """True where times [s] are what stamps [ns] round."""
    own = np.array(times)
    return bool(np.isfinite(own).all() and np.abs(own - np.array(stamps) / NANOSECONDS).max() <= _ROUNDED)
