"""GTSAM's estimators over a log with beacons, as peers: it is no dependency of this package.

| name | method |
| --- | --- |
| ``GTSAM, batch`` | Levenberg-Marquardt over the whole log; it begins with the poses of the reference |
| ``GTSAM, fixed lag`` | ``IncrementalFixedLagSmoother`` (iSAM2) over the last ten seconds, its newest pose on line |
| ``GTSAM, invariant EKF`` | ``InvariantEKFPose2``, on line |

All begin with the first pose of the reference, so that none need find it. Smoothers have Tukey's loss, and the filter
rejects readings beyond the same number of deviations. Errors are at all times of the log, as ours; between their poses
those on line are interpolated too, which favours them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.table import Row
from mathnavi.studies.real.beacon_logs import KNOWN, BeaconCase
from mathnavi.studies.real.judging import row
from mathnavi.studies.real.peer_problem import PeerProblem, Sight, problem_of
from mathnavi.studies.real.published import peer

BATCH, FIXED_LAG, INVARIANT = "GTSAM, batch", "GTSAM, fixed lag", "GTSAM, invariant EKF"
ON_LINE, SMOOTHED = (FIXED_LAG, INVARIANT), (BATCH,)
_TUKEY = 4.685  # deviations
_LAG = 10.0  # [s]
_RELINEARIZED = 0.01  # [m, rad] change of a state from which on it is linearized again


def at_hand() -> bool:
    """True where GTSAM is installed."""
    return peer("gtsam") is not None


def gtsam_rows(case: BeaconCase, scale: float) -> list[Row]:
    """A job: rows of GTSAM's estimators over a log whose ranges are 1 + ``scale`` times too long."""
    drive = case.drive()
    problem = problem_of(drive, scale)
    t = drive.log.t[(drive.log.t >= problem.t[0]) & (drive.log.t <= problem.t[-1])]
    truth, rows = drive.truth_at(t), []
    for name, method in PEERS.items():
        begun = time.process_time()
        poses = method(problem)
        update = MeasuredTime(1e6 * (time.process_time() - begun) / len(drive.log.t))
        poses[:, 2] = np.unwrap(poses[:, 2])
        error = np.column_stack([np.interp(t, problem.t, each) for each in poses.T]) - truth
        rms = float(np.sqrt(np.square(error[:, :2]).sum(axis=1).mean()))
        rows.append(
            row(
                part=case.part,
                log=case.log,
                case=f"ranges / {1.0 + scale:.4f}" if scale else "as recorded",
                beams=len(problem.places),
                estimator=name,
                start="reference",
                position_rms_m=rms,
                position_rms_all_m=rms,
                heading_rms_deg=math.degrees(float(np.sqrt(np.square(wrapped(error[:, 2])).mean()))),
                setting=scale,
                update_us=update,
            )
        )
    return rows


def smoothed(problem: PeerProblem) -> Array:
    """Poses (n, 3) of the batch smoother."""
    gtsam: Any = peer("gtsam")
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    _add_beacons(graph, values, problem)
    return _optimised(graph, values, problem, problem.truth)[0]


def mapped(problem: PeerProblem, poses: Array, places: Array) -> tuple[Array, Array]:
    """Poses (n, 3) and places (m, 2) [m] of the batch smoother with all beacons at unknown places, from those given."""
    gtsam: Any = peer("gtsam")
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for i, place in enumerate(places):
        values.insert(_beacon(i), gtsam.Point2(*place))
    return _optimised(graph, values, problem, poses)


def _optimised(graph: Any, values: Any, problem: PeerProblem, poses: Array) -> tuple[Array, Array]:
    """Poses (n, 3) and places (m, 2) [m] after Levenberg and Marquardt's steps from poses (n, 3) on."""
    gtsam: Any = peer("gtsam")
    for k, pose in enumerate(poses):
        values.insert(_pose(k), gtsam.Pose2(*pose))
        _add_stage(graph, problem, k)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    places = np.array([found.atPoint2(_beacon(i)) for i in range(len(problem.places))])
    return np.array([_array(found.atPose2(_pose(k))) for k in range(len(problem.t))]), places


def lagged(problem: PeerProblem) -> Array:
    """Poses (n, 3) of the fixed-lag smoother, each as it was at its time."""
    gtsam: Any = peer("gtsam")
    parameters = gtsam.ISAM2Params()
    parameters.relinearizeSkip = 1
    parameters.setRelinearizeThreshold(_RELINEARIZED)
    smoother = gtsam.IncrementalFixedLagSmoother(_LAG, parameters)
    found = np.empty((len(problem.t), 3))
    beacons = [_beacon(i) for i in range(len(problem.places))]
    for k, t in enumerate(problem.t.tolist()):
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        if k == 0:
            pose = gtsam.Pose2(*problem.truth[0])
            _add_beacons(graph, values, problem)
        else:
            pose = gtsam.Pose2(*found[k - 1]).compose(gtsam.Pose2(*problem.steps[k - 1][0]))
        values.insert(_pose(k), pose)
        _add_stage(graph, problem, k)
        smoother.update(graph, values, {_pose(k): t, **dict.fromkeys(beacons, t)})  # beacons stay within the lag
        found[k] = _array(smoother.calculateEstimatePose2(_pose(k)))
    return found


def filtered(problem: PeerProblem) -> Array:
    """Poses (n, 3) of the invariant Kalman filter."""
    gtsam: Any = peer("gtsam")
    kalman = gtsam.InvariantEKFPose2(gtsam.Pose2(*problem.truth[0]), np.diag(np.square(KNOWN)))
    found = np.empty((len(problem.t), 3))
    for k, sights in enumerate(problem.sights):
        if k:
            step, deviation = problem.steps[k - 1]
            kalman.predict(gtsam.Pose2(*step), np.diag(np.square(deviation)))
        for sight in sights:
            h, H = _expected(_array(kalman.state()), problem.places[sight.beacon], sight)
            error = sight.value - h if sight.is_range else wrapped(sight.value - h)
            R = np.array([[sight.deviation**2]])
            if error**2 <= _TUKEY**2 * float((H @ kalman.covariance() @ H.T + R)[0, 0]):
                kalman.updateWithVector(np.array([h]), H, np.array([h + error]), R)
        found[k] = _array(kalman.state())
    return found


PEERS: Mapping[str, Callable[[PeerProblem], Array]] = {BATCH: smoothed, FIXED_LAG: lagged, INVARIANT: filtered}


def _expected(pose: Array, place: Array, sight: Sight) -> tuple[float, Array]:
    """Reading expected at a pose, and its derivative (1, 3) by a motion in the frame of the pose."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    offset = place - pose[:2]
    x, y = float(c * offset[0] + s * offset[1]), float(c * offset[1] - s * offset[0])  # of the beacon, seen from it
    rho = math.hypot(x, y)
    if sight.is_range:
        return rho, np.array([[-x / rho, -y / rho, 0.0]])
    return math.atan2(y, x), np.array([[y / rho**2, -x / rho**2, -1.0]])


def _add_stage(graph: Any, problem: PeerProblem, k: int) -> None:
    """Add the factors of a pose: the motion to it, or the start, and what was read there."""
    gtsam: Any = peer("gtsam")
    diagonal = gtsam.noiseModel.Diagonal.Sigmas
    if k == 0:
        graph.add(gtsam.PriorFactorPose2(_pose(0), gtsam.Pose2(*problem.truth[0]), diagonal(np.array(KNOWN))))
    else:
        step, deviation = problem.steps[k - 1]
        graph.add(gtsam.BetweenFactorPose2(_pose(k - 1), _pose(k), gtsam.Pose2(*step), diagonal(deviation)))
    tukey = gtsam.noiseModel.mEstimator.Tukey.Create(_TUKEY)
    for sight in problem.sights[k]:
        noise = gtsam.noiseModel.Robust.Create(tukey, gtsam.noiseModel.Isotropic.Sigma(1, sight.deviation))
        if sight.is_range:
            graph.add(gtsam.RangeFactor2D(_pose(k), _beacon(sight.beacon), sight.value, noise))
        else:
            graph.add(gtsam.BearingFactor2D(_pose(k), _beacon(sight.beacon), gtsam.Rot2(sight.value), noise))


def _add_beacons(graph: Any, values: Any, problem: PeerProblem) -> None:
    """Add the beacons at their known places."""
    gtsam: Any = peer("gtsam")
    exact = gtsam.noiseModel.Isotropic.Sigma(2, 1e-4)
    for i, place in enumerate(problem.places):
        values.insert(_beacon(i), gtsam.Point2(*place))
        graph.add(gtsam.PriorFactorPoint2(_beacon(i), gtsam.Point2(*place), exact))


def _pose(k: int) -> int:
    return int(peer("gtsam").symbol("x", k))


def _beacon(i: int) -> int:
    return int(peer("gtsam").symbol("l", i))


def _array(pose: Any) -> Array:
    return np.array([pose.x(), pose.y(), pose.theta()])
