"""Data of a finished run of a robot that localises itself, for pictures: truth, measurements and estimates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.field.wall import Wall
from mathnavi.models.unicycle.beacons import BeaconFieldMission
from mathnavi.models.unicycle.entity import DriveName
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.renders.logged_run import LoggedRun
from mathnavi.renders.ranging.beliefs import Beliefs, read_beliefs, shaped
from mathnavi.sim.metrics.consistency import normalised_error_squared
from mathnavi.sim.metrics.ranging import HEADING, POSITION
from mathnavi.sim.records.log_arrays import CRAMER_RAO
from mathnavi.sim.records.missions import read_mission
from mathnavi.sim.records.range_missions import RangingRecord
from mathnavi.sim.records.run_folder import ARRAYS, CONFIG, last_at, read_log

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RangingRun(LoggedRun):
    """The run of one robot."""

    mission: RangingMission
    drive: DriveName
    friction: float
    ranges: Array  # (n, l) [m] as read; NaN where lost
    odometry: Array  # (n, 2) [m/s, rad/s] as read; NaN where there is none
    beliefs: Beliefs
    beacons: Array  # (m, 2) [m] true places of the beacons that the robot reads; none in most runs
    beacon_beliefs: tuple[Array, Array] | None = None
    """places (k, 2 m) [m] of the beacons and covariances (k, 2 m, 2 m), if it was not given all; NaN if not found"""

    @property
    def pose(self) -> Array:
        """(n, 3) the true pose [m, m, rad]."""
        return self.log.x[:, :3]

    @property
    def curve(self) -> Wall:
        """The wall."""
        return self.mission.curve

    def beacons_believed(self, k: int) -> dict[int, tuple[Array, Array]]:
        """Place (2,) [m] and covariance (2, 2) of each beacon that estimate ``k`` has found, by its number."""
        mission = self.mission
        if self.beacon_beliefs is None or k < 0 or not isinstance(mission, BeaconFieldMission):
            return {}
        x, P = self.beacon_beliefs[0][k], self.beacon_beliefs[1][k]
        slices = {i: slice(2 * i, 2 * i + 2) for i in mission.beacons.unknown}
        return {i: (x[own], P[own, own]) for i, own in slices.items() if np.isfinite(x[own]).all()}

    @cached_property
    def reads_walls(self) -> bool:
        """True if there is a range to the wall in the log, or nothing else to read."""
        return bool(np.isfinite(self.ranges).any()) or not len(self.beacons)

    @property
    def symmetry(self) -> int:
        """Number of poses from which the robot reads the same, 0 for a continuum; beacons leave one."""
        return 1 if len(self.beacons) else self.curve.symmetry

    def images(self, pose: Array) -> Array:
        """Poses (k, 3) from which the robot would read the same as from a pose (3,), which is the first."""
        return self.curve.images(pose)[: 1 if len(self.beacons) else None]

    @cached_property
    def true_ranges(self) -> Array:
        """(n, l) [m] what ideal sensors would have read."""
        return np.array([self.mission.ranges(pose) for pose in self.pose])

    @cached_property
    def believed_at(self) -> Array:
        """(k, 3) the true poses at the times of the estimates."""
        samples = np.clip(np.searchsorted(self.t, self.beliefs.t + 1e-9, side="right") - 1, 0, None)
        poses: Array = self.pose[samples]
        return poses

    @cached_property
    def difference(self) -> Array:
        """(k, 3) [m, m, rad] estimate less truth, modulo the symmetry of the wall."""
        pairs = zip(self.beliefs.x, self.believed_at, strict=True)
        return np.array([self.mission.difference(x, truth) for x, truth in pairs]).reshape(-1, 3)

    @cached_property
    def position_error(self) -> Array:
        """(k,) [m]."""
        error: Array = np.hypot(self.difference[:, 0], self.difference[:, 1])
        return error

    @cached_property
    def heading_error(self) -> Array:
        """(k,) [rad]."""
        return np.abs(self.difference[:, 2])

    @cached_property
    def deviation(self) -> tuple[Array, Array] | None:
        """Standard deviations that the estimator states: (k,) [m] in the worst direction, (k,) [rad].

        NaN where it states none.
        """
        P = self.beliefs.covariance
        if P is None:
            return None
        variance = np.full((len(P), 2), np.nan)
        stated = np.isfinite(P).all(axis=(1, 2))
        variance[stated, 0] = np.linalg.eigvalsh(P[stated, :2, :2])[:, -1]
        variance[stated, 1] = P[stated, 2, 2]
        metres, radians = np.sqrt(np.maximum(variance, 0.0)).T
        return metres, radians

    @cached_property
    def least_deviation(self) -> tuple[Array, Array] | None:
        """Cramér-Rao bounds at the estimates: (k,) [m] of the position, (k,) [rad]; None if not known."""
        bound = self.log.arrays.get(CRAMER_RAO)
        if bound is None or bound.shape[1] != 3:
            return None
        samples = np.clip(np.searchsorted(self.t, self.beliefs.t + 1e-9, side="right") - 1, 0, None)
        return np.hypot(bound[samples, 0], bound[samples, 1]), bound[samples, 2]

    @cached_property
    def nees(self) -> Array:
        """(k,) e' P^-1 e of the errors e (3,); NaN where there is no covariance, or a singular one."""
        P = self.beliefs.covariance
        return np.full(len(self.beliefs.t), np.nan) if P is None else normalised_error_squared(self.difference, P)

    @cached_property
    def seen_as(self) -> Array:
        """(k, 3) of the poses indistinguishable from the true one those nearest to the estimates; heading unwrapped."""
        near = self.beliefs.x - self.difference
        near[:, 2] = np.unwrap(near[:, 2])
        return near

    @cached_property
    def indistinguishable(self) -> Flags:
        """(k,) whether an estimate is right, but not the true pose: one from which the robot would read the same."""
        distance = np.linalg.norm(self.seen_as[:, :2] - self.believed_at[:, :2], axis=1)
        such: Flags = (distance > POSITION) & (self.position_error < POSITION) & (self.heading_error < HEADING)
        return such

    @cached_property
    def image(self) -> int:
        """Index of the image (``images``) of the truth nearest to the last estimate; 0 is the truth itself."""
        if self.symmetry < 2 or not len(self.beliefs.x):
            return 0
        distance = self.images(self.believed_at[-1]) - self.seen_as[-1]
        return int(np.argmin(np.square(distance[:, :2]).sum(axis=1) + np.square(np.sin(0.5 * distance[:, 2]))))

    @cached_property
    def mirrored(self) -> Array:
        """(k, 3) that image of the true poses, heading unwrapped; in a circle, which has them all, ``seen_as``."""
        if self.symmetry == 0:
            return self.seen_as
        poses = np.array([self.images(pose)[self.image] for pose in self.believed_at]).reshape(-1, 3)
        poses[:, 2] = np.unwrap(poses[:, 2])
        return poses

    @cached_property
    def agreed(self) -> Flags:
        """(k,) whether all hypotheses that are left are the estimate, modulo the symmetry of the wall; there is one."""
        hypotheses, left = self.beliefs.hypotheses, self.beliefs.left
        agreed: Flags = np.zeros(len(self.beliefs.t), dtype=bool)
        if hypotheses is None or left is None:
            return agreed
        agreed |= left == 1
        for k in np.flatnonzero(left > 1):
            poses = hypotheses[k][np.isfinite(hypotheses[k]).all(axis=1)]
            errors = np.array([self.mission.error(pose, self.beliefs.x[k]) for pose in poses])
            agreed[k] = (errors < (POSITION, HEADING)).all()
        return agreed

    @cached_property
    def found(self) -> float | None:
        """[s] from when on the estimate was right; None if it was not at the end, or if there was none."""
        wrong = (self.position_error > POSITION) | (self.heading_error > HEADING)
        bad = np.flatnonzero(wrong | ~self.initialised)
        after = int(bad[-1]) + 1 if len(bad) else 0
        return float(self.beliefs.t[after]) if after < len(self.beliefs.t) else None

    @cached_property
    def initialised(self) -> Flags:
        """(k,) whether an estimate says where the robot is: the estimator has seen enough."""
        return np.array([self.status(float(t)) is not Status.INITIALISING for t in self.beliefs.t], dtype=bool)

    def joints(self, t: float) -> Array:
        """(2 nq,) MuJoCo's joint coordinates and rates at ``t`` [s], linear between samples."""
        return self.interpolated(self.log.x, t)

    def belief(self, t: float) -> int:
        """Return the index of the newest estimate at ``t`` [s]; -1 without one, or without one of the pose."""
        k = last_at(self.beliefs.t, t)
        return k if k >= 0 and self.initialised[k] else -1


def load_run(directory: str | Path) -> RangingRun:
    """Read a run's folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    log = read_log(directory)
    try:
        record = read_mission(RangingRecord, log.config["mission"])
        mission = _mission(record)
    except (KeyError, TypeError, ValueError) as error:
        name = str(log.directory / CONFIG)
        raise RunFolderError(f"{name!r} does not describe a robot with range sensors: {error!r}") from None
    if log.x.shape[1] < 6 or log.x.shape[1] % 2 or log.u.shape[1] != 2:
        raise RunFolderError(
            f"{str(log.directory / ARRAYS)!r}: truth.x {log.x.shape} and command.u {log.u.shape} are not those of a "
            "unicycle, (n, 2 nq) with nq at least 3 and (n, 2)"
        )
    arrays, n, sensors = log.arrays, len(log.t), mission.sensors
    try:
        ranges = shaped(arrays, "measurement.ranges", (n, sensors))
        odometry = shaped(arrays, "measurement.odometry", (n, 2))
        beliefs = read_beliefs(arrays, sensors)
        beacons = _beacons(record)
        k, m = len(beliefs.t), 2 * len(beacons)
        places = shaped(arrays, "estimate.beacons", (k, m))
        covariance = shaped(arrays, "estimate.beacons_covariance", (k, m, m))
    except ValueError as error:
        raise RunFolderError(f"{str(log.directory / ARRAYS)!r}: {error}") from None
    missing = np.nan
    return RangingRun(
        log, mission, record.drive, record.friction,
        np.full((n, sensors), missing) if ranges is None else ranges,
        np.full((n, 2), missing) if odometry is None else odometry,
        beliefs,
        beacons,
        None if places is None or covariance is None else (places, covariance),
    )  # fmt: skip


def _beacons(record: RangingRecord) -> Array:
    """True places (m, 2) [m] of the beacons."""
    if record.beacon_places or record.beacons is None:
        return np.array(record.beacon_places).reshape(-1, 2)
    return record.beacons.places


def _mission(record: RangingRecord) -> RangingMission:
    beacons = record.beacons
    kind: Any = RangingMission if beacons is None else partial(BeaconFieldMission, beacons=beacons)
    mission: RangingMission = kind(
        curve=record.wall(),
        angles=record.angles,
        mounting=record.mounting,
        ranging=record.ranging,
        odometry=record.odometry,
        start=record.known_start,
        speed_max=record.speed_max,
        turn_rate_max=record.turn_rate_max,
        margin=record.margin,
        period=record.period,
    )
    return mission
