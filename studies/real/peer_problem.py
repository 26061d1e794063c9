"""A log with beacons as a peer takes it: poses, the motion between them, and what was read at each.

Poses are at the readings of beacons and every quarter of a second, and odometry is integrated between them. Peers have
the deviations that ``beacon_bank`` has. None of them has the scale of ranges as an unknown: they get the ranges as
recorded, or over the scale that our filter has found.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.studies.real.beacon_logs import RecordedDrive

_APART = 0.25  # [s] between poses at most, but for the step of the log
_STILL = 1e-3  # [m, rad] least deviation of a step


class Sight(NamedTuple):
    """One reading of a beacon."""

    beacon: int
    is_range: bool  # False for a bearing
    value: float  # [m or rad]
    deviation: float  # [m or rad]


class PeerProblem(NamedTuple):
    """Knowledge of a drive, pose by pose."""

    t: Array  # (n,) [s]
    truth: Array  # (n, 3) poses of the reference
    steps: list[tuple[Array, Array]]  # motion (3,) from each pose to the next, in it, and its deviations (3,)
    sights: list[list[Sight]]  # of each pose
    places: Array  # (m, 2) [m] of the beacons


def problem_of(drive: RecordedDrive, scale: float) -> PeerProblem:
    """The problem of a drive whose ranges are 1 + ``scale`` times too long."""
    log, mission = drive.log, drive.mission
    ranges = log.readings["beacon_ranges"] / (1.0 + scale)
    bearings = log.readings.get("beacon_bearings", np.full_like(ranges, np.nan))
    inside = (log.t >= drive.t[0]) & (log.t <= drive.t[-1])
    reads: NDArray[np.bool_] = np.any(np.isfinite(ranges) | np.isfinite(bearings), axis=1)
    rows = pose_rows(log.t, reads, inside)
    sights: list[list[Sight]] = []
    for row in rows.tolist():
        own = []
        for i in np.flatnonzero(np.isfinite(ranges[row]) | np.isfinite(bearings[row])).tolist():
            rho, bearing = float(ranges[row, i]), float(bearings[row, i])
            if mission.ranges is not None and math.isfinite(rho):
                own.append(Sight(i, True, rho, math.hypot(mission.ranges.absolute, mission.ranges.relative * rho)))
            if mission.bearings is not None and math.isfinite(bearing):
                own.append(Sight(i, False, bearing, mission.bearings.absolute))
        sights.append(own)
    truth = drive.truth_at(log.t[rows])
    return PeerProblem(log.t[rows], truth, steps_between(drive, rows), sights, np.array(mission.beacons))


def pose_rows(t: Array, reads: NDArray[np.bool_], inside: NDArray[np.bool_]) -> Integers:
    """Rows of the log that have a pose: those with readings, and others so that none is far from the one before."""
    rows: list[int] = []
    for k in np.flatnonzero(inside).tolist():
        if reads[k] or not rows or t[k] - t[rows[-1]] >= _APART:
            rows.append(k)
    return np.array(rows)


def steps_between(drive: RecordedDrive, rows: Integers) -> list[tuple[Array, Array]]:
    """Motion (3,) by the odometry from each row of the log to the next, in the pose before, and its deviations."""
    log, mission = drive.log, drive.mission
    as_input = log.inputs if mission.odometry_is_input else None
    speeds = log.readings["odometry"] if as_input is None else as_input
    sigma, bias = np.array(mission.odometry.noise), mission.odometry.bias
    if as_input is None:  # a reading is the mean since the one before: it holds up to its own time
        read = np.flatnonzero(np.isfinite(speeds).all(axis=1))
        after = read[np.minimum(np.searchsorted(read, np.arange(len(log.t)) + 1), len(read) - 1)]
        speeds = speeds[after]
    h = np.diff(log.t)
    steps = []
    for first, last in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
        pose, variance = np.zeros(3), np.zeros(2)
        for k in range(first, last):
            pose = integrate(pose, float(speeds[k, 0]), float(speeds[k, 1]), float(h[k]))
            variance += np.square(sigma * h[k])
        moved = np.array([math.hypot(pose[0], pose[1]), abs(pose[2])])
        ahead, turn = np.sqrt(variance + np.square(bias * moved)) + _STILL
        steps.append((pose, np.array([ahead, _STILL + 0.2 * ahead, turn])))
    return steps
