"""Beacons at unknown places: errors of the path and of the places, ours beside those of GTSAM's batch smoother.

Odometry and ranges do not say where on the ground a drive is, nor which way it faces: of a solution every one that is
moved and turned as a whole fits as well. All estimators begin with the first pose of the reference, but only to the
deviations of a known start, and none knows the way to a beacon. So what a solution is judged by is left after path and
places are moved and turned together, by the translation and rotation that leave the path at the least sum of squared
distances from the reference; there is neither a scale nor a reflection in it.

GTSAM has the readings, deviations and loss of the known case. Of its unknowns, the poses begin with the reference and
the places where our smoother has them, or ``OFF`` from there, each in another direction.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.sensor_log import estimate, smoother
from mathnavi.sim.records.table import Row
from mathnavi.studies.real import gtsam_peers
from mathnavi.studies.real.beacon_logs import BeaconCase, RecordedDrive
from mathnavi.studies.real.judging import row
from mathnavi.studies.real.peer_problem import problem_of

PART = "unknown beacons"
FAR = 80.0  # [m] that a beacon can be off
OFF = 10.0  # [m] of places from ours with which GTSAM begins
NO_PLACES = "no places"


def aligned(path: Array, reference: Array) -> tuple[Array, Array]:
    """Rotation (2, 2) and translation (2,) [m] that bring a path (n, 2) [m] next to a reference (n, 2) [m].

    The least squares of R p + s - q, with det R = 1 (Kabsch).
    """
    middle, other = path.mean(axis=0), reference.mean(axis=0)
    U, _, V = np.linalg.svd((reference - other).T @ (path - middle))
    R: Array = U @ np.diag([1.0, np.linalg.det(U @ V)]) @ V
    return R, other - R @ middle


def unknown_rows(case: BeaconCase) -> list[Row]:
    """A job: rows of filter, smoother and, where it is installed, GTSAM over a log, with all beacons unknown."""
    drive = case.drive()
    count = len(drive.mission.beacons)
    mission = replace(drive.mission, beacons=(None,) * count, start=drive.start, surroundings=FAR)
    rows, scale, places = [], math.nan, np.full((count, 2), np.nan)
    methods: dict[str, Any] = {"beacon_bank": "beacon_bank", "smoother of beacon_bank": smoother("beacon_bank")}
    for name, method in methods.items():
        begun = time.process_time()
        try:
            found = estimate(method, mission, drive.log)
        except LogError:  # the smoother, where the filter finds no pose or place
            rows.append(_row(case.log, drive, {"estimator": name, "start": NO_PLACES, "found": False}))
            continue
        update = MeasuredTime(1e6 * (time.process_time() - begun) / len(found.t))
        at = np.flatnonzero((found.t >= drive.t[0]) & (found.t <= drive.t[-1]))
        places = found.extra["beacons"][-1].reshape(-1, 2)
        own_scale = float(found.extra["scales"][-1, 2]) if "scales" in found.extra else math.nan
        scale = own_scale if math.isfinite(own_scale) else scale
        own = _errors(drive, found.t[at], found.x[at, :2], places, found.usable[at])
        own |= {"estimator": name, "start": NO_PLACES, "setting": own_scale, "update_us": update}
        rows.append(_row(case.log, drive, own))
    if gtsam_peers.at_hand() and np.isfinite([*places.ravel(), scale]).all():
        rows += _peers(case, drive, scale, places)
    return rows


def _peers(case: BeaconCase, drive: RecordedDrive, scale: float, places: Array) -> list[Row]:
    """GTSAM's rows from places (m, 2) [m] and from others, of ranges as recorded and over 1 + ``scale``."""
    angles = np.arange(len(places), dtype=np.float64)
    starts = {"ours": places, f"{OFF:g} m off": places + OFF * np.column_stack([np.cos(angles), np.sin(angles)])}
    rows = []
    for setting in (0.0, scale):
        problem = problem_of(drive, setting)
        for start, begin in starts.items():
            begun = time.process_time()
            poses, found = gtsam_peers.mapped(problem, problem.truth, begin)
            update = MeasuredTime(1e6 * (time.process_time() - begun) / len(drive.log.t))
            t = drive.log.t[(drive.log.t >= problem.t[0]) & (drive.log.t <= problem.t[-1])]
            path = np.column_stack([np.interp(t, problem.t, each) for each in poses[:, :2].T])
            own = _errors(drive, t, path, found, np.full(len(t), True))
            own["case"] = f"ranges / {1.0 + setting:.4f}" if setting else "as recorded"
            own |= {"estimator": gtsam_peers.BATCH, "start": start, "setting": setting, "update_us": update}
            rows.append(_row(case.log, drive, own))
    return rows


def _errors(drive: RecordedDrive, t: Array, path: Array, places: Array, used: NDArray[np.bool_]) -> dict[str, Any]:
    """Errors of positions (n, 2) [m] at t (n,) [s] and of places (m, 2) [m], aligned by those that are ``used`` (n,).

    NaN, and not found, where fewer than two are used or a place is missing.
    """
    if used.sum() < 2 or not np.isfinite(places).all():
        return {"found": False, "usable_share": float(used.mean())}
    reference = drive.truth_at(t)[:, :2]
    R, s = aligned(path[used], reference[used])
    squares = np.square(path @ R.T + s - reference).sum(axis=1)
    off = np.hypot(*(places @ R.T + s - np.array(drive.mission.beacons)).T)
    return {
        "found": True,
        "position_rms_m": float(np.sqrt(squares[used].mean())),
        "position_rms_all_m": float(np.sqrt(squares.mean())),
        "beacons_rms_m": float(np.sqrt(np.square(off).mean())),
        "beacons_max_m": float(off.max()),
        "usable_share": float(used.mean()),
    }


def _row(log: str, drive: RecordedDrive, figures: Mapping[str, Any]) -> Row:
    return row(part=PART, log=log, beams=len(drive.mission.beacons), **figures)
