"""Windows of a building's log, in which range estimators find the robot or follow it with few beams of its laser.

For each window the map is made of the scans at least ``apart`` seconds away from it, and the estimators get evenly
spread beams of the scans within it and the steps of the wheels, which are calibrated outside of the window too. Two
places are tried: the whole **floor**, and the **room**, where the map is what scans within 7 m of the middle of the
path saw up to 10 m and beams reach 7 m, so that the robot knows the room and not where in it. Those that find a pose
have an unknown start; the others are given the pose of SLAM at the first scan, with deviations of 0.3 m and 0.15 rad.

A window is **found** if all errors of its last quarter are within 0.3 m and 0.2 rad. Errors are against the poses of
SLAM at the scans, which are no independent truth. Windows in places that no other scan has seen have no map and are
not among those that are chosen. Of the others, ``mapped_share`` is what the whole laser says of the map, without any
estimator: where a map has little of what is seen, no one finds a robot on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.input_files import InputFile
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.angles import wrapped
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.records.sensor_log import EstimateHistory, SensorLog, estimate
from mathnavi.sim.records.table import Row
from mathnavi.studies.real.floor_logs import Floor, beams_of, calibration, floor_of, sensor_log, walls_of
from mathnavi.studies.real.judging import HEADING, POSITION, pose_figures, row, timed

FEWEST, LATE = 10, 3  # scans of a window that can be measured, and of its last quarter
TAILS = 2.0  # times the deviation of a step is declared: steps have wider tails than a Gaussian
MAPPED = 0.95  # share of the poses of a window that lie on the map
EXPLAINED = 0.3  # [m] from what the map would give to a range that it explains
NEARBY = 3.0  # [m] from a pose of a window to one of the map's scans
EVERY = 10.0  # [s] between the windows that are looked at
CANDIDATES = 40  # random poses to begin with, per square metre
TIMEOUT = 20.0  # [s] longer than scans are apart
OFF = (0.05, 0.01)  # [m, rad] deviation of a map: scans fitted to their own are off by 0.04 m and 0.008 rad, RMS
UNSURE = (0.3, 0.3, 0.15)  # [m, m, rad] deviation of a start that is known


@dataclass(frozen=True)
class Place:
    """Limits on the path, the map and the ranges of a window."""

    widest: float  # [m] the path of the window spans at most, either way
    around: float  # [m] from the middle of the path to the scans of the map
    longest: float  # [m] of a range of the map; from there on it counts as one without an echo
    reach: float  # [m] of the beams, likewise: what they read the map has, also where it sees through a door


PLACES = {"floor": Place(math.inf, math.inf, 30.0, 30.0), "room": Place(8.0, 7.0, 10.0, 7.0)}


@dataclass(frozen=True)
class FloorWindow:
    """Window of a log."""

    log: Annotated[str, InputFile()]
    place: str  # of PLACES
    since: float  # [s]
    seconds: float
    apart: float  # [s] at least, from the scans of the map
    seed: int = 0

    @property
    def name(self) -> str:
        """Name of the building."""
        return Path(self.log).name.partition(".log")[0].removesuffix("-corrected")

    @property
    def case(self) -> str:
        """Start of the window in the log, for a row of the table."""
        return f"{self.since:.0f} s"

    @property
    def last(self) -> float:
        """Time [s] at which its last quarter begins."""
        return self.since + 0.75 * self.seconds

    def rows(self, floor: Floor) -> Integers:
        """Scans of the window."""
        found: Integers = np.flatnonzero((floor.t >= self.since) & (floor.t < self.since + self.seconds))
        return found

    def used(self, floor: Floor) -> NDArray[np.bool_]:
        """Scans (n,) of which its map is made."""
        used = (floor.t < self.since - self.apart) | (floor.t > self.since + self.seconds + self.apart)
        middle = np.median(floor.poses[self.rows(floor), :2], axis=0)
        near: NDArray[np.bool_] = used & (np.hypot(*(floor.poses[:, :2] - middle).T) <= PLACES[self.place].around)
        return near


def windows_of(log: str, place: str, count: int, seconds: float, apart: float, seed: int = 0) -> list[FloorWindow]:
    """Windows of a log that can be measured and do not overlap, ``count`` at most, spread over the log."""
    floor = floor_of(Path(log))
    found: list[FloorWindow] = []
    for since in np.arange(floor.t.min(), floor.t.max() - seconds, EVERY).tolist():
        window = FloorWindow(log, place, since, seconds, apart, seed)
        if (not found or since >= found[-1].since + seconds) and _has_others_near(floor, window):
            found.append(window)
    # Maps take a while: each share of the log has its first window that is on its own.
    shares = np.array_split(np.arange(len(found)), min(count, len(found))) if found else []
    of_share = (next((found[k] for k in share.tolist() if on_map(floor, found[k])), None) for share in shares)
    return [each for each in of_share if each is not None]


def _has_others_near(floor: Floor, window: FloorWindow) -> bool:
    """True with enough scans, also in its last quarter, a path that the place spans, and other scans near all of it."""
    rows = window.rows(floor)
    if len(rows) < FEWEST or (floor.t[rows] >= window.last).sum() < LATE:
        return False
    path = floor.poses[rows, :2]
    others = floor.poses[window.used(floor), :2]
    if (np.ptp(path, axis=0) > PLACES[window.place].widest).any() or not len(others):
        return False
    nearest = np.array([np.hypot(*(others - each).T).min() for each in path])
    return bool((nearest <= NEARBY).all())


def on_map(floor: Floor, window: FloorWindow) -> bool:
    """True if the poses of the window lie within the walls of its map."""
    walls = walls_for(window)
    return bool(np.mean([walls.contains(pose[:2]) for pose in floor.poses[window.rows(floor)]]) >= MAPPED)


@lru_cache(maxsize=4)
def walls_for(window: FloorWindow) -> Polygon:
    """The map of a window."""
    floor = floor_of(Path(window.log))
    return walls_of(floor, window.used(floor), PLACES[window.place].longest, window.name)


@lru_cache(maxsize=4)
def mapped_share(window: FloorWindow) -> float:
    """Share of all ranges of the laser that the map explains at SLAM's pose: the least of a scan of the last quarter.

    0 for a scan without any range within reach.
    """
    floor, walls, reach = floor_of(Path(window.log)), walls_for(window), PLACES[window.place].reach
    shares = list[float]()
    for k in window.rows(floor):
        if floor.t[k] >= window.last:
            expected, _ = walls.ranges(floor.poses[k], floor.angles)
            read = floor.ranges[k] < reach
            explained = np.abs(floor.ranges[k] - expected)[read] <= EXPLAINED
            shares.append(float(explained.sum()) / max(len(explained), 1))
    return min(shares, default=0.0)


def _bank(walls: Polygon) -> dict[str, Any]:
    """One scan to begin with, and as many poses as the area needs."""
    return {
        "candidates": CANDIDATES * math.ceil(walls.area),
        "hypotheses": 1000,
        "readings": 1,
        "timeout": TIMEOUT,
        "deviation": UNSURE,
        "lowest": -40.0,
        "misfit": 6.0,
    }


def _particles(walls: Polygon) -> dict[str, Any]:
    """Fields of the particle filter, with as many particles as the bank has candidates."""
    return {"max_particles": max(5000, CANDIDATES * math.ceil(walls.area)), "timeout": TIMEOUT}


def _patient(walls: Polygon) -> dict[str, Any]:
    return {"timeout": TIMEOUT}


BANK = "feasible_set_bank"
FINDING: Mapping[str, Callable[[Polygon], dict[str, Any]]] = {BANK: _bank, "range_particle": _particles}
"""estimators that find a pose, and their fields on a map"""
FOLLOWING: Mapping[str, Callable[[Polygon], dict[str, Any]]] = dict.fromkeys(
    ("range_ekf", "range_iekf", "range_ukf", "moving_horizon"), _patient
)
"""estimators that are given the start"""
LEFT_OUT = (
    "range_observer, which needs a smooth wall; range_certified, whose bank has a time-out that is shorter than scans "
    "are apart"
)


@dataclass(frozen=True)
class WindowEstimates:
    """Estimates over a window: the scans, their rows among the estimates, and the CPU time of an update [us]."""

    rows: Integers
    at: Integers
    found: EstimateHistory
    update: float


def estimated(window: FloorWindow, beams: int, name: str) -> WindowEstimates:
    """Estimates of an estimator with evenly spread beams over a window."""
    floor, walls = floor_of(Path(window.log)), walls_for(window)
    place, rows, chosen = PLACES[window.place], window.rows(floor), beams_of(floor, beams)
    wheels = calibration(floor, window.since - window.apart, window.since + window.seconds + window.apart)
    log = sensor_log(floor, rows, chosen, wheels)
    period = float(np.median(np.diff(log.t)))
    scan = (len(log.t) - 1) / (len(rows) - 1)  # readings of odometry from one scan to the next
    noise = tuple(TAILS * each / math.sqrt(scan) / period for each in wheels.deviation)
    pose = floor.poses[rows[0]].tolist()
    mission = RangingMission(
        walls,
        tuple(floor.angles[chosen].tolist()),
        RangeQuality(0.01, 0.1, outliers=0.15, maximum=place.reach),
        OdometryQuality((noise[0], noise[1]), 0.02),
        map_deviation=OFF,
        start=None if name in FINDING else KnownStart((pose[0], pose[1], pose[2]), UNSURE, float(floor.t[rows[0]])),
        period=period,
    )
    fields = ({**FINDING, **FOLLOWING})[name](walls) | ({"seed": window.seed} if name in FINDING else {})
    run = partial(estimate, name, mission, log, **fields)
    head = SensorLog(log.t[:3], {each: values[:3] for each, values in log.readings.items()})
    found, update = timed(name, run, partial(estimate, name, mission, head, **fields))
    rows = rows[np.isin(floor.t[rows], log.t)]
    return WindowEstimates(rows, np.searchsorted(found.t, floor.t[rows]), found, update)


def window_rows(window: FloorWindow, beams: int) -> list[Row]:
    """A job: rows of every estimator over a window with evenly spread beams."""
    floor = floor_of(Path(window.log))
    return [_row(floor, window, beams, name, estimated(window, beams, name)) for name in (*FINDING, *FOLLOWING)]


def _row(floor: Floor, window: FloorWindow, beams: int, name: str, measured: WindowEstimates) -> Row:
    truth = floor.poses[measured.rows]
    error = measured.found.x[measured.at] - truth
    off, turned = np.hypot(*error[:, :2].T), np.abs(wrapped(error[:, 2]))
    last = floor.t[measured.rows] >= window.last
    near = (off <= POSITION) & (turned <= HEADING)
    return row(
        part=window.place,
        log=window.name,
        case=window.case,
        beams=beams,
        estimator=name,
        start="unknown" if name in FINDING else "known",
        found=bool(last.any() and near[last].all()),
        last_error_m=float(off[last].max(initial=0.0)),
        mapped_share=mapped_share(window),
        update_us=measured.update,
        **pose_figures(measured.found, measured.at, truth, (POSITION, HEADING)),
    )


@dataclass(frozen=True)
class DrawnWindow:
    """Content of the picture of a window, one row for each scan."""

    name: str
    beams: int
    outlines: tuple[Array, ...]  # (m, 2) [m] rings of the walls
    t: Array  # (n,) [s] since the first scan
    hypotheses: Array  # (n, K, 3) poses that can be, NaN where there is none
    best: Array  # (n, 3) estimate
    truth: Array  # (n, 3) poses of SLAM
    angles: Array  # (l,) [rad] of the beams
    ranges: Array  # (n, l) [m] NaN without an echo


def drawn_window(window: FloorWindow, beams: int) -> DrawnWindow:
    """A job: the hypotheses of the bank over a window, for a picture."""
    floor, measured = floor_of(Path(window.log)), estimated(window, beams, BANK)
    chosen, found, at = beams_of(floor, beams), measured.found, measured.at
    ranges = floor.ranges[measured.rows][:, chosen]
    return DrawnWindow(
        window.name,
        beams,
        tuple(np.asarray(each) for each in walls_for(window).outlines),
        found.t[at] - found.t[at[0]],
        found.extra["hypotheses"][at],
        found.x[at],
        floor.poses[measured.rows],
        floor.angles[chosen],
        np.where(ranges < PLACES[window.place].reach, ranges, np.nan),
    )
