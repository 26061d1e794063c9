"""Logs of buildings: scans with poses by SLAM, the steps of the wheels between them, a map, and readings of few beams.

A log is one of CARMEN with scans whose poses SLAM has corrected (Radish: Intel lab, Freiburg 101). These poses are no
independent truth, and the map is made of the same poses, though of other scans.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.angles import wrapped
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.field.scan_map import grid_of_scans
from mathnavi.models.field.tracing import traced
from mathnavi.sim.logs.formats import read_log
from mathnavi.sim.logs.recorded_log import RecordedLog
from mathnavi.sim.records.sensor_log import SensorLog

SOONEST = 0.1  # [s] after the scan before


@dataclass(frozen=True)
class Floor:
    """Scans of a log, their poses by SLAM, and what the wheels measured between them."""

    t: Array  # (n,) [s]
    ranges: Array  # (n, l) [m]
    angles: Array  # (l,) [rad]
    poses: Array  # (n, 3)
    wheels: tuple[Array, ...]  # n: poses (m, 3) by the wheels from the scan before to this one, which begin there


@lru_cache(maxsize=2)
def floor_of(file: Path) -> Floor:
    """Read a log; LogError without scans that SLAM has corrected."""
    log = read_log(file)
    if "scan" not in log or "scan pose" not in log:
        raise LogError(f"{file}: no scans with corrected poses; allowed: a log of CARMEN that SLAM has corrected")
    scan, poses = log["scan"], log["scan pose"].values
    first, step = (float(scan.facts[key]) for key in ("first angle [deg]", "step [deg]"))
    angles = np.radians(first + step * np.arange(scan.values.shape[1]))
    return Floor(scan.t, scan.values, angles, poses, _wheels(log, poses))


def _wheels(log: RecordedLog, poses: Array) -> tuple[Array, ...]:
    """Poses by the wheels from each scan to the next: those of ``scan odometry``, or ODOM as GMapping passes it on.

    GMapping repeats the pose of each scan as a row of ODOM, from which the rows up to the next scan go on.
    """
    if "scan odometry" in log:
        own = log["scan odometry"].values
        return (own[:1], *(own[k - 1 : k + 1] for k in range(1, len(own))))
    rows = log["odometry"].values[:, :3]
    marks: list[int] = []
    at = 0
    for pose in poses:
        same = np.flatnonzero((rows[at:] == pose).all(axis=1))
        if not same.size:
            raise LogError(f"{log.source}: the pose of scan {len(marks)} is in no message ODOM after it")
        # While the robot stands, rows before the repeated one may be the same: the wheels did not move.
        at += int(same[0])
        marks.append(at)
        at += 1
    return (rows[marks[0] : marks[0] + 1], *(rows[a:b] for a, b in itertools.pairwise(marks)))


def walls_of(floor: Floor, used: NDArray[np.bool_], longest: float, name: str) -> Polygon:
    """Walls by the scans ``used`` (n,), whose ranges from ``longest`` [m] on count as without an echo."""
    grid = grid_of_scans(floor.poses[used], floor.angles, floor.ranges[used], longest=longest, name=name)
    return traced(grid, 0.1, 0.05).walls


def beams_of(floor: Floor, count: int) -> Integers:
    """Indices (count,) of beams that are spread evenly over the scan."""
    share = (np.arange(count) + 0.5) / count
    return np.rint(share * (len(floor.angles) - 1)).astype(int)


@dataclass(frozen=True)
class Calibration:
    """Wheels of a robot against the poses of SLAM: the true step is (ahead * d, turn * turn + veer * d)."""

    ahead: float
    turn: float
    veer: float  # [rad/m]
    deviation: tuple[float, float]  # [m, rad] of what is left of a step from one scan to the next


def calibration(floor: Floor, since: float, until: float) -> Calibration:
    """Least squares over the steps before ``since`` and after ``until`` [s]."""
    steps, truth = [], []
    for k in range(1, len(floor.t)):
        if since <= floor.t[k] <= until or since <= floor.t[k - 1] <= until:
            continue
        path = floor.wheels[k]
        steps.append(_relative(path[0], path[-1]))
        truth.append(_relative(floor.poses[k - 1], floor.poses[k]))
    wheels, slam = np.array(steps), np.array(truth)
    ahead = float(wheels[:, 0] @ slam[:, 0] / (wheels[:, 0] @ wheels[:, 0]))
    turn, veer = np.linalg.lstsq(wheels[:, [2, 0]], slam[:, 2], rcond=None)[0].tolist()
    left = np.hypot(slam[:, 0] - ahead * wheels[:, 0], slam[:, 1] - wheels[:, 1])
    turned = slam[:, 2] - turn * wheels[:, 2] - veer * wheels[:, 0]
    return Calibration(ahead, turn, veer, (float(np.sqrt(np.mean(left**2))), float(np.std(turned))))


def _relative(one: Array, other: Array) -> Array:
    """Pose (3,) of ``other`` as seen from ``one``."""
    c, s = math.cos(one[2]), math.sin(one[2])
    d = other[:2] - one[:2]
    return np.array([c * d[0] + s * d[1], -s * d[0] + c * d[1], float(wrapped(other[2] - one[2]))])


def sensor_log(floor: Floor, rows: Integers, beams: Integers, wheels: Calibration) -> SensorLog:
    """Ranges of the ``beams`` at the scans ``rows``, and mean speeds of the wheels between them.

    Rows of odometry between two scans have no reliable stamps: they count as evenly spread. A scan whose stamp is not
    later than that before it is left out, and the wheels go on to the next.
    """
    nothing = np.full(len(beams), np.nan)
    t, ranges, speeds = [floor.t[rows[0]]], [floor.ranges[rows[0], beams]], [[0.0, 0.0]]
    steps: list[Array] = []
    for k in rows[1:]:
        steps.extend(_arcs(floor.wheels[k]))
        before = t[-1]
        if floor.t[k] < before + SOONEST:
            continue
        dt = (floor.t[k] - before) / len(steps)
        for j, (ahead, turn) in enumerate(steps, start=1):
            is_last = j == len(steps)
            t.append(floor.t[k] if is_last else before + j * dt)
            ranges.append(floor.ranges[k, beams] if is_last else nothing)
            speeds.append([wheels.ahead * ahead / dt, (wheels.turn * turn + wheels.veer * ahead) / dt])
        steps = []
    return SensorLog(np.array(t), {"ranges": np.array(ranges), "odometry": np.array(speeds)})


def _arcs(path: Array) -> list[Array]:
    """Lengths [m] and turns [rad] of the arcs between poses (m, 3); one of no length if there is one pose only."""
    found = [np.zeros(2)] if len(path) < 2 else []
    for one, other in itertools.pairwise(path):
        d, turn = other[:2] - one[:2], float(wrapped(other[2] - one[2]))
        middle = one[2] + 0.5 * turn
        chord = float(d @ [math.cos(middle), math.sin(middle)])
        found.append(np.array([chord / float(np.sinc(0.5 * turn / math.pi)), turn]))
    return found
