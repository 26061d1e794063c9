"""Small logs in the formats of those that are published, of robots whose poses are known."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from scipy.io import savemat

import mathnavi as mn
from mathnavi.interfaces.signals import Array
from tests.estimators.beacons.drives import PLACES, drive

ROOM = mn.Polygon((((0, 0), (9, 0), (9, 4), (6, 4), (6, 7), (0, 7)), ((2, 2), (3, 2), (3, 3.5), (2, 3))))
ANGLES = np.radians(np.arange(-90.0, 90.0, 9.0))
MISREAD = 1.05  # of a turn by the wheels


def write_building(file: Path, laps: int) -> Array:
    """A log of GMapping: a robot around a block, a scan each 2 s with the pose, and ODOM that goes on from there."""
    lines, poses, t = [], [], 0.0
    for k in range(16 * laps):
        at = k * math.tau / 16
        pose = np.array([2.5 + 1.8 * math.cos(at), 2.8 + 1.8 * math.sin(at), (at + 0.5 * math.pi) % math.tau])
        step = 3.6 * math.sin(math.pi / 16)
        if poses:  # ODOM at the end of the step: an arc, a little too much of a turn
            x, y, heading = poses[-1]
            lines.append(_odom(x + step * math.cos(heading + 0.196), y + step * math.sin(heading + 0.196),
                               heading + MISREAD * math.tau / 16, t))  # fmt: skip
        ranges = " ".join(f"{each:.4f}" for each in ROOM.ranges(pose, ANGLES)[0])
        words = " ".join(f"{each:.6f}" for each in pose)
        lines.append(f"FLASER {len(ANGLES)} {ranges} {words} {words} {t} host {t}")
        lines += [_odom(*np.round(pose, 6).tolist(), 0.0), "NEFF 9.5"]
        poses.append(np.round(pose, 6))
        t += 2.0
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(lines) + "\n")
    return np.array(poses)


def _odom(x: float, y: float, heading: float, t: float) -> str:
    return f"ODOM {x:.6f} {y:.6f} {heading:.6f} 0 0 0 {t} host {t}"


def write_plaza(file: Path, count: int) -> None:
    """A drive among four beacons, in the format of Plaza1."""
    driven = drive(count=count)
    t, odometry = driven.log.t, driven.log.readings["odometry"]
    rows = np.flatnonzero(np.isfinite(odometry[:, 0]))
    steps = np.diff(t[rows], prepend=0.0)
    ranges = [
        [t[k], 2.0, 10.0 + i, rho[i]]
        for k, rho in enumerate(driven.log.readings["beacon_ranges"])
        for i in np.flatnonzero(np.isfinite(rho)).tolist()
    ]
    arrays = {
        "DR": np.column_stack([t[rows], odometry[rows] * steps[:, None]]),
        "TD": np.array(ranges),
        "GT": np.column_stack([t, driven.truth]),
        "TL": np.column_stack([10.0 + np.arange(4), np.array(PLACES)])[::-1],
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    savemat(file, arrays)
