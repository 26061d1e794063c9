"""Data sets of the UTIAS multi-robot cooperative localisation and mapping collection (MR.CLAM; Leung et al., 2011).

A data set is a folder, of which one robot is read:

| file | channel | signals |
|---|---|---|
| ``RobotN_Odometry.dat`` | ``odometry`` | speed, yaw rate, each from its time to the next |
| ``RobotN_Measurement.dat`` | ``landmarks``, ``robots``, ``unknown`` | subject, range, bearing of what was seen |
| ``RobotN_Groundtruth.dat`` | ``motion capture`` | pose |

``Barcodes.dat`` says which subject has the bar code that a robot reads, ``Landmark_Groundtruth.dat`` where the
landmarks are, which become facts. Each file may be compressed (.gz).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge

from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.logs.carmen import POSE
from mathnavi.sim.logs.lines import lines_of
from mathnavi.sim.logs.recorded_log import Channel, RecordedLog
from mathnavi.sim.records.log_times import epoch_of

_ROBOT = re.compile(r"Robot(\d+)_Odometry\.dat(\.gz)?")
_SEEN = ("subject", "range [m]", "bearing [rad]")


class MrclamLog:
    """Data set of MR.CLAM, a folder: odometry, ranges and bearings of landmarks, motion capture of one robot."""

    @configuration
    class Config:
        """Robot that is read."""

        robot: Annotated[int, Ge(1)] | None = None
        """number of the robot; the first in the folder if not given"""

    @staticmethod
    def accepts(path: Path) -> bool:
        """True for a folder with the odometry of a robot."""
        return path.is_dir() and any(_robots(path))

    @staticmethod
    def read(path: Path, config: Config) -> RecordedLog:
        """Read one robot; LogError for one that is not there, and for a line that is not of numbers."""
        known = sorted(_robots(path))
        if not known or (config.robot is not None and config.robot not in known):
            named = ", ".join(map(str, known)) or "none"
            raise LogError(f"{path}: robot = {config.robot}; allowed: one whose odometry is in the folder: {named}")
        robot = config.robot or known[0]
        odometry = _table(path, f"Robot{robot}_Odometry.dat", 3)
        seen = _table(path, f"Robot{robot}_Measurement.dat", 4)
        codes = {code: subject for subject, code in _table(path, "Barcodes.dat", 2).tolist()}
        landmarks = _table(path, "Landmark_Groundtruth.dat", 5)
        truth = _table(path, f"Robot{robot}_Groundtruth.dat", 4, optional=True)
        tables = [odometry, *([seen] if len(seen) else []), *([truth] if len(truth) else [])]
        start = epoch_of(np.concatenate([table[:, 0] for table in tables]), "s")
        channels = {"odometry": Channel(odometry[:, 0] - start, odometry[:, 1:3], ("speed [m/s]", "yaw rate [rad/s]"))}
        subjects = np.array([codes.get(code, np.nan) for code in seen[:, 1].tolist()])
        at = landmarks[:, 0]
        parts = {
            "landmarks": np.isin(subjects, at),
            "robots": np.isfinite(subjects) & ~np.isin(subjects, at),
            "unknown": np.isnan(subjects),
        }
        for name, rows in parts.items():
            if rows.any():
                who = np.where(np.isnan(subjects), seen[:, 1], subjects)[rows]
                values = np.column_stack([who, seen[rows, 2:4]])
                signals = ("bar code", *_SEEN[1:]) if name == "unknown" else _SEEN
                channels[name] = Channel(seen[rows, 0] - start, values, signals)
        if len(truth):
            channels["motion capture"] = Channel(truth[:, 0] - start, truth[:, 1:4], POSE, "reference")
        facts = {f"landmark {int(each[0])} [m]": f"{each[1]:.9g} {each[2]:.9g}" for each in landmarks.tolist()}
        return RecordedLog(
            str(path), f"data set of MR.CLAM, robot {robot}", channels, "common clock of the robots",
            Decimal(repr(start)), facts,
        )  # fmt: skip


def _robots(path: Path) -> Iterator[int]:
    for file in path.iterdir():
        if found := _ROBOT.fullmatch(file.name):
            yield int(found[1])


def _table(path: Path, name: str, columns: int, *, optional: bool = False) -> Array:
    """Numbers (n, columns) of a file; no rows of an optional one that is not there."""
    file = next((each for each in (path / name, path / f"{name}.gz") if each.is_file()), None)
    if file is None:
        if optional:
            return np.empty((0, columns))
        raise LogError(f"{path} has no {name}; allowed: a whole data set")
    rows = []
    for number, line in lines_of(file):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            rows.append([float(word) for word in words[:columns]])
            if len(words) < columns or not np.isfinite(rows[-1]).all():
                raise ValueError
        except ValueError:
            raise LogError(f"{file} line {number}: {line[:60]!r}; allowed: {columns} numbers") from None
    return np.array(rows, dtype=np.float64).reshape(-1, columns)
