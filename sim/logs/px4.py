"""Logs of PX4 (.ulg), by ``pyulog``. A topic is a channel, "sensor_gyro 1" that of a second sensor."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np

from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.extras import extra
from mathnavi.interfaces.short_tables import counted
from mathnavi.sim.logs.lines import head_of
from mathnavi.sim.logs.recorded_log import Channel, RecordedLog

_MAGIC = b"ULog\x01\x12\x35"
_MICROSECONDS = 10**6  # of a second
_STAMP = "timestamp"


class Px4Log:
    """Log of PX4 (.ulg)."""

    @configuration
    class Config:
        """Which stamps are taken."""

        stamp: str = _STAMP
        """field of each topic with its stamps [us], such as timestamp_sample; topics without it have timestamp"""

    @staticmethod
    def accepts(path: Path) -> bool:
        """True for a file that begins as a ULog."""
        return head_of(path).startswith(_MAGIC)

    @staticmethod
    def read(path: Path, config: Config) -> RecordedLog:
        """Read a log; LogError for one that is damaged."""
        pyulog = extra("pyulog", "format px4")
        try:
            content = pyulog.ULog(str(path))
        except Exception as fault:  # a damaged file raises nearly anything
            reason = str(fault).partition("\n")[0] or type(fault).__name__
            raise LogError(f"{path}: not a readable ULog ({reason})") from None
        notes: list[str] = []
        stamps = {}
        for data in content.data_list:
            name = f"{data.name} {data.multi_id}" if data.multi_id else data.name
            stamps[name] = data.data.get(config.stamp, data.data[_STAMP])
        if not any(len(each) for each in stamps.values()):
            raise LogError(f"{path}: it has no topic with messages")
        start = min(int(each.min()) for each in stamps.values() if len(each))
        channels = {}
        for data in content.data_list:
            name = f"{data.name} {data.multi_id}" if data.multi_id else data.name
            signals = tuple(each for each in data.data if not each.startswith(_STAMP))
            if not len(stamps[name]) or not signals:
                notes.append(f"{name} not read, which holds no numbers")
                continue
            since = (stamps[name].astype(np.int64) - start) / _MICROSECONDS
            channels[name] = Channel(
                since, np.column_stack([data.data[each] for each in signals]).astype(float), signals
            )
        if lost := len(content.dropouts):
            longest = max(each.duration for each in content.dropouts)
            notes.append(f"{counted(lost, 'dropout')} of the recorder, the longest {longest} ms")
        if content.file_corruption:
            notes.append("the file is damaged, and was read as far as possible")
        facts = {name: str(value) for name, value in content.msg_info_dict.items() if isinstance(value, str)}
        facts |= {name: f"{value:g}" for name, value in content.initial_parameters.items()}
        return RecordedLog(
            str(path), "log of PX4", channels, f"{config.stamp} since the start of the autopilot",
            Decimal(start) / _MICROSECONDS, facts, tuple(notes),
        )  # fmt: skip
