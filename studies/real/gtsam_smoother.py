"""GTSAM's batch smoother over a log with beacons, as a peer: it is no dependency of this package.

Poses are at the readings of beacons and every quarter of a second, odometry is integrated between them, and errors are
at all times of the log, as ours; ranges and bearings have Tukey's loss. It
begins with the poses of the reference, so that it need not find them, and has the deviations that ``beacon_bank`` has.
It has no factor with the scale of ranges as an unknown: it gets them as recorded, and over the scale that our filter
has found.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.angles import wrapped
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.table import Row
from mathnavi.studies.real.beacon_logs import KNOWN, BeaconCase, RecordedDrive
from mathnavi.studies.real.judging import row
from mathnavi.studies.real.published import peer

NAME = "GTSAM, batch"
_TUKEY = 4.685
_APART = 0.25  # [s] between poses at most, but for the step of the log
_STILL = 1e-3  # [m, rad] least deviation of a step


def at_hand() -> bool:
    """True where GTSAM is installed."""
    return peer("gtsam") is not None


def gtsam_row(case: BeaconCase, scale: float) -> Row:
    """A job: the row of GTSAM over a log whose ranges are 1 + ``scale`` times too long."""
    drive = case.drive()
    begun = time.process_time()
    at, poses = smoothed(drive, scale)
    update = MeasuredTime(1e6 * (time.process_time() - begun) / len(drive.log.t))
    t = drive.log.t[(drive.log.t >= at[0]) & (drive.log.t <= at[-1])]
    poses[:, 2] = np.unwrap(poses[:, 2])
    error = np.column_stack([np.interp(t, at, each) for each in poses.T]) - drive.truth_at(t)
    rms = float(np.sqrt(np.square(error[:, :2]).sum(axis=1).mean()))
    return row(
        part=case.part,
        log=case.log,
        case=f"ranges / {1.0 + scale:.4f}" if scale else "as recorded",
        beams=len(drive.mission.beacons),
        estimator=NAME,
        start="reference",
        position_rms_m=rms,
        position_rms_all_m=rms,
        heading_rms_deg=math.degrees(float(np.sqrt(np.square(wrapped(error[:, 2])).mean()))),
        setting=scale,
        update_us=update,
    )


def smoothed(drive: RecordedDrive, scale: float) -> tuple[Array, Array]:
    """Times (n,) [s] and poses (n, 3) of the batch smoother."""
    gtsam: Any = peer("gtsam")
    diagonal, robust = gtsam.noiseModel.Diagonal.Sigmas, gtsam.noiseModel.Robust.Create
    tukey = gtsam.noiseModel.mEstimator.Tukey.Create(_TUKEY)
    log, mission = drive.log, drive.mission
    ranges = log.readings["beacon_ranges"] / (1.0 + scale)
    bearings = log.readings.get("beacon_bearings", np.full_like(ranges, np.nan))
    inside = (log.t >= drive.t[0]) & (log.t <= drive.t[-1])
    reads: NDArray[np.bool_] = np.any(np.isfinite(ranges) | np.isfinite(bearings), axis=1)
    rows = pose_rows(log.t, reads, inside)
    truth = drive.truth_at(log.t[rows])
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    keys = [gtsam.symbol("x", k) for k in range(len(rows))]
    for key, pose in zip(keys, truth, strict=True):
        values.insert(key, gtsam.Pose2(*pose))
    graph.add(gtsam.PriorFactorPose2(keys[0], gtsam.Pose2(*truth[0]), diagonal(np.array(KNOWN))))
    for k, (step, deviation) in enumerate(steps_between(drive, rows)):
        graph.add(gtsam.BetweenFactorPose2(keys[k], keys[k + 1], gtsam.Pose2(*step), diagonal(deviation)))
    points = [gtsam.symbol("l", i) for i in range(len(mission.beacons))]
    exact = gtsam.noiseModel.Isotropic.Sigma(2, 1e-4)
    for point, place in zip(points, mission.beacons, strict=True):
        values.insert(point, gtsam.Point2(*place))
        graph.add(gtsam.PriorFactorPoint2(point, gtsam.Point2(*place), exact))
    for key, row_ in zip(keys, rows.tolist(), strict=True):
        for i in np.flatnonzero(np.isfinite(ranges[row_]) | np.isfinite(bearings[row_])).tolist():
            rho, bearing = float(ranges[row_, i]), float(bearings[row_, i])
            if mission.ranges is not None and math.isfinite(rho):
                noise = math.hypot(mission.ranges.absolute, mission.ranges.relative * rho)
                model = robust(tukey, gtsam.noiseModel.Isotropic.Sigma(1, noise))
                graph.add(gtsam.RangeFactor2D(key, points[i], rho, model))
            if mission.bearings is not None and math.isfinite(bearing):
                model = robust(tukey, gtsam.noiseModel.Isotropic.Sigma(1, mission.bearings.absolute))
                graph.add(gtsam.BearingFactor2D(key, points[i], gtsam.Rot2(bearing), model))
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    poses = [found.atPose2(key) for key in keys]
    return log.t[rows], np.array([[each.x(), each.y(), each.theta()] for each in poses])


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
