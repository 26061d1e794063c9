"""Logs of the CARMEN robot navigation toolkit: text, one message per line.

| message | channel | signals |
|---|---|---|
| ``ODOM x y heading v w acceleration ...`` | ``odometry`` | pose, speeds |
| ``FLASER n ranges[n] x y heading odom_x odom_y odom_heading ...``, ``RLASER`` | ``scan``, ``rear scan`` | ranges |
| ``ROBOTLASER1 ...``, ``RAWLASER1 ...`` (2 to 5) | ``laser 1``, ... | ranges |
| ``TRUEPOS x y heading odom_x odom_y odom_heading ...`` | ``true pose`` | pose |

A message ends in the time of its sender, its host and the time of the logger. The stamps are the sender's. A scan of
FLASER spans 180 degrees, from the right to the left: n even, every 180 / n degrees from -90 on, n odd, every
180 / (n - 1) degrees from -90 to 90; others state their angles.

Poses of FLASER are those of the laser: a pose of the robot, moved ahead by the PARAM ``robot_frontlaser_offset`` [m].

A scan comes with two poses, ``scan pose`` and ``scan odometry``. Where they differ, the first is what another program
found, and a reference. GMapping writes its own pose in both, and beside each a message ``NEFF``; it moves what
it passes on as ``ODOM`` along, so that these poses jump with each scan, and only their steps between two scans are
those of the wheels.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import numpy as np

from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.short_tables import counted
from mathnavi.sim.logs.lines import head_of, lines_of
from mathnavi.sim.logs.recorded_log import Channel, RecordedLog, Role
from mathnavi.sim.records.log_times import epoch_of

POSE = ("x [m]", "y [m]", "heading [rad]")
_KNOWN = re.compile(rb"(PARAM|ODOM|FLASER|RLASER|TRUEPOS|RAWLASER\d|ROBOTLASER\d) ")
_MESSAGE = re.compile(rb"[A-Z_]+\d? ")
_OLD_LASERS = {"FLASER": "scan", "RLASER": "rear scan"}
_NEW_LASER = re.compile(r"(RAW|ROBOT)LASER(\d)")
_DESCRIBED = 7  # numbers by which a newer laser describes itself, before the number of its ranges
_GMAPPING = "NEFF"  # message with its number of effective particles
_SAME = 1e-9  # [m] or [rad] by which a pose and odometry may differ


@dataclass
class _Rows:
    """Readings of a channel."""

    stamps: list[float] = field(default_factory=list)
    values: list[Sequence[float]] = field(default_factory=list)
    facts: dict[str, str] = field(default_factory=dict)


class CarmenLog:
    """Log of the CARMEN toolkit, as of the Radish data sets: odometry, laser scans, poses."""

    @configuration
    class Config:
        """It has no fields."""

    @staticmethod
    def accepts(path: Path) -> bool:
        """True for a text whose first lines are messages of CARMEN."""
        lines = [line for line in head_of(path).split(b"\n") if line.strip() and not line.startswith(b"#")]
        return any(map(_KNOWN.match, lines)) and all(map(_MESSAGE.match, lines[:-1]))

    @staticmethod
    def read(path: Path, config: Config) -> RecordedLog:
        """Read a log; LogError names the line of a message that is cut off or is no message."""
        found: dict[str, _Rows] = {}
        facts: dict[str, str] = {}
        left: Counter[str] = Counter()
        for number, line in lines_of(path):
            kind, *words = line.split() or ["#"]
            if kind.startswith("#"):
                continue
            if kind == "PARAM":
                if len(words) > 1:
                    facts[words[0]] = words[1]
                continue
            read = _MESSAGES.get(kind) or (_new_laser if _NEW_LASER.fullmatch(kind) else None)
            if read is None:
                left[kind] += 1
                continue
            try:
                read(kind, words, found)
            except (ValueError, IndexError, OverflowError):
                raise LogError(f"{path} line {number}: {line[:60]!r} is no whole message {kind} of CARMEN") from None
        if not found:
            raise LogError(f"{path}: no message of CARMEN that is known; allowed: {', '.join(_MESSAGES)}, ROBOTLASER1")
        start = epoch_of(np.array([stamp for rows in found.values() for stamp in rows.stamps]), "s")
        channels = {name: _channel(path, name, rows, start) for name, rows in found.items()}
        notes = [f"{counted(count, 'message')} {kind} not read" for kind, count in left.items() if kind != _GMAPPING]
        if corrected := _GMAPPING in left:
            notes.append("poses are those of GMapping, and those of ODOM between two scans begin at them")
        return RecordedLog(
            str(path),
            "log of CARMEN",
            _with_roles(channels, corrected=corrected),
            "time of the sender (IPC)",
            Decimal(repr(start)),
            facts,
            tuple(notes),
        )


def _odometry(kind: str, words: Sequence[str], found: dict[str, _Rows]) -> None:
    _add(found, "odometry", _stamp(words, 6), [float(word) for word in words[:5]])


def _true_pose(kind: str, words: Sequence[str], found: dict[str, _Rows]) -> None:
    _add(found, "true pose", _stamp(words, 6), [float(word) for word in words[:3]])


def _old_laser(kind: str, words: Sequence[str], found: dict[str, _Rows]) -> None:
    count, name = int(words[0]), _OLD_LASERS[kind]
    if count < 2:
        raise ValueError
    numbers = [float(word) for word in words[1 : 7 + count]]
    stamp = _stamp(words, 7 + count)
    step = 180.0 / (count if count % 2 == 0 else count - 1)
    facts = {"first angle [deg]": "-90", "step [deg]": f"{step:.10g}"}
    _add(found, name, stamp, numbers[:count], facts)
    _add(found, f"{name} pose", stamp, numbers[count : count + 3])
    _add(found, f"{name} odometry", stamp, numbers[count + 3 : count + 6])


def _new_laser(kind: str, words: Sequence[str], found: dict[str, _Rows]) -> None:
    described = _NEW_LASER.fullmatch(kind)
    assert described is not None
    name = f"laser {described[2]}"
    first, _, step, maximum = (float(word) for word in words[1:5])
    count = int(words[_DESCRIBED])
    after = _DESCRIBED + 1 + count
    ranges = [float(word) for word in words[_DESCRIBED + 1 : after]]
    after += 1 + int(words[after])  # remissions
    facts = {
        "first angle [deg]": f"{math.degrees(first):.10g}",
        "step [deg]": f"{math.degrees(step):.10g}",
        "longest range [m]": f"{maximum:g}",
    }
    behind = {"RAW": 0, "ROBOT": 11}[described[1]]
    numbers = [float(word) for word in words[after : after + behind]]
    stamp = _stamp(words, after + behind)
    _add(found, name, stamp, ranges, facts)
    if behind:
        _add(found, f"{name} pose", stamp, numbers[:3])
        _add(found, f"{name} odometry", stamp, numbers[3:6])


_MESSAGES: dict[str, Callable[[str, Sequence[str], dict[str, _Rows]], None]] = {
    "ODOM": _odometry,
    "FLASER": _old_laser,
    "RLASER": _old_laser,
    "TRUEPOS": _true_pose,
}


def _stamp(words: Sequence[str], place: int) -> float:
    """Time of the sender, after which host and time of the logger end the message."""
    stamp, _ = float(words[place]), words[place + 1]
    if not math.isfinite(stamp):
        raise ValueError
    return stamp


def _add(
    found: dict[str, _Rows], name: str, stamp: float, values: Sequence[float], facts: dict[str, str] | None = None
) -> None:
    rows = found.setdefault(name, _Rows())
    rows.stamps.append(stamp)
    rows.values.append(values)
    rows.facts.update(facts or {})


def _channel(path: Path, name: str, rows: _Rows, start: float) -> Channel:
    counts = sorted({len(row) for row in rows.values})
    if len(counts) > 1:
        raise LogError(
            f"{path}: {name} has messages with {counts[0]} and with {counts[-1]} numbers; allowed: one number"
        )
    if name == "odometry":
        signals: tuple[str, ...] = (*POSE, "speed [m/s]", "yaw rate [rad/s]")
    elif name.endswith(("pose", "odometry")):
        signals = POSE
    else:
        signals = tuple(f"range {k} [m]" for k in range(counts[0]))
    values = np.array(rows.values, dtype=np.float64).reshape(len(rows.stamps), counts[0])
    return Channel(np.array(rows.stamps) - start, values, signals, facts=rows.facts)


def _with_roles(channels: dict[str, Channel], *, corrected: bool) -> dict[str, Channel]:
    """The channels, with the poses that another program found as references, and none that is there twice."""
    found = {}
    for name, channel in channels.items():
        role: Role = "reference" if name == "true pose" else "reading"
        if name.endswith(" pose") and (odometry := channels.get(f"{name.removesuffix('pose')}odometry")) is not None:
            same = np.abs(channel.values - odometry.values).max() <= _SAME
            if same and not corrected:
                continue
            role = "reference"
        elif name.endswith(" odometry") and corrected:
            continue  # the pose once more
        found[name] = Channel(channel.t, channel.values, channel.signals, role, channel.frame, channel.facts)
    return found
