"""Logs of PX4 (.ulg), by ``pyulog``. A topic is a channel, "sensor_gyro 1" that of a second sensor."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from decimal import Decimal
from pathlib import Path
from typing import Any

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
        """Stamps that are taken."""

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
            with redirect_stdout(io.StringIO()):  # it prints what it finds damaged
                content = pyulog.ULog(str(path))
            return _log(path, content, config.stamp)
        except LogError:
            raise
        except Exception as fault:  # a damaged file raises nearly anything
            reason = str(fault).partition("\n")[0] or type(fault).__name__
            raise LogError(f"{path}: not a readable ULog ({reason})") from None


def _log(path: Path, content: Any, stamp: str) -> RecordedLog:
    """The log in what ``pyulog`` has read."""
    topics = {f"{data.name} {data.multi_id}" if data.multi_id else data.name: data.data for data in content.data_list}
    stamps = {name: numbers.get(stamp, numbers[_STAMP]).astype(np.int64) for name, numbers in topics.items()}
    if not any(len(each) for each in stamps.values()):
        raise LogError(f"{path}: it has no topic with messages")
    start = min(int(each.min()) for each in stamps.values() if len(each))
    channels, notes = {}, []
    for name, numbers in topics.items():
        signals = tuple(each for each in numbers if not each.startswith(_STAMP))
        if not len(stamps[name]) or not signals:
            notes.append(f"{name} not read, which holds no numbers")
            continue
        values = np.column_stack([numbers[each] for each in signals]).astype(float)
        channels[name] = Channel((stamps[name] - start) / _MICROSECONDS, values, signals)
    if lost := len(content.dropouts):
        longest = max(each.duration for each in content.dropouts)
        notes.append(f"{counted(lost, 'dropout')} of the recorder, the longest {longest} ms")
    if content.file_corruption:
        notes.append("the file is damaged, and was read as far as possible")
    facts = {name: str(value) for name, value in content.msg_info_dict.items() if isinstance(value, str)}
    facts |= {name: f"{value:g}" for name, value in content.initial_parameters.items()}
    clock = f"{stamp} since the start of the autopilot"
    start_s = Decimal(start) / _MICROSECONDS
    return RecordedLog(str(path), "log of PX4", channels, clock, start_s, facts, tuple(notes))
